//! The iterations.

use super::Ipm;
use super::kkt::lengths::Lengths;
use super::kkt::start::push_inside;
use super::kkt::work::Work;
use super::state::State;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::{Curvature, Exact};
use crate::ocp::nlp::solver;
use crate::ocp::solution::log::Iteration;
use crate::ocp::solution::outcome::{Outcome, Status};
use crate::qp::{QpField, StageDims, Store};
use crate::scalar::Real;
use core::ops::ControlFlow;

/// IPOPT's `diverging_iterates_tol`, as a multiple of the largest size in the data of a problem.
const DIVERGING_ITERATES: f64 = 1e12;
impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// Solves a problem, from its iterate on; afterwards this is the best one, whatever the status.
    ///
    /// # Errors
    /// [`OcpError::Length`] where the memory is that of another problem; [`OcpError::Missing`],
    /// [`OcpError::InvalidOption`]; [`OcpError::Integration`] and [`OcpError::NonFiniteFunction`]
    /// where a function has no value at the start.
    pub fn solve<P: Program<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>) -> Result<Outcome, OcpError>
    where
        Exact: Curvature<P::Dynamics, T>,
    {
        self.run(ocp, &mut |_| ControlFlow::Continue(()), &mut || false)
    }

    /// As [`Ipm::solve`], until the time is over: `over` is asked after each evaluation of the
    /// problem, factorisation and trial of the line search. A clock, or a counter of cycles. Then
    /// the status is [`Status::OutOfTime`], and the iterate the best one until then.
    ///
    /// # Errors
    /// As [`Ipm::solve`].
    ///
    /// # Example
    /// ```
    /// use casados::ocp::{HeapIpm, Horizon, LeastSquaresCost, Map, Problem, Status};
    /// use casados::prelude::*;
    /// use std::time::{Duration, Instant};
    ///
    /// #[function]
    /// fn push(x: f64, u: f64) -> f64 { x + u }
    /// #[function]
    /// fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
    ///
    /// let mut ocp = Problem::new(Map::<Push, f64>::new())
    ///     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
    ///     .on(Horizon::uniform(10, 0.1))?;
    /// ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
    /// let deadline = Instant::now() + Duration::from_secs(60);
    /// let mut ipm = HeapIpm::new(&ocp)?;
    /// assert!(ipm.solve_until(&mut ocp, &mut || Instant::now() > deadline)?.is_converged());
    /// assert_eq!(ipm.solve_until(&mut ocp, &mut || true)?.status, Status::OutOfTime);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn solve_until<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        over: &mut dyn FnMut() -> bool,
    ) -> Result<Outcome, OcpError>
    where
        Exact: Curvature<P::Dynamics, T>,
    {
        self.run(ocp, &mut |_| ControlFlow::Continue(()), over)
    }

    /// As [`Ipm::solve`], with an observer of the iterations that may stop the run.
    ///
    /// # Errors
    /// As [`Ipm::solve`].
    pub fn solve_observed<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        observer: &mut dyn FnMut(&Iteration) -> ControlFlow<()>,
    ) -> Result<Outcome, OcpError>
    where
        Exact: Curvature<P::Dynamics, T>,
    {
        self.run(ocp, observer, &mut || false)
    }

    fn run<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        observer: &mut dyn FnMut(&Iteration) -> ControlFlow<()>,
        over: &mut dyn FnMut() -> bool,
    ) -> Result<Outcome, OcpError>
    where
        Exact: Curvature<P::Dynamics, T>,
    {
        ocp.fits(self.trial.dims())?;
        self.options.check()?;
        ocp.begin_stages(self.options.warm_start)?;
        // Bounds of constraints are in the QP once it is written.
        let perturbed = ocp.linearise_guess(P::slopes, &mut self.trial, self.options.perturb_start)?;
        let (lengths, capacity, is_linearised) = self.prepare(ocp)?;
        let mut state = State::new(over, (lengths, capacity), is_linearised, &self.options);
        state.has_perturbed_start = perturbed;
        state.first_objective = ocp.objective.to_f64();
        state.contradiction = ocp.contradiction(self.options.tolerance);
        state.diverging_iterates = DIVERGING_ITERATES * ocp.largest_size();
        #[cfg(feature = "alloc")]
        self.log.clear();
        let mut outcome = Outcome::new();
        let result = solver::iterate(self, ocp, &mut state, observer, &mut outcome);
        let work = Work::new(ocp.ends(), &capacity, self.work.as_mut());
        ocp.set_penalties(work.penalties, None, &[]);
        let is_last = matches!(outcome.status, Status::Converged | Status::Infeasible { .. });
        if !(is_last && result.is_ok()) && state.best_residual.is_finite() {
            ocp.recall(&self.best);
        }
        (ocp.step_length, ocp.has_algebraic) = (None, false);
        let stuck =
            matches!(outcome.status, Status::NoProgress | Status::QpFailed(_) | Status::MaxIterations);
        if stuck && state.best_residual <= self.options.acceptable_tolerance {
            outcome.status = Status::Acceptable;
        }
        ocp.complete(&mut outcome);
        outcome.objective = state.best_iteration.objective;
        outcome.residuals = state.best_iteration.residuals;
        result.map(|()| outcome)
    }

    /// Memory for all that may come, a point inside of the bounds, and what is remembered of the
    /// problem; whether the point is still the one that the problem was linearised at.
    fn prepare<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
    ) -> Result<(Lengths, Lengths, bool), OcpError> {
        let mut lengths = Lengths::of(ocp.qp());
        let mut capacity = lengths.all_soft(ocp.qp());
        let length = Work::<T>::length(ocp.qp().dims, ocp.ends(), &capacity.counts);
        self.work.at_least(length, QpField::Numbers)?.fill(T::ZERO);
        self.numbers.at_least(capacity.numbers, QpField::Numbers)?.fill(T::ZERO);
        let work = Work::new(ocp.ends(), &capacity, self.work.as_mut());
        work.units.fill(T::ONE);
        if self.options.scaling {
            lengths.sizes = ocp.find_units(work.units, work.scratch);
            capacity.sizes = lengths.sizes;
        }
        let push = self.options.push::<T>(self.options.warm_start);
        let (qp, iterate) = ocp.qp_and_iterate();
        self.trial.copy_from(iterate);
        push_inside(qp, lengths.fixed, push, work.units, &mut iterate.view_mut());
        ocp.join_controls();
        self.guess.copy_from(&ocp.iterate);
        let stays = self.trial.variables_and_costates().0 == ocp.iterate.variables_and_costates().0;
        let work = Work::new(ocp.ends(), &capacity, self.work.as_mut());
        ocp.remember_penalties(work.penalties);
        Ok((lengths, capacity, stays))
    }
}
