//! Entry points, iterations and end of a run.

use super::Sqp;
use super::restart::primal_infeasibility;
use super::run_state::{Attempt, RunState};
use super::scaling::ScalingDirection;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::Curvature;
use crate::ocp::nlp::solver_loop::{self, IterativeMethod, NextAction};
use crate::ocp::nlp::stopwatch::Stopwatch;
use crate::ocp::solution::log::Iteration;
use crate::ocp::solution::outcome::{Outcome, Status};
#[cfg(feature = "alloc")]
use crate::qp::try_reserve;
use crate::qp::{QpSolver, StageDims};
use crate::scalar::Real;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;
use core::ops::ControlFlow;

/// The initial capacity of the log, in iterations.
#[cfg(feature = "alloc")]
const LOG_CAPACITY: usize = 64;

/// The number of consecutive elastic steps after which multipliers are no longer set to zero: the
/// iterations minimise the sum of violations, and need its curvature.
const ELASTIC_STEPS_WITHOUT_MULTIPLIERS: usize = 4;

/// IPOPT's `acceptable_tol` over its `tol`: the residual of an acceptable point, in tolerances.
const ACCEPTABLE: f64 = 100.0;

impl<S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Sqp<S, C, T, D, M> {
    /// Solves a problem from its iterate. Afterwards the iterate is the best one, whatever the
    /// status, or the last one after `Converged` and `Infeasible`. With exact Hessians the run
    /// starts with least-squares multipliers if there are none and costs leave a control without
    /// curvature.
    ///
    /// # Errors
    /// [`OcpError::Missing`]; [`OcpError::Integration`] and [`OcpError::NonFiniteFunction`] if full
    /// steps lead to a point where a function is not finite; the iterate is the best one then, too.
    pub fn solve<P: Program<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>) -> Result<Outcome, OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        self.solve_observed(ocp, &mut |_| ControlFlow::Continue(()))
    }

    /// [`Sqp::solve`] with an observer of the iterations, which may stop the run.
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

    /// [`Sqp::solve`] with a deadline: `over` is called after each linearisation, and in every
    /// iteration of a QP whose solver supports it; it may read a clock or a counter of cycles. When
    /// it returns true the status is [`Status::OutOfTime`], and the iterate the best one so far.
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
        deadline_passed: &mut dyn FnMut() -> bool,
    ) -> Result<Outcome, OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        ocp.check_dimensions(self.qp_solution.dims())?;
        self.options.validate()?;
        self.qp_solver.require(self.options.tolerance);
        let contradiction = ocp.contradictory_bounds(self.options.tolerance);
        let mut state = RunState {
            deadline_passed: Some(deadline_passed),
            contradictory_bounds: contradiction,
            ..RunState::new(&self.options)
        };
        // Solutions of QPs satisfy the coupling; so must the first iterate.
        ocp.equalise_shared_controls();
        ocp.equalise_periodic_states();
        self.violation_weights.copy_from(&ocp.iterate);
        #[cfg(feature = "alloc")]
        {
            self.log.clear();
            try_reserve(&mut self.log, self.options.max_iterations.saturating_add(1).min(LOG_CAPACITY))?;
        }
        let mut outcome = Outcome::new();
        let result = solver_loop::iterate(self, ocp, &mut state, observer, &mut outcome);
        self.leave_elastic_mode(ocp, &mut state);
        let is_stuck =
            matches!(outcome.status, Status::NoProgress | Status::QpFailed(_) | Status::MaxIterations);
        if is_stuck
            && state.has_rescaled_objective
            && state.best_residual <= ACCEPTABLE * self.options.tolerance
        {
            outcome.status = Status::Acceptable;
        }
        // The verdict `Infeasible` holds at the last iterate.
        let is_last =
            matches!(outcome.status, Status::Converged | Status::Infeasible { .. }) && result.is_ok();
        if !is_last && state.best_residual.is_finite() {
            ocp.iterate.copy_from(&self.best_iterate);
        }
        ocp.complete_outcome(&mut outcome);
        outcome.objective = state.best_iteration.objective;
        outcome.residuals = state.best_iteration.residuals;
        result.map(|()| outcome)
    }

    /// Replaces the merit function by the filter after too many short steps.
    fn switch_to_filter<P: Program<T>>(
        &mut self,
        ocp: &Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        log_row: &Iteration,
    ) where
        C: Curvature<P::Dynamics, T>,
    {
        if C::EXACT && state.update_short_steps(log_row, &self.options) {
            state.line_search.filter.clear();
            self.reset_weights(ocp, state);
        }
    }

    /// The curvature of the QP along its step, after a part of the step has been taken.
    fn curvature_of_step<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &RunState<'_, T>,
    ) -> f64 {
        self.scale_qp_and_points(ocp, state, ScalingDirection::Scale);
        let curvature = ocp.curvature_along_step(&self.qp_solution);
        self.scale_qp_and_points(ocp, state, ScalingDirection::Unscale);
        curvature
    }
}

impl<P, S, C, T, D, M> IterativeMethod<P, T, D, M> for Sqp<S, C, T, D, M>
where
    P: Program<T>,
    S: QpSolver<T>,
    C: Curvature<P::Dynamics, T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
{
    type RunState<'c> = RunState<'c, T>;

    fn evaluate(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        log_row: &mut Iteration,
    ) -> Result<(), OcpError> {
        match state.line_search.linearisation_seconds.take() {
            // The line search has linearised at this iterate already.
            Some(seconds) => log_row.times.linearise = seconds,
            None if log_row.iteration == 0 => {
                let curvature = self.curvature;
                let linearise = |ocp: &mut Ocp<P, T, D, M>| ocp.linearise(curvature);
                let may_perturb = self.options.perturb_start.then_some(self.options.advanced.start);
                log_row.perturbed = ocp.linearise_guess(linearise, &mut self.trial_point, may_perturb)?;
                if log_row.perturbed {
                    self.violation_weights.copy_from(&ocp.iterate);
                }
            }
            None => ocp.linearise(self.curvature)?,
        }
        self.leave_elastic_mode(ocp, state);
        if log_row.iteration == 0 {
            if self.options.scaling {
                self.find_units(ocp, state);
            }
            self.reset_weights(ocp, state);
            state.guess_violation = primal_infeasibility(&ocp.residuals().0);
        }
        if state.is_run_start && C::EXACT {
            self.least_squares_multipliers(ocp, state)?;
        }
        if state.scaling.is_some() && log_row.iteration > 0 {
            self.update_bound_multipliers(ocp, state);
        }
        let (residuals, objective) = ocp.residuals();
        (log_row.residuals, log_row.objective) = (residuals, objective);
        state.nlp_error = self.nlp_error(ocp, state, &residuals);
        if state.nlp_error < state.best_residual || state.is_run_start && !state.best_residual.is_finite() {
            (state.best_residual, state.best_iteration) = (state.nlp_error, *log_row);
            self.best_iterate.copy_from(&ocp.iterate);
        }
        state.is_run_start = false;
        Ok(())
    }

    fn check_termination(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        log_row: &Iteration,
    ) -> NextAction {
        if state.nlp_error <= self.options.tolerance && self.rescale_objective(ocp, state) {
            state.nlp_error = self.nlp_error(ocp, state, &log_row.residuals);
            (state.best_residual, state.best_iteration) = (state.nlp_error, *log_row);
            self.best_iterate.copy_from(&ocp.iterate);
        }
        if state.nlp_error <= self.options.tolerance {
            state.best_iteration = *log_row;
            return NextAction::Terminate(Status::Converged);
        }
        if let Some(status) = state.contradictory_bounds {
            return NextAction::Terminate(status);
        }
        if log_row.iteration >= self.options.max_iterations {
            return NextAction::Terminate(Status::MaxIterations);
        }
        if state.is_out_of_time() { NextAction::Terminate(Status::OutOfTime) } else { NextAction::Step }
    }

    fn step(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        log_row: &mut Iteration,
        watch: &mut Stopwatch,
    ) -> Result<Option<Status>, OcpError> {
        let accepted_step = match self.attempt_step(ocp, state, log_row, watch)? {
            ControlFlow::Continue(Some(accepted_step)) => accepted_step,
            ControlFlow::Continue(None) => return self.select_next_attempt(ocp, state, log_row),
            ControlFlow::Break(status) => return Ok(Some(status)),
        };
        state.attempt = Attempt::First;
        (log_row.step, log_row.corrected) = (accepted_step.length, accepted_step.corrected);
        let curvature = if state.is_short_step(log_row) { self.curvature_of_step(ocp, state) } else { 0.0 };
        state.update_damping(log_row, curvature);
        self.switch_to_filter(ocp, state, log_row);
        state.elastic_steps = if log_row.elastic { state.elastic_steps + 1 } else { 0 };
        if log_row.elastic
            && C::EXACT
            && (state.is_feasibility_step || state.elastic_steps <= ELASTIC_STEPS_WITHOUT_MULTIPLIERS)
        {
            // Far from feasible points multipliers are as large as the penalties, and would make
            // the curvature far too large.
            ocp.iterate.multipliers_mut().fill(T::ZERO);
            state.line_search.linearisation_seconds = None;
            self.reset_weights(ocp, state);
        }
        Ok(None)
    }

    fn restart(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        final_status: Option<Status>,
        log_row: &Iteration,
    ) -> bool {
        let restarts = self.try_restart(ocp, state, final_status, log_row);
        if !restarts && matches!(final_status, Some(Status::Infeasible { .. })) {
            // The verdict holds at the last iterate.
            state.best_iteration = *log_row;
        }
        restarts
    }

    #[cfg(feature = "alloc")]
    fn log(&mut self) -> &mut Vec<Iteration> {
        &mut self.log
    }
}
