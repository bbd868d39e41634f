//! Which Jacobian Newton's method takes, and when it is renewed.
//!
//! One rule ([`Jacobian::Auto`]): the Jacobian of the last step or of the start values is kept as
//! long as the iterations that are still expected with it cost less than a new one. How many that
//! are is known from two increments by the same; of the first one, which begins far away with a
//! Jacobian of its own, the residual that it leaves tells. A new one, with three stages or more, is
//! shared by the stages: their mean, or that in their middle where they are not evaluated side by
//! side. Its system is solved in the eigenbasis of the tableau, in numbers that may be
//! [demoted](Lanes::Demoted): it costs a fraction of one with a Jacobian for each stage.

use super::convergence::{Status, predicted_iterations};
use crate::irk::workspace::FactorValidity;
use crate::model::Dae;
use crate::options::Jacobian;
use crate::scalar::Lanes;
use bytemuck::Zeroable;
use core::marker::PhantomData;

/// The first shared Jacobian is that of start values, which may be far away: that increments grow
/// with it is not its fault.
const IGNORED_RENEWALS: usize = 1;
/// So often the shared Jacobian is renewed in a step before the stages' own are taken.
const MAX_SHARED_RENEWALS: usize = 3;

/// So many iterations new factors still take themselves: by blocks, and of the shared Jacobian,
/// with which increments never shrink quadratically.
const ITERATIONS_AFTER_RENEWAL: [f64; 2] = [2.0, 3.0];

/// The state of the rule while a step is solved.
pub(super) struct JacobianPolicy<M, E, const S: usize> {
    /// Whether every iteration has a Jacobian of its own.
    pub full_newton: bool,
    simplified: bool,
    adaptive: bool,
    /// Whether stages may share a Jacobian.
    may_share: bool,
    /// Whether the factors that iterations take are those of the shared Jacobian.
    pub shared: bool,
    /// Whether the next iteration has new ones.
    pub renew: bool,
    /// Whether any were new in this step.
    pub renewed_in_step: bool,
    /// Whether the residual that the first increment leaves is asked how good its Jacobian is.
    pub may_refresh_early: bool,
    /// Whether start values are solutions but for their last digits.
    start_near_solution: bool,
    renewals: usize,
    types: PhantomData<(M, E)>,
}

impl<M: Dae, E: Lanes, const S: usize> JacobianPolicy<M, E, S> {
    /// The operations of an iteration with old factors: what is computed for all stages side by
    /// side counts once.
    const ITERATION_COST: f64 = {
        let blocks = M::STRUCTURE.elimination.slots.len() as f64;
        M::STRUCTURE.operations.residual as f64 + blocks * S as f64 + 1.0
    };

    /// The cost of new factors, in iterations with old ones: by blocks, and of the shared Jacobian
    /// in the eigenbasis.
    const RENEWAL_COST: [f64; 2] = {
        let (operations, plan) = (&M::STRUCTURE.operations, &M::STRUCTURE.elimination);
        let (s, inverses) = (S as f64, 4.0 * plan.pivots.len() as f64);
        // A complex product is four real ones.
        let jacobian = operations.residual_jacobian as f64;
        // One for all stages, where they are not evaluated side by side.
        let middle = if E::LANES > 1 { jacobian / s } else { jacobian };
        let (products, terms) = (plan.block_product_count() + inverses, plan.assembly.len() as f64);
        let of_blocks = (jacobian + (products + terms / s) * s * s) / Self::ITERATION_COST;
        [of_blocks, (middle + (products + terms) * 4.0) / Self::ITERATION_COST]
    };

    /// The cost of a residual, in iterations.
    const RESIDUAL_COST: f64 = M::STRUCTURE.operations.residual as f64 / Self::ITERATION_COST;

    /// Whether factors by blocks cost no more than the iterations that they save where start values
    /// are near, with shared Jacobians that are renewed up to three times.
    pub const STAGE_FACTORS_ARE_CHEAP: bool = Self::RENEWAL_COST[0] <= 10.0;

    /// Before the first iteration, with factors that are valid for something or nothing.
    #[inline(always)]
    pub fn start(jacobian: Jacobian, may_share: bool, validity: FactorValidity, near_solution: bool) -> Self {
        let (full, simplified) = (jacobian == Jacobian::Full, jacobian == Jacobian::Simplified);
        let (adaptive, exact) = (jacobian.is_adaptive(), M::STRUCTURE.linear_in_state);
        // Exact factors of the step before are the best there are, and cost nothing.
        let shared = may_share && !validity.factors;
        let near = cfg!(feature = "alloc") && Self::STAGE_FACTORS_ARE_CHEAP && near_solution && shared;
        let renew = if shared {
            !validity.shared
        } else if M::STRUCTURE.constant_matrix && validity.factors {
            false
        } else {
            // Of linear equations every step has one matrix, which may be that of all steps.
            full || exact || !(adaptive && validity.factors)
        };
        let asks = adaptive && renew && !near && !exact && !full && !M::STRUCTURE.constant_matrix;
        let (factored, renewals, of) = (false, 0, PhantomData);
        Self {
            full_newton: full,
            simplified,
            adaptive,
            may_share,
            shared,
            renew,
            renewed_in_step: factored,
            may_refresh_early: asks,
            start_near_solution: near,
            renewals,
            types: of,
        }
    }

    /// Whether new factors are those of a shared Jacobian. Where it says too little about each of
    /// the stages, their own Jacobians are taken.
    #[inline(always)]
    fn next_is_shared(&self) -> bool {
        self.may_share && (self.simplified || self.renewals < MAX_SHARED_RENEWALS)
    }

    /// The factors are renewed.
    #[inline(always)]
    pub fn on_renewal(&mut self) {
        self.shared = self.next_is_shared() && !self.start_near_solution;
        self.renewals += usize::from(self.renew);
        self.renewed_in_step = true;
    }

    /// After an iteration that is not the last, whose factors may have been renewed `early`.
    #[inline(always)]
    pub fn after_iteration(&mut self, status: &Status, iteration: usize, renewed_early: bool) {
        if iteration > 1 && self.renewals > IGNORED_RENEWALS && status.increments_grow {
            // The shared one does not do.
            self.renewals = MAX_SHARED_RENEWALS;
        }
        // Those of a solution nearby do for all iterations, unless increments hardly shrink.
        self.start_near_solution &= !status.stagnates;
        // The first increment of new factors against the last of old ones does not tell how good
        // the new ones are.
        let new_factors = renewed_early || self.renew && iteration > 1;
        let converges_slowly = status.predicted_iterations > Self::renewal_cost(self.next_is_shared())
            && (!new_factors || status.increments_grow);
        let exact = M::STRUCTURE.linear_in_state;
        // A frozen one is renewed where it hardly helps.
        let frozen = !(self.full_newton || self.adaptive);
        let renewal_wanted = self.full_newton
            || self.adaptive && !self.start_near_solution && converges_slowly
            || frozen && status.stagnates;
        self.renew = !exact && renewal_wanted;
    }

    /// How many iterations new factors cost, with those that they take themselves.
    #[inline(always)]
    fn renewal_cost(shared: bool) -> f64 {
        ITERATIONS_AFTER_RENEWAL[usize::from(shared)] + Self::RENEWAL_COST[usize::from(shared)]
    }

    /// Whether the residual that an increment leaves, as a part of the first one, lets so many
    /// iterations be expected that new factors cost less. Where it leaves more than a sixteenth,
    /// those of where it led to would soon be renewed as well. Where it leaves more than there was,
    /// another increment by the same factors would be longer than the first, and may lead to
    /// another root than Newton's method does.
    pub fn contraction_too_slow(&self, remaining_residual: E, tolerance: f64) -> bool {
        let factor_kind = usize::from(self.may_share);
        let renewal_cost =
            ITERATIONS_AFTER_RENEWAL[factor_kind] + Self::RESIDUAL_COST + Self::RENEWAL_COST[factor_kind];
        let mut cell: E::Cell = Zeroable::zeroed();
        remaining_residual.store(&mut cell);
        let (mut slowest_rate, mut grows) = (0.0f64, false);
        for lane in 0..E::LANES {
            let left = E::lane(&cell, lane);
            grows |= left >= 1.0;
            if left < 1.0 / 16.0 {
                slowest_rate = slowest_rate.max(left);
            }
        }
        grows || predicted_iterations(true, 1.0, slowest_rate, tolerance) > renewal_cost
    }
}
