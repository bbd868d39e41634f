//! A problem gets variables for parameters that are found, and rows for points inside of intervals.

use crate::ocp::formulation::check::Labels;
use crate::ocp::formulation::error::{OcpError, Part, Text};
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::horizon::{Horizon, range_limits};
use crate::ocp::formulation::instance::HeapOcp;
use crate::ocp::formulation::instance::data::split_data;
use crate::ocp::formulation::instance::inner_points::{InnerPoints, check_supports_pieces};
use crate::ocp::formulation::problem::Formulation;
use crate::scalar::Real;
use crate::shape::Shape;
use crate::structure::name_matches;
use alloc::vec::Vec;
use core::ops::RangeBounds;

impl<P: Formulation<T>, T: Real> HeapOcp<P, T> {
    /// Frees a parameter of the model, or all that a name means: it is found together with states
    /// and controls, the same at all stages, in a range, from a guess. Functions of it are costs
    /// and constraints like all others, at the last stage too.
    ///
    /// In a solution it is a parameter ([`Trajectory::parameter`](crate::ocp::Trajectory)), with
    /// bounds and multipliers. A parameter that is free already gets this range and this guess.
    /// What was set for it by `set_parameters` is not used.
    ///
    /// The QP has a column for it at each stage, its recursion one right-hand side. Solvers are
    /// made afterwards: dimensions change.
    ///
    /// # Errors
    /// [`OcpError::UnknownParameter`]; [`OcpError::CrossedBounds`], [`OcpError::InvalidValue`] of
    /// the range; [`OcpError::OutOfRange`] of the guess; [`OcpError::OutOfMemory`]. Then nothing is
    /// changed, but in the last case.
    ///
    /// # Example
    /// The spring that takes a mass over a metre in a second, with least effort.
    /// ```
    /// use casados::ocp::{GeneralCost, HeapIpm, Horizon, Problem};
    /// use casados::prelude::*;
    ///
    /// #[ode]
    /// fn spring(x: [f64; 2], u: f64, p: f64) -> [f64; 2] { [x[1], u - p * x[0]] }
    /// #[function]
    /// fn effort(_x: [f64; 2], u: f64, _p: f64) -> f64 { u * u }
    ///
    /// let mut ocp = Problem::new(Irk::<Spring, Gauss<3>>::new(Options::default())?)
    ///     .running_cost(GeneralCost::<Effort>::new())
    ///     .on(Horizon::uniform(20, 0.05))?;
    /// ocp.fix_initial_state(&[1.0, 0.0])?.guess(&[0.0; 2], &[0.0])?.free("p", 0.1..=50.0, 1.0)?;
    /// ocp.bound("x[0]", 20.., -1.0, -1.0)?.bound("x[1]", 20.., 0.0, 0.0)?;
    /// assert!(HeapIpm::new(&ocp)?.solve(&mut ocp)?.is_converged());
    /// // Half a period is a second: no effort at all.
    /// let stiffness = ocp.solution()?.parameter("p")?[0];
    /// assert!((stiffness - std::f64::consts::PI.powi(2)).abs() < 1e-4);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn free(&mut self, name: &str, range: impl RangeBounds<T>, guess: T) -> Result<&mut Self, OcpError> {
        let known = const { &<P::Dynamics as Dynamics<T>>::NAMES };
        let matching_parameters =
            || known.p.iter().enumerate().filter(|(_, parameter)| name_matches(name, parameter));
        let Some((first, &name_of_first)) = matching_parameters().next() else {
            return Err(OcpError::UnknownParameter { name: Text::new(name), known });
        };
        let [lower, upper] = range_limits(&range);
        Labels::parameters::<P, T>(Part::ParameterBounds, 0).check_bounds(first, lower, upper)?;
        if !(guess.is_finite() && lower <= guess && guess <= upper) {
            let [value, lower, upper] = [guess, lower, upper].map(Real::to_f64);
            return Err(OcpError::OutOfRange { name: name_of_first, value, lower, upper });
        }
        for (parameter, _) in matching_parameters() {
            let w = match self.free.view().index_of(parameter) {
                Some(w) => w,
                None => {
                    let mut free = self.free.clone();
                    let w = free.add(parameter, P::Shape::NP);
                    let inner = self.inner_points.clone();
                    self.rebuild(free, inner, Some(w))?;
                    w
                }
            };
            self.write_free_parameter(w, guess);
            if let Some(mut stage) = self.qp.stage_mut(0) {
                stage.u_bounds_mut().set(w, lower, upper);
            }
            let layout = self.layout();
            let p = split_data::<P, T>(self.data.as_mut(), layout).p;
            p.iter_mut().skip(parameter).step_by(P::Shape::NP).for_each(|p| *p = guess);
        }
        Ok(self)
    }

    /// Frees the end of a horizon that has a free one.
    ///
    /// # Errors
    /// [`OcpError::FixedEndTime`], [`OcpError::Times`], [`OcpError::Unsupported`]; those of
    /// [`HeapOcp::free`]
    pub(in crate::ocp) fn free_end(&mut self, horizon: &Horizon<'_, T>) -> Result<(), OcpError> {
        let Horizon::Free { range: [lower, upper], guess, .. } = *horizon else { return Ok(()) };
        let known = const { &<P::Dynamics as Dynamics<T>>::NAMES };
        let Some((duration, name)) = known.duration.and_then(|d| Some((d, known.p.get(d)?))) else {
            return Err(OcpError::FixedEndTime { model: known.model });
        };
        let positive = lower > T::ZERO;
        if !positive {
            return Err(OcpError::Times { interval: 0, start: 0.0, end: lower.to_f64() });
        }
        self.free(name, lower..=upper, guess)?;
        self.free.set_end_time(duration);
        self.check_functions_for_free_end()
    }

    /// Points inside of every interval, as parts of it, at which path constraints hold too, with
    /// the bounds of the node before: what holds at nodes alone may be violated between them.
    /// Bounds of states that are given afterwards hold there too, and those of algebraic states.
    ///
    /// Intervals are integrated from point to point, each piece by as many steps as the options of
    /// the integrator say: states there are ends of steps, with exact derivatives of first and
    /// second order. In a solution and in messages a constraint `Speed` at the part 0.5 is
    /// `Speed@0.5`.
    ///
    /// It is called before bounds are given, and once. Solvers are made afterwards: dimensions
    /// change.
    ///
    /// # Errors
    /// [`OcpError::InvalidPoint`] where parts do not increase between 0 and 1;
    /// [`OcpError::Unsupported`] of maps and lifted stages, and where there are bounds of states
    /// or such points already; [`OcpError::OutOfMemory`].
    ///
    /// # Example
    /// A cart that comes with 1 m/s and stops before 0.3 m: where it turns round is no node.
    /// ```
    /// use casados::ocp::{GeneralCost, HeapIpm, Horizon, Problem};
    /// use casados::prelude::*;
    ///
    /// /// Place and speed of a cart that is pushed.
    /// #[ode]
    /// fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
    /// #[function]
    /// fn effort(_x: [f64; 2], u: f64) -> f64 { u * u }
    ///
    /// let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
    ///     .running_cost(GeneralCost::<Effort>::new())
    ///     .on(Horizon::uniform(2, 1.0))?;
    /// ocp.inside(&[0.5])?.fix_initial_state(&[0.0, 1.0])?.guess(&[0.0; 2], &[0.0])?;
    /// ocp.bound("x[0]", .., -1.0, 0.3)?;
    /// assert!(HeapIpm::new(&ocp)?.solve(&mut ocp)?.is_converged());
    /// // Half a second after the start it is as far as it may be.
    /// let solution = ocp.solution()?;
    /// assert!((solution.inside("x[0]@0.5")?[0] - 0.3).abs() < 1e-6);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn inside(&mut self, parts: &[T]) -> Result<&mut Self, OcpError> {
        self.set_inner_points(InnerPoints::with_points(parts)?)
    }

    /// Holds the controls of every interval over so many pieces of it, as moves are blocked: costs
    /// and path constraints are those of a finer horizon, whose controls are the same in a block.
    /// Blocks of different lengths are intervals of different lengths
    /// ([`Horizon::nodes`](crate::ocp::Horizon::nodes)).
    ///
    /// Pieces are of equal length, and points between them as those of [`inside`](Self::inside), by
    /// which they are chosen too; running costs count each piece as long as it is, and a reference
    /// is that of the interval. The QP has as many stages as there are moves.
    ///
    /// # Errors
    /// As [`inside`](Self::inside); [`OcpError::InvalidOption`] of no pieces at all.
    ///
    /// # Example
    /// Forty pieces, ten moves.
    /// ```
    /// use casados::ocp::{GeneralCost, HeapSqp, Horizon, Problem};
    /// use casados::prelude::*;
    ///
    /// #[ode]
    /// fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
    /// #[function]
    /// fn price(x: [f64; 2], u: f64) -> f64 { x[0] * x[0] + 0.1 * u * u }
    ///
    /// let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
    ///     .running_cost(GeneralCost::<Price>::new())
    ///     .on(Horizon::uniform(10, 0.2))?;
    /// ocp.hold(4)?.fix_initial_state(&[1.0, 0.0])?.guess(&[0.0; 2], &[0.0])?;
    /// ocp.bound("x[1]", .., -0.8, 0.8)?; // at all ends of pieces
    /// assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
    /// assert_eq!(ocp.solution()?.inside("x[1]@0.75")?.len(), 10);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn hold(&mut self, pieces: usize) -> Result<&mut Self, OcpError> {
        if pieces == 0 {
            return Err(OcpError::InvalidOption { name: "pieces", value: 0.0, allowed: "at least 1" });
        }
        let parts: Vec<T> = (1..pieces).map(|j| T::from_whole(j) / T::from_whole(pieces)).collect();
        self.set_inner_points(InnerPoints::with_points(&parts)?.with_costs_at_points())
    }

    /// Gives intervals these points.
    fn set_inner_points(&mut self, inner: InnerPoints<T>) -> Result<&mut Self, OcpError> {
        let interval_count = self.intervals();
        let has_state_bounds = |k: usize| {
            let first = self.qp.view().stage(k).map(|stage| stage.x_bounds());
            first.is_some_and(|x| x.lower.iter().chain(x.upper).any(|bound| bound.is_finite()))
        };
        if (1..interval_count).any(has_state_bounds)
            || self.layout().inner_rows > 0
            || self.inner_points.count() > 0
        {
            let what = "`inside` and `hold` after bounds, or a second time";
            let remedy = "Call one of them once, before all bounds";
            return Err(OcpError::Unsupported { what, remedy });
        }
        if inner.count() > 0 {
            check_supports_pieces::<P::Dynamics, T>(&self.problem.parts().dynamics)?;
            let free = self.free.clone();
            self.rebuild(free, inner, None)?;
        }
        Ok(self)
    }
}
