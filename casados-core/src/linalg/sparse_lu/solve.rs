//! Triangular solves with the factors of a plan (`factor`): forward substitution with `I + L`, back
//! substitution with `P + U`, and the transposed systems.
//!
//! For scalars a pivot is subtracted from all rows below it, so that these operations are
//! independent. If one column fills registers, the updates of a row are accumulated in registers
//! instead, and stored once.

use super::factor::{PlannedFactors, blocks_with_slots, has_all_blocks};
use super::micro_panel::{is_zero, load, store, subtract_from_memory};
use crate::linalg::block::{PanelRow, negate, subtract_product};
use crate::linalg::kernel::arithmetic::{Arithmetic, Block};
use crate::linalg::kernel::dispatch::{Kernel, dispatch};
use crate::linalg::kernel::prefetch::Prefetch;
use crate::linalg::kernel::unroll::{PivotVisitor, is_large_plan, pivots_backward, pivots_forward};
use crate::model::{Pivot, Update};
use crate::plan::Plan;
use crate::scalar::Field;
use crate::shape::{Array, InBounds, Plain};
use core::marker::PhantomData;

/// Solves `M X = R` in place. A row of `rows` holds the `s` stages of a slot in all columns.
///
/// Columns are processed in panels that fit registers, each through the whole elimination, so that
/// a panel of all slots stays in the L1 cache.
pub fn solve<M: Plan, E: Field + Plain, R: Array<E>, const S: usize>(
    factors: PlannedFactors<'_, M, E, S>,
    rows: &mut [[R; S]],
) {
    dispatch(Solve::<M, E, R, ForwardSubstitution, BackSubstitution, S> {
        factors,
        rows,
        systems: PhantomData,
    });
}

/// Solves `Mᵀ X = R` in place.
pub fn solve_transposed<M: Plan, E: Field + Plain, R: Array<E>, const S: usize>(
    factors: PlannedFactors<'_, M, E, S>,
    rows: &mut [[R; S]],
) {
    dispatch(Solve::<M, E, R, TransposedForwardSubstitution, TransposedBackSubstitution, S> {
        factors,
        rows,
        systems: PhantomData,
    });
}

/// Solves two triangular systems for all columns, eight, four, two and one at a time; SIMD
/// registers two at a time, so that the panel row of all stages fits the registers.
struct Solve<'a, M, E, R, First, Second, const S: usize> {
    factors: PlannedFactors<'a, M, E, S>,
    rows: &'a mut [[R; S]],
    systems: PhantomData<(First, Second)>,
}

impl<
    M: Plan,
    E: Field + Plain,
    R: Array<E>,
    First: TriangularSystem,
    Second: TriangularSystem,
    const S: usize,
> Kernel for Solve<'_, M, E, R, First, Second, S>
{
    type Number = E;
    type Output = ();
    const WIDE: bool = R::LEN >= 8 && is_large_plan::<M, S>();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { factors, rows, .. } = self;
        let mut column = 0;
        if const { size_of::<E>() <= 8 && R::LEN >= 8 } {
            while column + 8 <= R::LEN {
                solve_triangular_pair::<A, M, E, R, S, 8, First, Second>(factors, rows, column, &mut ());
                column += 8;
            }
        }
        if const { size_of::<E>() <= 8 && R::LEN % 8 >= 4 } {
            solve_triangular_pair::<A, M, E, R, S, 4, First, Second>(factors, rows, column, &mut ());
            column += 4;
        }
        if const { size_of::<E>() > 8 && R::LEN >= 2 || R::LEN % 4 >= 2 } {
            while column + 2 <= R::LEN {
                solve_triangular_pair::<A, M, E, R, S, 2, First, Second>(factors, rows, column, &mut ());
                column += 2;
            }
        }
        if const { R::LEN % 2 == 1 } {
            solve_triangular_pair::<A, M, E, R, S, 1, First, Second>(factors, rows, column, &mut ());
        }
    }
}

/// A visitor of the solution. Its functions are `#[inline(always)]`.
pub trait Visitor<E, const S: usize, const W: usize> {
    /// Visits an unknown that has just been solved for; not called for transposed systems.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn on_solved<A: Arithmetic>(&mut self, _slot: usize, _packet: &PanelRow<E, S, W>) {}
    /// Called after each pivot of the second system.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn on_pivot_done(&mut self) {}
}

/// The empty visitor.
impl<E, const S: usize, const W: usize> Visitor<E, S, W> for () {}

/// A visitor that prefetches memory, line by line.
impl<E, const S: usize, const W: usize> Visitor<E, S, W> for Prefetch<'_, E> {
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn on_pivot_done(&mut self) {
        self.prefetch_line();
    }
}

/// Solves two triangular systems in place for `W` columns, inside of a kernel. The visitor receives
/// the solution of the second one while it is in registers.
#[inline(always)]
pub fn solve_triangular_pair<
    A: Arithmetic,
    M: Plan,
    E: Field + Plain,
    R: Array<E>,
    const S: usize,
    const W: usize,
    First: TriangularSystem,
    Second: TriangularSystem,
>(
    factors: PlannedFactors<'_, M, E, S>,
    rows: &mut [[R; S]],
    column: usize,
    visitor: &mut impl Visitor<E, S, W>,
) {
    if !has_all_blocks(factors.plan, factors.blocks) || rows.len() != factors.plan.nk() {
        return;
    }
    let no_visitor = &mut ();
    let mut first = SystemVisitor::<First, Substitution<'_, M, E, R, (), S, W>>(
        Substitution { factors, rows, column, visitor: no_visitor },
        PhantomData,
    );
    pivots_forward::<A, M, _>(factors.plan, &mut first);
    let rows = first.0.rows;
    let mut second = SystemVisitor::<Second, Substitution<'_, M, E, R, _, S, W>>(
        Substitution { factors, rows, column, visitor },
        PhantomData,
    );
    pivots_backward::<A, M, _>(factors.plan, &mut second);
}

/// A substitution in `W` columns of right-hand sides.
pub struct Substitution<'a, M, E, R, V, const S: usize, const W: usize> {
    pub factors: PlannedFactors<'a, M, E, S>,
    pub rows: &'a mut [[R; S]],
    pub column: usize,
    /// The visitor of the solution of the second system.
    pub visitor: &'a mut V,
}

/// A triangular system.
pub trait TriangularSystem {
    /// Processes a pivot.
    fn at<
        A: Arithmetic,
        M: Plan,
        E: Field + Plain,
        R: Array<E>,
        V: Visitor<E, S, W>,
        const S: usize,
        const W: usize,
    >(
        substitution: &mut Substitution<'_, M, E, R, V, S, W>,
        pivot: &'static Pivot,
    );
}

/// A substitution, as a visitor of pivots.
struct SystemVisitor<Y, T>(T, PhantomData<Y>);

impl<
    Y: TriangularSystem,
    M: Plan,
    E: Field + Plain,
    R: Array<E>,
    V: Visitor<E, S, W>,
    const S: usize,
    const W: usize,
> PivotVisitor for SystemVisitor<Y, Substitution<'_, M, E, R, V, S, W>>
{
    const INSTRUCTIONS: usize = {
        let columns = if size_of::<E>() > 8 { W } else { W.div_ceil(4) };
        4 + if W == 1 && size_of::<E>() <= 8 { S } else { S * S * columns }
    };
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, pivot: &'static Pivot, _: &'static [Update]) {
        Y::at::<A, M, E, R, V, S, W>(&mut self.0, pivot);
        self.0.visitor.on_pivot_done();
    }
}

/// Defines one of the triangular systems.
macro_rules! system {
    ($(#[$text:meta])* $name:ident: $what:ident) => {
        $(#[$text])*
        pub struct $name;

        impl TriangularSystem for $name {
            #[inline(always)]
            fn at<A: Arithmetic, M: Plan, E: Field + Plain, R: Array<E>, V: Visitor<E, S, W>, const S: usize, const W: usize>(
                substitution: &mut Substitution<'_, M, E, R, V, S, W>,
                pivot: &'static Pivot,
            ) {
                substitution.$what::<A>(pivot);
            }
        }
    };
}

system!(
    /// Forward substitution with `I + L`.
    ForwardSubstitution: down
);
system!(
    /// Back substitution with `P + U`.
    BackSubstitution: up
);
system!(
    /// Forward substitution with `(P + U)ᵀ`.
    TransposedForwardSubstitution: transposed_down
);
system!(
    /// Back substitution with `(I + L)ᵀ`.
    TransposedBackSubstitution: transposed_up
);

impl<M: Plan, E: Field + Plain, R: Array<E>, V: Visitor<E, S, W>, const S: usize, const W: usize>
    Substitution<'_, M, E, R, V, S, W>
{
    #[inline(always)]
    fn down<A: Arithmetic>(&mut self, pivot: &'static Pivot) {
        // If one column fills registers, the updates of a row are accumulated in registers.
        if const { align_of::<E>() > 8 && is_solved_by_rows::<M>(size_of::<Block<E, S>>()) } {
            self.forward_by_rows::<A>(pivot);
        } else {
            self.forward_by_columns::<A>(pivot);
        }
    }

    #[cfg_attr(not(debug_assertions), inline(always))]
    fn forward_by_columns<A: Arithmetic>(&mut self, pivot: &'static Pivot) {
        let Self { factors, rows, column, .. } = self;
        let slot = pivot.slot as usize;
        if slot >= rows.len() {
            return;
        }
        // Skips rows of zeros: directions without influence on this unknown, as at the start of an
        // interval. SIMD registers are compared in memory, since a panel row whose elements are
        // compared one by one leaves the registers. Scalars are compared in the loaded panel row.
        if const { W > 1 && size_of::<E>() > 8 } && is_zero::<E, R, S, W>(rows, slot, *column) {
            return;
        }
        let panel_row = load::<E, R, S, W>(rows, slot, *column);
        if const { W > 1 && size_of::<E>() <= 8 }
            && panel_row.as_flattened().iter().all(|element| *element == E::from_f64(0.0))
        {
            return;
        }
        for (block, other) in blocks_with_slots(*factors, pivot.lower()) {
            if other >= rows.len() {
                continue;
            }
            let mut target = load(rows, other, *column);
            subtract_product::<A, E, S, W>(&mut target, block, &panel_row);
            store(rows, other, *column, &target);
        }
    }

    /// Subtracts the products with all preceding pivots from a row.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn forward_by_rows<A: Arithmetic>(&mut self, pivot: &'static Pivot) {
        let Self { factors, rows, column, .. } = self;
        let slot = pivot.slot as usize;
        if slot >= rows.len() || pivot.left().is_empty() {
            return;
        }
        let mut panel_row = load(rows, slot, *column);
        for left in
            factors.plan.structure().elimination.left.get(pivot.left()).in_bounds().unwrap_or_default()
        {
            let (block, other) = (factors.blocks.get(left.block as usize), rows.get(left.slot as usize));
            let (Some(block), Some(other)) = (block, other) else { continue };
            subtract_from_memory::<A, E, R, S, W>(&mut panel_row, block, other, *column);
        }
        store(rows, slot, *column, &panel_row);
    }

    #[cfg_attr(not(debug_assertions), inline(always))]
    fn up<A: Arithmetic>(&mut self, pivot: &'static Pivot) {
        let Self { factors, rows, column, visitor } = self;
        if pivot.slot as usize >= rows.len() {
            return;
        }
        let mut panel_row = load::<E, R, S, W>(rows, pivot.slot as usize, *column);
        for (block, other) in blocks_with_slots(*factors, pivot.upper()) {
            let Some(other) = rows.get(other).in_bounds() else { continue };
            subtract_from_memory::<A, E, R, S, W>(&mut panel_row, block, other, *column);
        }
        if let (false, Some(inverse)) = (pivot.identity, factors.blocks.get(pivot.block as usize)) {
            let mut solution = [[E::from_f64(0.0); W]; S];
            // For one stage the inverse is negated, so that the panel row stays in its registers.
            if const { S == 1 } {
                let mut inverse = *inverse;
                negate(&mut inverse);
                subtract_product::<A, E, S, W>(&mut solution, &inverse, &panel_row);
            } else {
                negate(&mut panel_row);
                subtract_product::<A, E, S, W>(&mut solution, inverse, &panel_row);
            }
            panel_row = solution;
        }
        store(rows, pivot.slot as usize, *column, &panel_row);
        visitor.on_solved::<A>(pivot.slot as usize, &panel_row);
    }
}

/// Whether right-hand sides of SIMD registers are solved with `L` row by row. The blocks of a row
/// are in different columns. For large blocks in the second-level cache the processor prefetches a
/// limited number of columns.
const fn is_solved_by_rows<M: Plan>(block: usize) -> bool {
    let Some(structure) = M::KNOWN_STRUCTURE else { return block <= 256 };
    let pivots = structure.elimination.pivots;
    let (mut longest, mut index) = (0, 0);
    while index < pivots.len() {
        let left = pivots[index].left[1] - pivots[index].left[0];
        longest = if left > longest { left } else { longest };
        index += 1;
    }
    block <= 256 || longest <= 8
}
