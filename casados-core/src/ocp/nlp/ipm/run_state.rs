//! State of a run.

use super::IpmOptions;
use super::barrier::{self, AdaptiveMu, Barrier};
use super::kkt::dimensions::KktDimensions;
use super::kkt::regularisation::Regularisation;
use super::kkt::scaling::ScaledResiduals;
use super::violations::RestorationPhase;
use crate::ocp::assembly::units;
use crate::ocp::nlp::filter::Filter;
use crate::ocp::solution::log::Iteration;
use crate::ocp::solution::outcome::Status;
use crate::qp::Residuals;
use crate::qp::interior::{Inequalities, Iterate};
use crate::scalar::Real;

/// State of a run, kept between iterations.
pub(in crate::ocp::nlp) struct RunState<'c> {
    /// Whether the deadline has passed.
    pub deadline_passed: &'c mut dyn FnMut() -> bool,
    pub dimensions: KktDimensions,
    /// The dimensions of the memory: with every bound soft.
    pub max_dimensions: KktDimensions,
    /// Whether the guess has been perturbed.
    pub has_perturbed_start: bool,
    /// The barrier parameter.
    pub mu: f64,
    /// State of the adaptive barrier parameter.
    pub adaptive_mu: AdaptiveMu,
    pub filter: Filter,
    /// `θ_min`: the switching condition requires a violation of at most this.
    pub theta_min: f64,
    /// The violation at which the filter was initialised.
    pub initial_violation: f64,
    pub regularisation: Regularisation,
    /// `δ_w` of the last step.
    pub delta_w: f64,
    /// The penalty of elastic mode, or of the restoration phase.
    pub elastic_penalty: Option<f64>,
    /// Whether the run has restarted.
    pub second_attempt: bool,
    /// State of the restoration phase.
    pub restoration: RestorationPhase,
    /// The largest gap or violation, in units.
    pub violation: f64,
    /// The largest gap, in units.
    pub largest_gap: f64,
    /// The largest gap or violation of the best iterate.
    pub best_violation: f64,
    /// The objective at the first iterate.
    pub initial_objective: f64,
    /// The violation that the last penalty has left.
    pub last_elastic_violation: f64,
    /// Consecutive iterations with acceptable residuals.
    pub acceptable_iterations: usize,
    /// Consecutive iterations in which complementarity is the only remaining residual, and stalls.
    pub complementarity_stall_iterations: usize,
    /// Whether small slacks have been reset.
    pub has_reset_slacks: bool,
    /// Consecutive steps that are short, or in the restoration phase.
    pub stalled_iterations: usize,
    /// The KKT error before the last step, if that was tiny.
    tiny_step_error: Option<f64>,
    /// Whether slacks and multipliers belong to the present bounds, hard or soft.
    pub slacks_are_current: bool,
    /// Whether the QP is linearised at the iterate, with whatever multipliers.
    pub is_linearised: bool,
    /// Whether the filter has the `θ_max` of the present slacks.
    pub filter_is_initialised: bool,
    /// The unit of products of slacks and multipliers.
    pub product_unit: f64,
    /// The largest residual, relative to units and multipliers.
    pub nlp_error: f64,
    /// The largest residual of the best iterate.
    pub best_residual: f64,
    /// The log row of the best iterate.
    pub best_iteration: Iteration,
    /// The status `Infeasible` of contradictory bounds.
    pub contradictory_bounds: Option<Status>,
    /// Whether the run converged with the units of the guess, and continues with those of the
    /// iterate.
    pub has_rescaled_objective: bool,
    /// The size of variables above which the problem is tested for unboundedness.
    pub diverging_iterates_tol: f64,
}

impl<'c> RunState<'c> {
    /// The state at the start of a run.
    pub fn new(
        over: &'c mut dyn FnMut() -> bool,
        (lengths, capacity): (KktDimensions, KktDimensions),
        is_linearised: bool,
        options: &IpmOptions,
    ) -> Self {
        // Products that do not vanish cannot be predicted by an affine-scaling step.
        let advanced = &options.advanced;
        let barrier = if options.final_mu > 0.0 { Barrier::Monotone } else { options.barrier };
        Self {
            deadline_passed: over,
            dimensions: lengths,
            max_dimensions: capacity,
            has_perturbed_start: false,
            mu: options.scaled_start_mu(lengths.scaling.objective_unit),
            adaptive_mu: AdaptiveMu::new(barrier, advanced.barrier),
            filter: Filter::new(advanced.filter, f64::INFINITY),
            theta_min: f64::INFINITY,
            initial_violation: f64::INFINITY,
            regularisation: Regularisation::new(advanced.inertia, advanced.damping),
            delta_w: 0.0,
            elastic_penalty: None,
            second_attempt: false,
            restoration: RestorationPhase::default(),
            violation: f64::INFINITY,
            largest_gap: f64::INFINITY,
            best_violation: f64::INFINITY,
            initial_objective: 0.0,
            last_elastic_violation: f64::INFINITY,
            acceptable_iterations: 0,
            complementarity_stall_iterations: 0,
            has_reset_slacks: false,
            stalled_iterations: 0,
            tiny_step_error: None,
            slacks_are_current: false,
            is_linearised,
            filter_is_initialised: false,
            product_unit: lengths.scaling.objective_unit,
            nlp_error: f64::INFINITY,
            best_residual: f64::INFINITY,
            best_iteration: Iteration::default(),
            contradictory_bounds: None,
            has_rescaled_objective: false,
            diverging_iterates_tol: f64::INFINITY,
        }
    }

    /// Returns whether a tiny step follows another that left more than half of the KKT error: tiny
    /// steps change only multipliers, and can still reduce the complementarity.
    pub fn count_tiny_step(&mut self, is_tiny: bool) -> bool {
        let last_error = self.tiny_step_error.take();
        self.tiny_step_error = is_tiny.then_some(self.nlp_error);
        is_tiny && last_error.is_some_and(|last_error| self.nlp_error > 0.5 * last_error)
    }

    /// Counts stalled steps: short ones, and steps of the restoration phase.
    pub fn count_stalled_step(&mut self, step: f64, short_step: f64) {
        let stalls = self.restoration.outer_objective_unit.is_some() || step <= short_step;
        self.stalled_iterations = if stalls { self.stalled_iterations + 1 } else { 0 };
    }

    /// Updates the unit of products at an iterate: `objective_unit` before the objective is
    /// rescaled, and in the restoration phase.
    pub fn update_product_unit(&mut self, objective: f64) {
        let objective_unit = self.dimensions.scaling.objective_unit;
        let is_final = self.has_rescaled_objective && !self.dimensions.in_restoration;
        self.product_unit =
            if is_final { units::product_unit(objective, objective_unit) } else { objective_unit };
    }

    /// Updates the barrier parameter from the residuals; complementarity is divided by `products`.
    /// A new barrier parameter clears the filter.
    pub(in crate::ocp::nlp::ipm) fn update_mu<T: Real>(
        &mut self,
        iterate: &Iterate<'_, T>,
        ScaledResiduals {
            barrier_residuals: (residuals, products),
            error_without_complementarity,
            ..
        }: &ScaledResiduals,
        options: &IpmOptions,
    ) {
        let objective_unit = self.dimensions.scaling.objective_unit;
        let Inequalities { slack, multiplier, .. } = &iterate.inequalities;
        // Residuals below the tolerance may be rounding errors, and do not delay smaller `μ`.
        let left = if *error_without_complementarity <= options.tolerance {
            Residuals::default()
        } else {
            *residuals
        };
        let error = |mu| {
            let complementarity =
                barrier::max_complementarity_error(slack, multiplier, mu * objective_unit) / products;
            barrier::barrier_error(&left, complementarity)
        };
        let mean_complementarity = barrier::mean_complementarity(&iterate.inequalities) / objective_unit;
        let tolerance = options.product_tolerance(self.product_unit) / objective_unit;
        let mu = objective_unit
            * self.adaptive_mu.update_mu(self.mu / objective_unit, error, mean_complementarity, tolerance);
        if mu != self.mu {
            self.mu = mu;
            self.filter.clear();
        }
    }

    /// Stores the error of an iterate, and counts iterations in which complementarity stalls: with
    /// the smallest `μ`, and all other residuals below the tolerance.
    pub fn update_nlp_error(&mut self, error: f64, error_without_complementarity: f64, options: &IpmOptions) {
        let (tolerance, barrier) = (options.tolerance, &options.advanced.barrier);
        let min_mu = barrier.min_mu(options.product_tolerance(self.product_unit));
        let is_min_mu = self.mu <= 2.0 * min_mu;
        let is_stalled = error > tolerance.max(barrier.stalled_complementarity_ratio * self.nlp_error);
        self.complementarity_stall_iterations =
            if is_min_mu && error_without_complementarity <= tolerance && is_stalled {
                self.complementarity_stall_iterations + 1
            } else {
                0
            };
        self.nlp_error = error;
    }

    /// Whether complementarity stalls; true at most once in a run.
    pub fn is_complementarity_stalled(&mut self, stall_iterations: usize) -> bool {
        let is_complementarity_stalled =
            self.complementarity_stall_iterations >= stall_iterations && !self.has_reset_slacks;
        self.has_reset_slacks |= is_complementarity_stalled;
        is_complementarity_stalled
    }

    /// Starts monotone mode for the rest of the run; slacks, multipliers and filter are initialised
    /// again.
    pub fn begin_monotone_mode(&mut self, options: &IpmOptions) {
        self.adaptive_mu = AdaptiveMu::new(Barrier::Monotone, options.advanced.barrier);
        self.mu = options.scaled_start_mu(self.dimensions.scaling.objective_unit);
        self.regularisation = self.regularisation.restarted();
        (self.slacks_are_current, self.filter_is_initialised) = (false, false);
    }
}
