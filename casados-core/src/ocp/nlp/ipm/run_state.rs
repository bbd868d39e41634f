//! What a run remembers.

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

/// So many iterations with nothing left but complementarity, each of which leaves this part of it,
/// are no convergence of Newton's method.
const COMPLEMENTARITY_STALL_ITERATIONS: usize = 3;
const STALLED_COMPLEMENTARITY_RATIO: f64 = 0.9;

/// Steps that are no longer lead nowhere if there are many of them.
const SHORT_STEP: f64 = 1.0 / 32.0;

/// What a run remembers from one iteration to the next.
pub(in crate::ocp::nlp) struct RunState<'c> {
    /// Whether the time is over.
    pub deadline_passed: &'c mut dyn FnMut() -> bool,
    pub dimensions: KktDimensions,
    /// Those of memory: of every bound soft.
    pub max_dimensions: KktDimensions,
    /// Whether the run began beside the guess.
    pub has_perturbed_start: bool,
    /// The barrier parameter.
    pub mu: f64,
    /// What an adaptive one follows.
    pub adaptive_mu: AdaptiveMu,
    pub filter: Filter,
    /// `θ_min`: below this violation the barrier function may decide.
    pub theta_min: f64,
    /// The violation that the filter began with.
    pub initial_violation: f64,
    pub regularisation: Regularisation,
    /// `δ_w` of the step.
    pub delta_w: f64,
    /// The penalty, if bounds are soft.
    pub elastic_penalty: Option<f64>,
    /// Whether this is a second attempt.
    pub second_attempt: bool,
    /// Phases in which violations alone are made small.
    pub restoration: RestorationPhase,
    /// The largest gap or violation, in units.
    pub violation: f64,
    /// The largest gap.
    pub largest_gap: f64,
    /// The largest gap or violation of the best iterate.
    pub best_violation: f64,
    /// The objective at the first iterate.
    pub initial_objective: f64,
    /// The violation that the last penalty left.
    pub last_elastic_violation: f64,
    /// Iterations one after the other whose residuals are acceptable.
    pub acceptable_iterations: usize,
    /// Iterations one after the other in which complementarity is all that is left, and stays.
    pub complementarity_stall_iterations: usize,
    /// Whether slacks that multipliers held were released.
    pub has_reset_slacks: bool,
    /// Steps one after the other that are short, or of phases for violations.
    pub stalled_iterations: usize,
    /// Whether slacks and multipliers are those of the bounds as they are, hard or soft.
    pub slacks_are_current: bool,
    /// Whether the QP is that at the iterate, with whatever multipliers.
    pub is_linearised: bool,
    /// Whether the filter has the bound of violations that belongs to these slacks.
    pub filter_is_initialised: bool,
    /// The unit of products of slacks and multipliers.
    pub product_unit: f64,
    /// The largest residual, relative to units and multipliers.
    pub nlp_error: f64,
    /// That of the best iterate.
    pub best_residual: f64,
    /// That iterate.
    pub best_iteration: Iteration,
    /// Infeasible, where bounds contradict each other.
    pub contradictory_bounds: Option<Status>,
    /// Whether the run has converged in the units of the guess, and goes on with those of the
    /// iterate.
    pub has_rescaled_objective: bool,
    /// Where variables are larger, it is asked whether the problem is unbounded.
    pub diverging_iterates_tol: f64,
}

impl<'c> RunState<'c> {
    /// That of a run that begins.
    pub fn new(
        over: &'c mut dyn FnMut() -> bool,
        (lengths, capacity): (KktDimensions, KktDimensions),
        is_linearised: bool,
        options: &IpmOptions,
    ) -> Self {
        // Products that do not vanish leave nothing to correct.
        let barrier = if options.final_mu > 0.0 { Barrier::Monotone } else { options.barrier };
        Self {
            deadline_passed: over,
            dimensions: lengths,
            max_dimensions: capacity,
            has_perturbed_start: false,
            mu: options.scaled_start_mu(lengths.scaling.objective_unit),
            adaptive_mu: AdaptiveMu::new(barrier),
            filter: Filter::new(f64::INFINITY),
            theta_min: f64::INFINITY,
            initial_violation: f64::INFINITY,
            regularisation: Regularisation::default(),
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

    /// Counts a step of this length.
    pub fn count_stalled_step(&mut self, step: f64) {
        let stalls = self.restoration.outer_objective_unit.is_some() || step <= SHORT_STEP;
        self.stalled_iterations = if stalls { self.stalled_iterations + 1 } else { 0 };
    }

    /// The unit of products at an iterate: that of forces until the run would end.
    pub fn update_product_unit(&mut self, objective: f64) {
        let objective_unit = self.dimensions.scaling.objective_unit;
        let is_final = self.has_rescaled_objective && !self.dimensions.in_restoration;
        self.product_unit =
            if is_final { units::product_unit(objective, objective_unit) } else { objective_unit };
    }

    /// The next barrier parameter, from residuals; another one has another filter.
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
        let Inequalities { slack, multiplier, .. } = &iterate.sides;
        // What meets the tolerance, and may be rounding errors, holds no `μ` back.
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
        let mean_complementarity = barrier::mean_complementarity(&iterate.sides) / objective_unit;
        let tolerance = options.product_tolerance(self.product_unit) / objective_unit;
        let mu = objective_unit
            * self.adaptive_mu.update_mu(self.mu / objective_unit, error, mean_complementarity, tolerance);
        if mu != self.mu {
            self.mu = mu;
            self.filter.clear();
        }
    }

    /// Takes the residuals of an iterate, and those of them that are not complementarity. Where
    /// that is all that is left, and stays, no smaller `μ` can make it less.
    pub fn update_nlp_error(&mut self, error: f64, error_without_complementarity: f64, options: &IpmOptions) {
        let tolerance = options.tolerance;
        let is_min_mu = self.mu <= 2.0 * barrier::min_mu(options.product_tolerance(self.product_unit));
        let is_stalled = error > tolerance.max(STALLED_COMPLEMENTARITY_RATIO * self.nlp_error);
        self.complementarity_stall_iterations =
            if is_min_mu && error_without_complementarity <= tolerance && is_stalled {
                self.complementarity_stall_iterations + 1
            } else {
                0
            };
        self.nlp_error = error;
    }

    /// Whether multipliers hold slacks, which is said once.
    pub fn is_complementarity_stalled(&mut self) -> bool {
        let is_complementarity_stalled = self.complementarity_stall_iterations
            >= COMPLEMENTARITY_STALL_ITERATIONS
            && !self.has_reset_slacks;
        self.has_reset_slacks |= is_complementarity_stalled;
        is_complementarity_stalled
    }

    /// The barrier parameter is monotone from now on; slacks, multipliers and filter begin anew.
    pub fn begin_monotone_mode(&mut self, options: &IpmOptions) {
        self.adaptive_mu = AdaptiveMu::new(Barrier::Monotone);
        self.mu = options.scaled_start_mu(self.dimensions.scaling.objective_unit);
        self.regularisation = Regularisation::default();
        (self.slacks_are_current, self.filter_is_initialised) = (false, false);
    }
}
