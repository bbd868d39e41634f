//! Restart from a simulation with the controls of the guess.

use super::Sqp;
use super::run_state::RunState;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::Convexification;
use crate::ocp::formulation::program::curvature::Curvature;
use crate::ocp::nlp::simulation::RestartPoint;
use crate::ocp::solution::log::Iteration;
use crate::ocp::solution::outcome::Status;
use crate::qp::{QpSolver, Residuals, SolutionStageMut, StageDims, copy_common, nan_max};
use crate::scalar::Real;

/// The Levenberg-Marquardt damping of the first direction after a restart.
const RESTART_DAMPING: f64 = 1.0;
/// The largest number of simulations with the controls of an iterate in a run.
const MAX_SIMULATIONS: usize = 4;

impl<S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Sqp<S, C, T, D, M> {
    /// Restarts a run at most once, with damped steps as for Gauss-Newton Hessians: after a
    /// failure, or after many elastic steps if a simulation with the controls of the guess violates
    /// less than the iterate. Long first steps, or closing gaps over unstable dynamics, may have
    /// caused the failure. Returns whether it restarts.
    pub(super) fn try_restart<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        final_status: Option<Status>,
        log_row: &Iteration,
    ) -> bool
    where
        C: Curvature<P::Dynamics, T>,
    {
        let failed = matches!(
            final_status,
            Some(Status::Infeasible { .. } | Status::NoProgress | Status::QpFailed(_))
        );
        let stalls =
            final_status.is_none() && state.elastic_steps == self.options.advanced.restart.restart_after;
        let may_restart = C::EXACT
            && self.options.restart
            && state.contradictory_bounds.is_none()
            && log_row.iteration < self.options.max_iterations
            && self.curvature.convexification() == Convexification::Reduced;
        let has_verdict = matches!(final_status, Some(Status::Infeasible { .. }));
        if state.second_attempt && failed && may_restart && !has_verdict {
            return self.simulate_iterate(ocp, state, log_row);
        }
        if !((failed || stalls) && may_restart && !state.second_attempt) {
            return false;
        }
        self.leave_elastic_mode(ocp, state);
        let restart = self.options.advanced.restart;
        let current_violation = primal_infeasibility(&log_row.residuals);
        let mut simulated_violation = self.linearise_simulated_guess(ocp, RestartPoint::Simulation);
        let is_infeasible = matches!(final_status, Some(Status::Infeasible { .. }));
        let guess_violation_range =
            restart.restart_gain * current_violation..=restart.guess_violation_ratio * current_violation;
        if is_infeasible
            && simulated_violation.is_some_and(|violation| guess_violation_range.contains(&violation))
        {
            // A guess whose violations did not decrease may be a maximum of them.
            simulated_violation = self.linearise_simulated_guess(
                ocp,
                RestartPoint::PerturbedSimulation(self.options.advanced.start),
            );
        }
        if stalls
            && !simulated_violation
                .is_some_and(|violation| violation < restart.restart_gain * current_violation)
        {
            if simulated_violation.is_some() {
                ocp.iterate.copy_from(&self.trial_point);
            }
            state.line_search.linearisation_seconds = None;
            return false;
        }
        simulated_violation = simulated_violation
            .filter(|&violation| violation <= restart.max_simulated_violation * state.guess_violation);
        if simulated_violation.is_none() {
            ocp.iterate.copy_from(&self.violation_weights);
            ocp.iterate.multipliers_mut().fill(T::ZERO);
        }
        self.continue_from_restart(ocp, state);
        true
    }

    /// Closes the gaps of the last iterate by a simulation with its controls, at most
    /// `MAX_SIMULATIONS` times in a run, if the violation decreases to `restart_gain`: gaps over
    /// unstable dynamics may leave no QP that is solved. Returns whether the run continues there.
    fn simulate_iterate<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        log_row: &Iteration,
    ) -> bool
    where
        C: Curvature<P::Dynamics, T>,
    {
        if state.simulations >= MAX_SIMULATIONS || ocp.problem.is_lifted() {
            return false;
        }
        state.simulations += 1;
        self.leave_elastic_mode(ocp, state);
        let current_violation = primal_infeasibility(&log_row.residuals);
        // Functions have values at the states of the guess.
        self.trial_point.copy_from(&self.violation_weights);
        self.trial_point.multipliers_mut().fill(T::ZERO);
        for (k, stage) in ocp.iterate.stages().enumerate() {
            if let Some(SolutionStageMut { u, .. }) = self.trial_point.stage_mut(k) {
                copy_common(u, stage.u);
            }
        }
        let ends = self.workspace.as_mut().get_mut(..ocp.ends()).unwrap_or_default();
        let is_finite = ocp.simulate_guess(&mut self.trial_point, ends, RestartPoint::Simulation)
            && ocp.linearise(self.curvature).is_ok();
        let violation = if is_finite { primal_infeasibility(&ocp.residuals().0) } else { f64::INFINITY };
        if violation < self.options.advanced.restart.restart_gain * current_violation {
            self.continue_from_restart(ocp, state);
            return true;
        }
        if is_finite {
            core::mem::swap(&mut ocp.iterate, &mut self.trial_point);
        }
        false
    }

    /// Begins a second attempt at the iterate, where the QP is written.
    fn continue_from_restart<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
    ) {
        // The best iterate of all attempts is kept.
        let &mut RunState { scaling: sizes, best_residual, best_iteration, simulations, .. } = state;
        let over = state.deadline_passed.take();
        let fresh_state =
            RunState { best_residual, best_iteration, simulations, ..RunState::new(&self.options) };
        *state = RunState {
            deadline_passed: over,
            second_attempt: true,
            damping: RESTART_DAMPING,
            scaling: sizes,
            ..fresh_state
        };
        self.reset_weights(ocp, state);
    }

    /// Simulates the states with the controls of the guess, makes the result the iterate and
    /// linearises there; the trial point becomes the last iterate. Returns the violation of the
    /// simulation, if it is finite.
    fn linearise_simulated_guess<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        start: RestartPoint,
    ) -> Option<f64>
    where
        C: Curvature<P::Dynamics, T>,
    {
        self.trial_point.copy_from(&self.violation_weights);
        self.trial_point.multipliers_mut().fill(T::ZERO);
        let ends = self.workspace.as_mut().get_mut(..ocp.ends()).unwrap_or_default();
        if ocp.problem.is_lifted() || !ocp.simulate_guess(&mut self.trial_point, ends, start) {
            return None;
        }
        if ocp.linearise(self.curvature).is_err() {
            core::mem::swap(&mut ocp.iterate, &mut self.trial_point);
            return None;
        }
        Some(primal_infeasibility(&ocp.residuals().0))
    }
}

/// The largest violation of equations and inequalities.
pub(super) fn primal_infeasibility(residuals: &Residuals) -> f64 {
    nan_max(residuals.dynamics, residuals.inequalities)
}
