//! The Jacobian update policy of Newton's method.
//!
//! With [`Jacobian::Auto`] the Jacobian of the last step or of the initial guess is kept while the
//! predicted iterations with it cost less than an update. The prediction is based on the
//! contraction rate of two increments with the same Jacobian; for the first increment, which starts
//! far from the solution with its own Jacobian, on the remaining residual. With three stages or
//! more a new Jacobian is shared by the stages: the mean of their Jacobians, or the Jacobian at
//! their midpoint if stages are not evaluated in one SIMD register. Its system is solved in the
//! eigenbasis of the tableau (Butcher transformation), in [demoted](Lanes::Demoted) precision if
//! possible, at a fraction of the cost of one Jacobian per stage.

use super::convergence::{Status, predicted_iterations};
use crate::irk::workspace::FactorValidity;
use crate::model::Dae;
use crate::options::Jacobian;
use crate::scalar::Lanes;
use bytemuck::Zeroable;
use core::marker::PhantomData;

/// Number of updates that growing increments do not count against: the first shared Jacobian is
/// that of the initial guess, which may be far from the solution.
const IGNORED_RENEWALS: usize = 1;
/// Maximal number of updates of the shared Jacobian in a step; then each stage has its own.
const MAX_SHARED_RENEWALS: usize = 3;

/// Iterations after an update: with one Jacobian per stage, and with a shared Jacobian, whose
/// convergence is never quadratic.
const ITERATIONS_AFTER_RENEWAL: [f64; 2] = [2.0, 3.0];

/// State of the policy during a step.
pub(super) struct JacobianPolicy<M, E, const S: usize> {
    /// Whether the Jacobian is updated in every iteration.
    pub full_newton: bool,
    simplified: bool,
    adaptive: bool,
    /// Whether stages may share a Jacobian.
    may_share: bool,
    /// Whether the current factors are those of a shared Jacobian.
    pub shared: bool,
    /// Whether the next iteration updates the Jacobian.
    pub renew: bool,
    /// Whether the Jacobian was updated in this step.
    pub renewed_in_step: bool,
    /// Whether the residual after the first increment may cause an early update.
    pub may_refresh_early: bool,
    /// Whether start values are solutions up to rounding.
    start_near_solution: bool,
    renewals: usize,
    types: PhantomData<(M, E)>,
}

impl<M: Dae, E: Lanes, const S: usize> JacobianPolicy<M, E, S> {
    /// Operations of an iteration without update; operations on all stages in one SIMD register
    /// count once.
    const ITERATION_COST: f64 = {
        let blocks = M::STRUCTURE.elimination.slots.len() as f64;
        M::STRUCTURE.operations.residual as f64 + blocks * S as f64 + 1.0
    };

    /// Cost of an update in iterations: with one Jacobian per stage, and with a shared Jacobian in
    /// the eigenbasis.
    const RENEWAL_COST: [f64; 2] = {
        let (operations, plan) = (&M::STRUCTURE.operations, &M::STRUCTURE.elimination);
        let (s, inverses) = (S as f64, 4.0 * plan.pivots.len() as f64);
        // Operations of all stages together.
        let jacobian = operations.residual_jacobian as f64;
        // At the midpoint the model is evaluated once for all stages.
        let middle = if E::LANES > 1 { jacobian / s } else { jacobian };
        let (products, terms) = (plan.block_product_count() + inverses, plan.assembly.len() as f64);
        let of_blocks = (jacobian + (products + terms / s) * s * s) / Self::ITERATION_COST;
        [of_blocks, (middle + (products + terms) * 4.0) / Self::ITERATION_COST]
    };

    /// Cost of a residual in iterations.
    const RESIDUAL_COST: f64 = M::STRUCTURE.operations.residual as f64 / Self::ITERATION_COST;

    /// Whether one Jacobian per stage costs no more than the iterations that it saves from an
    /// accurate initial guess, compared with shared Jacobians that are updated up to three times.
    pub const STAGE_FACTORS_ARE_CHEAP: bool = Self::RENEWAL_COST[0] <= 10.0;

    /// Starts the policy before the first iteration, with factors of this `validity`.
    #[inline(always)]
    pub fn start(jacobian: Jacobian, may_share: bool, validity: FactorValidity, near_solution: bool) -> Self {
        let (full, simplified) = (jacobian == Jacobian::Full, jacobian == Jacobian::Simplified);
        let (adaptive, exact) = (jacobian.is_adaptive(), M::STRUCTURE.linear_in_state);
        // Exact factors of the preceding step are best and need no update.
        let shared = may_share && !validity.factors;
        let near = cfg!(feature = "alloc") && Self::STAGE_FACTORS_ARE_CHEAP && near_solution && shared;
        let renew = if shared {
            !validity.shared
        } else if M::STRUCTURE.constant_matrix && validity.factors {
            false
        } else {
            // Linear equations: every step has one matrix, or all steps have the same one.
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

    /// Whether the next update is a shared Jacobian. After too many updates of it each stage has
    /// its own.
    #[inline(always)]
    fn next_is_shared(&self) -> bool {
        self.may_share && (self.simplified || self.renewals < MAX_SHARED_RENEWALS)
    }

    /// Records an update.
    #[inline(always)]
    pub fn on_renewal(&mut self) {
        self.shared = self.next_is_shared() && !self.start_near_solution;
        self.renewals += usize::from(self.renew);
        self.renewed_in_step = true;
    }

    /// Decides about the next update, after an iteration that is not the last.
    #[inline(always)]
    pub fn after_iteration(&mut self, status: &Status, iteration: usize, renewed_early: bool) {
        if iteration > 1 && self.renewals > IGNORED_RENEWALS && status.increments_grow {
            // The shared Jacobian is too inaccurate.
            self.renewals = MAX_SHARED_RENEWALS;
        }
        // Factors near the solution are kept for all iterations, unless increments stagnate.
        self.start_near_solution &= !status.stagnates;
        // The ratio of the first increment with new factors and the last with old ones is no
        // contraction rate of the new factors.
        let new_factors = renewed_early || self.renew && iteration > 1;
        let converges_slowly = status.predicted_iterations > Self::renewal_cost(self.next_is_shared())
            && (!new_factors || status.increments_grow);
        let exact = M::STRUCTURE.linear_in_state;
        // A frozen Jacobian is updated if increments stagnate.
        let frozen = !(self.full_newton || self.adaptive);
        let renewal_wanted = self.full_newton
            || self.adaptive && !self.start_near_solution && converges_slowly
            || frozen && status.stagnates;
        self.renew = !exact && renewal_wanted;
    }

    /// Cost of an update in iterations, including the iterations after it.
    #[inline(always)]
    fn renewal_cost(shared: bool) -> f64 {
        ITERATIONS_AFTER_RENEWAL[usize::from(shared)] + Self::RENEWAL_COST[usize::from(shared)]
    }

    /// Whether an early update is cheaper than the predicted iterations, with the remaining
    /// residual relative to the first one as rate. Rates from 1/16 to 1 do not count: an update at
    /// this iterate would soon be repeated. Rates above 1 cause an update: the next increment with
    /// the same factors would exceed the first, and may lead to another root than Newton's method.
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
