//! Parameters are made free: the problem gets variables for them.

use crate::ocp::formulation::check::Labels;
use crate::ocp::formulation::error::{OcpError, Part, Text};
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::horizon::{Horizon, limits};
use crate::ocp::formulation::instance::HeapOcp;
use crate::ocp::formulation::instance::data::{self, Layout, split};
use crate::ocp::formulation::problem::Formulation;
use crate::qp::{
    Bounds, BoundsMut, Qp, Solution, SolutionStage, SolutionStageMut, StageDims, assign, marked, room, zeros,
};
use crate::scalar::Real;
use crate::shape::Shape;
use crate::structure::means;
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
        let meant = || known.p.iter().enumerate().filter(|(_, parameter)| means(name, parameter));
        let Some((first, &name_of_first)) = meant().next() else {
            return Err(OcpError::UnknownParameter { name: Text::new(name), known });
        };
        let [lower, upper] = limits(&range);
        Labels::parameters::<P, T>(Part::ParameterBounds, 0).check_bounds(first, lower, upper)?;
        if !(guess.is_finite() && lower <= guess && guess <= upper) {
            let [value, lower, upper] = [guess, lower, upper].map(Real::to_f64);
            return Err(OcpError::OutOfRange { name: name_of_first, value, lower, upper });
        }
        for (parameter, _) in meant() {
            let w = match self.free.view().of(parameter) {
                Some(w) => w,
                None => self.add_free(parameter)?,
            };
            self.write_free(w, guess);
            if let Some(mut stage) = self.qp.stage_mut(0) {
                stage.u_bounds_mut().set(w, lower, upper);
            }
            let layout = self.layout();
            let p = split::<P, T>(self.data.as_mut(), layout).p;
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
        self.free.set_end(duration);
        self.check_functions()
    }

    /// Makes room for one more; which one it is.
    fn add_free(&mut self, parameter: usize) -> Result<usize, OcpError> {
        let mut free = self.free.clone();
        let w = free.add(parameter, P::Shape::NP);
        let (intervals, count) = (self.intervals(), free.count());
        let mut dims: Vec<StageDims> = Vec::new();
        room(&mut dims, intervals.saturating_add(1))?;
        dims.resize(intervals, data::stage::<P, T>(count, false));
        dims.push(data::stage::<P, T>(count, true));
        let (mut qp, mut iterate) = (Qp::new(&dims)?, Solution::new(&dims)?);
        let layout = Layout { intervals, free: count };
        let mut data = zeros(data::length::<P, T>(layout))?;
        self.move_qp(&mut qp, w);
        for (k, stage) in self.iterate.stages().enumerate() {
            if let Some(to) = iterate.stage_mut(k) {
                copy_stage(&stage, to, w);
            }
        }
        let old_layout = self.layout();
        let (to, from) = (split::<P, T>(&mut data, layout), split::<P, T>(&mut self.data, old_layout));
        for (to, from) in [
            (to.times, from.times),
            (to.p, from.p),
            (to.references, from.references),
            (to.lower, from.lower),
            (to.upper, from.upper),
            (to.arrival, from.arrival),
        ] {
            assign(to, from);
        }
        (self.qp, self.iterate, self.data, self.free) = (qp, iterate, data, free);
        self.has_algebraic = false;
        Ok(w)
    }

    /// Bounds and couplings, with one more variable in front of the controls from `w` on.
    fn move_qp(&self, to: &mut Qp<T, Vec<StageDims>, Vec<T>>, w: usize) {
        let view = self.qp.view();
        for (from, mut to) in view.stages().zip(to.stages_mut()) {
            copy_bounds(&from.x_bounds(), to.x_bounds_mut(), usize::MAX);
            copy_bounds(&from.u_bounds(), to.u_bounds_mut(), w);
            copy_bounds(&from.g_bounds(), to.g_bounds_mut(), usize::MAX);
        }
        marked(view.periodic()).for_each(|i| {
            to.make_periodic(i);
        });
        marked(view.shared()).map(|j| if j < w { j } else { j + 1 }).for_each(|j| {
            to.share(j);
        });
        to.share(w);
    }
}

/// Copies a list to one with another element at `gap`.
fn copy<T: Real>(from: &[T], to: &mut [T], gap: usize) {
    let (before, behind) = from.split_at(gap.min(from.len()));
    assign(to, before);
    assign(to.get_mut(gap.saturating_add(1)..).unwrap_or_default(), behind);
}

fn copy_bounds<T: Real>(from: &Bounds<'_, T>, to: BoundsMut<'_, T>, gap: usize) {
    for (from, to) in [
        (from.lower, to.lower),
        (from.upper, to.upper),
        (from.lower_linear, to.lower_linear),
        (from.lower_quadratic, to.lower_quadratic),
        (from.upper_linear, to.upper_linear),
        (from.upper_quadratic, to.upper_quadratic),
    ] {
        copy(from, to, gap);
    }
}

fn copy_stage<T: Real>(from: &SolutionStage<'_, T>, to: SolutionStageMut<'_, T>, gap: usize) {
    for (from, to) in [(from.u, to.u), (from.u_lower, to.u_lower), (from.u_upper, to.u_upper)] {
        copy(from, to, gap);
    }
    for (from, to) in [
        (from.x, to.x),
        (from.dynamics, to.dynamics),
        (from.x_lower, to.x_lower),
        (from.x_upper, to.x_upper),
        (from.g_lower, to.g_lower),
        (from.g_upper, to.g_upper),
    ] {
        assign(to, from);
    }
}
