//! Triangular solves with the factors of the shared Jacobian. The transformations to and from the
//! eigenbasis overlap with the substitution, in which each row waits for the preceding one.
//!
//! The substitution is done supernode by supernode: an unknown is loaded once for all rows of a
//! supernode, and their sums stay in registers.

use super::basis::Eigenbasis;
use super::complex::Complex;
use super::demoted::{DemotedComplex, demote};
use crate::linalg::kernel::arithmetic::Arithmetic;
use crate::linalg::kernel::dispatch::Kernel;
use crate::linalg::kernel::unroll::{
    SupernodeVisitor, is_large_plan, supernodes_backward, supernodes_forward,
};
use crate::linalg::sparse_lu::factor::has_all_blocks;
use crate::model::Pivot;
use crate::plan::Plan;
use crate::scalar::Lanes;
use crate::shape::InBounds;

/// Transforms the residuals and solves with `I + L`; solves with `P + U` and transforms the
/// solution back.
pub struct SharedSolve<'a, M: Plan, E: Lanes, const S: usize> {
    pub plan: M,
    pub basis: &'a Eigenbasis<E, S, S>,
    pub f: &'a M::K<[E; S]>,
    /// `P⁻¹`, `L`, `U`.
    pub blocks: &'a [DemotedComplex<E, S>],
    /// Memory for one row per slot.
    pub rows: &'a mut [DemotedComplex<E, S>],
    pub solution: &'a mut M::K<[[E; 1]; S]>,
}

impl<M: Plan, E: Lanes, const S: usize> Kernel for SharedSolve<'_, M, E, S> {
    type Number = E;
    type Output = ();
    const WIDE: bool = S >= 8 && is_large_plan::<M, 1>();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { plan, basis, f, blocks, rows, solution } = self;
        let (f, solution) = (f.as_ref(), solution.as_mut());
        if !has_all_blocks(plan, blocks) || rows.len() != f.len() {
            return;
        }
        let mut down = ForwardSubstitution { plan, basis: *basis, f, blocks, rows };
        supernodes_forward::<A, M, _>(plan, &mut down);
        let mut up = BackSubstitution { plan, basis: *basis, blocks, rows: down.rows, solution };
        supernodes_backward::<A, M, _>(plan, &mut up);
    }
}

/// Instructions per block: loads, and the two products of a complex number.
const INSTRUCTIONS_PER_BLOCK: usize = 5;

/// Forward substitution of [`SharedSolve`].
struct ForwardSubstitution<'a, M, E: Lanes, const S: usize> {
    plan: M,
    basis: Eigenbasis<E, S, S>,
    f: &'a [[E; S]],
    blocks: &'a [DemotedComplex<E, S>],
    rows: &'a mut [DemotedComplex<E, S>],
}

/// Back substitution of [`SharedSolve`].
struct BackSubstitution<'a, M, E: Lanes, const S: usize> {
    plan: M,
    basis: Eigenbasis<E, S, S>,
    blocks: &'a [DemotedComplex<E, S>],
    rows: &'a mut [DemotedComplex<E, S>],
    solution: &'a mut [[[E; 1]; S]],
}

impl<M: Plan, E: Lanes, const S: usize> SupernodeVisitor for ForwardSubstitution<'_, M, E, S> {
    const INSTRUCTIONS: usize = INSTRUCTIONS_PER_BLOCK;
    #[inline(always)]
    fn at<A: Arithmetic, const P: usize>(&mut self, pivots: [&'static Pivot; P]) {
        let mut sums = [Complex::zero(); P];
        for (sum, pivot) in sums.iter_mut().zip(pivots) {
            if let Some(f) = self.f.get(pivot.equation as usize).in_bounds() {
                *sum = demote(self.basis.transform::<A>(f));
            }
        }
        for left in
            self.plan.structure().elimination.left.get(pivots[0].left()).in_bounds().unwrap_or_default()
        {
            // Blocks of the rows of a supernode are adjacent.
            let blocks = self.blocks.get(left.block as usize..).and_then(|blocks| blocks.first_chunk::<P>());
            let (Some(blocks), Some(row)) = (blocks, self.rows.get(left.slot as usize).in_bounds()) else {
                continue;
            };
            for (sum, block) in sums.iter_mut().zip(blocks) {
                *sum = A::subtract(*sum, *block, *row);
            }
        }
        for (index, pivot) in pivots.into_iter().enumerate() {
            let sum = sums[index];
            let below = self.blocks.get(pivot.block as usize..).in_bounds().unwrap_or_default();
            // A constant range, which the optimiser unrolls.
            #[allow(clippy::needless_range_loop)]
            for other in index + 1..P {
                if let Some(block) = below.get(other - index).in_bounds() {
                    sums[other] = A::subtract(sums[other], *block, sum);
                }
            }
            if let Some(row) = self.rows.get_mut(pivot.slot as usize).in_bounds() {
                *row = sum;
            }
        }
    }
}

impl<M: Plan, E: Lanes, const S: usize> SupernodeVisitor for BackSubstitution<'_, M, E, S> {
    const INSTRUCTIONS: usize = INSTRUCTIONS_PER_BLOCK;
    #[inline(always)]
    fn at<A: Arithmetic, const P: usize>(&mut self, pivots: [&'static Pivot; P]) {
        let common_columns = pivots[P - 1].upper();
        let slots =
            self.plan.structure().elimination.slots.get(common_columns).in_bounds().unwrap_or_default();
        let (mut sums, mut own): (_, [&[DemotedComplex<E, S>]; P]) = ([Complex::zero(); P], [&[]; P]);
        let mut triangle = own;
        for (index, pivot) in pivots.into_iter().enumerate() {
            let (row, blocks) = (self.rows.get(pivot.slot as usize), self.blocks.get(pivot.upper as usize..));
            let (Some(row), Some((blocks, others))) =
                (row, blocks.and_then(|blocks| blocks.split_at_checked(slots.len())))
            else {
                return;
            };
            (sums[index], own[index], triangle[index]) = (*row, blocks, others);
        }
        for (index, &slot) in slots.iter().enumerate() {
            let Some(row) = self.rows.get(slot as usize).in_bounds() else { continue };
            for (sum, own) in sums.iter_mut().zip(own) {
                if let Some(block) = own.get(index).in_bounds() {
                    *sum = A::subtract(*sum, *block, *row);
                }
            }
        }
        for index in (0..P).rev() {
            let pivot = pivots[index];
            if let (false, Some(inverse)) = (pivot.identity, self.blocks.get(pivot.block as usize)) {
                sums[index] = A::subtract(Complex::zero(), -*inverse, sums[index]);
            }
            let (sum, slot) = (sums[index], pivot.slot as usize);
            for (other, triangle) in sums[..index].iter_mut().zip(triangle) {
                if let Some(block) = triangle.get(P - 1 - index).in_bounds() {
                    *other = A::subtract(*other, *block, sum);
                }
            }
            if let Some(row) = self.rows.get_mut(slot).in_bounds() {
                *row = sum;
            }
            if let Some(solution) = self.solution.get_mut(slot).in_bounds() {
                let sum = Complex { parts: sum.parts.map(E::promote) };
                solution.as_flattened_mut().copy_from_slice(&self.basis.transform_back::<A>(&sum));
            }
        }
    }
}
