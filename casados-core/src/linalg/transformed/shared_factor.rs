//! Factors of the shared Jacobian of the stages, in the eigenbasis of the tableau, in
//! [demoted](Lanes::Demoted) precision: the next iteration corrects errors of the increments.

use super::basis::Eigenbasis;
use super::complex::Complex;
use super::demoted::{DemotedComplex, demote};
use super::shared_solve::SharedSolve;
use crate::linalg::kernel::arithmetic::Arithmetic;
use crate::linalg::kernel::dispatch::{Kernel, dispatch};
use crate::linalg::kernel::unroll::{RowVisitor, for_each_row};
use crate::linalg::sparse_lu::factor;
use crate::memory::Fallback;
use crate::model::{ArrayK, Dae};
use crate::plan::{Plan, PlanOf, StructureTable};
use crate::scalar::Lanes;
use crate::shape::{Aligned, InBounds};
use bytemuck::Zeroable;

/// Factors of the shared Jacobian for all eigenvalues, by the plan; for Newton increments, which
/// need not be exact.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct SharedFactors<M: Dae, E: Lanes, const S: usize> {
    blocks: Aligned<M::Factors<[[DemotedComplex<E, S>; 1]; 1]>>,
    rows: Aligned<ArrayK<M, [[DemotedComplex<E, S>; 1]; 1]>>,
}

impl<M: Dae, E: Lanes, const S: usize> SharedFactors<M, E, S> {
    /// Factorises; a vanishing pivot gives factors that are not finite. With `first_stage_only` the
    /// Jacobian is given at the first stage of identical stages; this is ignored for a single lane.
    pub fn factor<F: Fallback>(
        &mut self,
        jacobian: &M::Jacobian<[E; S]>,
        first_stage_only: bool,
        basis: &Eigenbasis<E, S, S>,
        h: E,
    ) {
        let (plan, values) = (F::plan::<M>(), &basis.eigenvalues);
        let jacobian = F::Plan::<M>::jacobian(jacobian);
        let blocks = F::Plan::<M>::factors_mut(&mut self.blocks);
        if const { E::LANES > 1 } && first_stage_only {
            dispatch(AssembleShared::<_, E, S, true> { plan, jacobian, eigenvalues: values, h, blocks });
        } else {
            dispatch(AssembleShared::<_, E, S, false> { plan, jacobian, eigenvalues: values, h, blocks });
        }
        factor::factor(plan, self.blocks.as_mut());
    }

    /// Solves the Newton system of the stages. Rows of kinematic states in the solution remain
    /// unchanged.
    pub fn solve<F: Fallback>(
        &mut self,
        basis: &Eigenbasis<E, S, S>,
        f: &ArrayK<M, [E; S]>,
        solution: &mut ArrayK<M, [[E; 1]; S]>,
    ) {
        let Self { blocks, rows } = self;
        let (blocks, rows) =
            (blocks.as_ref().as_flattened().as_flattened(), rows.as_mut().as_flattened_mut());
        let (f, rows) = (F::Plan::<M>::k(f), rows.as_flattened_mut());
        let solution = F::Plan::<M>::k_mut(solution);
        dispatch(SharedSolve { plan: F::plan::<M>(), basis, f, blocks, rows, solution });
    }
}

/// Assembles `Σ c f (hμ)^order` of the shared Jacobian, each block written once.
struct AssembleShared<'a, M: Plan, E: Lanes, const S: usize, const FIRST_ONLY: bool> {
    plan: M,
    jacobian: &'a M::Jacobian<[E; S]>,
    /// The eigenvalues `μ`.
    eigenvalues: &'a Complex<E, S>,
    h: E,
    blocks: &'a mut M::Factors<[[DemotedComplex<E, S>; 1]; 1]>,
}

impl<M: Plan, E: Lanes, const S: usize, const FIRST_ONLY: bool> Kernel
    for AssembleShared<'_, M, E, S, FIRST_ONLY>
{
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { plan, jacobian, eigenvalues: values, h, blocks } = self;
        let (jacobian, blocks) = (jacobian.as_ref(), blocks.as_mut());
        let (scale, share) =
            (values.scaled(h), E::from_f64(SharedAssemblyRows::<M, E, S, FIRST_ONLY>::MEAN_WEIGHT));
        let scales = [scale.scaled(share), (scale * scale).scaled(share)].map(demote);
        for_each_row::<A, _>(&mut SharedAssemblyRows::<M, E, S, FIRST_ONLY> {
            plan,
            jacobian,
            scales,
            blocks,
        });
    }
}

/// See [`AssembleShared`].
struct SharedAssemblyRows<'a, M, E: Lanes, const S: usize, const FIRST_ONLY: bool> {
    plan: M,
    jacobian: &'a [[E; S]],
    /// `hμ` and `(hμ)²` times the weight of the mean.
    scales: [DemotedComplex<E, S>; 2],
    blocks: &'a mut [[[DemotedComplex<E, S>; 1]; 1]],
}

impl<M: Plan, E: Lanes, const S: usize, const FIRST_ONLY: bool> RowVisitor
    for SharedAssemblyRows<'_, M, E, S, FIRST_ONLY>
{
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
    const INSTRUCTIONS: usize = S + 2 + 2 * if size_of::<E>() > 8 { S } else { S.div_ceil(4) };
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, row: usize) {
        let Self { plan, jacobian, blocks, .. } = self;
        let Some(entry) = plan.structure().elimination.assembly.get(row).in_bounds() else { return };
        if const { factor::begins_with_update::<M, DemotedComplex<E, S>>() } && entry.is_fill() {
            return;
        }
        let Some([[to]]) = blocks.get_mut(entry.block as usize).in_bounds() else { return };
        let [scale, square] = self.scales;
        let mut element = if entry.first { Complex::zero() } else { *to };
        // Absent entries have an index outside of the Jacobian.
        if let Some(mut value) = jacobian.get(entry.entry as usize).map(Self::sum_over_stages) {
            if let Some(minus_c) = jacobian.get(entry.by as usize) {
                value = -(minus_c[0] * value);
            }
            element = match entry.order {
                0 => element.plus((E::from_f64(Self::MEAN_WEIGHT) * value).demote()),
                1 => element + scale.scaled(value.demote()),
                _ => element + square.scaled(value.demote()),
            };
        }
        *to = element;
    }
    /// Clears a block of fill-in.
    #[inline(always)]
    fn visit_simple(&mut self, row: usize) {
        factor::clear_fill::<M, DemotedComplex<E, S>, _>(self.plan, self.blocks, row, [[Complex::zero()]]);
    }
}

impl<M: Plan, E: Lanes, const S: usize, const FIRST_ONLY: bool> SharedAssemblyRows<'_, M, E, S, FIRST_ONLY> {
    /// Weight of each summand in the mean over the stages.
    const MEAN_WEIGHT: f64 = if FIRST_ONLY { 1.0 } else { 1.0 / S as f64 };

    /// The sum over the stages.
    #[inline(always)]
    fn sum_over_stages(stages: &[E; S]) -> E {
        if FIRST_ONLY {
            return stages[0];
        }
        let mut total = E::from_f64(0.0);
        for &stage in stages {
            total = total + stage;
        }
        total
    }
}
