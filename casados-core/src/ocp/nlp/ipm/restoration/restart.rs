//! Restart from a simulation with the controls of the guess.

use super::phase::exit_restoration;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::{Curvature, Exact};
use crate::ocp::nlp::ipm::Ipm;
use crate::ocp::nlp::ipm::kkt::workspace::Workspace;
use crate::ocp::nlp::ipm::run_state::RunState;
use crate::ocp::nlp::ipm::violations::RestorationPhase;
use crate::ocp::nlp::simulation::RestartPoint;
use crate::ocp::solution::outcome::Status;
use crate::qp::{StageDims, Store};
use crate::scalar::Real;

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// Restarts a run that failed or stalled, at most once, if a simulation with the controls of
    /// the guess violates bounds by less than the iterate. With unstable dynamics the gaps may lead
    /// to a stationary point of the violations that is no property of the problem. A run that ended
    /// with the violations of the guess restarts from a simulation with perturbed controls. Returns
    /// whether it restarts.
    pub(in crate::ocp::nlp::ipm) fn try_restart<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_>,
        final_status: Option<Status>,
    ) -> bool
    where
        Exact: Curvature<P::Dynamics, T>,
    {
        let options = self.options.advanced.restart;
        let stalls = final_status.is_none() && state.stalled_iterations == options.restart_after;
        let failed = matches!(final_status, Some(Status::Infeasible { .. } | Status::NoProgress));
        if !(failed || stalls) || !self.options.restart || state.second_attempt || ocp.problem.is_lifted() {
            return false;
        }
        let work = Workspace::new(ocp.ends(), &state.max_dimensions, self.workspace.as_mut());
        let current_violation = ocp
            .largest_hard_violation(work.saved_penalties, work.units)
            .0
            .map_or(0.0, |worst| worst.violation);
        let reference_violation = match final_status {
            Some(Status::NoProgress) => state.best_violation,
            Some(_) => current_violation,
            None => state.violation.max(current_violation),
        };
        // A guess whose violations did not decrease may be a maximum of them.
        let is_infeasible =
            matches!(final_status, Some(Status::Infeasible { .. })) && state.contradictory_bounds.is_none();
        let mut equals_guess_violation = false;
        for start in
            [RestartPoint::Simulation, RestartPoint::PerturbedSimulation(self.options.advanced.start)]
        {
            let max_violation_ratio = match start {
                RestartPoint::Simulation => options.restart_gain,
                RestartPoint::PerturbedSimulation(_) if is_infeasible && equals_guess_violation => {
                    options.max_simulated_violation
                }
                RestartPoint::PerturbedSimulation(_) => break,
            };
            self.trial_point.copy_from(&self.guess);
            let work = Workspace::new(ocp.ends(), &state.max_dimensions, self.workspace.as_mut());
            if !ocp.simulate_guess(&mut self.trial_point, work.interval_ends, start) {
                continue;
            }
            let is_linearised = P::slopes(ocp).is_ok();
            let simulated_violation = ocp
                .largest_hard_violation(work.saved_penalties, work.units)
                .0
                .map_or(0.0, |worst| worst.violation);
            if is_linearised && simulated_violation < max_violation_ratio * reference_violation {
                exit_restoration(ocp, state, work.saved_penalties, &self.options);
                (state.restoration, state.is_linearised, state.second_attempt) =
                    (RestorationPhase::default(), true, true);
                return true;
            }
            equals_guess_violation =
                simulated_violation <= options.guess_violation_ratio * reference_violation;
            core::mem::swap(&mut ocp.iterate, &mut self.trial_point);
            state.is_linearised = false;
        }
        false
    }
}
