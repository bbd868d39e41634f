//! Sparse block elimination with a plan: the elimination order is determined at compile time.
//!
//! The Newton matrix `M` has one s×s block for each structural nonzero. In the order of the plan
//!
//! ```text
//! M = (I + L) (P + U)        L_ik = B_ik P_k⁻¹,   B_ij ← B_ij − L_ik B_kj
//! ```
//!
//! with pivot blocks `P` on the diagonal (their inverses are stored), `L` below and `U` above.
//! Everything is indexed by *slots*: a slot is an unknown, and also the equation that is its pivot
//! row. So right-hand side and solution share one array, and no permutation is applied.
//!
//! The loops of a short plan are unrolled (`kernel::unroll`). In longer loops the compiler does not
//! evaluate the tables of the plan; elements are accessed by `get`, whose branch is never taken,
//! costs nothing compared with a block, and leaves no panic in the program.

use crate::linalg::block::{inverse, product};
use crate::linalg::kernel::arithmetic::{Arithmetic, Block};
use crate::linalg::kernel::dispatch::{Kernel, dispatch};
use crate::linalg::kernel::unroll::{PivotVisitor, is_large_plan, pivots_forward};
use crate::model::{Pivot, Structure, Update};
use crate::plan::Plan;
use crate::scalar::Field;
use crate::shape::{InBounds, copy};

/// The factors by the plan.
pub struct PlannedFactors<'a, M, E, const S: usize> {
    pub plan: M,
    /// `P⁻¹`, `L`, `U`.
    pub blocks: &'a [Block<E, S>],
}

copy!(['a, M: Copy, E, const S: usize] PlannedFactors<'a, M, E, S>);

/// Factorises in place: `blocks` holds the matrix (with zero fill-in, unless it
/// [begins with its first update](begins_with_update)) and afterwards `P⁻¹`, `L`, `U`. A singular
/// pivot block gives factors that are not finite.
pub fn factor<M: Plan, E: Field, const S: usize>(plan: M, blocks: &mut [Block<E, S>]) {
    dispatch(Factor { plan, blocks });
}

/// See [`factor`].
pub(in crate::linalg) struct Factor<'a, M, E, const S: usize> {
    pub plan: M,
    pub blocks: &'a mut [Block<E, S>],
}

impl<M: Plan, E: Field, const S: usize> Kernel for Factor<'_, M, E, S> {
    type Number = E;
    type Output = ();
    const WIDE: bool = S.is_multiple_of(4) && is_large_plan::<M, S>();
    #[inline(always)]
    fn run<A: Arithmetic>(mut self) {
        if has_all_blocks(self.plan, self.blocks) {
            pivots_forward::<A, M, _>(self.plan, &mut self);
        }
    }
}

impl<M: Plan, E: Field, const S: usize> PivotVisitor for Factor<'_, M, E, S> {
    const INSTRUCTIONS: usize = 4 + S * S * S / if size_of::<E>() > 8 { 1 } else { 2 };
    const PER_UPDATE: bool = true;
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, pivot: &'static Pivot, updates: &'static [Update]) {
        let blocks = &mut *self.blocks;
        if !pivot.identity {
            let Some(block) = blocks.get_mut(pivot.block as usize).in_bounds() else { return };
            let inverse = inverse::<A, E, S>(block);
            A::write(block, &inverse);
            for block in blocks.get_mut(pivot.lower()).into_iter().flatten() {
                *block = product::<A, E, S>(block, &inverse);
            }
        }
        let mut updates = updates.iter();
        // Copies of small blocks stay in registers: the optimiser cannot prove that blocks do not
        // overlap.
        if const { S <= 2 } {
            for lower in pivot.lower() {
                let Some(&lower) = blocks.get(lower).in_bounds() else { continue };
                for (upper, target) in pivot.upper().zip(&mut updates) {
                    let Some(&upper) = blocks.get(upper).in_bounds() else { continue };
                    if let Some(block) = blocks.get_mut(target.block as usize).in_bounds() {
                        update::<A, M, E, S>(block, target, &lower, &upper);
                    }
                }
            }
            return;
        }
        // Updated blocks come after those of the pivot.
        let Some((own_blocks, later)) = blocks.split_at_mut_checked(pivot.end as usize) else { return };
        for lower in pivot.lower() {
            let Some(&lower) = own_blocks.get(lower).in_bounds() else { continue };
            for (upper, target) in pivot.upper().zip(&mut updates) {
                let (upper, block) =
                    (own_blocks.get(upper), later.get_mut((target.block - pivot.end) as usize));
                if let (Some(upper), Some(block)) = (upper, block) {
                    update::<A, M, E, S>(block, target, &lower, upper);
                }
            }
        }
    }
}

/// `block − lower · upper`
#[inline(always)]
fn update<A: Arithmetic, M: Plan, E: Field, const S: usize>(
    block: &mut Block<E, S>,
    target: &Update,
    lower: &Block<E, S>,
    upper: &Block<E, S>,
) {
    if const { begins_with_update::<M, E>() } && target.first {
        let mut sum = [[E::from_f64(0.0); S]; S];
        A::subtract_blocks(&mut sum, lower, upper);
        *block = sum;
        return;
    }
    A::subtract_blocks(block, lower, upper);
}

/// Whether a block of fill-in begins with its first update. Otherwise it begins with zero: cheaper
/// for scalars, and for little fill-in.
pub const fn begins_with_update<M: Plan, E>() -> bool {
    let has_much_fill = match M::KNOWN_STRUCTURE {
        Some(Structure { elimination, .. }) => 8 * elimination.fill() >= elimination.slots.len(),
        None => true,
    };
    align_of::<E>() > 8 && has_much_fill
}

/// Clears a block of fill-in, given by its row of the assembly.
#[inline(always)]
pub fn clear_fill<M: Plan, E, B: Copy>(plan: M, blocks: &mut [B], row: usize, zero: B) {
    let Some(entry) = plan.structure().elimination.assembly.get(row).in_bounds() else { return };
    if const { begins_with_update::<M, E>() } {
        return;
    }
    if let Some(block) = blocks.get_mut(entry.block as usize).in_bounds() {
        *block = zero;
    }
}

/// Always true. It makes the number of blocks known to the optimiser, and with it the number of
/// iterations of loops over constant tables.
#[inline(always)]
pub fn has_all_blocks<M: Plan, B>(plan: M, blocks: &[B]) -> bool {
    blocks.len() == plan.structure().elimination.slots.len()
}

/// Returns the blocks of a range, each with the slot of its other index.
#[inline(always)]
pub fn blocks_with_slots<'a, M: Plan, E, const S: usize>(
    factors: PlannedFactors<'a, M, E, S>,
    range: core::ops::Range<usize>,
) -> impl Iterator<Item = (&'a Block<E, S>, usize)> {
    let slots = factors.plan.structure().elimination.slots.get(range.clone()).in_bounds().unwrap_or_default();
    factors
        .blocks
        .get(range)
        .in_bounds()
        .unwrap_or_default()
        .iter()
        .zip(slots.iter().map(|&slot| slot as usize))
}
