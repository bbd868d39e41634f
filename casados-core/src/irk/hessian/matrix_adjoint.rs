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

use super::matrix_adjoint_step::{Advance, Inverse, add_stages, columns, is_direct};
use super::products::COLUMNS;
use super::sparse_product::multiply_panel;
use crate::irk::coefficients::Coefficients;
use crate::irk::directions::{Identity, all_columns, before, panel_of, panels};
use crate::irk::forward::stage_rows::row_of;
use crate::irk::forward::sweep::Phase;
use crate::irk::kinematic::{CONDENSE_TRANSPOSED, RECONSTRUCT_TRANSPOSED, around};
use crate::irk::workspace::{Linearization, Work};
use crate::linalg::{
    Ahead, Arithmetic, Block, Factors, Kernel, PanelRow, Planned, TransposedDown, TransposedUp, dispatch,
    is_long, minus_ha, sweeps,
};
use crate::memory::Fallback;
use crate::model::{ArrayV, Dae};
use crate::scalar::Lanes;
use crate::shape::{Array, Plain, Shape};
use core::marker::PhantomData;

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
    let of_x = if is_direct::<M>() { blocks[1] } else { blocks[2] - blocks[1] };
    let entries = S * (of_x + blocks[5] - blocks[3]);
    let right = S * (structure.x.len() + S * structure.curved.len());
    let products = structure.curved.len() * S * structure.directions.len() / 2;
    9 * (solve + entries + right) < 4 * products
}

/// One step backwards, in all directions.
pub(in crate::irk) struct MatrixAdjoint<'a, M: Dae, E: Plain, R, const S: usize> {
    pub coefficients: &'a Coefficients<E, S>,
    /// Entries of `∇²(μᵀ f)` at all stages.
    pub entries: &'a [[E; S]],
    /// The rows of `D` that enter second derivatives.
    pub d: &'a [E],
    /// Memory for `G` and `M` of a panel.
    pub g: &'a mut ArrayV<M, [[E; COLUMNS]; S]>,
    /// `(Λ, Λ_w)`, over the directions that have any influence: a row for each, and a column.
    pub sum: &'a mut [R],
    /// Whether the step is the first of the interval: of its result nobody needs more than the
    /// lower triangle.
    pub first: bool,
    /// Whether it is the last one: `Λ_N = 0`.
    pub last: bool,
    /// Where the result will be written, if that is far away.
    pub ahead: &'a [E],
}

impl<M: Dae, E: Lanes, R: Array<E>, const S: usize> MatrixAdjoint<'_, M, E, R, S> {
    /// Over a step that is linearised, with its factors, which were `kept` or are there.
    pub fn run<F: Fallback>(mut self, work: &mut Work<M, E, S, F>, kept: Option<&Linearization<M, E, S, F>>) {
        let h = work.inputs.time.step;
        if const { !Factors::<M, E, S, F>::MAY_BE_DENSE } || work.linear(kept).factors.is_planned() {
            self.phase(work.linear(kept), h, Phase::Whole, 0);
            return;
        }
        let mut column = 0;
        while column < all_columns::<M, E>() {
            let (_, width) = panel_of::<E>(column, all_columns::<M, E>(), S);
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
        dispatch(Panels::<M, E, R, S> {
            phase,
            only,
            jacobian: &linear.jacobian,
            factors: linear.factors.planned(),
            minus_ha: minus_ha(&coefficients.a, h),
            minus_hb: coefficients.b.map(|b| -(h * b)),
            entries,
            d,
            g,
            m,
            sum,
            first: *first,
            last: *last,
            ahead,
            inverse: Inverse::new(coefficients, h),
            placed: 0,
            model: PhantomData,
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
struct Panels<'a, M: Dae, E: Plain, R, const S: usize> {
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
    sum: &'a mut [R],
    first: bool,
    last: bool,
    ahead: &'a [E],
    /// See [`Advance`].
    inverse: Option<Inverse<E, S>>,
    placed: usize,
    model: PhantomData<M>,
}

impl<M: Dae, E: Lanes, R: Array<E>, const S: usize> Kernel for Panels<'_, M, E, R, S> {
    type Number = E;
    type Output = ();
    const WIDE: bool = is_long::<M, S>() && all_columns::<M, E>() >= 8;
    #[inline(always)]
    fn run<A: Arithmetic>(mut self) {
        panels!(all_columns::<M, E>(), E, S, column, W => {
            if self.phase == Phase::Whole || self.only == column {
                self.panel::<A, W>(column);
            }
        });
    }
}

impl<M: Dae, E: Lanes, R: Array<E>, const S: usize> Panels<'_, M, E, R, S> {
    #[inline(always)]
    fn panel<A: Arithmetic, const W: usize>(&mut self, column: usize) {
        let rows = M::STRUCTURE.curved.len() * S;
        let g = self.g.get_mut(..rows * W).unwrap_or_default().as_chunks_mut::<W>().0;
        let m = self.m.get_mut(..M::Shape::NK * S * W).unwrap_or_default();
        let m = m.as_chunks_mut::<W>().0.as_chunks_mut::<S>().0;
        // Lengths that the optimiser knows need no looking at.
        if g.len() != rows || m.len() != M::Shape::NK || self.sum.len() != M::Shape::NW {
            return;
        }
        if self.phase != Phase::After {
            multiply_panel::<A, M, E, S, W>(self.entries, self.d, g, column);
            let sum: &[R] = if self.last { &[] } else { self.sum };
            RightHandSide { g, minus_ha: &self.minus_ha, minus_hb: &self.minus_hb, sum, column }
                .all::<A, M>(m);
            around::<A, M, E, S, W, CONDENSE_TRANSPOSED>(self.jacobian, &self.minus_ha, m);
        }
        if self.phase == Phase::Whole {
            let own = self.ahead.get(column * M::Shape::NX..).unwrap_or_default();
            let own = own.get(..W * M::Shape::NX).unwrap_or(own);
            let ahead = &mut Ahead(own);
            sweeps::<A, M, E, [E; W], S, W, TransposedDown, TransposedUp>(self.factors, m, 0, ahead);
        }
        if self.phase != Phase::Before {
            around::<A, M, E, S, W, RECONSTRUCT_TRANSPOSED>(self.jacobian, &self.minus_ha, m);
            let Self { jacobian, sum, first, last, inverse, placed, .. } = self;
            Advance::<M, E, R, S, W> {
                jacobian,
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
struct RightHandSide<'a, E, R, const S: usize, const W: usize> {
    g: &'a [[E; W]],
    minus_ha: &'a Block<E, S>,
    minus_hb: &'a [E; S],
    /// `Λ_{n+1}`; nothing where it is zero.
    sum: &'a [R],
    column: usize,
}

impl<E: Lanes, R: Array<E>, const S: usize, const W: usize> RightHandSide<'_, E, R, S, W> {
    #[inline(always)]
    fn all<A: Arithmetic, M: Dae>(&self, m: &mut [PanelRow<E, S, W>]) {
        let nx = M::Shape::NX;
        let (mut derivative, mut state) = (0, const { before(M::STRUCTURE.curved, M::Shape::NX) });
        let mut algebraic = const { before(M::STRUCTURE.curved, 2 * M::Shape::NX) };
        for (unknown, to) in m.iter_mut().enumerate() {
            let mut panel_row = [[E::from_f64(0.0); W]; S];
            if unknown >= nx {
                if is_at::<M>(algebraic, unknown + nx) {
                    add_stages::<A, M, E, S, W>(&mut panel_row, self.g, algebraic);
                    algebraic += 1;
                }
                *to = panel_row;
                continue;
            }
            if !self.sum.is_empty()
                && let Some(row) = Identity::<M>::column(unknown)
                && let Some(lambda) = columns::<E, R, W>(self.sum, row, self.column)
            {
                for (row, &minus_hb) in panel_row.iter_mut().zip(self.minus_hb) {
                    A::subtract_row(row, minus_hb, lambda);
                }
            }
            if is_at::<M>(derivative, unknown) {
                add_stages::<A, M, E, S, W>(&mut panel_row, self.g, derivative);
                derivative += 1;
            }
            if is_at::<M>(state, nx + unknown) {
                for stage in 0..S {
                    let Some(g) = self.g.get(row_of::<M, E, S>(state, stage)) else { continue };
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
fn is_at<M: Dae>(position: usize, variable: usize) -> bool {
    matches!(M::STRUCTURE.curved.get(position), Some(&of) if of as usize == variable)
}
