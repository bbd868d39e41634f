//! Factors of the Newton matrix `J_ij = δ_ij [f_ẋ,i | f_z,i] + h a_ij [f_x,i | 0]`.

use super::block::minus_ha;
use super::dense_lu::DenseLu;
use super::kernel::dispatch::{Kernel, dispatch};
use super::kernel::unroll::{RowVisitor, for_each_row};
use super::kernel::vector::axpy;
use super::sparse_lu::factor::{self, PlannedFactors};
use super::sparse_lu::solve;
use crate::linalg::kernel::arithmetic::{Arithmetic, Block};
use crate::memory::{Fallback, OptionalPlace, fallback::Pivoting};
use crate::model::{ArrayK, Dae, Kinematic};
use crate::plan::{self, Known, Plan, PlanOf, StructureTable};
use crate::scalar::{Field, Lanes, Real};
use crate::shape::{Aligned, Array, InBounds, Plain, Shape, copy_into};
use bytemuck::Zeroable;

/// Returns the row of an equation in right-hand sides: that of the unknown whose pivot it is.
#[inline(always)]
pub fn slot<M: Dae>(equation: usize) -> usize {
    Known::<M>::PLAN.slot(equation)
}

/// Returns the kinematic state of a slot, if it is [kinematic](Kinematic).
#[inline(always)]
pub const fn kinematic<M: Dae>(slot: usize) -> Option<&'static Kinematic> {
    plan::kinematic(&M::STRUCTURE, slot)
}

/// The factors, by the plan or dense.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct Factors<M: Dae, T: Plain, const S: usize, F: Fallback = Pivoting> {
    blocks: Aligned<M::Factors<Block<T, S>>>,
    /// Memory of the dense fallback, untouched while the plan is accurate.
    dense: F::Place<DenseLu<M, T, S>>,
    /// Whether the dense factors are the current ones.
    is_dense: bool,
}

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> Factors<M, E, S, F> {
    /// Whether the whole matrix may be pivoted: for scalars only. An interval in a SIMD lane that
    /// needs it is recomputed alone.
    pub const MAY_BE_DENSE: bool = E::LANES == 1;

    /// Factorises by the plan, from the Jacobian entries at all stages. A vanishing pivot gives
    /// factors that are not finite.
    pub fn factor_by_plan(&mut self, jacobian: &M::Jacobian<[E; S]>, a: &[[E; S]; S], h: E) {
        self.is_dense = false;
        let blocks = &mut self.blocks;
        let plan = F::plan::<M>();
        let (jacobian, to) = (F::Plan::<M>::jacobian(jacobian), F::Plan::<M>::factors_mut(&mut *blocks));
        dispatch(Assemble { plan, jacobian, a, h, blocks: to });
        factor::factor(plan, blocks.as_mut());
    }

    /// Solves `J X = B` in place for all columns of `B`; equations are in their slots. Rows of
    /// kinematic states remain unchanged.
    pub fn solve<R: Array<E>>(&self, b: &mut ArrayK<M, [R; S]>) {
        match self.dense() {
            Some(dense) if const { Self::MAY_BE_DENSE } => dense.solve(b),
            _ => solve::solve(self.planned(), b.as_mut()),
        }
    }

    /// Solves `Jᵀ X = B` in place for all columns of `B`; the solution has equations in their
    /// slots. Rows of kinematic states remain unchanged.
    pub fn solve_transposed<R: Array<E>>(&self, b: &mut ArrayK<M, [R; S]>) {
        match self.dense() {
            Some(dense) if const { Self::MAY_BE_DENSE } => dense.solve_transposed(b),
            _ => solve::solve_transposed(self.planned(), b.as_mut()),
        }
    }

    /// Returns the factors by the plan.
    pub fn planned(&self) -> PlannedFactors<'_, F::Plan<M>, E, S> {
        PlannedFactors { plan: F::plan::<M>(), blocks: self.blocks.as_ref() }
    }

    /// Whether the current factors are those of the plan.
    pub fn is_from_plan(&self) -> bool {
        !Self::MAY_BE_DENSE || self.dense().is_none()
    }

    /// Returns the factors of the whole matrix, if they are the current ones.
    #[inline(always)]
    fn dense(&self) -> Option<&DenseLu<M, E, S>> {
        self.dense.get().filter(|_| self.is_dense)
    }

    /// Copies the current factors.
    pub fn copy_from(&mut self, other: &Self) {
        self.is_dense = other.is_dense;
        if let (Some(to), Some(from)) = (self.dense.get_mut(), other.dense()) {
            copy_into(to, from);
        } else {
            copy_into(&mut self.blocks, &other.blocks);
        }
    }
}

/// Assembles all blocks of the Newton matrix, each written once.
struct Assemble<'a, M: Plan, E: Plain, const S: usize> {
    plan: M,
    jacobian: &'a M::Jacobian<[E; S]>,
    a: &'a [[E; S]; S],
    h: E,
    blocks: &'a mut M::Factors<Block<E, S>>,
}

impl<M: Plan, E: Field + Plain, const S: usize> Kernel for Assemble<'_, M, E, S> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { plan, jacobian, a, h, blocks } = self;
        let (jacobian, blocks) = (jacobian.as_ref(), blocks.as_mut());
        let minus_ha = minus_ha(a, h);
        let mut square = [[E::from_f64(0.0); S]; S];
        if const { StructureTable::Dependents.may_have_rows::<M>() } {
            A::subtract_blocks(&mut square, &minus_ha, &minus_ha);
        }
        for_each_row::<A, _>(&mut AssemblyRows { plan, jacobian, minus_ha, square, blocks });
    }
}

/// See [`Assemble`].
struct AssemblyRows<'a, M, E, const S: usize> {
    plan: M,
    jacobian: &'a [[E; S]],
    /// `−hA`
    minus_ha: Block<E, S>,
    /// `−(hA)²`
    square: Block<E, S>,
    blocks: &'a mut [Block<E, S>],
}

impl<M: Plan, E: Field + Plain, const S: usize> RowVisitor for AssemblyRows<'_, M, E, S> {
    const ROWS: Option<usize> = StructureTable::Assembly.known_row_count::<M>();
    const SIMPLE_ROWS: Option<usize> = StructureTable::Fill.known_row_count::<M>();
    #[inline(always)]
    fn row_count(&self) -> usize {
        StructureTable::Assembly.row_count(self.plan.structure())
    }
    #[inline(always)]
    fn simple_row_count(&self) -> usize {
        self.plan.facts().fill_terms
    }
    const INSTRUCTIONS: usize = 2 + 2 * S * if size_of::<E>() > 8 { S } else { 1 };
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, row: usize) {
        let Self { plan, jacobian, blocks, .. } = self;
        let Some(entry) = plan.structure().elimination.assembly.get(row).in_bounds() else { return };
        if const { factor::begins_with_update::<M, E>() } && entry.is_fill() {
            return;
        }
        let Some(to) = blocks.get_mut(entry.block as usize).in_bounds() else { return };
        let mut block = if entry.first { [[E::from_f64(0.0); S]; S] } else { *to };
        // Absent entries have an index outside of the Jacobian.
        if let Some(&(mut values)) = jacobian.get(entry.entry as usize) {
            if let Some(minus_c) = jacobian.get(entry.by as usize) {
                for value in &mut values {
                    *value = -(*value * minus_c[0]);
                }
            }
            if entry.order == 0 {
                for (stage, (column, &value)) in block.iter_mut().zip(&values).enumerate() {
                    column[stage] = column[stage] + value;
                }
            } else {
                let power = if entry.order == 1 { &self.minus_ha } else { &self.square };
                for (column, power) in block.iter_mut().zip(power) {
                    A::subtract_products(column, &values, power);
                }
            }
        }
        *to = block;
    }
    /// Clears a block of fill-in.
    #[inline(always)]
    fn visit_simple(&mut self, row: usize) {
        factor::clear_fill::<M, E, _>(self.plan, self.blocks, row, [[E::from_f64(0.0); S]; S]);
    }
}

impl<M: Dae, T: Real, const S: usize, F: Fallback> Factors<M, T, S, F> {
    /// Factorises with pivoting of the whole matrix; the row of each equation is in its slot.
    ///
    /// # Errors
    /// The unknown and the stage without a pivot; `None` if there is no memory for the matrix.
    pub fn factor_dense(
        &mut self,
        jacobian: &M::Jacobian<[T; S]>,
        a: &[[T; S]; S],
        h: T,
    ) -> Result<(), Option<(usize, usize)>> {
        let Some(dense) = self.dense.get_mut() else { return Err(None) };
        self.is_dense = true;
        dense.clear();
        let square = {
            let mut square = [[T::ZERO; S]; S];
            for (to, row) in square.iter_mut().zip(a) {
                for (&factor, a) in row.iter().zip(a) {
                    axpy(factor, a, to);
                }
            }
            square
        };
        for_each_dense_entry::<M, _>(jacobian.as_ref(), |place, values, minus_c| {
            let c = minus_c.and_then(|minus_c| minus_c.first()).map_or(T::ONE, |&minus_c| -minus_c);
            for (stage, &value) in values.iter().enumerate() {
                let (r, column, value) = (place.slot, place.column, c * value);
                match place.ha_power {
                    0 => dense.add(r, column, stage, value),
                    1 => dense.add_row(r, column, stage, h * value, &a[stage]),
                    _ => dense.add_row(r, column, stage, h * h * value, &square[stage]),
                }
            }
        });
        // Rows of kinematic states are those of the unit matrix.
        for state in (0..M::Shape::NX).filter(|&state| kinematic::<M>(state).is_some()) {
            (0..S).for_each(|stage| dense.add(state, state, stage, T::ONE));
        }
        dense.factor().map_err(Some)
    }
}

/// The position of an entry of the Jacobian in the whole matrix, which has rows for kinematic
/// states, but no entries in their columns.
pub struct DenseEntry {
    /// The row.
    pub slot: usize,
    /// The unknown.
    pub column: usize,
    /// Power of `hA` that the entry is multiplied by.
    pub ha_power: u32,
}

/// Visits the entries of `f_ẋ`, `f_x` and `f_z`, except those in equations of kinematic states;
/// with `−c` for an entry of a kinematic state.
pub fn for_each_dense_entry<M: Dae, V: Copy>(
    jacobian: &[V],
    mut visit: impl FnMut(DenseEntry, &V, Option<&V>),
) {
    let (pattern, blocks, nx) = (M::STRUCTURE.jacobian, M::STRUCTURE.blocks, M::STRUCTURE.x.len());
    for (e, values) in jacobian.iter().enumerate().take(blocks[3]) {
        let (r, c) = pattern.at(e);
        let slot = slot::<M>(r);
        if kinematic::<M>(slot).is_some() {
            continue;
        }
        let (column, order) =
            (if e < blocks[1] { c } else { c - nx }, u32::from((blocks[1]..blocks[2]).contains(&e)));
        match kinematic::<M>(column) {
            None => visit(DenseEntry { slot, column, ha_power: order }, values, None),
            Some(of) if (of.velocity as usize) < 2 * nx => {
                let place = DenseEntry { slot, column: of.velocity as usize - nx, ha_power: order + 1 };
                visit(place, values, jacobian.get(of.entry as usize));
            }
            Some(_) => {}
        }
    }
}
