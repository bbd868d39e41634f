//! Loops over the constant tables of a model, unrolled where they are short.
//!
//! The optimiser sees through constant tables only where indices are constants too. In an unrolled
//! loop addresses of blocks and rows are part of the instructions; otherwise most instructions of a
//! small block are spent on finding it.

use crate::linalg::kernel::arithmetic::Arithmetic;
use crate::model::{Pivot, Supernode, Update};
use crate::plan::Plan;

// Where nothing is optimised unrolled loops would only be long, and in firmware memory is dearer
// than time.
#[cfg(any(test, all(feature = "std", not(debug_assertions))))]
mod unrolled;

/// Whether there are lines at all.
const MAY_UNROLL: bool = cfg!(all(feature = "std", not(debug_assertions)));

/// So many chunks, and so many pivots, can be written one after the other.
const MAX_LINES: usize = 48;

/// So many rows.
const MAX_UNROLLED_ROWS: usize = 384;

/// They are not longer than so many instructions: they share the nearest cache, and take long to
/// compile.
const MAX_UNROLLED_INSTRUCTIONS: usize = 2000;

/// So much longer they may be where each step has so few instructions that a loop would spend most
/// of its time on finding what it is about: rows of `FEW`, and updates of blocks of one number.
const SHORT_BODY_FACTOR: usize = 2;
const SHORT_BODY_INSTRUCTIONS: usize = 8;

/// What is done with each row of a table.
pub trait RowVisitor {
    /// The rows of the table, where they are known when the kernel is compiled.
    const ROWS: Option<usize>;
    /// About how many instructions each takes.
    const INSTRUCTIONS: usize;
    /// Whether straight lines are worth their compilation.
    const UNROLLED: bool = true;
    /// To be `#[inline(always)]`.
    fn at<A: Arithmetic>(&mut self, row: usize);
    /// The rows of the table, where they are not known before.
    #[inline(always)]
    fn row_count(&self) -> usize {
        0
    }
    /// So many of the first rows need only what [`simple`](Self::simple) does.
    const SIMPLE_ROWS: Option<usize> = Some(0);
    /// How many these are, where that is not known before.
    #[inline(always)]
    fn simple_row_count(&self) -> usize {
        0
    }
    /// What a loop does with these instead, without branches. To be `#[inline(always)]`.
    #[inline(always)]
    fn visit_simple(&mut self, _row: usize) {}
}

/// Whether the rows of a table are unrolled.
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

/// All rows of a table.
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

/// What is done at each pivot of a plan.
pub trait PivotVisitor {
    /// About how many instructions that takes for each block of the factors, or for each update of
    /// one.
    const INSTRUCTIONS: usize;
    /// Whether it is done for each update, or for each block.
    const PER_UPDATE: bool = false;
    /// With the updates of the pivot, on the way from the first to the last. To be
    /// `#[inline(always)]`.
    fn at<A: Arithmetic>(&mut self, pivot: &'static Pivot, updates: &'static [Update]);
}

/// From the first pivot to the last.
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

/// From the last pivot to the first, without updates.
#[inline(always)]
pub fn pivots_backward<A: Arithmetic, M: Plan, V: PivotVisitor>(plan: M, visitor: &mut V) {
    if const { is_unrolled_plan::<A, M>(V::PER_UPDATE, V::INSTRUCTIONS) } {
        #[cfg(all(feature = "std", not(debug_assertions)))]
        return unrolled::pivots_backward::<A, M, V>(visitor);
    }
    let all = plan.structure().elimination.pivots;
    // The optimiser unrolls a loop over indices where a plan is short, as in firmware, but not one
    // that goes backwards through a slice, which is faster where it stays a loop.
    if const { cfg!(feature = "std") } {
        for pivot in all.iter().rev() {
            visitor.at::<A>(pivot, &[]);
        }
        return;
    }
    let mut index = all.len();
    while index > 0 {
        index -= 1;
        if let Some(pivot) = all.get(index) {
            visitor.at::<A>(pivot, &[]);
        }
    }
}

/// Whether pivots of a [supernode](Supernode) are taken together. In firmware each is one of its
/// own.
const USES_SUPERNODES: bool = cfg!(feature = "std");

/// What is done at each supernode of a plan.
pub trait SupernodeVisitor {
    /// About how many instructions that takes for each block of the factors.
    const INSTRUCTIONS: usize;
    /// With all of its pivots. To be `#[inline(always)]`.
    fn at<A: Arithmetic, const P: usize>(&mut self, pivots: [&'static Pivot; P]);
}

/// From the first supernode to the last.
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

/// From the last supernode to the first.
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

/// Each pivot is a supernode.
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
    let pivots = plan.structure().elimination.pivots.get(supernode.first as usize..).unwrap_or_default();
    match (supernode.count, pivots) {
        (4, [a, b, c, d, ..]) if const { has_supernode::<M>(4) } => visitor.at::<A, 4>([a, b, c, d]),
        (3, [a, b, c, ..]) if const { has_supernode::<M>(3) } => visitor.at::<A, 3>([a, b, c]),
        (2, [a, b, ..]) if const { has_supernode::<M>(2) } => visitor.at::<A, 2>([a, b]),
        (1, [a, ..]) => visitor.at::<A, 1>([a]),
        _ => {}
    }
}

/// Whether a plan may have a supernode of so many pivots.
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

/// Whether kernels that go through all blocks of a plan are known to be long.
#[cfg_attr(not(any(target_arch = "x86_64", target_arch = "aarch64")), allow(dead_code))]
pub const fn is_large_plan<M: Plan, const S: usize>() -> bool {
    match M::KNOWN_STRUCTURE {
        Some(structure) => structure.elimination.slots.len() * S * S > 250,
        None => false,
    }
}

/// Whether the pivots of a plan are unrolled, with so many instructions for each block, or for each
/// update of one.
const fn is_unrolled_plan<A: Arithmetic, M: Plan>(updates: bool, instructions: usize) -> bool {
    let Some(structure) = M::KNOWN_STRUCTURE else { return false };
    let plan = &structure.elimination;
    let few = updates && instructions <= SHORT_BODY_INSTRUCTIONS;
    let max_instructions =
        if few { SHORT_BODY_FACTOR * MAX_UNROLLED_INSTRUCTIONS } else { MAX_UNROLLED_INSTRUCTIONS };
    let count = if updates { plan.updates.len() } else { plan.slots.len() };
    MAY_UNROLL && A::UNROLLED && plan.pivots.len() <= MAX_LINES && count * instructions <= max_instructions
}

/// How many blocks a pivot updates.
const fn update_count(pivot: &Pivot) -> usize {
    ((pivot.upper - pivot.block - 1) * (pivot.end - pivot.upper)) as usize
}
