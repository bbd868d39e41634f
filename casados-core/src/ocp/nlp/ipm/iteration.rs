//! One iteration: residuals and barrier parameter, search direction, line search, step.

use super::barrier;
use super::kkt::barrier_function;
use super::kkt::newton::{
    costates_after_step, equation_residuals_after_step, evaluate_residuals, kkt_view, kkt_view_of_new_qp,
    refine_step, resolve,
};
use super::kkt::scaling::{ScaledResiduals, scaled_residuals};
use super::line_search::{AcceptedStep, FilterModel, LineSearch, LineSearchOutcome, max_step_to_boundary};
use super::predictor::{self, needs_equal_step_lengths};
use super::run_state::RunState;

use super::Ipm;
use super::kkt::workspace::Workspace;
use super::restoration::elastic_mode;
use crate::ocp::assembly::units::tolerance_factor;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::dynamics::StageAction;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::Convexification;
use crate::ocp::formulation::program::curvature::{Curvature, Exact};
use crate::ocp::nlp::filter::{Filter, FilterPair};
use crate::ocp::nlp::solver_loop::{IterativeMethod, NextAction};
use crate::ocp::nlp::stopwatch::Stopwatch;
use crate::ocp::solution::log::Iteration;
use crate::ocp::solution::outcome::Status;
use crate::qp::{QpError, StageDims, Store, nan_max};
use crate::scalar::Real;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;

/// The Hessian of the Lagrangian without convexification.
const EXACT_HESSIAN: Exact = Exact { convexification: Convexification::None };

/// A search direction and its largest step lengths.
struct SearchDirection {
    filter_model: FilterModel,
    tau: f64,
    max_alpha_primal: f64,
    max_alpha_dual: f64,
    /// Whether all changes are of the size of rounding errors.
    is_tiny: bool,
    /// Whether it has a higher-order correction.
    is_corrected: bool,
}

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// Writes the QP at the iterate. New slacks come with new multipliers, which the Hessian
    /// contains.
    pub(super) fn linearise<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_>,
    ) -> Result<(), OcpError>
    where
        Exact: Curvature<P::Dynamics, T>,
    {
        if !state.slacks_are_current {
            if !core::mem::take(&mut state.is_linearised) {
                P::slopes(ocp)?;
            }
            if state.dimensions.in_restoration {
                ocp.centre_objective_at_iterate();
            }
            self.initialise_slacks_and_multipliers(ocp, state)?;
        }
        self.load_hessian_multipliers(ocp, state)?;
        ocp.linearise(EXACT_HESSIAN)?;
        if state.dimensions.in_restoration {
            ocp.centre_objective_at_iterate();
        }
        let units = Workspace::new(ocp.ends(), &state.max_dimensions, self.workspace.as_mut()).units;
        kkt_view_of_new_qp(
            ocp.qp.view(),
            &state.dimensions,
            &mut self.kkt_numbers,
            &mut self.kkt_indices,
            units,
        )?;
        Ok(())
    }

    /// Updates residuals, barrier parameter and best iterate.
    fn update_residuals<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_>,
        log_row: &mut Iteration,
    ) -> Result<(), OcpError> {
        let (plain_objective, [_, of_stages]) =
            (ocp.objective.to_f64(), ocp.stage_residuals.map(|left| left.to_f64()));
        let of_stages = if ocp.problem.is_lifted() { of_stages } else { 0.0 };
        let ends = ocp.ends();
        let (qp, solution) = ocp.qp_and_iterate();
        let mut iterate = kkt_view(qp, &state.dimensions, &mut self.kkt_numbers, &mut self.kkt_indices)?;
        let (mut residuals, penalties) = evaluate_residuals(&mut iterate, &mut solution.view_mut());
        let mut view = solution.view_mut();
        iterate.store(&mut view);
        let objective =
            if state.dimensions.in_restoration { plain_objective } else { plain_objective + penalties };
        residuals.dynamics = nan_max(residuals.dynamics, of_stages);
        if self.options.final_mu > 0.0 {
            (residuals.inequalities, residuals.complementarity) =
                barrier::barrier_residuals(&iterate.inequalities, self.options.final_mu);
        }
        let work = Workspace::new(ends, &state.max_dimensions, self.workspace.as_mut());
        let units = state.dimensions.units(work.units);
        state.update_product_unit(objective);
        let (units_of_residuals, newton) = ((units, state.product_unit), &self.options.advanced.newton);
        let scaled =
            scaled_residuals(&residuals, &iterate, view.dynamics, units_of_residuals, of_stages, newton);
        state.update_mu(&iterate, &scaled, &self.options);
        let ScaledResiduals {
            barrier_residuals: (barrier, _),
            nlp_error: error,
            error_without_complementarity: others,
        } = scaled;
        state.update_nlp_error(error, others, &self.options);
        state.largest_gap = barrier.dynamics;
        state.violation = nan_max(state.largest_gap, barrier.inequalities);
        let in_restoration = state.dimensions.in_restoration;
        if in_restoration {
            state.restoration.update_violations(&iterate, view.dynamics, state.largest_gap, units);
        }
        (log_row.residuals, log_row.objective) = (residuals, objective);
        (log_row.elastic, log_row.barrier) = (state.elastic_penalty.is_some(), state.mu);
        let work = Workspace::new(ocp.ends(), &state.max_dimensions, self.workspace.as_mut());
        let worst = elastic_mode::largest_elastic_violation(ocp, state, (work.saved_penalties, work.units));
        let overall_error = nan_max(state.nlp_error, worst.map_or(0.0, |worst| worst.violation));
        // Violations of the given bounds count, also if bounds have penalties.
        let hard = elastic_mode::largest_elastic_violation(ocp, state, (work.saved_penalties, &[]))
            .map_or(0.0, |worst| worst.violation);
        log_row.residuals.inequalities = nan_max(log_row.residuals.inequalities, hard);
        let is_best = overall_error < state.best_residual || state.best_residual.is_nan();
        if !in_restoration && is_best || log_row.iteration == 0 {
            (state.best_residual, state.best_iteration) = (overall_error, *log_row);
            state.best_violation = state.violation;
            self.best_iterate.copy_from(&ocp.iterate);
            ocp.problem.apply_stage_action(StageAction::StoreBest);
        }
        let is_acceptable = !in_restoration && overall_error <= self.options.acceptable_tolerance;
        state.acceptable_iterations = if is_acceptable { state.acceptable_iterations + 1 } else { 0 };
        Ok(())
    }

    /// Returns barrier function and violation at the iterate.
    ///
    /// # Errors
    /// [`QpError::OutOfMemory`], [`QpError::Dimension`]
    fn barrier_and_violation<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_>,
    ) -> Result<FilterPair, QpError> {
        let dimensions = state.dimensions;
        let Self { trial_point, kkt_numbers, kkt_indices, workspace, .. } = self;
        let plain_objective = if dimensions.in_restoration { 0.0 } else { ocp.objective.to_f64() };
        let iterate = kkt_view(ocp.qp.view(), &dimensions, kkt_numbers, kkt_indices)?;
        let mut workspace = Workspace::new(ocp.ends(), &state.max_dimensions, workspace.as_mut());
        let mut current_pair = barrier_function::barrier_and_violation(
            &iterate,
            plain_objective,
            state.mu,
            dimensions.units(workspace.units),
        );
        if ocp.problem.is_lifted() {
            // The QP contains the ends of intervals that the next step of the stages leads to.
            let mut line_search = LineSearch {
                dimensions: &dimensions,
                kkt_numbers,
                kkt_indices,
                trial_point,
                workspace: &mut workspace,
                options: &self.options.advanced,
            };
            current_pair = line_search.evaluate_trial(ocp, state.mu, 0.0).unwrap_or(current_pair);
        }
        if !state.filter_is_initialised {
            state.initial_violation = current_pair.violation;
            let options = self.options.advanced.filter;
            let reference_violation = current_pair.violation.max(1.0);
            state.theta_min = options.theta_min_fact * reference_violation;
            state.filter = Filter::new(options, options.theta_max_fact * reference_violation);
            state.filter_is_initialised = true;
        }
        Ok(current_pair)
    }

    /// Computes the filter model along the search direction, and the largest step lengths.
    ///
    /// # Errors
    /// [`QpError::OutOfMemory`], [`QpError::Dimension`]
    fn prepare_line_search<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &RunState<'_>,
        here: FilterPair,
        is_corrected: bool,
    ) -> Result<SearchDirection, QpError> {
        let work = Workspace::new(ocp.ends(), &state.max_dimensions, self.workspace.as_mut());
        let iterate =
            kkt_view(ocp.qp.view(), &state.dimensions, &mut self.kkt_numbers, &mut self.kkt_indices)?;
        let reference_violation = state.initial_violation.max(1.0);
        let (options, newton) = (self.options.advanced.line_search, &self.options.advanced.newton);
        let noise = T::from_f64(options.rounding_units * T::EPSILON);
        let sizes = iterate.v.iter().zip(&*work.units).map(|(v, &unit)| T::ONE + (*v / unit).abs());
        let (equation_residual, equation_residual_sum) =
            equation_residuals_after_step(&iterate, work.units, newton);
        let rounding = (noise * sizes.fold(T::ZERO, |sum, size| sum + size)).to_f64() + equation_residual_sum;
        let objective_unit = state.dimensions.scaling.objective_unit;
        let (slope, gradient_terms) = barrier_function::barrier_slope(&iterate, state.mu, work.scratch);
        let expected = FilterModel {
            current: here,
            slope: slope / objective_unit,
            // Rounding errors of the function and of the point.
            noise: options.rounding_units
                * f64::EPSILON
                * (here.objective.abs() + gradient_terms / objective_unit),
            theta_min: state.theta_min,
            max_violation: (options.max_violation_growth * here.violation.min(reference_violation))
                .max(reference_violation),
            mu: state.mu,
            delta_w: state.delta_w,
            rounding_violation: rounding,
            equation_residual,
        };
        let tau = self.options.advanced.barrier.fraction_to_boundary(state.mu / objective_unit);
        let (primal, dual) = predictor::step_lengths(&iterate.inequalities, tau);
        let mut steps = iterate.step.iter().zip(&*iterate.v).zip(&*work.units);
        let tiny_step_tol = T::from_f64(options.tiny_step_tol * T::EPSILON);
        let is_tiny = |((&d, &v), &unit): ((&T, &T), &T)| d.abs() <= tiny_step_tol * (unit + v.abs());
        let tiny = here.violation <= options.tiny_step_violation && steps.all(is_tiny);
        Ok(SearchDirection {
            filter_model: expected,
            tau,
            max_alpha_primal: primal,
            max_alpha_dual: dual,
            is_tiny: tiny,
            is_corrected,
        })
    }

    /// Returns the step length. A corrected direction is taken at its full length; if the filter
    /// rejects it, the line search uses the direction without correction.
    fn line_search<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_>,
        direction: &mut SearchDirection,
    ) -> Result<LineSearchOutcome, OcpError> {
        if direction.is_tiny {
            return Ok(LineSearchOutcome::Step(AcceptedStep {
                alpha: direction.max_alpha_primal,
                corrected: false,
            }));
        }
        let dimensions = state.dimensions;
        macro_rules! line_search {
            ($workspace:ident) => {{
                let Self { trial_point, kkt_numbers, kkt_indices, workspace, options, .. } = &mut *self;
                $workspace = Workspace::new(ocp.ends(), &state.max_dimensions, workspace.as_mut());
                LineSearch {
                    dimensions: &dimensions,
                    kkt_numbers,
                    kkt_indices,
                    trial_point,
                    workspace: &mut $workspace,
                    options: &options.advanced,
                }
            }};
        }
        let mut workspace;
        if direction.is_corrected {
            let SearchDirection { filter_model: expected, max_alpha_primal: primal, .. } = direction;
            if line_search!(workspace).accepts(ocp, &mut state.filter, expected, *primal) {
                return Ok(LineSearchOutcome::Step(AcceptedStep { alpha: *primal, corrected: false }));
            }
            let current_pair = direction.filter_model.current;
            let mut iterate =
                kkt_view(ocp.qp.view(), &dimensions, &mut self.kkt_numbers, &mut self.kkt_indices)?;
            resolve(&mut iterate, T::from_f64(state.mu), false)?;
            refine_step(
                &mut iterate,
                Workspace::new(ocp.ends(), &state.max_dimensions, self.workspace.as_mut()).units,
                &self.options.advanced.newton,
            )?;
            *direction = self.prepare_line_search(ocp, state, current_pair, false)?;
            self.expand_stage_steps(ocp, state)?;
        }
        let SearchDirection { filter_model: expected, max_alpha_primal: primal, tau, .. } = direction;
        line_search!(workspace).search(ocp, state, expected, *primal, *tau)
    }

    /// Applies the accepted step.
    fn apply_step<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &RunState<'_>,
        direction: &SearchDirection,
        accepted: AcceptedStep,
    ) -> Result<(), OcpError> {
        let mut work = Workspace::new(ocp.ends(), &state.max_dimensions, self.workspace.as_mut());
        let (qp, mut view) = (ocp.qp.view(), ocp.iterate.view_mut());
        let mut iterate = kkt_view(qp, &state.dimensions, &mut self.kkt_numbers, &mut self.kkt_indices)?;
        iterate.units = &*core::mem::take(&mut work.units);
        let (AcceptedStep { alpha, corrected }, mut dual) = (accepted, direction.max_alpha_dual);
        if corrected {
            dual = max_step_to_boundary(
                iterate.inequalities.multiplier,
                iterate.inequalities.multiplier_step,
                direction.tau,
            );
        }
        if needs_equal_step_lengths(&iterate.inequalities) {
            dual = dual.min(alpha);
        }
        costates_after_step(&mut iterate, &mut work, T::from_f64(state.delta_w));
        let alpha_number = T::from_f64(alpha);
        for (pi, &after) in view.dynamics.iter_mut().zip(&*work.next_costates) {
            *pi = *pi + alpha_number * (after - *pi);
        }
        let multipliers_and_steps =
            iterate.inequalities.multiplier.iter().zip(&*iterate.inequalities.multiplier_step);
        for (of_hessian, (&multiplier, &step)) in
            work.hessian_multipliers.iter_mut().zip(multipliers_and_steps)
        {
            *of_hessian = *of_hessian + alpha_number * (multiplier + step - *of_hessian);
        }
        iterate.step_point(alpha_number, T::from_f64(dual));
        let kappa_sigma = self.options.advanced.barrier.kappa_sigma;
        barrier::correct_bound_multipliers(&mut iterate.inequalities, state.mu, kappa_sigma);
        iterate.store(&mut view);
        ocp.problem.apply_stage_action(StageAction::Step(alpha_number));
        // The line search has evaluated the accepted point; a tiny step has no line search.
        ocp.algebraic_is_current = !direction.is_tiny;
        Ok(())
    }
}

impl<P, T, D, M, I> IterativeMethod<P, T, D, M> for Ipm<T, D, M, I>
where
    P: Program<T>,
    Exact: Curvature<P::Dynamics, T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: Store<T>,
    I: Store<u32>,
{
    type RunState<'c> = RunState<'c>;

    fn evaluate(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_>,
        log_row: &mut Iteration,
    ) -> Result<(), OcpError> {
        log_row.perturbed = state.has_perturbed_start && log_row.iteration == 0;
        self.linearise(ocp, state)?;
        self.update_residuals(ocp, state, log_row)
    }

    fn check_termination(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_>,
        log_row: &Iteration,
    ) -> NextAction {
        if (state.deadline_passed)() {
            return NextAction::Terminate(Status::OutOfTime);
        }
        self.check_convergence(ocp, state, log_row)
    }

    fn step(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_>,
        log_row: &mut Iteration,
        watch: &mut Stopwatch,
    ) -> Result<Option<Status>, OcpError> {
        if state.is_complementarity_stalled(self.options.advanced.barrier.complementarity_stall_iterations) {
            self.reset_small_slacks(ocp, state)?;
        }
        let direction = self.search_direction(ocp, state, log_row)?.and_then(|is_corrected| {
            let current_pair = self.barrier_and_violation(ocp, state)?;
            self.prepare_line_search(ocp, state, current_pair, is_corrected)
        });
        let mut direction = match direction {
            Ok(direction) => direction,
            Err(error @ QpError::NotConvex { .. }) => {
                // A non-finite derivative ends the run with an error.
                ocp.qp_failure_status(error)?;
                return Ok(self.recover_from_failed_step(ocp, state));
            }
            Err(error) => return ocp.qp_failure_status(error).map(Some),
        };
        self.expand_stage_steps(ocp, state)?;
        log_row.times.qp = watch.lap();
        if (state.deadline_passed)() {
            return Ok(Some(Status::OutOfTime));
        }
        if self.is_unbounded(ocp, state) {
            return Ok(Some(Status::Unbounded));
        }
        let outcome = self.line_search(ocp, state, &mut direction)?;
        log_row.times.search = watch.lap();
        let accepted = match outcome {
            LineSearchOutcome::Step(accepted) => accepted,
            LineSearchOutcome::NoStep => return Ok(self.recover_from_failed_step(ocp, state)),
            LineSearchOutcome::OutOfTime => return Ok(Some(Status::OutOfTime)),
        };
        (log_row.step, log_row.corrected) = (accepted.alpha, accepted.corrected);
        state.count_stalled_step(log_row.step, self.options.advanced.restart.short_step);
        state.regularisation.update_damping(log_row.step / direction.max_alpha_primal);
        self.apply_step(ocp, state, &direction, accepted)?;
        let min_mu = self.options.tolerance * tolerance_factor(state.product_unit);
        let stalls = state.count_tiny_step(direction.is_tiny);
        let is_finished = stalls && state.mu <= min_mu.max(self.options.final_mu);
        Ok(is_finished.then_some(Status::NoProgress))
    }

    fn restart(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_>,
        final_status: Option<Status>,
        log_row: &Iteration,
    ) -> bool {
        let restarts = self.try_restart(ocp, state, final_status);
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
