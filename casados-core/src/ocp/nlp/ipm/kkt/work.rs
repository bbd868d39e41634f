//! Memory of a run beside that of Newton's equations.

use super::lengths::Lengths;
use crate::ocp::nlp::elastic;
use crate::qp::interior::{Counts, Extent};
use crate::qp::{StageDims, take_mut};
use crate::scalar::Real;

/// Memory beside that of Newton's equations.
pub(in crate::ocp::nlp::ipm) struct Work<'a, T> {
    /// Ends of intervals and constraints at a point that is tried.
    pub ends: &'a mut [T],
    /// Values of rows there.
    pub rows: &'a mut [T],
    /// Slacks there.
    pub slacks: &'a mut [T],
    /// The step before corrections.
    pub step: &'a mut [T],
    pub slack_step: &'a mut [T],
    pub multiplier_step: &'a mut [T],
    pub free_step: &'a mut [T],
    /// Multipliers `π` after the full step.
    pub pi: &'a mut [T],
    /// Multipliers of sides as the Hessian has them: they go as far as the point does, while those
    /// of the barrier go as far as they stay positive.
    pub hessian_multipliers: &'a mut [T],
    /// Units of variables and constraints.
    pub units: &'a mut [T],
    /// Over the variables of a stage.
    pub scratch: &'a mut [T],
    /// Linear penalties as they were given.
    pub penalties: &'a mut [T],
}

impl<'a, T: Real> Work<'a, T> {
    /// How many numbers it takes.
    pub const fn length(dims: &[StageDims], ends: usize, counts: &Counts) -> usize {
        let (pairs, Extent { ld, end, .. }) = (counts.pair_count(), Extent::of::<T>(dims));
        ends + 3 * end.row + 4 * pairs + counts.equations + end.dynamics + ld + elastic::memory(dims)
    }

    /// In memory of that length, whose contents stay.
    pub fn new(ends: usize, capacity: &Lengths, mut memory: &'a mut [T]) -> Self {
        let (pairs, end) = (capacity.counts.pair_count(), capacity.extent.end);
        let rest = &mut memory;
        Self {
            ends: take_mut(rest, ends),
            rows: take_mut(rest, end.row),
            slacks: take_mut(rest, pairs),
            step: take_mut(rest, end.row),
            slack_step: take_mut(rest, pairs),
            multiplier_step: take_mut(rest, pairs),
            free_step: take_mut(rest, capacity.counts.equations),
            pi: take_mut(rest, end.dynamics),
            hessian_multipliers: take_mut(rest, pairs),
            units: take_mut(rest, end.row),
            scratch: take_mut(rest, capacity.extent.ld),
            penalties: core::mem::take(rest),
        }
    }
}
