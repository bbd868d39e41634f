//! Forward sensitivities: implicit function theorem at the converged stages.
//!
//! ```text
//! J dK = −(f_x,i V_n + f_w,i)        V_{n+1} = V_n + h Σ_i b_i dk_i
//! ```
//!
//! `V_n = dx_n/dw`, one row per state, all directions `w` side by side.

use super::evaluate::entries;
use super::record::{Coefficients, Work, copy};
use super::step::check;
use crate::error::Error;
use crate::linalg::{Arithmetic, Kernel, axpy, dispatch, slot};
use crate::model::{ArrayK, ArrayW, ArrayX, Dae};
use crate::result::{DenseForward, Directional, Forward, ForwardAdjoint, Seeds};
use crate::scalar::{Lanes, Real};
use crate::shape::{Array, Matrix, Plain, Shape};
use crate::statistics::Statistics;
use bytemuck::Zeroable;
use core::marker::PhantomData;
use core::slice::{from_mut, from_ref};

/// Derivatives of one step in directions that are the elements of `R`.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct Sweep<M: Dae, R: Plain, const S: usize> {
    /// `dx_n/dw` at the start of the step.
    pub(crate) v: ArrayX<M, R>,
    /// `d(k, z)/dw` at its stages.
    pub(crate) dy: ArrayK<M, [R; S]>,
}
copy!([M: Dae, R: Plain, const S: usize] Sweep<M, R, S>);

/// How the directions depend on `w`.
pub(crate) trait Directions<E, R> {
    /// `row += factor · dw_index`
    fn add(&self, index: usize, factor: E, row: &mut R);
}

/// One direction for each element of `w`.
pub(crate) struct Identity;

impl<E: Lanes, R: Array<E>> Directions<E, R> for Identity {
    #[inline(always)]
    fn add(&self, index: usize, factor: E, row: &mut R) {
        if let Some(element) = row.as_mut().get_mut(index) {
            *element = *element + factor;
        }
    }
}

/// The rows of a matrix: each direction is a column.
pub(crate) struct Rows<'a, R>(pub &'a [R]);

impl<E: Lanes, R: Array<E>> Directions<E, R> for Rows<'_, R> {
    #[inline(always)]
    fn add(&self, index: usize, factor: E, row: &mut R) {
        if let Some(direction) = self.0.get(index) {
            axpy(factor, direction.as_ref(), row.as_mut());
        }
    }
}

impl<M: Dae, R: Plain, const S: usize> Sweep<M, R, S> {
    /// `V_0`
    pub(crate) fn start<E: Lanes>(&mut self, directions: &impl Directions<E, R>)
    where
        R: Array<E>,
    {
        for (index, row) in self.v.as_mut().iter_mut().enumerate() {
            row.as_mut().fill(E::from_f64(0.0));
            directions.add(index, E::from_f64(1.0), row);
        }
    }

    /// `dK` of a step that is linearised, the `first` of the interval or a later one.
    pub(crate) fn stages<E: Lanes>(
        &mut self,
        work: &Work<M, E, S>,
        directions: &impl Directions<E, R>,
        first: bool,
    ) where
        R: Array<E>,
    {
        let Self { v, dy } = self;
        let (v, jacobian) = (v.as_ref(), work.linear.jacobian.as_ref());
        dispatch(RightHandSide::<M, E, R, _, S> {
            v,
            jacobian,
            directions,
            first,
            dy: dy.as_mut(),
            model: PhantomData,
        });
        work.linear.factors.solve(dy);
    }

    /// `V_{n+1}`
    pub(crate) fn advance<E: Lanes>(&mut self, coefficients: &Coefficients<E, S>, h: E)
    where
        R: Array<E>,
    {
        dispatch(Combine { to: self.v.as_mut(), dy: self.dy.as_ref(), weights: &coefficients.b, h });
    }

    /// Derivatives `row` of `x` at the point of the step where the weights are `weights`.
    pub(crate) fn differential<E: Lanes>(&self, state: usize, h: E, weights: &[E; S], row: &mut R)
    where
        R: Array<E>,
    {
        *row = self.v[state];
        let (to, dy) = (from_mut(row), from_ref(&self.dy[state]));
        dispatch(Combine { to, dy, weights, h });
    }

    /// Derivatives `row` of `z` at the point of the step where the Lagrange polynomials are `lagrange`.
    pub(crate) fn algebraic<E: Lanes>(&self, state: usize, lagrange: &[E; S], row: &mut R)
    where
        R: Array<E>,
    {
        row.as_mut().fill(E::from_f64(0.0));
        let (to, dy) = (from_mut(row), from_ref(&self.dy[M::Shape::NX + state]));
        dispatch(Combine { to, dy, weights: lagrange, h: E::from_f64(1.0) });
    }
}

/// `−(f_x,i V_n + f_w,i)`, equations in their slots.
struct RightHandSide<'a, M, E, R, D, const S: usize> {
    v: &'a [R],
    jacobian: &'a [[E; S]],
    directions: &'a D,
    first: bool,
    dy: &'a mut [[R; S]],
    model: PhantomData<M>,
}

impl<M: Dae, E: Lanes, R: Array<E>, D: Directions<E, R>, const S: usize> Kernel
    for RightHandSide<'_, M, E, R, D, S>
{
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { v, jacobian, directions, first, dy, .. } = self;
        let (structure, nx) = (&M::STRUCTURE, M::Shape::NX);
        let blocks = structure.blocks;
        // Of the first variable that is a direction, `u_0`: columns of the Jacobian minus this are `w`.
        let shift = nx + M::Shape::NZ;
        for row in dy.as_flattened_mut() {
            row.as_mut().fill(E::from_f64(0.0));
        }
        for (r, c, values) in entries(structure, jacobian, blocks[1], blocks[2]) {
            let Some(rows) = dy.get_mut(slot::<M>(r)) else { continue };
            if first {
                // The rows of V_0 are the directions.
                for (row, &value) in rows.iter_mut().zip(values) {
                    directions.add(c - nx, -value, row);
                }
            } else if let Some(v) = v.get(c - nx) {
                for (row, &value) in rows.iter_mut().zip(values) {
                    for (to, &from) in row.as_mut().iter_mut().zip(v.as_ref()) {
                        *to = A::subtract(*to, value, from);
                    }
                }
            }
        }
        for (r, c, values) in entries(structure, jacobian, blocks[3], blocks[5]) {
            let Some(rows) = dy.get_mut(slot::<M>(r)) else { continue };
            for (row, &value) in rows.iter_mut().zip(values) {
                directions.add(c - shift, -value, row);
            }
        }
    }
}

/// `to += h Σ_i weight_i dy_i`, row after row.
struct Combine<'a, E, R, const S: usize> {
    to: &'a mut [R],
    dy: &'a [[R; S]],
    weights: &'a [E; S],
    h: E,
}

impl<E: Lanes, R: Array<E>, const S: usize> Kernel for Combine<'_, E, R, S> {
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        for (to, dy) in self.to.iter_mut().zip(self.dy) {
            for (&weight, dy) in self.weights.iter().zip(dy) {
                for (to, &dy) in to.as_mut().iter_mut().zip(dy.as_ref()) {
                    *to = A::subtract(*to, -(self.h * weight), dy);
                }
            }
        }
    }
}

/// Memory of forward sensitivities.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct ForwardMemory<M: Dae, T: Plain, const S: usize> {
    pub(crate) result: ForwardAdjoint<M, T>,
    pub(crate) dense: DenseForward<M, T>,
    pub(crate) sweep: Sweep<M, ArrayW<M, T>, S>,
    pub(crate) row: ArrayW<M, T>,
}
copy!([M: Dae, T: Plain, const S: usize] ForwardMemory<M, T, S>);

impl<M: Dae, E: Lanes, const S: usize> ForwardMemory<M, E, S> {
    /// `V_n`
    pub(crate) fn begin(&mut self, work: &Work<M, E, S>, coefficients: &Coefficients<E, S>, n: usize) {
        if n == 0 {
            self.sweep.start(&Identity);
        } else {
            self.sweep.advance(coefficients, work.inputs.time.step);
        }
    }

    /// The derivatives of the stages, by the factors that are there; whether they satisfy their equations.
    pub(crate) fn stages(
        &mut self,
        work: &mut Work<M, E, S>,
        coefficients: &Coefficients<E, S>,
        n: usize,
    ) -> E::Mask {
        self.sweep.stages(work, &Identity, n == 0);
        work.verify_forward(&self.sweep, coefficients, &Identity)
    }

    /// What a step contributes to the result.
    pub(crate) fn collect(
        &mut self,
        work: &Work<M, E, S>,
        coefficients: &Coefficients<E, S>,
        n: usize,
        count: usize,
    ) {
        let Self { result, sweep, row, .. } = self;
        let result = &mut result.forward;
        if n == 0 {
            for state in 0..M::Shape::NZ {
                sweep.algebraic(state, &coefficients.start, row);
                split(row.as_ref(), state, &mut result.dz0_dx0, &mut result.dz0_du, &mut result.dz0_dp);
            }
        }
        if n + 1 == count {
            for state in 0..M::Shape::NZ {
                sweep.algebraic(state, &coefficients.end, row);
                split(row.as_ref(), state, &mut result.dz_dx0, &mut result.dz_du, &mut result.dz_dp);
            }
            for state in 0..M::Shape::NX {
                sweep.differential(state, work.inputs.time.step, &coefficients.b, row);
                split(row.as_ref(), state, &mut result.dx_dx0, &mut result.dx_du, &mut result.dx_dp);
            }
        }
    }
}

impl<M: Dae, T: Real, const S: usize> ForwardMemory<M, T, S> {
    /// After a step that is linearised.
    ///
    /// # Errors
    /// [`Error::Singular`]
    pub(crate) fn step(
        &mut self,
        work: &mut Work<M, T, S>,
        coefficients: &Coefficients<T, S>,
        n: usize,
        count: usize,
        statistics: &mut Statistics,
    ) -> Result<(), Error> {
        self.begin(work, coefficients, n);
        if !self.stages(work, coefficients, n) && work.linear.factors.is_planned() {
            work.factor_pivoted(coefficients, n, 0, statistics)?;
            self.stages(work, coefficients, n);
        }
        self.collect(work, coefficients, n, count);
        Ok(())
    }

    /// # Errors
    /// [`Error::Overflow`]
    pub(crate) fn finish(&mut self, work: &Work<M, T, S>, step: usize) -> Result<(), Error> {
        self.result.forward.nominal = work.result;
        check_result(&self.result.forward, step)
    }
}

/// # Errors
/// [`Error::Overflow`] of the first derivative that is not finite.
pub(crate) fn check_result<M: Dae, T: Real>(result: &Forward<M, T>, step: usize) -> Result<(), Error> {
    for values in [
        result.dx_dx0.as_slice(),
        result.dx_du.as_slice(),
        result.dx_dp.as_slice(),
        result.dz_dx0.as_slice(),
        result.dz_du.as_slice(),
        result.dz_dp.as_slice(),
        result.dz0_dx0.as_slice(),
        result.dz0_du.as_slice(),
        result.dz0_dp.as_slice(),
    ] {
        check(values, step)?;
    }
    Ok(())
}

impl<M: Dae, E: Lanes, const S: usize> ForwardMemory<M, E, S> {
    /// `∇(λᵀx)` from the derivatives of `x`.
    pub(crate) fn multiply(&mut self, lambda: &[E]) {
        let ForwardAdjoint { forward, grad_x0, grad_u, grad_p } = &mut self.result;
        for (matrix, gradient) in [
            (forward.dx_dx0.as_slice(), grad_x0.as_mut_slice()),
            (forward.dx_du.as_slice(), grad_u.as_mut_slice()),
            (forward.dx_dp.as_slice(), grad_p.as_mut_slice()),
        ] {
            dispatch(Product { lambda, matrix, gradient });
        }
    }
}

impl<M: Dae, T: Real, const S: usize> ForwardMemory<M, T, S> {
    /// `∇(λᵀx)` from the derivatives of `x`.
    ///
    /// # Errors
    /// [`Error::Overflow`]
    pub(crate) fn gradient(&mut self, lambda: &[T]) -> Result<(), Error> {
        self.multiply(lambda);
        let ForwardAdjoint { grad_x0, grad_u, grad_p, .. } = &self.result;
        check(grad_x0.as_slice(), 0)?;
        check(grad_u.as_slice(), 0)?;
        check(grad_p.as_slice(), 0)
    }
}

/// `gradientᵀ = λᵀ S`, with `S` column after column.
struct Product<'a, E> {
    lambda: &'a [E],
    matrix: &'a [E],
    gradient: &'a mut [E],
}

impl<E: Lanes> Kernel for Product<'_, E> {
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { lambda, matrix, gradient } = self;
        gradient.fill(E::from_f64(0.0));
        // A model without states has no columns to go through.
        let columns = matrix.chunks_exact(lambda.len().max(1));
        for (gradient, column) in gradient.iter_mut().zip(columns) {
            for (&lambda, &s) in lambda.iter().zip(column) {
                *gradient = *gradient + lambda * s;
            }
        }
    }
}

/// A row over the directions `(x₀, u, p)`, written to row `r` of three matrices.
pub(crate) fn split<T: Plain>(
    row: &[T],
    r: usize,
    x: &mut impl Matrix<T>,
    u: &mut impl Matrix<T>,
    p: &mut impl Matrix<T>,
) {
    let mut values = row.iter();
    copy_row(&mut values, r, x);
    copy_row(&mut values, r, u);
    copy_row(&mut values, r, p);
}

fn copy_row<'a, T: Plain, A: Matrix<T>>(values: &mut impl Iterator<Item = &'a T>, r: usize, to: &mut A) {
    for column in 0..A::COLUMNS {
        if let Some(value) = values.next() {
            to[(r, column)] = *value;
        }
    }
}

/// Memory of sensitivities in `C` directions.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct DirectionalMemory<M: Dae, T: Plain, const S: usize, const C: usize> {
    pub(crate) result: Directional<M, T, C>,
    pub(crate) sweep: Sweep<M, [T; C], S>,
    /// The seeds, one row for each element of `w`.
    pub(crate) seeds: ArrayW<M, [T; C]>,
}
copy!([M: Dae, T: Plain, const S: usize, const C: usize] DirectionalMemory<M, T, S, C>);

impl<M: Dae, T: Real, const S: usize, const C: usize> DirectionalMemory<M, T, S, C> {
    pub(crate) fn seed(&mut self, seeds: &Seeds<M, T, C>) {
        let (nx, nu) = (M::Shape::NX, M::Shape::NU);
        for (w, row) in self.seeds.as_mut().iter_mut().enumerate() {
            *row = core::array::from_fn(|column| {
                if w < nx {
                    seeds.x0[(w, column)]
                } else if w < nx + nu {
                    seeds.u[(w - nx, column)]
                } else {
                    seeds.p[(w - nx - nu, column)]
                }
            });
        }
    }

    /// After a step that is linearised.
    ///
    /// # Errors
    /// [`Error::Singular`]
    pub(crate) fn step(
        &mut self,
        work: &mut Work<M, T, S>,
        coefficients: &Coefficients<T, S>,
        n: usize,
        count: usize,
        statistics: &mut Statistics,
    ) -> Result<(), Error> {
        let Self { result, sweep, seeds } = self;
        let directions = Rows(seeds.as_ref());
        if n == 0 {
            sweep.start(&directions);
        } else {
            sweep.advance(coefficients, work.inputs.time.step);
        }
        sweep.stages(work, &directions, n == 0);
        if !work.verify_forward(sweep, coefficients, &directions) && work.linear.factors.is_planned() {
            work.factor_pivoted(coefficients, n, 0, statistics)?;
            sweep.stages(work, &directions, n == 0);
        }
        let mut row = [T::ZERO; C];
        for state in 0..M::Shape::NZ {
            if n == 0 {
                sweep.algebraic(state, &coefficients.start, &mut row);
                copy_row(&mut row.iter(), state, &mut result.dz0);
            }
            if n + 1 == count {
                sweep.algebraic(state, &coefficients.end, &mut row);
                copy_row(&mut row.iter(), state, &mut result.dz);
            }
        }
        if n + 1 == count {
            for state in 0..M::Shape::NX {
                sweep.differential(state, work.inputs.time.step, &coefficients.b, &mut row);
                copy_row(&mut row.iter(), state, &mut result.dx);
            }
        }
        Ok(())
    }

    /// # Errors
    /// [`Error::Overflow`]
    pub(crate) fn finish(&mut self, work: &Work<M, T, S>, step: usize) -> Result<(), Error> {
        self.result.nominal = work.result;
        check(self.result.dx.as_slice(), step)?;
        check(self.result.dz.as_slice(), step)?;
        check(self.result.dz0.as_slice(), step)
    }
}
