//! A second attempt, from a simulation with the controls of the guess.

use super::Sqp;
use super::state::State;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::Convexification;
use crate::ocp::formulation::program::curvature::Curvature;
use crate::ocp::nlp::simulation::{
    MAX_SIMULATED_VIOLATION, RESTART_AFTER, RESTART_GAIN, SecondStart, VIOLATION_OF_GUESS,
};
use crate::ocp::solution::log::Iteration;
use crate::ocp::solution::outcome::Status;
use crate::qp::{QpSolver, Residuals, StageDims, nan_max};
use crate::scalar::Real;

/// The regularisation of the first direction.
const RESTART_DAMPING: f64 = 1.0;

impl<S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Sqp<S, C, T, D, M> {
    /// Whether a run begins again, with steps that are damped as those of Gauss and Newton are:
    /// once, where it failed, or has had penalties for long and a simulation with the controls of
    /// the guess violates less than its iterate. It was long steps at first that led astray, or
    /// gaps that were to be closed over unstable dynamics.
    pub(super) fn try_restart<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        end: Option<Status>,
        row: &Iteration,
    ) -> bool
    where
        C: Curvature<P::Dynamics, T>,
    {
        let failed =
            matches!(end, Some(Status::Infeasible { .. } | Status::NoProgress | Status::QpFailed(_)));
        let stalls = end.is_none() && state.elastic_steps == RESTART_AFTER;
        let can = C::EXACT
            && self.options.restart
            && !state.second_attempt
            && state.contradiction.is_none()
            && row.iteration < self.options.max_iterations;
        if !((failed || stalls) && can && self.curvature.convexification() == Convexification::Reduced) {
            return false;
        }
        self.leave_elastic(ocp, state);
        let here = violation_of(&row.residuals);
        let mut found = self.simulate_guess(ocp, SecondStart::Simulated);
        let is_infeasible = matches!(end, Some(Status::Infeasible { .. }));
        let of_guess = RESTART_GAIN * here..=VIOLATION_OF_GUESS * here;
        if is_infeasible && found.is_some_and(|violation| of_guess.contains(&violation)) {
            // Where nothing was gained from the guess it may be a maximum of violations.
            found = self.simulate_guess(ocp, SecondStart::Perturbed);
        }
        if stalls && !found.is_some_and(|violation| violation < RESTART_GAIN * here) {
            if found.is_some() {
                ocp.iterate.copy_from(&self.trial);
            }
            state.search.linearised = None;
            return false;
        }
        found = found.filter(|&violation| violation <= MAX_SIMULATED_VIOLATION * state.violation_of_guess);
        if found.is_none() {
            ocp.iterate.copy_from(&self.weights);
            ocp.iterate.multipliers_mut().fill(T::ZERO);
        }
        // The best iterate may be that of the first attempt, after the second one, too.
        let &mut State { sizes, best_residual, best_iteration, .. } = state;
        let over = state.over.take();
        let best = State { best_residual, best_iteration, ..State::new() };
        *state = State { over, second_attempt: true, damping: RESTART_DAMPING, sizes, ..best };
        self.forget_weights(ocp, state);
        true
    }

    /// Makes a simulation with the controls of the guess the iterate and linearises there; what was
    /// the iterate is a trial then. What it violates, if it has values.
    fn simulate_guess<P: Program<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>, start: SecondStart) -> Option<f64>
    where
        C: Curvature<P::Dynamics, T>,
    {
        self.trial.copy_from(&self.weights);
        self.trial.multipliers_mut().fill(T::ZERO);
        let ends = self.work.as_mut().get_mut(..ocp.ends()).unwrap_or_default();
        if P::LIFTED || !ocp.simulate_guess(&mut self.trial, ends, start) {
            return None;
        }
        if ocp.linearise(self.curvature).is_err() {
            core::mem::swap(&mut ocp.iterate, &mut self.trial);
            return None;
        }
        Some(violation_of(&ocp.residuals().0))
    }
}

/// The largest violation, of equations and of inequalities.
pub(super) fn violation_of(residuals: &Residuals) -> f64 {
    nan_max(residuals.dynamics, residuals.inequalities)
}
