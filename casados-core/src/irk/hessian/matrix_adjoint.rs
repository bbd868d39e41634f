//! `Σ_n Σ_i D_iᵀ H_i D_i` without products of all directions with each other: the adjoint,
//! backwards over the steps, of what second derivatives add at their stages, in all directions at
//! once.
//!
//! ```text
//! Jᵀ M = h (b ⊗ Λ_{n+1}, 0) + Qᵀ G        (Qᵀ G)_k,j = G_ẋ,j + h Σ_i a_ij G_x,i        (Qᵀ G)_z,j = G_z,j
//! Λ_n = Λ_{n+1} − Σ_i f_x,iᵀ M_i + Σ_i G_x,i        Λ_w += − Σ_i f_w,iᵀ M_i + Σ_i G_w,i
//! ```
//!
//! with `G_i = −H_i D_i`, and `Λ_N = 0`. Since `D` is what the forward sweep makes of unit vectors,
//! and this the same sweep transposed, `(Λ_0, Λ_w) = −Σ_n Σ_i D_iᵀ H_i D_i`. Products of panels
//! (`products`) take as many operations as there are curved variables for each pair of directions;
//! this takes a sparse solve for each direction, which is less where a model is large.

use super::matrix_adjoint_step::{Advance, Inverse, add_stages, columns};
use super::products::{COLUMNS, Square};
use super::sparse_product::multiply_panel;
use crate::irk::coefficients::Coefficients;
use crate::irk::directions::{all_columns, column_of, known_columns, panel_of, panels};
use crate::irk::forward::stage_rows::Rows;
use crate::irk::forward::sweep::Phase;
use crate::irk::kinematic::{CONDENSE_TRANSPOSED, RECONSTRUCT_TRANSPOSED, around};
use crate::irk::workspace::{Linearization, Work};
use crate::linalg::{
    Ahead, Arithmetic, Block, Factors, Kernel, PanelRow, Planned, TransposedDown, TransposedUp, dispatch,
    is_long, minus_ha, sweeps,
};
use crate::memory::Fallback;
use crate::model::{ArrayV, Dae};
use crate::plan::{Plan, PlanOf, is_direct};
use crate::scalar::Lanes;
use crate::shape::Plain;

/// Whether second derivatives are summed in this way: where it takes less than 4/9 of the products
/// that panels take, counted for each direction. A solve waits for memory, which products of panels
/// do not. Only of single numbers: registers of them leave no room for panel rows.
pub(in crate::irk) const fn is_worth<M: Dae, E, const S: usize>() -> bool {
    let structure = &M::STRUCTURE;
    if COLUMNS < 16 || size_of::<E>() > 8 || !structure.elimination.has_plan() {
        return false;
    }
    // Each of its products is an operation for the sum, too.
    let solve = structure.elimination_cost(S as u64).1 as usize / 2;
    let blocks = &structure.blocks;
    let of_x = if is_direct(structure) { blocks[1] } else { blocks[2] - blocks[1] };
    let entries = S * (of_x + blocks[5] - blocks[3]);
    let right = S * (structure.x.len() + S * structure.curved.len());
    let products = structure.curved.len() * S * structure.directions.len() / 2;
    9 * (solve + entries + right) < 4 * products
}

/// One step backwards, in all directions.
pub(in crate::irk) struct MatrixAdjoint<'a, M: Dae, E: Plain, const S: usize> {
    pub coefficients: &'a Coefficients<E, S>,
    /// Entries of `∇²(μᵀ f)` at all stages.
    pub entries: &'a [[E; S]],
    /// The rows of `D` that enter second derivatives.
    pub d: &'a [E],
    /// Memory for `G` and `M` of a panel.
    pub g: &'a mut ArrayV<M, [[E; COLUMNS]; S]>,
    /// `(Λ, Λ_w)`, over the directions that have any influence: a row for each, and a column.
    pub sum: Square<'a, E>,
    /// Whether the step is the first of the interval: of its result nobody needs more than the
    /// lower triangle.
    pub first: bool,
    /// Whether it is the last one: `Λ_N = 0`.
    pub last: bool,
    /// Where the result will be written, if that is far away.
    pub ahead: &'a [E],
}

impl<M: Dae, E: Lanes, const S: usize> MatrixAdjoint<'_, M, E, S> {
    /// Over a step that is linearised, with its factors, which were `kept` or are there.
    pub fn run<F: Fallback>(mut self, work: &mut Work<M, E, S, F>, kept: Option<&Linearization<M, E, S, F>>) {
        let h = work.inputs.time.step;
        if const { !Factors::<M, E, S, F>::MAY_BE_DENSE } || work.linear(kept).factors.is_planned() {
            self.phase(work.linear(kept), h, Phase::Whole, 0);
            return;
        }
        let mut column = 0;
        let columns = const { all_columns::<M, E, F>() };
        while column < columns {
            let known = const { F::Plan::<M>::KNOWN.is_some() };
            let (_, width) = panel_of::<E>(known, column, columns, S);
            self.phase(work.linear(kept), h, Phase::Before, column);
            self.solve_columns(work, kept, width);
            self.phase(work.linear(kept), h, Phase::After, column);
            column += width;
        }
    }

    /// All panels, or a part of what is done to one of them.
    fn phase<F: Fallback>(&mut self, linear: &Linearization<M, E, S, F>, h: E, phase: Phase, only: usize) {
        let Self { coefficients, entries, d, g, sum, first, last, ahead } = self;
        let (g, m) = halves::<M, E, S>(g);
        let Square { elements, stride } = sum;
        dispatch(Panels::<_, E, S> {
            plan: F::plan::<M>(),
            columns: const { all_columns::<M, E, F>() },
            phase,
            only,
            jacobian: F::Plan::<M>::jacobian(&linear.jacobian),
            factors: linear.factors.planned(),
            minus_ha: minus_ha(&coefficients.a, h),
            minus_hb: coefficients.b.map(|b| -(h * b)),
            entries,
            d,
            g,
            m,
            sum: Square { elements, stride: *stride },
            first: *first,
            last: *last,
            ahead,
            inverse: Inverse::new(coefficients, h),
            placed: 0,
        });
    }

    /// Solves by the factors of the whole matrix, column by column, of which the panel has so many.
    fn solve_columns<F: Fallback>(
        &mut self,
        work: &mut Work<M, E, S, F>,
        kept: Option<&Linearization<M, E, S, F>>,
        width: usize,
    ) {
        let Work { increment, linear, .. } = work;
        let linear = kept.unwrap_or(linear);
        let (_, m) = halves::<M, E, S>(self.g);
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

/// Where `G` and `M` of a panel are.
fn halves<M: Dae, E: Plain, const S: usize>(g: &mut ArrayV<M, [[E; COLUMNS]; S]>) -> (&mut [E], &mut [E]) {
    let all = g.as_mut().as_flattened_mut().as_flattened_mut();
    all.split_at_mut(all.len() / 2)
}

/// See [`MatrixAdjoint`].
struct Panels<'a, M: Plan, E: Plain, const S: usize> {
    plan: M,
    /// Of all directions.
    columns: usize,
    phase: Phase,
    /// The panel that a phase other than all is of.
    only: usize,
    jacobian: &'a M::Jacobian<[E; S]>,
    factors: Planned<'a, M, E, S>,
    /// `−hA`
    minus_ha: Block<E, S>,
    /// `−hb`
    minus_hb: [E; S],
    entries: &'a [[E; S]],
    d: &'a [E],
    g: &'a mut [E],
    m: &'a mut [E],
    sum: Square<'a, E>,
    first: bool,
    last: bool,
    ahead: &'a [E],
    /// See [`Advance`].
    inverse: Option<Inverse<E, S>>,
    placed: usize,
}

impl<M: Plan, E: Lanes, const S: usize> Kernel for Panels<'_, M, E, S> {
    type Number = E;
    type Output = ();
    const WIDE: bool = is_long::<M, S>() && matches!(known_columns::<M, E>(), Some(8..));
    #[inline(always)]
    fn run<A: Arithmetic>(mut self) {
        let columns = match const { known_columns::<M, E>() } {
            Some(columns) => columns,
            None => self.columns,
        };
        self.columns = columns;
        if M::KNOWN.is_some() {
            self.sum.stride = M::NC;
        }
        panels!([known_columns::<M, E>(), columns], E, S, column, W => {
            if self.phase == Phase::Whole || self.only == column {
                self.panel::<A, W>(column);
            }
        });
    }
}

impl<M: Plan, E: Lanes, const S: usize> Panels<'_, M, E, S> {
    #[inline(always)]
    fn panel<A: Arithmetic, const W: usize>(&mut self, column: usize) {
        let (plan, nk) = (self.plan, self.plan.nk());
        let (rows, count) = (Rows::of::<M, E, S>(plan), plan.structure().curved.len() * S);
        let g = self.g.get_mut(..count * W).unwrap_or_default().as_chunks_mut::<W>().0;
        let m = self.m.get_mut(..nk * S * W).unwrap_or_default();
        let m = m.as_chunks_mut::<W>().0.as_chunks_mut::<S>().0;
        // Lengths that the optimiser knows need no looking at.
        if g.len() != count || m.len() != nk {
            return;
        }
        if self.phase != Phase::After {
            multiply_panel::<A, M, E, S, W>(plan, self.entries, self.d, g, column);
            let sum = if self.last { None } else { Some(&self.sum) };
            let (minus_ha, minus_hb) = (&self.minus_ha, &self.minus_hb);
            RightHandSide { plan, rows, g, minus_ha, minus_hb, sum, column }.all::<A>(m);
            around::<A, M, E, S, W, CONDENSE_TRANSPOSED>(plan, self.jacobian.as_ref(), &self.minus_ha, m);
        }
        if self.phase == Phase::Whole {
            let own = self.ahead.get(column * plan.nx()..).unwrap_or_default();
            let own = own.get(..W * plan.nx()).unwrap_or(own);
            let ahead = &mut Ahead(own);
            sweeps::<A, M, E, [E; W], S, W, TransposedDown, TransposedUp>(self.factors, m, 0, ahead);
        }
        if self.phase != Phase::Before {
            around::<A, M, E, S, W, RECONSTRUCT_TRANSPOSED>(plan, self.jacobian.as_ref(), &self.minus_ha, m);
            let Self { jacobian, sum, first, last, inverse, placed, .. } = self;
            Advance {
                plan,
                rows,
                jacobian: jacobian.as_ref(),
                g,
                m,
                sum,
                column,
                first: *first,
                last: *last,
                inverse,
                placed,
            }
            .all::<A>();
        }
    }
}

/// `h (b ⊗ Λ_{n+1}, 0) + Qᵀ G` of a panel.
struct RightHandSide<'a, M, E, const S: usize, const W: usize> {
    plan: M,
    rows: Rows,
    g: &'a [[E; W]],
    minus_ha: &'a Block<E, S>,
    minus_hb: &'a [E; S],
    /// `Λ_{n+1}`; nothing where it is zero.
    sum: Option<&'a Square<'a, E>>,
    column: usize,
}

impl<M: Plan, E: Lanes, const S: usize, const W: usize> RightHandSide<'_, M, E, S, W> {
    #[inline(always)]
    fn all<A: Arithmetic>(&self, m: &mut [PanelRow<E, S, W>]) {
        let (plan, rows, nx) = (self.plan, self.rows, self.plan.nx());
        let (mut derivative, mut state) = (0, plan.facts().curved[0]);
        let mut algebraic = plan.facts().curved[1];
        for (unknown, to) in m.iter_mut().enumerate() {
            let mut panel_row = [[E::from_f64(0.0); W]; S];
            if unknown >= nx {
                if is_at(plan, algebraic, unknown + nx) {
                    add_stages::<A, E, S, W>(rows, &mut panel_row, self.g, algebraic);
                    algebraic += 1;
                }
                *to = panel_row;
                continue;
            }
            if let Some(sum) = self.sum
                && let Some(row) = column_of(plan, unknown)
                && let Some(lambda) = columns::<E, W>(sum, row, self.column)
            {
                for (row, &minus_hb) in panel_row.iter_mut().zip(self.minus_hb) {
                    A::subtract_row(row, minus_hb, lambda);
                }
            }
            if is_at(plan, derivative, unknown) {
                add_stages::<A, E, S, W>(rows, &mut panel_row, self.g, derivative);
                derivative += 1;
            }
            if is_at(plan, state, nx + unknown) {
                for stage in 0..S {
                    let Some(g) = self.g.get(rows.at::<S>(state, stage)) else { continue };
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

/// Whether the curved variable in a position is this one.
#[inline(always)]
fn is_at<M: Plan>(plan: M, position: usize, variable: usize) -> bool {
    matches!(plan.structure().curved.get(position), Some(&of) if of as usize == variable)
}
