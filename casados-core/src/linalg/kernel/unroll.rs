//! Loops over the constant tables of a model, unrolled if they are short.
//!
//! The optimiser evaluates constant tables only at constant indices. In an unrolled loop the
//! addresses of blocks and rows are part of the instructions; otherwise most instructions for a
//! small block compute its address.

use crate::linalg::kernel::arithmetic::Arithmetic;
use crate::model::{Pivot, Supernode, Update};
use crate::plan::Plan;
use crate::shape::InBounds;

// Unrolled loops are not compiled in unoptimised programs, where they would only be long, and in
// firmware, where memory is scarcer than time.
#[cfg(any(test, all(feature = "std", not(debug_assertions))))]
mod unrolled;

/// Whether loops may be unrolled.
const MAY_UNROLL: bool = cfg!(all(feature = "std", not(debug_assertions)));

/// Maximal number of chunks, and of pivots, in an unrolled loop.
const MAX_UNROLLED_PIVOTS: usize = 48;

/// Maximal number of rows in an unrolled loop.
const MAX_UNROLLED_ROWS: usize = 384;

/// Maximal number of instructions of an unrolled loop, for the L1 cache and the compile time.
const MAX_UNROLLED_INSTRUCTIONS: usize = 2000;

/// Factor on this maximum for bodies of at most `SHORT_BODY_INSTRUCTIONS`, where a loop would spend
/// most of its time on addresses: short rows, and updates of blocks of one number.
const SHORT_BODY_FACTOR: usize = 2;
const SHORT_BODY_INSTRUCTIONS: usize = 8;

/// An operation on each row of a table.
pub trait RowVisitor {
    /// Number of rows of the table, if it is known at compile time.
    const ROWS: Option<usize>;
    /// Approximate number of instructions per row.
    const INSTRUCTIONS: usize;
    /// Whether unrolling is worth its compile time.
    const UNROLLED: bool = true;
    /// Processes a row; `#[inline(always)]`.
    fn at<A: Arithmetic>(&mut self, row: usize);
    /// Number of rows of the table, if it is known at run time only.
    #[inline(always)]
    fn row_count(&self) -> usize {
        0
    }
    /// Number of first rows for which [`visit_simple`](Self::visit_simple) suffices.
    const SIMPLE_ROWS: Option<usize> = Some(0);
    /// Their number, if it is known at run time only.
    #[inline(always)]
    fn simple_row_count(&self) -> usize {
        0
    }
    /// Processes a simple row in a loop, without branches; `#[inline(always)]`.
    #[inline(always)]
    fn visit_simple(&mut self, _row: usize) {}
}

/// Whether the loop over the rows of a table is unrolled.
pub const fn is_unrolled<A: Arithmetic, V: RowVisitor>() -> bool {
    let max_instructions = if V::INSTRUCTIONS <= SHORT_BODY_INSTRUCTIONS {
        SHORT_BODY_FACTOR * MAX_UNROLLED_INSTRUCTIONS
    } else {
        MAX_UNROLLED_INSTRUCTIONS
    };
    let Some(rows) = V::ROWS else { return false };
    MAY_UNROLL
        && A::UNROLLED
        && V::UNROLLED
        && rows <= MAX_UNROLLED_ROWS
        && rows * V::INSTRUCTIONS <= max_instructions
}

/// Processes all rows of a table.
#[inline(always)]
pub fn for_each_row<A: Arithmetic, V: RowVisitor>(visitor: &mut V) {
    if const { is_unrolled::<A, V>() } {
        #[cfg(all(feature = "std", not(debug_assertions)))]
        return unrolled::for_each_row::<A, V>(visitor);
    }
    let simple = match V::SIMPLE_ROWS {
        Some(rows) => rows,
        None => visitor.simple_row_count(),
    };
    let rows = match V::ROWS {
        Some(rows) => rows,
        None => visitor.row_count(),
    };
    for row in 0..simple {
        visitor.visit_simple(row);
    }
    for row in simple..rows {
        visitor.at::<A>(row);
    }
}

/// An operation at each pivot of a plan.
pub trait PivotVisitor {
    /// Approximate number of instructions per block of the factors, or per update of a block.
    const INSTRUCTIONS: usize;
    /// Whether `INSTRUCTIONS` counts per update, otherwise per block.
    const PER_UPDATE: bool = false;
    /// Processes a pivot, with its updates in forward order; `#[inline(always)]`.
    fn at<A: Arithmetic>(&mut self, pivot: &'static Pivot, updates: &'static [Update]);
}

/// Visits the pivots from first to last.
#[inline(always)]
pub fn pivots_forward<A: Arithmetic, M: Plan, V: PivotVisitor>(plan: M, visitor: &mut V) {
    if const { is_unrolled_plan::<A, M>(V::PER_UPDATE, V::INSTRUCTIONS) } {
        #[cfg(all(feature = "std", not(debug_assertions)))]
        return unrolled::pivots_forward::<A, M, V>(visitor);
    }
    let mut updates = plan.structure().elimination.updates;
    for pivot in plan.structure().elimination.pivots {
        let Some((own, rest)) = updates.split_at_checked(update_count(pivot)) else { return };
        updates = rest;
        visitor.at::<A>(pivot, own);
    }
}

/// Visits the pivots from last to first, without updates.
#[inline(always)]
pub fn pivots_backward<A: Arithmetic, M: Plan, V: PivotVisitor>(plan: M, visitor: &mut V) {
    if const { is_unrolled_plan::<A, M>(V::PER_UPDATE, V::INSTRUCTIONS) } {
        #[cfg(all(feature = "std", not(debug_assertions)))]
        return unrolled::pivots_backward::<A, M, V>(visitor);
    }
    let all = plan.structure().elimination.pivots;
    // The optimiser unrolls an index loop over a short plan, as in firmware, but not a reverse
    // iteration over a slice, which is faster as a loop.
    if const { cfg!(feature = "std") } {
        for pivot in all.iter().rev() {
            visitor.at::<A>(pivot, &[]);
        }
        return;
    }
    let mut index = all.len();
    while index > 0 {
        index -= 1;
        if let Some(pivot) = all.get(index).in_bounds() {
            visitor.at::<A>(pivot, &[]);
        }
    }
}

/// Whether the pivots of a [supernode](Supernode) are processed together. In firmware each pivot is
/// a supernode.
const USES_SUPERNODES: bool = cfg!(feature = "std");

/// An operation at each supernode of a plan.
pub trait SupernodeVisitor {
    /// Approximate number of instructions per block of the factors.
    const INSTRUCTIONS: usize;
    /// Processes a supernode with its pivots; `#[inline(always)]`.
    fn at<A: Arithmetic, const P: usize>(&mut self, pivots: [&'static Pivot; P]);
}

/// Visits the supernodes from first to last.
#[inline(always)]
pub fn supernodes_forward<A: Arithmetic, M: Plan, V: SupernodeVisitor>(plan: M, visitor: &mut V) {
    if const { is_unrolled_plan::<A, M>(false, V::INSTRUCTIONS) } {
        #[cfg(all(feature = "std", not(debug_assertions)))]
        return unrolled::supernodes_forward::<A, M, V>(visitor);
    }
    if const { !USES_SUPERNODES } {
        return pivots_forward::<A, M, _>(plan, &mut SinglePivot(visitor));
    }
    for supernode in plan.structure().elimination.supernodes {
        visit_supernode::<A, M, V>(plan, visitor, supernode);
    }
}

/// Visits the supernodes from last to first.
#[inline(always)]
pub fn supernodes_backward<A: Arithmetic, M: Plan, V: SupernodeVisitor>(plan: M, visitor: &mut V) {
    if const { is_unrolled_plan::<A, M>(false, V::INSTRUCTIONS) } {
        #[cfg(all(feature = "std", not(debug_assertions)))]
        return unrolled::supernodes_backward::<A, M, V>(visitor);
    }
    if const { !USES_SUPERNODES } {
        return pivots_backward::<A, M, _>(plan, &mut SinglePivot(visitor));
    }
    for supernode in plan.structure().elimination.supernodes.iter().rev() {
        visit_supernode::<A, M, V>(plan, visitor, supernode);
    }
}

/// Visits each pivot as a supernode.
struct SinglePivot<'a, V>(&'a mut V);

impl<V: SupernodeVisitor> PivotVisitor for SinglePivot<'_, V> {
    const INSTRUCTIONS: usize = V::INSTRUCTIONS;
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, pivot: &'static Pivot, _: &'static [Update]) {
        self.0.at::<A, 1>([pivot]);
    }
}

#[inline(always)]
fn visit_supernode<A: Arithmetic, M: Plan, V: SupernodeVisitor>(
    plan: M,
    visitor: &mut V,
    supernode: &'static Supernode,
) {
    let pivots =
        plan.structure().elimination.pivots.get(supernode.first as usize..).in_bounds().unwrap_or_default();
    match (supernode.count, pivots) {
        (4, [a, b, c, d, ..]) if const { has_supernode::<M>(4) } => visitor.at::<A, 4>([a, b, c, d]),
        (3, [a, b, c, ..]) if const { has_supernode::<M>(3) } => visitor.at::<A, 3>([a, b, c]),
        (2, [a, b, ..]) if const { has_supernode::<M>(2) } => visitor.at::<A, 2>([a, b]),
        (1, [a, ..]) => visitor.at::<A, 1>([a]),
        _ => {}
    }
}

/// Whether a plan may have a supernode of `count` pivots.
const fn has_supernode<M: Plan>(count: u32) -> bool {
    let Some(structure) = M::KNOWN_STRUCTURE else { return true };
    let supernodes = structure.elimination.supernodes;
    let mut index = 0;
    while index < supernodes.len() {
        if supernodes[index].count == count {
            return true;
        }
        index += 1;
    }
    false
}

/// Whether kernels over all blocks of a plan are known to be long.
#[cfg_attr(not(any(target_arch = "x86_64", target_arch = "aarch64")), allow(dead_code))]
pub const fn is_large_plan<M: Plan, const S: usize>() -> bool {
    match M::KNOWN_STRUCTURE {
        Some(structure) => structure.elimination.slots.len() * S * S > 250,
        None => false,
    }
}

/// Whether the loop over the pivots of a plan is unrolled, with this number of instructions per
/// block, or per update.
const fn is_unrolled_plan<A: Arithmetic, M: Plan>(updates: bool, instructions: usize) -> bool {
    let Some(structure) = M::KNOWN_STRUCTURE else { return false };
    let plan = &structure.elimination;
    let few = updates && instructions <= SHORT_BODY_INSTRUCTIONS;
    let max_instructions =
        if few { SHORT_BODY_FACTOR * MAX_UNROLLED_INSTRUCTIONS } else { MAX_UNROLLED_INSTRUCTIONS };
    let count = if updates { plan.updates.len() } else { plan.slots.len() };
    MAY_UNROLL
        && A::UNROLLED
        && plan.pivots.len() <= MAX_UNROLLED_PIVOTS
        && count * instructions <= max_instructions
}

/// Number of blocks that a pivot updates.
const fn update_count(pivot: &Pivot) -> usize {
    ((pivot.upper - pivot.block - 1) * (pivot.end - pivot.upper)) as usize
}
