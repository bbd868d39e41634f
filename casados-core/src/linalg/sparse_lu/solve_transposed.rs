//! Triangular solves with the transposed factors of a plan: the operations at a pivot for
//! `(P + U)ᵀ` and `(I + L)ᵀ`.
//!
//! A row of `(I + L)ᵀ` is a column of `L`, so that in back substitution the updates of a row are
//! accumulated in registers, and stored once. Panels process two blocks at a time, with independent
//! additions.

use super::factor::{PlannedFactors, blocks_with_slots};
use super::micro_panel::{load, store};
use super::solve::Substitution;
use crate::linalg::block::{negate, subtract_transposed};
use crate::linalg::kernel::arithmetic::{Arithmetic, Block};
use crate::model::Pivot;
use crate::plan::Plan;
use crate::scalar::Field;
use crate::shape::{Array, InBounds, Plain};

impl<M: Plan, E: Field + Plain, R: Array<E>, V, const S: usize, const W: usize>
    Substitution<'_, M, E, R, V, S, W>
{
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(in crate::linalg) fn transposed_down<A: Arithmetic>(&mut self, pivot: &'static Pivot) {
        let Self { factors, rows, column, .. } = self;
        if pivot.slot as usize >= rows.len() {
            return;
        }
        let mut panel_row = load::<E, R, S, W>(rows, pivot.slot as usize, *column);
        if let (false, Some(inverse)) = (pivot.identity, factors.blocks.get(pivot.block as usize)) {
            let mut solution = [[E::from_f64(0.0); W]; S];
            negate(&mut panel_row);
            subtract_transposed::<A, E, S, W>(&mut solution, inverse, &panel_row);
            panel_row = solution;
            store(rows, pivot.slot as usize, *column, &panel_row);
        }
        for (block, other) in blocks_with_slots(*factors, pivot.upper()) {
            if other >= rows.len() {
                continue;
            }
            let mut target = load(rows, other, *column);
            subtract_transposed::<A, E, S, W>(&mut target, block, &panel_row);
            store(rows, other, *column, &target);
        }
    }

    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(in crate::linalg) fn transposed_up<A: Arithmetic>(&mut self, pivot: &'static Pivot) {
        // Without optimisation this would only cost compile time.
        if const { W > 1 && size_of::<E>() <= 8 && A::FUSED } {
            return self.transposed_backward_two_sums::<A>(pivot);
        }
        let Self { factors, rows, column, .. } = self;
        if pivot.slot as usize >= rows.len() {
            return;
        }
        let mut panel_row = load::<E, R, S, W>(rows, pivot.slot as usize, *column);
        for index in pivot.lower().rev() {
            let Some((block, other)) = block_with_slot(*factors, index) else { continue };
            if other >= rows.len() {
                continue;
            }
            let other = load(rows, other, *column);
            subtract_transposed::<A, E, S, W>(&mut panel_row, block, &other);
        }
        store(rows, pivot.slot as usize, *column, &panel_row);
    }

    /// Two blocks at a time, with one accumulator each, so that additions do not wait for each
    /// other.
    #[inline(always)]
    fn transposed_backward_two_sums<A: Arithmetic>(&mut self, pivot: &'static Pivot) {
        let Self { factors, rows, column, .. } = self;
        let slot = pivot.slot as usize;
        if slot >= rows.len() || pivot.lower().is_empty() {
            return;
        }
        let mut slots =
            factors.plan.structure().elimination.slots.get(pivot.lower()).in_bounds().unwrap_or_default();
        let mut blocks = factors.blocks.get(pivot.lower()).in_bounds().unwrap_or_default();
        let mut panel_row = load::<E, R, S, W>(rows, slot, *column);
        let mut accumulator = [[E::from_f64(0.0); W]; S];
        while let Some((rest, [block, last])) = blocks.split_last_chunk()
            && let Some((rest_of_slots, &[other, of_last])) = slots.split_last_chunk()
        {
            (blocks, slots) = (rest, rest_of_slots);
            if of_last as usize >= rows.len() || other as usize >= rows.len() {
                continue;
            }
            let of_last = load(rows, of_last as usize, *column);
            subtract_transposed::<A, E, S, W>(&mut panel_row, last, &of_last);
            let other = load(rows, other as usize, *column);
            subtract_transposed::<A, E, S, W>(&mut accumulator, block, &other);
        }
        if let ([block], &[other]) = (blocks, slots)
            && (other as usize) < rows.len()
        {
            let other = load(rows, other as usize, *column);
            subtract_transposed::<A, E, S, W>(&mut panel_row, block, &other);
        }
        for (row, accumulator) in panel_row.iter_mut().zip(&accumulator) {
            A::subtract_row(row, E::from_f64(-1.0), accumulator);
        }
        store(rows, slot, *column, &panel_row);
    }
}

/// Returns one block, with the slot of its other index.
#[inline(always)]
fn block_with_slot<'a, M: Plan, E, const S: usize>(
    factors: PlannedFactors<'a, M, E, S>,
    index: usize,
) -> Option<(&'a Block<E, S>, usize)> {
    let &slot = factors.plan.structure().elimination.slots.get(index)?;
    Some((factors.blocks.get(index)?, slot as usize))
}
