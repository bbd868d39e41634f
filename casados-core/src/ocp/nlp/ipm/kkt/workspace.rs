//! Memory of a run except that of Newton's equations.

use super::dimensions::KktDimensions;
use crate::ocp::nlp::elastic_mode;
use crate::qp::interior::{Counts, Extent};
use crate::qp::{StageDims, take_mut};
use crate::scalar::Real;

/// Memory of a run except that of Newton's equations.
pub(in crate::ocp::nlp::ipm) struct Workspace<'a, T> {
    /// Ends of intervals and constraints at the trial point.
    pub interval_ends: &'a mut [T],
    /// Values of rows at the trial point.
    pub row_values: &'a mut [T],
    /// Slacks at the trial point.
    pub trial_slacks: &'a mut [T],
    /// The step before second-order corrections.
    pub saved_step: &'a mut [T],
    pub saved_slack_step: &'a mut [T],
    pub saved_multiplier_step: &'a mut [T],
    pub saved_equation_multipliers: &'a mut [T],
    /// Multipliers `π` after the full step.
    pub next_costates: &'a mut [T],
    /// Multipliers of inequalities in the Hessian. They take the primal step length, the
    /// multipliers of the barrier problem the dual one.
    pub hessian_multipliers: &'a mut [T],
    /// Units of variables and constraints.
    pub units: &'a mut [T],
    /// Scratch memory for the variables of a stage.
    pub scratch: &'a mut [T],
    /// The given linear penalties.
    pub saved_penalties: &'a mut [T],
}

impl<'a, T: Real> Workspace<'a, T> {
    /// The length of the memory.
    pub const fn length(dims: &[StageDims], ends: usize, counts: &Counts) -> usize {
        let (pairs, Extent { ld, end, .. }) = (counts.pair_count(), Extent::of::<T>(dims));
        ends + 3 * end.row
            + 4 * pairs
            + counts.equations
            + end.dynamics
            + ld
            + elastic_mode::penalty_memory_len(dims)
    }

    /// A view of memory of that length, whose contents are unchanged.
    pub fn new(ends: usize, capacity: &KktDimensions, mut memory: &'a mut [T]) -> Self {
        let (pairs, end) = (capacity.counts.pair_count(), capacity.extent.end);
        let rest = &mut memory;
        Self {
            interval_ends: take_mut(rest, ends),
            row_values: take_mut(rest, end.row),
            trial_slacks: take_mut(rest, pairs),
            saved_step: take_mut(rest, end.row),
            saved_slack_step: take_mut(rest, pairs),
            saved_multiplier_step: take_mut(rest, pairs),
            saved_equation_multipliers: take_mut(rest, capacity.counts.equations),
            next_costates: take_mut(rest, end.dynamics),
            hessian_multipliers: take_mut(rest, pairs),
            units: take_mut(rest, end.row),
            scratch: take_mut(rest, capacity.extent.ld),
            saved_penalties: core::mem::take(rest),
        }
    }
}
