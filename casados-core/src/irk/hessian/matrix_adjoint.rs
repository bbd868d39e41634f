//! `Σ_n Σ_i D_iᵀ H_i D_i` by a matrix adjoint: the second derivatives at the stages are the source
//! terms of a backward sweep, in all directions at once. It replaces the products of panels with
//! panels.
//!
//! ```text
//! Jᵀ M = h (b ⊗ Λ_{n+1}, 0) + Qᵀ G        (Qᵀ G)_k,j = G_ẋ,j + h Σ_i a_ij G_x,i        (Qᵀ G)_z,j = G_z,j
//! Λ_n = Λ_{n+1} − Σ_i f_x,iᵀ M_i + Σ_i G_x,i        Λ_w += − Σ_i f_w,iᵀ M_i + Σ_i G_w,i
//! ```
//!
//! with `G_i = −H_i D_i`, and `Λ_N = 0`. The forward sweep maps unit vectors to `D`; this is its
//! transpose, so `(Λ_0, Λ_w) = −Σ_n Σ_i D_iᵀ H_i D_i`. Products of panels (`products`) take one
//! operation per nonlinear variable and pair of directions; the matrix adjoint takes one sparse
//! solve per direction, which is cheaper for large models.

use super::matrix_adjoint_step::{AdvancePanel, InverseWeights, add_stages, row_chunk};
use super::products::{G_COLUMNS, StridedMatrix};
use super::sparse_product::multiply_panel;
use crate::irk::coefficients::Coefficients;
use crate::irk::directions::{column_of, panel_of, panels, static_columns, total_columns};
use crate::irk::forward::stage_sensitivities::StageRowLayout;
use crate::irk::forward::sweep::SweepPart;
use crate::irk::kinematic::{CONDENSE_TRANSPOSED, RECONSTRUCT_TRANSPOSED, condense};
use crate::irk::workspace::{Linearization, StageWorkspace};
use crate::linalg::{
    Arithmetic, Block, Factors, Kernel, PanelRow, PlannedFactors, Prefetch, TransposedBackSubstitution,
    TransposedForwardSubstitution, dispatch, is_large_plan, minus_ha, solve_triangular_pair,
};
use crate::memory::Fallback;
use crate::model::{ArrayV, Dae};
use crate::plan::{Plan, PlanOf, has_ordered_derivatives};
use crate::scalar::Lanes;
use crate::shape::{InBounds, Plain};

/// Whether the matrix adjoint is used: for scalars, if it takes less than 4/9 of the operations of
/// the products of panels, per direction. The factor accounts for the memory traffic of a solve.
/// SIMD registers leave no room for panel rows.
pub(in crate::irk) const fn is_cheaper<M: Dae, E, const S: usize>() -> bool {
    let structure = &M::STRUCTURE;
    if G_COLUMNS < 16 || size_of::<E>() > 8 || !structure.elimination.has_plan() {
        return false;
    }
    // Each product of a solve is one multiplication with one addition.
    let solve = structure.elimination_cost(S as u64).1 as usize / 2;
    let blocks = &structure.blocks;
    let of_x = if has_ordered_derivatives(structure) { blocks[1] } else { blocks[2] - blocks[1] };
    let entries = S * (of_x + blocks[5] - blocks[3]);
    let right = S * (structure.x.len() + S * structure.curved.len());
    let products = structure.curved.len() * S * structure.directions.len() / 2;
    9 * (solve + entries + right) < 4 * products
}

/// One step of the matrix adjoint, in all directions.
pub(in crate::irk) struct MatrixAdjoint<'a, M: Dae, E: Plain, const S: usize> {
    pub coefficients: &'a Coefficients<E, S>,
    /// Entries of `∇²(μᵀ f)` at all stages.
    pub entries: &'a [[E; S]],
    /// The rows of `D` of nonlinear variables.
    pub d: &'a [E],
    /// Memory for `G` and `M` of a panel.
    pub g: &'a mut ArrayV<M, [[E; G_COLUMNS]; S]>,
    /// `(Λ, Λ_w)` over the directions with influence, one row and one column each.
    pub sum: StridedMatrix<'a, E>,
    /// Whether the step is the first of the interval: only the lower triangle of its result is
    /// used.
    pub is_first: bool,
    /// Whether the step is the last of the interval: `Λ_N = 0`.
    pub is_last: bool,
    /// Prefetch target: the memory of the result.
    pub prefetch: &'a [E],
}

impl<M: Dae, E: Lanes, const S: usize> MatrixAdjoint<'_, M, E, S> {
    /// Runs one linearised step, with the factors of `stored_linearization` or of the workspace.
    pub fn run<F: Fallback>(
        mut self,
        work: &mut StageWorkspace<M, E, S, F>,
        stored_linearization: Option<&Linearization<M, E, S, F>>,
    ) {
        let h = work.inputs.time.step;
        if const { !Factors::<M, E, S, F>::MAY_BE_DENSE }
            || work.linearization(stored_linearization).factors.is_from_plan()
        {
            self.run_part(work.linearization(stored_linearization), h, SweepPart::All, 0);
            return;
        }
        let mut column = 0;
        let columns = const { total_columns::<M, E, F>() };
        while column < columns {
            let known = const { F::Plan::<M>::KNOWN_STRUCTURE.is_some() };
            let (_, width) = panel_of::<E>(known, column, columns, S);
            self.run_part(work.linearization(stored_linearization), h, SweepPart::RightHandSide, column);
            self.solve_columns(work, stored_linearization, width);
            self.run_part(work.linearization(stored_linearization), h, SweepPart::AfterSolve, column);
            column += width;
        }
    }

    /// Runs all panels, or a part of the work on one panel.
    fn run_part<F: Fallback>(
        &mut self,
        linear: &Linearization<M, E, S, F>,
        h: E,
        phase: SweepPart,
        selected_panel: usize,
    ) {
        let Self { coefficients, entries, d, g, sum, is_first: first, is_last: last, prefetch: ahead } = self;
        let (g, m) = split_g_and_m::<M, E, S>(g);
        let StridedMatrix { elements, stride } = sum;
        dispatch(PanelKernel::<_, E, S> {
            plan: F::plan::<M>(),
            columns: const { total_columns::<M, E, F>() },
            part: phase,
            selected_panel,
            jacobian: F::Plan::<M>::jacobian(&linear.jacobian),
            factors: linear.factors.planned(),
            minus_ha: minus_ha(&coefficients.a, h),
            minus_hb: coefficients.b.map(|b| -(h * b)),
            entries,
            d,
            g,
            m,
            sum: StridedMatrix { elements, stride: *stride },
            is_first: *first,
            is_last: *last,
            prefetch: ahead,
            inverse_weights: InverseWeights::new(coefficients, h),
            skipped_entries: 0,
        });
    }

    /// Solves for the `width` columns of a panel, with the factors of the whole matrix.
    fn solve_columns<F: Fallback>(
        &mut self,
        work: &mut StageWorkspace<M, E, S, F>,
        stored_linearization: Option<&Linearization<M, E, S, F>>,
        width: usize,
    ) {
        let StageWorkspace { increment, linearization: linear, .. } = work;
        let linear = stored_linearization.unwrap_or(linear);
        let (_, m) = split_g_and_m::<M, E, S>(self.g);
        for column in 0..width {
            for (to, from) in increment.as_mut().as_flattened_mut().iter_mut().zip(m.chunks_exact(width)) {
                *to = [from[column]];
            }
            linear.factors.solve_transposed(increment);
            let solution = increment.as_ref().as_flattened();
            for (to, &[from]) in m.chunks_exact_mut(width).zip(solution) {
                to[column] = from;
            }
        }
    }
}

/// Splits the memory into `G` and `M` of a panel.
fn split_g_and_m<M: Dae, E: Plain, const S: usize>(
    g: &mut ArrayV<M, [[E; G_COLUMNS]; S]>,
) -> (&mut [E], &mut [E]) {
    let all = g.as_mut().as_flattened_mut().as_flattened_mut();
    all.split_at_mut(all.len() / 2)
}

/// See [`MatrixAdjoint`].
struct PanelKernel<'a, M: Plan, E: Plain, const S: usize> {
    plan: M,
    /// Number of columns of all directions.
    columns: usize,
    part: SweepPart,
    /// The first column of the panel, for parts other than `All`.
    selected_panel: usize,
    jacobian: &'a M::Jacobian<[E; S]>,
    factors: PlannedFactors<'a, M, E, S>,
    /// `−hA`
    minus_ha: Block<E, S>,
    /// `−hb`
    minus_hb: [E; S],
    entries: &'a [[E; S]],
    d: &'a [E],
    g: &'a mut [E],
    m: &'a mut [E],
    sum: StridedMatrix<'a, E>,
    is_first: bool,
    is_last: bool,
    prefetch: &'a [E],
    /// See [`AdvancePanel`].
    inverse_weights: Option<InverseWeights<E, S>>,
    skipped_entries: usize,
}

impl<M: Plan, E: Lanes, const S: usize> Kernel for PanelKernel<'_, M, E, S> {
    type Number = E;
    type Output = ();
    const WIDE: bool = is_large_plan::<M, S>() && matches!(static_columns::<M, E>(), Some(8..));
    #[inline(always)]
    fn run<A: Arithmetic>(mut self) {
        let columns = match const { static_columns::<M, E>() } {
            Some(columns) => columns,
            None => self.columns,
        };
        self.columns = columns;
        if M::KNOWN_STRUCTURE.is_some() {
            self.sum.stride = M::NC;
        }
        panels!([static_columns::<M, E>(), columns], E, S, column, W => {
            if self.part == SweepPart::All || self.selected_panel == column {
                self.process_panel::<A, W>(column);
            }
        });
    }
}

impl<M: Plan, E: Lanes, const S: usize> PanelKernel<'_, M, E, S> {
    #[inline(always)]
    fn process_panel<A: Arithmetic, const W: usize>(&mut self, column: usize) {
        let (plan, nk) = (self.plan, self.plan.nk());
        let (rows, count) = (StageRowLayout::for_plan::<M, E, S>(plan), plan.structure().curved.len() * S);
        let g = self.g.get_mut(..count * W).in_bounds().unwrap_or_default().as_chunks_mut::<W>().0;
        let m = self.m.get_mut(..nk * S * W).in_bounds().unwrap_or_default();
        let m = m.as_chunks_mut::<W>().0.as_chunks_mut::<S>().0;
        // Equal lengths, so that the optimiser removes bounds checks.
        if g.len() != count || m.len() != nk {
            return;
        }
        if self.part != SweepPart::AfterSolve {
            multiply_panel::<A, M, E, S, W>(plan, self.entries, self.d, g, column);
            let sum = if self.is_last { None } else { Some(&self.sum) };
            let (minus_ha, minus_hb) = (&self.minus_ha, &self.minus_hb);
            RightHandSide { plan, rows, g, minus_ha, minus_hb, sum, column }.evaluate::<A>(m);
            condense::<A, M, E, S, W, CONDENSE_TRANSPOSED>(plan, self.jacobian.as_ref(), &self.minus_ha, m);
        }
        if self.part == SweepPart::All {
            let own = self.prefetch.get(column * plan.nx()..).unwrap_or_default();
            let own = own.get(..W * plan.nx()).unwrap_or(own);
            let ahead = &mut Prefetch(own);
            solve_triangular_pair::<
                A,
                M,
                E,
                [E; W],
                S,
                W,
                TransposedForwardSubstitution,
                TransposedBackSubstitution,
            >(self.factors, m, 0, ahead);
        }
        if self.part != SweepPart::RightHandSide {
            condense::<A, M, E, S, W, RECONSTRUCT_TRANSPOSED>(
                plan,
                self.jacobian.as_ref(),
                &self.minus_ha,
                m,
            );
            let Self {
                jacobian,
                sum,
                is_first: first,
                is_last: last,
                inverse_weights: inverse,
                skipped_entries: placed,
                ..
            } = self;
            AdvancePanel {
                plan,
                rows,
                jacobian: jacobian.as_ref(),
                g,
                m,
                sum,
                column,
                is_first: *first,
                is_last: *last,
                inverse,
                skipped_entries: placed,
            }
            .evaluate::<A>();
        }
    }
}

/// Computes `h (b ⊗ Λ_{n+1}, 0) + Qᵀ G` of a panel.
struct RightHandSide<'a, M, E, const S: usize, const W: usize> {
    plan: M,
    rows: StageRowLayout,
    g: &'a [[E; W]],
    minus_ha: &'a Block<E, S>,
    minus_hb: &'a [E; S],
    /// `Λ_{n+1}`; `None` if it is zero.
    sum: Option<&'a StridedMatrix<'a, E>>,
    column: usize,
}

impl<M: Plan, E: Lanes, const S: usize, const W: usize> RightHandSide<'_, M, E, S, W> {
    #[inline(always)]
    fn evaluate<A: Arithmetic>(&self, m: &mut [PanelRow<E, S, W>]) {
        let (plan, rows, nx) = (self.plan, self.rows, self.plan.nx());
        let (mut derivative, mut state) = (0, plan.facts().nonlinear_before[0]);
        let mut algebraic = plan.facts().nonlinear_before[1];
        for (unknown, to) in m.iter_mut().enumerate() {
            let mut panel_row = [[E::from_f64(0.0); W]; S];
            if unknown >= nx {
                if is_variable_at(plan, algebraic, unknown + nx) {
                    add_stages::<A, E, S, W>(rows, &mut panel_row, self.g, algebraic);
                    algebraic += 1;
                }
                *to = panel_row;
                continue;
            }
            if let Some(sum) = self.sum
                && let Some(row) = column_of(plan, unknown)
                && let Some(lambda) = row_chunk::<E, W>(sum, row, self.column)
            {
                for (row, &minus_hb) in panel_row.iter_mut().zip(self.minus_hb) {
                    A::subtract_row(row, minus_hb, lambda);
                }
            }
            if is_variable_at(plan, derivative, unknown) {
                add_stages::<A, E, S, W>(rows, &mut panel_row, self.g, derivative);
                derivative += 1;
            }
            if is_variable_at(plan, state, nx + unknown) {
                for stage in 0..S {
                    let Some(g) = self.g.get(rows.row_index::<S>(state, stage)).in_bounds() else { continue };
                    for (row, minus_ha) in panel_row.iter_mut().zip(self.minus_ha) {
                        A::subtract_row(row, minus_ha[stage], g);
                    }
                }
                state += 1;
            }
            *to = panel_row;
        }
    }
}

/// Whether the nonlinear variable at this position is `variable`.
#[inline(always)]
fn is_variable_at<M: Plan>(plan: M, position: usize, variable: usize) -> bool {
    matches!(plan.structure().curved.get(position), Some(&of) if of as usize == variable)
}
