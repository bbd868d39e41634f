//! The iterations.

use super::Sqp;
use super::direction::Direction;
use super::options::Globalisation;
use super::restart::violation_of;
use super::scaled::Way;
use super::state::{Attempt, State, Taken};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::Convexification;
use crate::ocp::formulation::program::curvature::Curvature;
use crate::ocp::nlp::solver::{self, Method, Next};
use crate::ocp::nlp::watch::Watch;
use crate::ocp::solution::log::Iteration;
use crate::ocp::solution::outcome::{Outcome, Status};
#[cfg(feature = "alloc")]
use crate::qp::try_reserve;
use crate::qp::{QpError, QpSolver, StageDims};
use crate::scalar::Real;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;
use core::ops::ControlFlow;

/// The log has room for so many iterations before it grows.
#[cfg(feature = "alloc")]
const ROOM: usize = 64;

/// After so many steps with penalties in a row it is the sum of violations that is made small, and
/// its curvature counts.
const ELASTIC_STEPS_WITHOUT_MULTIPLIERS: usize = 4;

const ATTEMPTS: [Attempt; 5] = [
    Attempt::First,
    Attempt::Exact,
    Attempt::Damped(1e-2),
    Attempt::Damped(1e0),
    Attempt::Damped(MOST_DAMPING),
];
const MOST_DAMPING: f64 = 1e2;
/// IPOPT's `acceptable_tol` over its `tol`: what is left at a point that is acceptable, in
/// tolerances.
const ACCEPTABLE: f64 = 100.0;

impl<S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Sqp<S, C, T, D, M> {
    /// Solves a problem, from its iterate on; afterwards this is the best one, whatever the status.
    /// With exact Hessians, without multipliers and without costs that curve in all controls, it
    /// begins with the multipliers of least squares.
    ///
    /// # Errors
    /// [`OcpError::Missing`]; [`OcpError::Integration`] and [`OcpError::NonFiniteFunction`] where
    /// full steps went to a point at which something has no value: then the iterate is the best
    /// one, too.
    pub fn solve<P: Program<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>) -> Result<Outcome, OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        self.solve_observed(ocp, &mut |_| ControlFlow::Continue(()))
    }

    /// As [`Sqp::solve`], with an observer of the iterations that may stop the run.
    ///
    /// # Errors
    /// As [`Sqp::solve`].
    pub fn solve_observed<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        observer: &mut dyn FnMut(&Iteration) -> ControlFlow<()>,
    ) -> Result<Outcome, OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        self.run(ocp, observer, &mut || false)
    }

    /// As [`Sqp::solve`], until the time is over: `over`, a clock or a counter of cycles, is asked
    /// after each linearisation, and in every iteration of a QP, as far as its solver makes use of
    /// that. Then the status is [`Status::OutOfTime`], and the iterate the best one.
    ///
    /// # Errors
    /// As [`Sqp::solve`].
    ///
    /// # Example
    /// ```
    /// # use casados::ocp::*;
    /// # use casados::prelude::*;
    /// use std::time::{Duration, Instant};
    /// # #[function]
    /// # fn push(x: f64, u: f64) -> f64 { x + u }
    /// # #[function]
    /// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
    /// # let mut ocp = Problem::new(Map::<Push, f64>::new())
    /// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
    /// #     .on(Horizon::uniform(10, 0.1))?;
    /// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
    /// let deadline = Instant::now() + Duration::from_secs(60);
    /// let mut sqp = HeapSqp::new(&ocp)?;
    /// assert_eq!(sqp.solve_until(&mut ocp, &mut || true)?.status, Status::OutOfTime);
    /// assert!(sqp.solve_until(&mut ocp, &mut || Instant::now() > deadline)?.is_converged());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn solve_until<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        over: &mut dyn FnMut() -> bool,
    ) -> Result<Outcome, OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        self.run(ocp, &mut |_| ControlFlow::Continue(()), over)
    }

    fn run<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        observer: &mut dyn FnMut(&Iteration) -> ControlFlow<()>,
        over: &mut dyn FnMut() -> bool,
    ) -> Result<Outcome, OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        ocp.fits(self.solution.dims())?;
        self.options.check()?;
        self.qp_solver.require(self.options.tolerance);
        let contradiction = ocp.contradiction(self.options.tolerance);
        let mut state = State { over: Some(over), contradiction, ..State::new() };
        // Steps are to solutions of QPs: what is one stays so.
        ocp.join_controls();
        ocp.join_states();
        self.weights.copy_from(&ocp.iterate);
        #[cfg(feature = "alloc")]
        {
            self.log.clear();
            try_reserve(&mut self.log, self.options.max_iterations.saturating_add(1).min(ROOM))?;
        }
        let mut outcome = Outcome::new();
        let result = solver::iterate(self, ocp, &mut state, observer, &mut outcome);
        self.leave_elastic(ocp, &mut state);
        let stuck =
            matches!(outcome.status, Status::NoProgress | Status::QpFailed(_) | Status::MaxIterations);
        if stuck && state.has_tightened && state.best_residual <= ACCEPTABLE * self.options.tolerance {
            outcome.status = Status::Acceptable;
        }
        // What is infeasible is said of the last iterate.
        let is_last =
            matches!(outcome.status, Status::Converged | Status::Infeasible { .. }) && result.is_ok();
        if !is_last && state.best_residual.is_finite() {
            ocp.iterate.copy_from(&self.best);
        }
        ocp.complete(&mut outcome);
        outcome.objective = state.best_iteration.objective;
        outcome.residuals = state.best_iteration.residuals;
        result.map(|()| outcome)
    }

    /// Lets the filter decide from now on where the merit function creeps.
    fn switch_to_filter<P: Program<T>>(
        &mut self,
        ocp: &Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        row: &Iteration,
    ) where
        C: Curvature<P::Dynamics, T>,
    {
        if C::EXACT && state.switches_to_filter(row, &self.options) {
            state.search.filter.clear();
            self.forget_weights(ocp, state);
        }
    }

    /// The curvature of the QP along its step, of which the iterate has gone a part.
    fn curvature_of_step<P: Program<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>, state: &State<'_, T>) -> f64 {
        self.scale(ocp, state, Way::Into);
        let curvature = ocp.curvature(&self.solution);
        self.scale(ocp, state, Way::Back);
        curvature
    }

    /// The full step, or one that a line search finds.
    fn take_step<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        row: &mut Iteration,
    ) -> Result<Option<Taken>, OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        if self.options.globalisation != Globalisation::FullStep {
            return self.search(ocp, state, row);
        }
        core::mem::swap(&mut ocp.iterate, &mut self.solution);
        Ok(Some(Taken { length: 1.0, corrected: false }))
    }

    /// A step in the direction of the QP; nothing where none is short enough, or the QP has no
    /// solution.
    fn attempt_step<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        row: &mut Iteration,
        watch: &mut Watch,
    ) -> Result<ControlFlow<Status, Option<Taken>>, OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        let attempt = state.attempt;
        let damping = if let Attempt::Damped(damping) = attempt { damping } else { 0.0 };
        state.exact = state.second_attempt || attempt != Attempt::First;
        state.may_reject_short_steps = state.damps(C::EXACT) && damping.max(state.damping) < MOST_DAMPING;
        if damping > 0.0 {
            state.damping = damping;
        }
        let direction = self.direction(ocp, state, row)?;
        row.times.qp += watch.lap();
        state.failure = direction.as_ref().err().copied();
        if state.late {
            return Ok(ControlFlow::Break(Status::OutOfTime));
        }
        match direction {
            Ok(Direction::Step) => {
                let taken = self.take_step(ocp, state, row)?;
                row.times.search += watch.lap() - state.search.linearised.unwrap_or(0.0);
                return Ok(ControlFlow::Continue(taken));
            }
            Ok(Direction::Infeasible(worst)) => {
                return Ok(ControlFlow::Break(ocp.status_of_worst(&worst)));
            }
            Err(QpError::Infeasible { .. }) if self.options.elastic => {}
            Err(QpError::NotConvex { .. } | QpError::MaxIterations { .. } | QpError::Stalled { .. })
                if self.curvature.convexification() == Convexification::Reduced => {}
            Err(error) => return ocp.status_of_error(error).map(ControlFlow::Break),
        }
        Ok(ControlFlow::Continue(None))
    }

    /// The iterate stays, and the next iteration tries another QP there; how the run ends if there
    /// is none.
    fn stay<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        row: &mut Iteration,
    ) -> Result<Option<Status>, OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        row.step = 0.0;
        let failure = state.failure;
        let next = ATTEMPTS.iter().skip_while(|attempt| **attempt != state.attempt).skip(1);
        let next = next.copied().find(|attempt| match attempt {
            Attempt::First => false,
            Attempt::Exact => !(failure.is_some() || row.elastic || state.may_reject_short_steps),
            Attempt::Damped(damping) => !(state.damps(C::EXACT) && *damping <= state.damping),
        });
        let Some(next) = next else {
            return Ok(Some(match failure {
                // That the QP at one iterate has no solution says nothing of the problem.
                None | Some(QpError::Infeasible { .. }) => Status::NoProgress,
                Some(error) => ocp.status_of_error(error)?,
            }));
        };
        state.attempt = next;
        state.search.linearised = None;
        if failure.is_some() {
            // The curvature that multipliers have is no help.
            ocp.iterate.multipliers_mut().fill(T::ZERO);
        }
        Ok(None)
    }
}

impl<P, S, C, T, D, M> Method<P, T, D, M> for Sqp<S, C, T, D, M>
where
    P: Program<T>,
    S: QpSolver<T>,
    C: Curvature<P::Dynamics, T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
{
    type State<'c> = State<'c, T>;

    fn evaluate(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        row: &mut Iteration,
    ) -> Result<(), OcpError> {
        match state.search.linearised.take() {
            // The line search has linearised here already.
            Some(seconds) => row.times.linearise = seconds,
            None if row.iteration == 0 => {
                let curvature = self.curvature;
                let linearise = |ocp: &mut Ocp<P, T, D, M>| ocp.linearise(curvature);
                let perturbs = self.options.perturb_start;
                row.perturbed = ocp.linearise_guess(linearise, &mut self.trial, perturbs)?;
                if row.perturbed {
                    self.weights.copy_from(&ocp.iterate);
                }
            }
            None => ocp.linearise(self.curvature)?,
        }
        self.leave_elastic(ocp, state);
        if row.iteration == 0 {
            if self.options.scaling {
                self.find_units(ocp, state);
            }
            self.forget_weights(ocp, state);
            state.violation_of_guess = violation_of(&ocp.residuals().0);
        }
        if state.begins && C::EXACT {
            self.first_multipliers(ocp, state)?;
        }
        let (residuals, objective) = ocp.residuals();
        (row.residuals, row.objective) = (residuals, objective);
        state.error = self.judge(ocp, state, &residuals);
        if state.error < state.best_residual || state.begins && !state.best_residual.is_finite() {
            (state.best_residual, state.best_iteration) = (state.error, *row);
            self.best.copy_from(&ocp.iterate);
        }
        state.begins = false;
        Ok(())
    }

    fn test(&mut self, ocp: &mut Ocp<P, T, D, M>, state: &mut State<'_, T>, row: &Iteration) -> Next {
        if state.error <= self.options.tolerance && self.tightens(ocp, state) {
            state.error = self.judge(ocp, state, &row.residuals);
            (state.best_residual, state.best_iteration) = (state.error, *row);
            self.best.copy_from(&ocp.iterate);
        }
        if state.error <= self.options.tolerance {
            state.best_iteration = *row;
            return Next::End(Status::Converged);
        }
        if let Some(status) = state.contradiction {
            return Next::End(status);
        }
        if row.iteration >= self.options.max_iterations {
            return Next::End(Status::MaxIterations);
        }
        if state.is_over() { Next::End(Status::OutOfTime) } else { Next::Step }
    }

    fn step(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        row: &mut Iteration,
        watch: &mut Watch,
    ) -> Result<Option<Status>, OcpError> {
        let taken = match self.attempt_step(ocp, state, row, watch)? {
            ControlFlow::Continue(Some(taken)) => taken,
            ControlFlow::Continue(None) => return self.stay(ocp, state, row),
            ControlFlow::Break(status) => return Ok(Some(status)),
        };
        state.attempt = Attempt::First;
        (row.step, row.corrected) = (taken.length, taken.corrected);
        let curvature = if state.is_short(row) { self.curvature_of_step(ocp, state) } else { 0.0 };
        state.damp(row, curvature);
        self.switch_to_filter(ocp, state, row);
        state.elastic_steps = if row.elastic { state.elastic_steps + 1 } else { 0 };
        if row.elastic
            && C::EXACT
            && (state.feasibility_step || state.elastic_steps <= ELASTIC_STEPS_WITHOUT_MULTIPLIERS)
        {
            // On the way to a feasible point forces of penalties are no multipliers: curvatures
            // would be far too large.
            ocp.iterate.multipliers_mut().fill(T::ZERO);
            state.search.linearised = None;
            self.forget_weights(ocp, state);
        }
        Ok(None)
    }

    fn restart(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        end: Option<Status>,
        row: &Iteration,
    ) -> bool {
        let begins = self.try_restart(ocp, state, end, row);
        if !begins && matches!(end, Some(Status::Infeasible { .. })) {
            // That is said of the last iterate.
            state.best_iteration = *row;
        }
        begins
    }

    #[cfg(feature = "alloc")]
    fn log(&mut self) -> &mut Vec<Iteration> {
        &mut self.log
    }
}
