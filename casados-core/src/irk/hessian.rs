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
use super::evaluate::{Give, Take, not_finite};
use super::forward::{ForwardMemory, Sweep};
use super::record::{Coefficients, Linearization, Stage, Step, Work, copy};
use super::step::check;
use crate::error::{Error, Place, Quantity};
use crate::linalg::{Arithmetic, Kernel, axpy, dispatch, slot};
use crate::model::{ArrayK, ArrayV, ArrayW, Dae, Pattern};
use crate::result::{ForwardAdjoint, Hessian};
use crate::scalar::{Lanes, Real, SideBySide};
use crate::shape::assign;
use crate::shape::{Array, Matrix, Plain, Shape};
use crate::statistics::Statistics;
use bytemuck::Zeroable;

/// Memory of second-order sensitivities.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct HessianMemory<M: Dae, T: Plain, const S: usize> {
    pub(crate) result: Hessian<M, T>,
    pub(crate) backward: Backward<M, T, S, 1>,
    /// `D` at one stage.
    d: ArrayV<M, ArrayW<M, T>>,
    /// `G = H D` at one stage.
    g: ArrayV<M, ArrayW<M, T>>,
    /// The Hessian over `w`, its lower triangle.
    sum: ArrayW<M, ArrayW<M, T>>,
    /// `μ` at all stages, in the order of the equations.
    mu: ArrayK<M, [T; S]>,
    /// Entries of `∇²(μᵀ f)` at all stages.
    entries: M::Hessian<[T; S]>,
}
copy!([M: Dae, T: Plain, const S: usize] HessianMemory<M, T, S>);

/// What the way back needs of a step.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct HessianStep<M: Dae, T: Plain, const S: usize> {
    linear: Linearization<M, T, S>,
    sweep: Sweep<M, ArrayW<M, T>, S>,
}
copy!([M: Dae, T: Plain, const S: usize] HessianStep<M, T, S>);

impl<M: Dae, E: Lanes, const S: usize> HessianStep<M, E, S> {
    /// Remembers a step on the way forth.
    pub(crate) fn record(&mut self, work: &Work<M, E, S>, forward: &ForwardMemory<M, E, S>) {
        self.linear.copy_from(&work.linear);
        assign(&mut self.sweep, &forward.sweep);
    }

    /// Brings back what was remembered: the linearisation, and the derivatives of the stages.
    pub(crate) fn recall(&self, work: &mut Work<M, E, S>) -> &Sweep<M, ArrayW<M, E>, S> {
        work.linear.copy_from(&self.linear);
        &self.sweep
    }
}

impl<M: Dae, T: Real, const S: usize> HessianMemory<M, T, S> {
    /// The way back, with the derivatives of the `last` step, which is not recorded.
    ///
    /// # Errors
    /// A second derivative of the model that is not finite, a singular matrix.
    #[allow(clippy::too_many_arguments)]
    pub(crate) fn run(
        &mut self,
        work: &mut Work<M, T, S>,
        coefficients: &Coefficients<T, S>,
        steps: &[Step<M, T, S>],
        records: &[HessianStep<M, T, S>],
        last: &Sweep<M, ArrayW<M, T>, S>,
        seed: &[T],
        statistics: &mut Statistics,
        mut along: Along<'_, '_, M, T>,
    ) -> Result<(), Error> {
        self.begin(seed);
        for (n, (step, record)) in steps.iter().zip(records).enumerate().rev() {
            let mut sweep = last;
            if n + 1 < steps.len() {
                sweep = record.recall(work);
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
            self.subtract(sweep, coefficients, work.inputs.time.step);
        }
        Ok(())
    }
}

impl<M: Dae, E: Lanes, const S: usize> HessianMemory<M, E, S> {
    /// `sum += Σ Dᵀ ∇² D` of an integrand.
    pub(crate) fn add(&mut self, second: &[ArrayW<M, E>]) {
        for (sum, second) in self.sum.as_mut().iter_mut().zip(second) {
            axpy(E::from_f64(1.0), second.as_ref(), sum.as_mut());
        }
    }

    /// Before the last step.
    pub(crate) fn begin(&mut self, seed: &[E]) {
        self.backward.start(seed);
        for row in self.sum.as_mut() {
            row.as_mut().fill(E::from_f64(0.0));
        }
    }

    /// `∇²(μ_iᵀ f)` at all stages of a step.
    pub(crate) fn curvature(
        &mut self,
        work: &mut Work<M, E, S>,
        coefficients: &Coefficients<E, S>,
        n: usize,
        step: &Step<M, E, S>,
    ) {
        let Self { backward, mu, entries, .. } = self;
        for (equation, to) in mu.as_mut().iter_mut().enumerate() {
            *to = backward.mu[slot::<M>(equation)].map(|[mu]| mu);
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
    pub(crate) fn subtract(
        &mut self,
        sweep: &Sweep<M, ArrayW<M, E>, S>,
        coefficients: &Coefficients<E, S>,
        h: E,
    ) {
        let Self { d, g, sum, entries, .. } = self;
        let curved = M::STRUCTURE.curved;
        for stage in 0..S {
            let (v, dy, nx, nz) = (sweep.v.as_ref(), sweep.dy.as_ref(), M::Shape::NX, M::Shape::NZ);
            dispatch(Rows { curved, nx, nz, v, dy, a: &coefficients.a[stage], h, stage, d: d.as_mut() });
            dispatch(Subtract {
                pattern: M::STRUCTURE.hessian,
                curved,
                entries: entries.as_ref(),
                stage,
                d: d.as_ref(),
                g: g.as_mut(),
                sum: sum.as_mut(),
            });
        }
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
    /// The result, after the first step.
    pub(crate) fn collect(&mut self, forward: &ForwardMemory<M, E, S>) {
        let (nx, nu, np) = (M::Shape::NX, M::Shape::NU, M::Shape::NP);
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
        symmetric(&mut result.h_xx, sum.as_ref(), 0);
        symmetric(&mut result.h_uu, sum.as_ref(), nx);
        symmetric(&mut result.h_pp, sum.as_ref(), nx + nu);
        for x in 0..nx {
            for u in 0..nu {
                result.h_xu[(x, u)] = sum[nx + u][x];
            }
            for p in 0..np {
                result.h_xp[(x, p)] = sum[nx + nu + p][x];
            }
        }
        for u in 0..nu {
            for p in 0..np {
                result.h_up[(u, p)] = sum[nx + nu + p][nx + u];
            }
        }
    }
}

impl<M: Dae, T: Real, const S: usize> HessianMemory<M, T, S> {
    /// # Errors
    /// [`Error::Overflow`]
    pub(crate) fn finish(&mut self, forward: &ForwardMemory<M, T, S>) -> Result<(), Error> {
        self.collect(forward);
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

/// The rows of `D` at a stage that enter second derivatives.
pub(super) struct Rows<'a, E, R, const S: usize> {
    pub curved: &'static [u32],
    pub nx: usize,
    pub nz: usize,
    pub v: &'a [R],
    pub dy: &'a [[R; S]],
    pub a: &'a [E; S],
    pub h: E,
    pub stage: usize,
    pub d: &'a mut [R],
}

impl<E: Lanes, R: Array<E>, const S: usize> Kernel for Rows<'_, E, R, S> {
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { curved, nx, nz, v, dy, a, h, stage, d } = self;
        for &variable in curved {
            let variable = variable as usize;
            let Some(row) = d.get_mut(variable) else { continue };
            if variable < nx {
                if let Some(dk) = dy.get(variable) {
                    *row = dk[stage];
                }
            } else if variable < 2 * nx {
                let (Some(dk), Some(v)) = (dy.get(variable - nx), v.get(variable - nx)) else { continue };
                *row = *v;
                for (&a, dk) in a.iter().zip(dk) {
                    for (to, &dk) in row.as_mut().iter_mut().zip(dk.as_ref()) {
                        *to = A::subtract(*to, -(h * a), dk);
                    }
                }
            } else if variable < 2 * nx + nz {
                if let Some(dz) = dy.get(variable - nx) {
                    *row = dz[stage];
                }
            } else {
                row.as_mut().fill(E::from_f64(0.0));
                if let Some(element) = row.as_mut().get_mut(variable - nx - nz) {
                    *element = E::from_f64(1.0);
                }
            }
        }
    }
}

/// `sum −= Dᵀ H D` at a stage, the lower triangle, with `H` given by its own.
pub(crate) struct Subtract<'a, E, R, const S: usize> {
    pub pattern: Pattern,
    pub curved: &'static [u32],
    pub entries: &'a [[E; S]],
    pub stage: usize,
    pub d: &'a [R],
    pub g: &'a mut [R],
    pub sum: &'a mut [R],
}

impl<E: Lanes, R: Array<E>, const S: usize> Kernel for Subtract<'_, E, R, S> {
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { pattern, curved, entries, stage, d, g, sum } = self;
        for &row in curved {
            if let Some(row) = g.get_mut(row as usize) {
                row.as_mut().fill(E::from_f64(0.0));
            }
        }
        // G = H D
        let places = pattern.rows.iter().zip(pattern.columns);
        for ((&row, &column), values) in places.zip(entries) {
            let Some(&value) = values.get(stage) else { continue };
            add::<A, E, R>(value, d, column, g, row);
            if row != column {
                add::<A, E, R>(value, d, row, g, column);
            }
        }
        // Tiles of the triangle, each over all curved variables while it is in registers. The last ones lie over
        // those before, and leave out what these have done.
        // Of numbers that are registers themselves, narrow ones.
        let wide = const { size_of::<E>() <= 8 };
        let rows = if R::LEN < 4 { 1 } else { 4 };
        let mut row = 0;
        while row < R::LEN {
            let start = row.min(R::LEN - rows);
            let mut column = 0;
            while column < start + rows {
                let skip = [row - start, 0];
                if wide && column + 8 <= R::LEN && rows == 4 {
                    tile::<A, E, R, 4, 8>(curved, d, g, sum, [start, column], skip);
                    column += 8;
                } else if wide && R::LEN >= 8 && column + 4 < R::LEN {
                    let at = R::LEN - 8;
                    tile::<A, E, R, 4, 8>(curved, d, g, sum, [start, at], [skip[0], column - at]);
                    column = R::LEN;
                } else if !wide && rows == 4 {
                    let at = column.min(R::LEN - 2);
                    tile::<A, E, R, 4, 2>(curved, d, g, sum, [start, at], [skip[0], column - at]);
                    column = at + 2;
                } else if rows == 4 {
                    let at = column.min(R::LEN - 4);
                    tile::<A, E, R, 4, 4>(curved, d, g, sum, [start, at], [skip[0], column - at]);
                    column = at + 4;
                } else {
                    tile::<A, E, R, 1, 1>(curved, d, g, sum, [start, column], skip);
                    column += 1;
                }
            }
            row = start + rows;
        }
    }
}

/// `g_to += value · d_from`
#[inline(always)]
fn add<A: Arithmetic, E: Lanes, R: Array<E>>(value: E, d: &[R], from: u32, g: &mut [R], to: u32) {
    let (Some(from), Some(to)) = (d.get(from as usize), g.get_mut(to as usize)) else { return };
    let value = -value;
    for (to, &from) in to.as_mut().iter_mut().zip(from.as_ref()) {
        *to = A::subtract(*to, value, from);
    }
}

/// A tile of `sum −= Dᵀ G` from a row and a column on, but for the first ones that are to be skipped; above the diagonal
/// it may write what nobody reads.
#[inline(always)]
fn tile<A: Arithmetic, E: Lanes, R: Array<E>, const ROWS: usize, const COLUMNS: usize>(
    curved: &[u32],
    d: &[R],
    g: &[R],
    sum: &mut [R],
    [row, column]: [usize; 2],
    skip: [usize; 2],
) {
    let mut tile = [[E::from_f64(0.0); COLUMNS]; ROWS];
    for &variable in curved {
        let (Some(d), Some(g)) = (d.get(variable as usize), g.get(variable as usize)) else { continue };
        let (Some(d), Some(g)) = (d.as_ref().get(row..), g.as_ref().get(column..)) else { continue };
        let (Some(d), Some(g)) = (d.first_chunk::<ROWS>(), g.first_chunk::<COLUMNS>()) else { continue };
        for (tile, &d) in tile.iter_mut().zip(d) {
            A::subtract_row(tile, d, g);
        }
    }
    for (tile, sum) in tile.iter().zip(sum.iter_mut().skip(row)).skip(skip[0]) {
        for (&tile, sum) in tile.iter().zip(sum.as_mut().iter_mut().skip(column)).skip(skip[1]) {
            *sum = *sum + tile;
        }
    }
}

/// A block on the diagonal, from its lower triangle.
pub(crate) fn symmetric<T: Plain, R: Array<T>, A: Matrix<T>>(block: &mut A, lower: &[R], offset: usize) {
    for r in 0..A::ROWS {
        for c in 0..=r {
            let value = lower[offset + r][offset + c];
            block[(r, c)] = value;
            block[(c, r)] = value;
        }
    }
}
