//! What a run remembers.

use super::IpmOptions;
use super::barrier::{self, Barrier, Progress};
use super::kkt::lengths::Lengths;
use super::kkt::regularisation::Regularisation;
use super::kkt::scaling::Relative;
use super::violations::Phase;
use crate::ocp::assembly::units::unit_of_products;
use crate::ocp::nlp::filter::Filter;
use crate::ocp::solution::log::Iteration;
use crate::ocp::solution::outcome::Status;
use crate::qp::Residuals;
use crate::qp::interior::{Inequalities, Iterate};
use crate::scalar::Real;

/// So many iterations with nothing left but complementarity, each of which leaves this part of it,
/// are no convergence of Newton's method.
const COMPLEMENTARITY_STALL: usize = 3;
const STALLED_DECREASE: f64 = 0.9;

/// Steps that are no longer lead nowhere if there are many of them.
const SHORT_STEP: f64 = 1.0 / 32.0;

/// What a run remembers from one iteration to the next.
pub(in crate::ocp::nlp) struct State<'c> {
    /// Whether the time is over.
    pub over: &'c mut dyn FnMut() -> bool,
    pub lengths: Lengths,
    /// Those of memory: of every bound soft.
    pub capacity: Lengths,
    /// Whether the run began beside the guess.
    pub has_perturbed_start: bool,
    /// The barrier parameter.
    pub mu: f64,
    /// What an adaptive one follows.
    pub progress: Progress,
    pub filter: Filter,
    /// `θ_min`: below this violation the barrier function may decide.
    pub small_violation: f64,
    /// The violation that the filter began with.
    pub first_violation: f64,
    pub regularisation: Regularisation,
    /// `δ_w` of the step.
    pub delta: f64,
    /// The penalty, if bounds are soft.
    pub elastic: Option<f64>,
    /// Whether this is a second attempt.
    pub second_attempt: bool,
    /// Phases in which violations alone are made small.
    pub phase: Phase,
    /// The largest gap or violation, in units.
    pub violation: f64,
    /// The largest gap.
    pub gaps: f64,
    /// The largest gap or violation of the best iterate.
    pub best_violation: f64,
    /// The objective at the first iterate.
    pub first_objective: f64,
    /// The violation that the last penalty left.
    pub stationary_violation: f64,
    /// Iterations one after the other whose residuals are acceptable.
    pub acceptable: usize,
    /// Iterations one after the other in which complementarity is all that is left, and stays.
    pub complementarity_stall: usize,
    /// Whether slacks that multipliers held were released.
    pub has_reset_slacks: bool,
    /// Steps one after the other that are short, or of phases for violations.
    pub stalled_iterations: usize,
    /// Whether slacks and multipliers are those of the bounds as they are, hard or soft.
    pub has_slacks: bool,
    /// Whether the QP is that at the iterate, with whatever multipliers.
    pub is_linearised: bool,
    /// Whether the filter has the bound of violations that belongs to these slacks.
    pub has_filter: bool,
    /// The unit of products of slacks and multipliers.
    pub objective_unit: f64,
    /// The largest residual, relative to units and multipliers.
    pub error: f64,
    /// That of the best iterate.
    pub best_residual: f64,
    /// That iterate.
    pub best_iteration: Iteration,
    /// Infeasible, where bounds contradict each other.
    pub contradiction: Option<Status>,
    /// Whether the run has converged in the units of the guess, and goes on with those of the
    /// iterate.
    pub has_tightened: bool,
    /// Where variables are larger, it is asked whether the problem is unbounded.
    pub diverging_iterates: f64,
}

impl<'c> State<'c> {
    /// That of a run that begins.
    pub fn new(
        over: &'c mut dyn FnMut() -> bool,
        (lengths, capacity): (Lengths, Lengths),
        is_linearised: bool,
        options: &IpmOptions,
    ) -> Self {
        // Products that do not vanish leave nothing to correct.
        let barrier = if options.final_mu > 0.0 { Barrier::Monotone } else { options.barrier };
        Self {
            over,
            lengths,
            capacity,
            has_perturbed_start: false,
            mu: options.first_mu(lengths.sizes.force),
            progress: Progress::new(barrier),
            filter: Filter::new(f64::INFINITY),
            small_violation: f64::INFINITY,
            first_violation: f64::INFINITY,
            regularisation: Regularisation::default(),
            delta: 0.0,
            elastic: None,
            second_attempt: false,
            phase: Phase::default(),
            violation: f64::INFINITY,
            gaps: f64::INFINITY,
            best_violation: f64::INFINITY,
            first_objective: 0.0,
            stationary_violation: f64::INFINITY,
            acceptable: 0,
            complementarity_stall: 0,
            has_reset_slacks: false,
            stalled_iterations: 0,
            has_slacks: false,
            is_linearised,
            has_filter: false,
            objective_unit: lengths.sizes.force,
            error: f64::INFINITY,
            best_residual: f64::INFINITY,
            best_iteration: Iteration::default(),
            contradiction: None,
            has_tightened: false,
            diverging_iterates: f64::INFINITY,
        }
    }

    /// Counts a step of this length.
    pub fn count_stalled(&mut self, step: f64) {
        let stalls = self.phase.force.is_some() || step <= SHORT_STEP;
        self.stalled_iterations = if stalls { self.stalled_iterations + 1 } else { 0 };
    }

    /// The unit of products at an iterate: that of forces until the run would end.
    pub fn measure_objective(&mut self, objective: f64) {
        let (force, ends) = (self.lengths.sizes.force, self.has_tightened && !self.lengths.alone);
        self.objective_unit = if ends { unit_of_products(objective, force) } else { force };
    }

    /// The next barrier parameter, from residuals; another one has another filter.
    pub(in crate::ocp::nlp::ipm) fn update_barrier<T: Real>(
        &mut self,
        iterate: &Iterate<'_, T>,
        Relative { barrier: (residuals, products), others, .. }: &Relative,
        options: &IpmOptions,
    ) {
        let force = self.lengths.sizes.force;
        let Inequalities { slack, multiplier, .. } = &iterate.sides;
        // What meets the tolerance, and may be rounding errors, holds no `μ` back.
        let left = if *others <= options.tolerance { Residuals::default() } else { *residuals };
        let error = |mu| {
            let farthest = barrier::farthest(slack, multiplier, mu * force) / products;
            barrier::error(&left, farthest)
        };
        let mean = barrier::mean(&iterate.sides) / force;
        let least = options.least_product(self.objective_unit) / force;
        let mu = force * self.progress.next(self.mu / force, error, mean, least);
        if mu != self.mu {
            self.mu = mu;
            self.filter.clear();
        }
    }

    /// Takes the residuals of an iterate, and those of them that are not complementarity. Where
    /// that is all that is left, and stays, no smaller `μ` can make it less.
    pub fn judge(&mut self, error: f64, others: f64, options: &IpmOptions) {
        let tolerance = options.tolerance;
        let is_last = self.mu <= 2.0 * barrier::least(options.least_product(self.objective_unit));
        let stays = error > tolerance.max(STALLED_DECREASE * self.error);
        self.complementarity_stall =
            if is_last && others <= tolerance && stays { self.complementarity_stall + 1 } else { 0 };
        self.error = error;
    }

    /// Whether multipliers hold slacks, which is said once.
    pub fn is_complementarity_stalled(&mut self) -> bool {
        let is_complementarity_stalled =
            self.complementarity_stall >= COMPLEMENTARITY_STALL && !self.has_reset_slacks;
        self.has_reset_slacks |= is_complementarity_stalled;
        is_complementarity_stalled
    }

    /// The barrier parameter is monotone from now on; slacks, multipliers and filter begin anew.
    pub fn begin_monotone(&mut self, options: &IpmOptions) {
        self.progress = Progress::new(Barrier::Monotone);
        self.mu = options.first_mu(self.lengths.sizes.force);
        self.regularisation = Regularisation::default();
        (self.has_slacks, self.has_filter) = (false, false);
    }
}
