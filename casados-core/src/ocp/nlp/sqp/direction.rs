//! The search direction: the QP at the iterate with inertia correction, in elastic mode if it is
//! infeasible.

use super::Sqp;
use super::run_state::RunState;
use super::scaling::{ScalingDirection, saved_penalties_end, saved_penalties_mut};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::Convexification;
use crate::ocp::formulation::program::curvature::Curvature;
use crate::ocp::nlp::elastic_mode::Worst;
use crate::ocp::solution::log::Iteration;
use crate::qp::{QpError, QpSolver, QpStart, QpStatistics, StageDims};
use crate::scalar::Real;

/// The first QP is solved to all digits if the error of the gradient, in the user's units, could be
/// larger than this.
const MAX_FIRST_GRADIENT_ERROR: f64 = 1e-2;
/// The growth of penalties if the objective keeps the violations from decreasing.
const PENALTY_FACTOR: f64 = 100.0;
/// The largest ratio of penalties to the option; at this ratio the objective is negligible.
const MAX_PENALTY_FACTOR: f64 = 1e4;
/// The shares of the remaining QP iterations for QPs with hard bounds, and for elastic QPs.
const HARD_QP_ITERATION_SHARE: f64 = 0.35;
const ELASTIC_QP_ITERATION_SHARE: f64 = 0.6;
/// The relative rounding error of multipliers: QPs are solved to no more digits.
const QP_ROUNDING: f64 = 1e-13;
/// Violations are stationary if the best direction leaves at least this fraction of them.
const STATIONARY_VIOLATION_RATIO: f64 = 1.0 - 1e-3;
/// Gaps count as closed up to this fraction of the violations of bounds.
const CLOSED_GAP_RATIO: f64 = 1e-2;
/// The number of consecutive elastic steps after which gaps up to the violations of bounds are
/// accepted: a step that closes them opens others of the same size.
const MAX_GAP_CLOSING_STEPS: usize = 4;
/// IPOPT's `resto_proximity_weight` and the accuracy of the QP, relative to the penalty; then those
/// of an easier QP.
const PROXIMITY_WEIGHTS: [(f64, f64); 2] = [(2e-5, QP_ROUNDING), (2e-3, 1e-9)];

/// The outcome of a direction.
pub(super) enum DirectionOutcome {
    /// A step.
    Step,
    /// The sum of violations is proved to be stationary.
    LocallyInfeasible(Worst),
}

impl<S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Sqp<S, C, T, D, M> {
    pub(super) fn saved_penalties<'s, P: Program<T>>(&'s self, ocp: &Ocp<P, T, D, M>) -> &'s [T] {
        self.workspace.as_ref().get(ocp.ends()..saved_penalties_end(ocp)).unwrap_or_default()
    }

    /// Replaces hard bounds by penalties.
    fn enter_elastic_mode<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        penalty: f64,
    ) {
        let memory = saved_penalties_mut(self.workspace.as_mut(), ocp);
        if !state.is_elastic {
            ocp.save_penalties(memory);
        }
        ocp.set_penalties(memory, Some(T::from_f64(penalty)), &[]);
        state.is_elastic = true;
        // Objectives with different penalties are not comparable.
        state.line_search.filter.clear();
    }

    /// Restores the given bounds.
    pub(super) fn leave_elastic_mode<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
    ) {
        if state.is_elastic {
            // The saved penalties are in units.
            self.scale_qp_and_points(ocp, state, ScalingDirection::Scale);
            ocp.set_penalties(self.saved_penalties(ocp), None, &[]);
            self.scale_qp_and_points(ocp, state, ScalingDirection::Unscale);
            state.is_elastic = false;
            state.line_search.filter.clear();
        }
    }

    /// Computes the direction by the QP at the iterate, in elastic mode if it is infeasible.
    pub(super) fn compute_direction<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        log_row: &mut Iteration,
    ) -> Result<Result<DirectionOutcome, QpError>, OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        (state.is_feasibility_step, state.qp_overwritten) = (false, false);
        state.residual_in_units = log_row.residuals.largest();
        self.scale_qp_and_points(ocp, state, ScalingDirection::Scale);
        if state.scaling.is_some() {
            state.residual_in_units = ocp.residuals().0.largest();
        }
        let mut direction = self.compute_direction_in_units(ocp, state, log_row);
        self.scale_qp_and_points(ocp, state, ScalingDirection::Unscale);
        if state.is_feasibility_step || state.qp_overwritten {
            ocp.linearise(self.curvature)?;
        }
        if let (Ok(DirectionOutcome::LocallyInfeasible(worst)), Some(_)) = (&mut direction, state.scaling) {
            *worst = self.unscaled_violation(ocp, *worst);
        }
        Ok(direction)
    }

    /// Computes the direction with QP, iterate and constants in units.
    fn compute_direction_in_units<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        log_row: &mut Iteration,
    ) -> Result<DirectionOutcome, QpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        let largest_multiplier =
            ocp.iterate.multipliers_mut().iter().fold(T::ZERO, |m, force| force.abs().max(m));
        let reduced = self.curvature.convexification() == Convexification::Reduced;
        let warm = self.options.warm_start && (log_row.iteration > 0 || reduced);
        let relative_accuracy = self.options.qp_accuracy * state.residual_in_units;
        // Without multipliers the stationarity is the gradient, which may be far too large.
        let gradient_error = relative_accuracy * state.objective_unit();
        let is_inaccurate_start = log_row.iteration == 0
            && largest_multiplier == T::ZERO
            && gradient_error > MAX_FIRST_GRADIENT_ERROR;
        let permitted_error =
            if is_inaccurate_start || state.full_qp_accuracy { 0.0 } else { relative_accuracy };
        let is_scaled = state.scaling.is_some();
        let rounding =
            if is_scaled { ocp.gap_rounding_error().max(ocp.gradient_rounding_error()) } else { 0.0 };
        self.qp_solver.permit(permitted_error.max(QP_ROUNDING * largest_multiplier.to_f64()).max(rounding));
        // After an elastic step whose violations remain the QP with hard bounds is omitted. An
        // elastic solution without violations solves it.
        if core::mem::take(&mut state.reenter_elastic_mode) {
            return self.elastic_direction(ocp, state, log_row, None);
        }
        let start = if warm { QpStart::Warm } else { QpStart::Cold };
        self.allot_qp_iterations(state, log_row, HARD_QP_ITERATION_SHARE);
        let Err(error) = self.solve_regularised_qp(ocp, state, start, log_row) else {
            return Ok(DirectionOutcome::Step);
        };
        let elastic_mode_may_help = matches!(
            error,
            QpError::Infeasible { .. } | QpError::MaxIterations { .. } | QpError::Stalled { .. }
        );
        if !(elastic_mode_may_help && self.options.elastic) {
            return Err(error);
        }
        self.elastic_direction(ocp, state, log_row, Some(error))
    }

    /// Computes an elastic step, or the verdict that violations are stationary.
    ///
    /// # Errors
    /// `hard_qp_error`, the error of the QP with hard bounds, if the elastic QP fails too; the
    /// error of the elastic QP if there is none.
    fn elastic_direction<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        log_row: &mut Iteration,
        hard_qp_error: Option<QpError>,
    ) -> Result<DirectionOutcome, QpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        // Violations before and after the step are compared, which requires exact solutions.
        let penalty = self.options.elastic_penalty.max(state.required_penalty);
        self.enter_elastic_mode(ocp, state, penalty);
        self.qp_solver.permit(QP_ROUNDING * penalty);
        log_row.elastic = true;
        let (worst, bound_violation) = ocp.largest_hard_violation(self.saved_penalties(ocp), &[]);
        let gaps = ocp.gap_sum();
        let current_violation = bound_violation + gaps;
        if let (Some(error), 0.0) = (hard_qp_error, current_violation) {
            // There are no violations that penalties could reduce.
            return Err(error);
        }
        self.allot_qp_iterations(state, log_row, ELASTIC_QP_ITERATION_SHARE);
        if let Err(error) = self.solve_regularised_qp(ocp, state, QpStart::Cold, log_row) {
            if current_violation == 0.0 {
                return Err(error);
            }
            // Without objective and curvature the QP is nearly a linear program.
            self.solve_feasibility_qp(ocp, state, log_row, current_violation)
                .map_err(|_| hard_qp_error.unwrap_or(error))?;
            return Ok(Self::take_feasibility_step(state, log_row));
        }
        let remaining_violation = self.linearised_violation(ocp);
        if remaining_violation <= self.options.tolerance {
            // The solution solves the QP with hard bounds, too.
            ocp.set_penalties(self.saved_penalties(ocp), None, &[]);
            (state.is_elastic, log_row.elastic) = (false, false);
            return Ok(DirectionOutcome::Step);
        }
        state.reenter_elastic_mode = true;
        match worst.filter(|worst| worst.violation > self.options.tolerance) {
            Some(worst) if remaining_violation >= STATIONARY_VIOLATION_RATIO * current_violation => {
                Ok(self.steer_penalty(ocp, state, log_row, (worst, [bound_violation, gaps])))
            }
            _ => Ok(DirectionOutcome::Step),
        }
    }

    /// Steering: if penalties do not decrease violations of bounds and gaps, a QP that minimises
    /// only these determines whether larger penalties would (R. H. Byrd, J. Nocedal, R. A. Waltz,
    /// "Steering exact penalty methods for nonlinear programming", Optim. Methods Softw. 23, 2008).
    fn steer_penalty<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        log_row: &mut Iteration,
        (worst, [bound_violation, gaps]): (Worst, [f64; 2]),
    ) -> DirectionOutcome {
        self.trial_point.copy_from(&self.qp_solution);
        let current_violation = bound_violation + gaps;
        if self.solve_feasibility_qp(ocp, state, log_row, current_violation).is_ok() {
            if self.linearised_violation(ocp) < STATIONARY_VIOLATION_RATIO * current_violation {
                let largest = MAX_PENALTY_FACTOR * self.options.elastic_penalty;
                let penalty = self.options.elastic_penalty.max(state.required_penalty);
                state.required_penalty = (PENALTY_FACTOR * penalty).min(largest);
                return Self::take_feasibility_step(state, log_row);
            }
            let closes_gaps =
                gaps > CLOSED_GAP_RATIO * bound_violation && state.elastic_steps < MAX_GAP_CLOSING_STEPS;
            if !(closes_gaps || gaps > bound_violation) {
                return DirectionOutcome::LocallyInfeasible(worst);
            }
        }
        // Gaps are closed first, whatever violations of bounds remain. The objective of the QP was
        // replaced: the QP must be written again.
        (state.qp_overwritten, state.required_penalty) = (true, 0.0);
        self.enter_elastic_mode(ocp, state, self.options.elastic_penalty);
        core::mem::swap(&mut self.qp_solution, &mut self.trial_point);
        DirectionOutcome::Step
    }

    /// Allots a share of the remaining iterations to the next QPs.
    fn allot_qp_iterations(&self, state: &mut RunState<'_, T>, log_row: &Iteration, share: f64) {
        let remaining_iterations = self.options.max_qp_iterations.saturating_sub(log_row.qp_iterations);
        state.qp_iteration_budget = log_row.qp_iterations + (share * remaining_iterations as f64) as usize;
    }

    /// Takes the feasibility step. The QP no longer has the objective of the iterate.
    fn take_feasibility_step(state: &mut RunState<'_, T>, log_row: &mut Iteration) -> DirectionOutcome {
        (state.is_feasibility_step, log_row.regularisation) = (true, 0.0);
        DirectionOutcome::Step
    }

    /// Computes the feasibility step, which minimises the violations of the linearisation near the
    /// iterate:
    ///
    /// ```text
    /// min  θ(v) + ½ ε ‖v − v̄‖² / θ₀        θ: violations of bounds, θ₀: those at v̄, and gaps
    /// ```
    ///
    /// Afterwards the objective is negligible relative to the penalties.
    fn solve_feasibility_qp<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        log_row: &mut Iteration,
        violation: f64,
    ) -> Result<(), QpError> {
        let (base_penalty, dominant_penalty) =
            (self.options.elastic_penalty, MAX_PENALTY_FACTOR * self.options.elastic_penalty);
        // The given penalties of soft bounds are part of the objective.
        let soft = self.saved_penalties(ocp).iter().any(|penalty| penalty.is_finite());
        let penalty = if soft { dominant_penalty } else { base_penalty };
        self.enter_elastic_mode(ocp, state, penalty);
        self.allot_qp_iterations(state, log_row, 1.0);
        let mut result = Ok(());
        for (weight, accuracy) in PROXIMITY_WEIGHTS {
            self.qp_solver.permit(accuracy * penalty);
            ocp.set_pure_proximal_objective(T::from_f64(weight * penalty / violation));
            result = self.solve_qp(ocp, state, QpStart::Cold, log_row);
            if result.is_ok() {
                break;
            }
        }
        self.enter_elastic_mode(ocp, state, dominant_penalty);
        result
    }

    /// Returns the sum of violations at the solution of the QP, by its linearisation.
    fn linearised_violation<P: Program<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>) -> f64 {
        core::mem::swap(&mut ocp.iterate, &mut self.qp_solution);
        let (_, sum) = ocp.largest_hard_violation(self.saved_penalties(ocp), &[]);
        core::mem::swap(&mut ocp.iterate, &mut self.qp_solution);
        sum
    }

    /// Solves the QP with damping and inertia correction.
    fn solve_regularised_qp<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        start: QpStart,
        log_row: &mut Iteration,
    ) -> Result<(), QpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        if state.damping > log_row.regularisation {
            ocp.regularise(T::from_f64(state.damping - log_row.regularisation));
            log_row.regularisation = state.damping;
        }
        if self.curvature.convexification() != Convexification::Reduced {
            return self.solve_qp(ocp, state, start, log_row);
        }
        let (mut correction, mut delta) = (state.inertia_correction, log_row.regularisation);
        let solve = |ocp: &Ocp<P, T, D, M>| self.solve_qp(ocp, state, start, log_row);
        let result = ocp.correct_inertia(&mut correction, &mut delta, solve);
        (state.inertia_correction, log_row.regularisation) = (correction, delta);
        result
    }

    /// Solves the QP from the iterate, with the remaining iterations of its share.
    fn solve_qp<P: Program<T>>(
        &mut self,
        ocp: &Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        start: QpStart,
        log_row: &mut Iteration,
    ) -> Result<(), QpError> {
        self.qp_solution.copy_from(&ocp.iterate);
        let remaining_iterations = state.qp_iteration_budget.saturating_sub(log_row.qp_iterations);
        if self.options.elastic && remaining_iterations == 0 {
            let iterations = log_row.qp_iterations;
            return Err(QpError::MaxIterations { iterations, residuals: log_row.residuals });
        }
        // Without elastic mode the solver must not stop early.
        self.qp_solver.limit(self.options.elastic.then_some(remaining_iterations));
        let mut time_checks = 0;
        let over = &mut || {
            time_checks += 1;
            state.is_out_of_time()
        };
        let result = self.qp_solver.solve_until(ocp.qp(), start, self.qp_solution.view_mut(), over);
        self.qp_solver.limit(None);
        let used_iterations = match result {
            Ok(QpStatistics { iterations, .. })
            | Err(
                QpError::MaxIterations { iterations, .. }
                | QpError::Stalled { iterations, .. }
                | QpError::OutOfTime { iterations, .. },
            ) => iterations,
            // The solver calls `over` in every iteration; other errors have no iteration count.
            Err(_) => time_checks,
        };
        log_row.qp_iterations += used_iterations;
        result.map(drop)
    }
}
