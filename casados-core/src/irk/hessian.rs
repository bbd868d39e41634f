//! Second-order sensitivities: symmetric, in one pass over the steps that the adjoint takes.
//!
//! ```text
//! d²(λᵀ x_N)/dw² = − Σ_n Σ_i D_iᵀ [∇²(μ_iᵀ f)_i] D_i
//! ```
//!
//! with `D_i = d(k_i, ξ_i, z_i, u, p)/dw` from the forward sweep. The product with the sparse matrix in
//! the middle comes first, `G = H D`, then the lower triangle of `Dᵀ G`.

use super::adjoint::Backward;
use super::along::Along;
use super::directions::{Identity, panel, panel_mut, panels};
use super::evaluate::{Give, Take, not_finite};
use super::forward::ForwardMemory;
use super::record::{Coefficients, Linearization, Stage, Step, Work, copy};
use super::step::check;
use crate::error::{Error, Place, Quantity};
use crate::linalg::{Arithmetic, Kernel, dispatch, is_long, slot};
use crate::memory::{Fallback, fallback::Pivoting};
use crate::model::{ArrayK, ArrayV, ArrayW, Dae};
use crate::result::{ForwardAdjoint, Hessian};
use crate::scalar::{Lanes, Real, SideBySide};
use crate::shape::{Aligned, assign};
use crate::shape::{Array, Matrix, Plain, Shape};
use crate::statistics::Statistics;
use bytemuck::Zeroable;
use core::marker::PhantomData;

/// The columns of the widest panel.
const PANEL: usize = 8;

/// Memory of second-order sensitivities.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct HessianMemory<M: Dae, T: Plain, const S: usize> {
    pub(crate) result: Hessian<M, T>,
    pub(crate) backward: Backward<M, T, S, 1>,
    /// `−H D` of a panel at all stages.
    g: Aligned<ArrayV<M, [[T; PANEL]; S]>>,
    /// The Hessian over the directions that have any influence, its lower triangle.
    sum: ArrayW<M, ArrayW<M, T>>,
    /// `μ` at all stages, in the order of the equations.
    mu: Aligned<ArrayK<M, [T; S]>>,
    /// Entries of `∇²(μᵀ f)` at all stages.
    entries: Aligned<M::Hessian<[T; S]>>,
}
copy!([M: Dae, T: Plain, const S: usize] HessianMemory<M, T, S>);

/// What the way back needs of a step.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct HessianStep<M: Dae, T: Plain, const S: usize, F: Fallback = Pivoting> {
    linear: Linearization<M, T, S, F>,
    /// The rows of `D` at all stages that enter second derivatives, in panels.
    d: Aligned<ArrayV<M, [ArrayW<M, T>; S]>>,
}
copy!([M: Dae, T: Plain, const S: usize, F: Fallback] HessianStep<M, T, S, F>);

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> HessianStep<M, E, S, F> {
    /// Where the way forth writes `D`.
    pub(crate) fn curved(&mut self) -> &mut [E] {
        Array::flat_mut(self.d.as_mut().as_flattened_mut())
    }

    /// Remembers the linearisation on the way forth.
    pub(crate) fn record(&mut self, work: &Work<M, E, S, F>) {
        self.linear.copy_from(&work.linear);
    }

    /// Brings it back.
    pub(crate) fn recall(&self, work: &mut Work<M, E, S, F>) {
        work.linear.copy_from(&self.linear);
    }
}

impl<M: Dae, T: Real, const S: usize> HessianMemory<M, T, S> {
    /// The way back; the linearisation of the last step is still there.
    ///
    /// # Errors
    /// A second derivative of the model that is not finite, a singular matrix.
    #[allow(clippy::too_many_arguments)]
    pub(crate) fn run<F: Fallback>(
        &mut self,
        work: &mut Work<M, T, S, F>,
        coefficients: &Coefficients<T, S>,
        steps: &[Step<M, T, S>],
        records: &[HessianStep<M, T, S, F>],
        seed: &[T],
        statistics: &mut Statistics,
        mut along: Along<'_, '_, M, T>,
    ) -> Result<(), Error> {
        self.begin(seed);
        for (n, (step, record)) in steps.iter().zip(records).enumerate().rev() {
            if n + 1 < steps.len() {
                record.recall(work);
            }
            self.backward.step(work, coefficients, n, step, statistics, &mut along)?;
            self.curvature(work, coefficients, n, step);
            if let Some((entry, value)) = not_finite(self.entries.as_ref().as_flattened()) {
                return Err(Error::NonFiniteModel {
                    quantity: Quantity::Hessian,
                    equation: M::STRUCTURE.hessian.at(entry / S).0,
                    value,
                    at: Place { step: n, stage: entry % S, iteration: 0 },
                });
            }
            self.subtract(record);
        }
        Ok(())
    }
}

impl<M: Dae, E: Lanes, const S: usize> HessianMemory<M, E, S> {
    /// Before the last step.
    pub(crate) fn begin(&mut self, seed: &[E]) {
        self.backward.start(seed);
        for row in self.sum.as_mut() {
            row.as_mut().fill(E::from_f64(0.0));
        }
    }

    /// `∇²(μ_iᵀ f)` at all stages of a step.
    pub(crate) fn curvature<F: Fallback>(
        &mut self,
        work: &mut Work<M, E, S, F>,
        coefficients: &Coefficients<E, S>,
        n: usize,
        step: &Step<M, E, S>,
    ) {
        let Self { backward, mu, entries, .. } = self;
        for (equation, to) in mu.as_mut().iter_mut().enumerate() {
            if let Some(mu) = backward.mu.as_ref().get(slot::<M>(equation)) {
                *to = mu.map(|[mu]| mu);
            }
        }
        work.place(coefficients, n, &step.x, &step.y);
        let Work { points, stage, .. } = work;
        if let Err(call) = E::side_by_side(Curvature::<M, E, S> { points, mu, entries, stage }) {
            let Curvature { points, mu, entries, stage } = call;
            for i in 0..S {
                dispatch(Take { cells: stage.v.as_mut(), from: points.as_ref(), i });
                dispatch(Take { cells: stage.mu.as_mut(), from: mu.as_ref(), i });
                M::hessian::<E>(&stage.v, &stage.mu, &mut stage.hessian);
                dispatch(Give { cells: stage.hessian.as_ref(), to: entries.as_mut(), i });
            }
        }
    }

    /// `sum −= Σ_i D_iᵀ H_i D_i`
    pub(crate) fn subtract<F: Fallback>(&mut self, record: &HessianStep<M, E, S, F>) {
        let Self { g, sum, entries, .. } = self;
        dispatch(Subtract::<M, E, ArrayW<M, E>, S> {
            entries: entries.as_ref(),
            d: Array::flat(record.d.as_ref().as_flattened()),
            g: g.as_mut(),
            sum: sum.as_mut(),
            model: PhantomData,
        });
    }
}

/// `∇²(μᵀ f)` at all stages in one call.
struct Curvature<'a, M: Dae, E: Lanes, const S: usize> {
    points: &'a ArrayV<M, [E; S]>,
    mu: &'a ArrayK<M, [E; S]>,
    entries: &'a mut M::Hessian<[E; S]>,
    stage: &'a mut Stage<M, E::Cell>,
}

impl<M: Dae, E: Lanes, const S: usize> SideBySide<E, S> for Curvature<'_, M, E, S> {
    #[inline(always)]
    fn call<R: Lanes<Cell = [E; S]>>(self) {
        M::hessian::<R>(self.points, self.mu, self.entries);
    }
}

impl<M: Dae, E: Lanes, const S: usize> HessianMemory<M, E, S> {
    /// The result, after the first step, and `more`: second derivatives of an integrand.
    pub(crate) fn collect(&mut self, forward: &ForwardMemory<M, E, S>, more: Option<&[ArrayW<M, E>]>) {
        let (nx, nu) = (M::Shape::NX, M::Shape::NU);
        let Self { result, backward, sum, .. } = self;
        assign(&mut result.first.forward, &forward.result.forward);
        for (to, [from]) in result.first.grad_x0.as_mut_slice().iter_mut().zip(backward.lambda.as_ref()) {
            *to = *from;
        }
        let mut gradient = backward.gradient.as_ref()[nx..].iter();
        for (to, [from]) in result.first.grad_u.as_mut_slice().iter_mut().zip(&mut gradient) {
            *to = *from;
        }
        for (to, [from]) in result.first.grad_p.as_mut_slice().iter_mut().zip(gradient) {
            *to = *from;
        }
        let sum = Lower::<M, E> { sum, more };
        let (u, p) = (nx, nx + nu);
        sum.write(&mut result.h_xx, 0, 0);
        sum.write(&mut result.h_uu, u, u);
        sum.write(&mut result.h_pp, p, p);
        sum.write(&mut result.h_xu, 0, u);
        sum.write(&mut result.h_xp, 0, p);
        sum.write(&mut result.h_up, u, p);
    }
}

/// A symmetric matrix over the directions that have any influence, of which the lower triangle is known.
struct Lower<'a, M: Dae, E: Plain> {
    sum: &'a ArrayW<M, ArrayW<M, E>>,
    /// What an integrand adds, over all directions.
    more: Option<&'a [ArrayW<M, E>]>,
}

/// An element of a symmetric matrix of which the lower triangle is known.
#[inline(always)]
fn element<M: Dae, E: Lanes>(rows: &[ArrayW<M, E>], r: usize, c: usize) -> Option<E> {
    rows.get(r.max(c)).and_then(|row| row.as_ref().get(r.min(c))).copied()
}

impl<M: Dae, E: Lanes> Lower<'_, M, E> {
    /// Its part over the directions from `row` on and those from `column` on, which are not before them.
    fn write<B: Matrix<E>>(&self, to: &mut B, row: usize, column: usize) {
        for (c, to) in to.as_mut_slice().chunks_exact_mut(B::ROWS.max(1)).enumerate() {
            let c = column + c;
            let of_c = Identity::<M>::column(c);
            for (r, to) in to.iter_mut().enumerate() {
                let r = row + r;
                let sum = match (Identity::<M>::column(r), of_c) {
                    (Some(r), Some(c)) => element::<M, E>(self.sum.as_ref(), r, c),
                    _ => None,
                };
                *to = sum.unwrap_or(E::from_f64(0.0));
                if let Some(more) = self.more.and_then(|more| element::<M, E>(more, r, c)) {
                    *to = *to + more;
                }
            }
        }
    }
}

impl<M: Dae, T: Real, const S: usize> HessianMemory<M, T, S> {
    /// # Errors
    /// [`Error::Overflow`]
    pub(crate) fn finish(
        &mut self,
        forward: &ForwardMemory<M, T, S>,
        more: Option<&[ArrayW<M, T>]>,
    ) -> Result<(), Error> {
        self.collect(forward, more);
        let result = &self.result;
        let ForwardAdjoint { grad_x0, grad_u, grad_p, .. } = &result.first;
        for values in [
            grad_x0.as_slice(),
            grad_u.as_slice(),
            grad_p.as_slice(),
            result.h_xx.as_slice(),
            result.h_xu.as_slice(),
            result.h_uu.as_slice(),
            result.h_xp.as_slice(),
            result.h_up.as_slice(),
            result.h_pp.as_slice(),
        ] {
            check(values, 0)?;
        }
        Ok(())
    }
}

/// `sum −= Σ_i D_iᵀ H_i D_i`, the lower triangle, with `H_i` given by its own.
struct Subtract<'a, M, E, R, const S: usize> {
    entries: &'a [[E; S]],
    d: &'a [E],
    g: &'a mut [[[E; PANEL]; S]],
    sum: &'a mut [R],
    model: PhantomData<M>,
}

impl<M: Dae, E: Lanes, R: Array<E>, const S: usize> Kernel for Subtract<'_, M, E, R, S> {
    type Number = E;
    type Output = ();
    const WIDE: bool = is_long::<M, S>();
    #[inline(always)]
    fn run<A: Arithmetic>(mut self) {
        panels!(M::STRUCTURE.directions.len(), E, column, W => self.panel::<A, W>(column));
    }
}

impl<M: Dae, E: Lanes, R: Array<E>, const S: usize> Subtract<'_, M, E, R, S> {
    #[inline(always)]
    fn panel<A: Arithmetic, const W: usize>(&mut self, column: usize) {
        let rows = M::STRUCTURE.curved.len() * S;
        let (d, _) = panel::<E, W>(self.d, column, rows).as_chunks::<S>();
        let g = self.g.as_flattened_mut().as_flattened_mut();
        let (g, _) = panel_mut::<E, W>(g, 0, rows).as_chunks_mut::<S>();
        // G = −H D, row by row; all stages in registers, or two of them where numbers are registers themselves.
        if const { size_of::<E>() <= 8 || S <= 2 } {
            multiply::<A, M, E, S, S, W>(self.entries, d, g, 0);
        } else {
            for stage in (0..S).step_by(2) {
                multiply::<A, M, E, S, 2, W>(self.entries, d, g, stage);
            }
        }
        let g = g.as_flattened();
        panels!(M::STRUCTURE.directions.len(), E, row, V => {
            if row >= column {
                let d = panel::<E, V>(self.d, row, rows);
                if const { size_of::<E>() > 8 && V > 2 } {
                    tiles::<A, E, R, V, 2, 1, W>(d, g, self.sum, row, column);
                } else if const { size_of::<E>() > 8 } {
                    tiles::<A, E, R, V, V, 1, W>(d, g, self.sum, row, column);
                } else if const { V > 4 && A::WIDE } {
                    tiles::<A, E, R, V, 8, 1, W>(d, g, self.sum, row, column);
                } else if const { V > 4 } {
                    tiles::<A, E, R, V, 4, 1, W>(d, g, self.sum, row, column);
                } else if const { V > 2 } {
                    tiles::<A, E, R, V, 4, 2, W>(d, g, self.sum, row, column);
                } else {
                    tiles::<A, E, R, V, V, 4, W>(d, g, self.sum, row, column);
                }
            }
        });
    }
}

/// `G = −H D` at `N` stages, from a stage on.
#[inline(always)]
fn multiply<A: Arithmetic, M: Dae, E: Lanes, const S: usize, const N: usize, const W: usize>(
    entries: &[[E; S]],
    d: &[[[E; W]; S]],
    g: &mut [[[E; W]; S]],
    stage: usize,
) {
    // Without a slice for each row, which would have to be found.
    let (mut packet, mut terms) = ([[E::from_f64(0.0); W]; N], M::STRUCTURE.symmetric.iter());
    let mut next = terms.next();
    while let Some(term) = next {
        if let (Some(values), Some(d)) = (entries.get(term.entry as usize), d.get(term.column as usize)) {
            subtract_stages::<A, E, N, W>(&mut packet, from(values, stage), from(d, stage));
        }
        next = terms.next();
        if let Some(next) = next
            && next.row == term.row
        {
            continue;
        }
        if let Some(rows) = g.get_mut(term.row as usize).and_then(|rows| rows.get_mut(stage..)) {
            for (to, packet) in rows.iter_mut().zip(&packet) {
                *to = *packet;
            }
        }
        packet = [[E::from_f64(0.0); W]; N];
    }
}

/// `packet − values d` at `N` stages.
#[inline(always)]
fn subtract_stages<A: Arithmetic, E: Lanes, const N: usize, const W: usize>(
    packet: &mut [[E; W]; N],
    values: &[E],
    d: &[[E; W]],
) {
    if const { W == 1 }
        && let Some(packet) = packet.as_flattened_mut().first_chunk_mut::<N>()
        && let (Some(values), Some(d)) = (values.first_chunk(), d.as_flattened().first_chunk())
    {
        // The stages of one column side by side.
        A::subtract_products(packet, values, d);
        return;
    }
    for ((packet, &value), d) in packet.iter_mut().zip(values).zip(d) {
        A::subtract_row(packet, value, d);
    }
}

/// The stages from one of them on.
#[inline(always)]
fn from<V>(stages: &[V], first: usize) -> &[V] {
    stages.get(first..).unwrap_or_default()
}

/// `sum −= Dᵀ G` for the panels of `D` and of `−G` that begin with a row and a column; each tile is in registers while it goes
/// through all variables at all stages, in as many strands as hide how long an addition takes. Above the diagonal it writes
/// what nobody reads.
#[inline(always)]
fn tiles<
    A: Arithmetic,
    E: Lanes,
    R: Array<E>,
    const V: usize,
    const ROWS: usize,
    const STRANDS: usize,
    const W: usize,
>(
    d: &[[E; V]],
    g: &[[E; W]],
    sum: &mut [R],
    row: usize,
    column: usize,
) {
    for t in 0..V / ROWS {
        let mut tiles = [[[E::from_f64(0.0); W]; ROWS]; STRANDS];
        let ((d, last_d), (g, last_g)) = (d.as_chunks::<STRANDS>(), g.as_chunks::<STRANDS>());
        for (d, g) in d.iter().zip(g) {
            for ((tile, d), g) in tiles.iter_mut().zip(d).zip(g) {
                subtract_outer::<A, E, V, ROWS, W>(tile, d, g, t);
            }
        }
        let Some((tile, others)) = tiles.split_first_mut() else { return };
        for (d, g) in last_d.iter().zip(last_g) {
            subtract_outer::<A, E, V, ROWS, W>(tile, d, g, t);
        }
        for other in others {
            for (to, from) in tile.as_flattened_mut().iter_mut().zip(other.as_flattened()) {
                *to = *to + *from;
            }
        }
        for (tile, sum) in tile.iter().zip(sum.iter_mut().skip(row + t * ROWS)) {
            let columns = sum.as_mut().get_mut(column..).and_then(|columns| columns.first_chunk_mut::<W>());
            for (sum, &tile) in columns.into_iter().flatten().zip(tile) {
                *sum = *sum - tile;
            }
        }
    }
}

/// `tile − d gᵀ`, of `ROWS` elements of `d`.
#[inline(always)]
fn subtract_outer<A: Arithmetic, E: Lanes, const V: usize, const ROWS: usize, const W: usize>(
    tile: &mut [[E; W]; ROWS],
    d: &[E; V],
    g: &[E; W],
    t: usize,
) {
    let Some(d) = d.as_chunks::<ROWS>().0.get(t) else { return };
    for (tile, &d) in tile.iter_mut().zip(d) {
        A::subtract_row(tile, d, g);
    }
}
