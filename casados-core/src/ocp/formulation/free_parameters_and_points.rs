//! Free parameters and points inside intervals, which add variables and rows to a problem.

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
    /// Frees a parameter of the model, or all parameters with this name: it is optimised together
    /// with states and controls, has the same value at all stages, a range and a guess. Costs and
    /// constraints may depend on it at every stage, including the last.
    ///
    /// In a solution it is a parameter ([`Trajectory::parameter`](crate::ocp::Trajectory)), with
    /// bounds and multipliers. A second call for the same parameter replaces range and guess.
    /// Values from `set_parameters` are ignored for it.
    ///
    /// The QP has one more column per stage, its recursion one more right-hand side. Call this
    /// before creating a solver: dimensions change.
    ///
    /// # Errors
    /// [`OcpError::UnknownParameter`]; [`OcpError::CrossedBounds`], [`OcpError::InvalidValue`] of
    /// the range; [`OcpError::OutOfRange`] of the guess; [`OcpError::OutOfMemory`]. Except after
    /// the last one the problem is unchanged.
    ///
    /// # Example
    /// The stiffness of the spring that moves a mass by a metre in a second, with least effort.
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
        let matching_parameters = || {
            let model_parameters = known.p.iter().take(known.model_parameter_count());
            model_parameters.enumerate().filter(|(_, parameter)| name_matches(name, parameter))
        };
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

    /// Frees the end time of a horizon with a free end.
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

    /// Sets points inside every interval, as fractions of it. Path constraints hold at these points
    /// too, with the bounds of the node before: a constraint that holds at the nodes may be
    /// violated between them. Bounds of states and algebraic states that are set later hold at the
    /// points too.
    ///
    /// Each interval is integrated from point to point, each piece with the number of steps in the
    /// options of the integrator. States at the points are therefore ends of steps, with exact
    /// first and second derivatives. In solutions and messages a constraint `Speed` at the fraction
    /// 0.5 is `Speed@0.5`.
    ///
    /// Call this once, before setting bounds and before creating a solver: dimensions change.
    ///
    /// # Errors
    /// [`OcpError::InvalidPoint`] if the fractions do not increase between 0 and 1;
    /// [`OcpError::Unsupported`] for maps and lifted stages, and if states have bounds or points
    /// are set already; [`OcpError::OutOfMemory`].
    ///
    /// # Example
    /// A cart arrives with 1 m/s and stops before 0.3 m; it turns round between two nodes.
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

    /// Holds the controls of every interval over this number of pieces (move blocking). Costs and
    /// path constraints are those of a finer horizon whose controls are equal within a block. For
    /// blocks of different lengths use intervals of different lengths
    /// ([`Horizon::nodes`](crate::ocp::Horizon::nodes)).
    ///
    /// Pieces have equal lengths; the points between them are set as by [`inside`](Self::inside).
    /// Running costs weight each piece by its length; all pieces of an interval have its reference.
    /// The number of stages of the QP is the number of blocks.
    ///
    /// # Errors
    /// As [`inside`](Self::inside); [`OcpError::InvalidOption`] for zero pieces.
    ///
    /// # Example
    /// Forty pieces, ten blocks.
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

    /// Rebuilds the problem with these points inside its intervals.
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
