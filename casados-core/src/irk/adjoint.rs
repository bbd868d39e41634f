//! Adjoint sensitivities: backwards over the steps.
//!
//! ```text
//! Jᵀ μ = h (b ⊗ λ_{n+1}, 0)        λ_n = λ_{n+1} − Σ_i f_x,iᵀ μ_i        λ_w −= Σ_i f_w,iᵀ μ_i
//! ```

use super::evaluate::entries;
use super::record::{Coefficients, Linearization, Work, copy};
use super::step::check;
use crate::error::Error;
use crate::linalg::{axpy, slot};
use crate::model::{ArrayK, ArrayW, ArrayX, Dae};
use crate::result::Adjoint;
use crate::scalar::Real;
use crate::shape::{Matrix, Plain, Shape};
use bytemuck::Zeroable;

/// The adjoint of `C` seeds while it goes backwards.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct Backward<M: Dae, T: Plain, const S: usize, const C: usize> {
    /// `λ_n`
    pub(crate) lambda: ArrayX<M, [T; C]>,
    /// `λ_w`; the first `NX` rows stay zero.
    pub(crate) gradient: ArrayW<M, [T; C]>,
    /// `μ`, one row per slot and stage.
    pub(crate) mu: ArrayK<M, [[T; C]; S]>,
}
copy!([M: Dae, T: Plain, const S: usize, const C: usize] Backward<M, T, S, C>);

impl<M: Dae, T: Real, const S: usize, const C: usize> Backward<M, T, S, C> {
    /// `λ_N`: seeds in column-major order.
    pub(crate) fn start(&mut self, seeds: &[T]) {
        let nx = M::Shape::NX;
        for (state, row) in self.lambda.as_mut().iter_mut().enumerate() {
            *row = core::array::from_fn(|column| seeds[column * nx + state]);
        }
        self.gradient.as_mut().fill([T::ZERO; C]);
    }

    /// `λ_n` from `λ_{n+1}`.
    pub(crate) fn step(&mut self, linear: &Linearization<M, T, S>, coefficients: &Coefficients<T, S>, h: T) {
        let (blocks, nx) = (M::STRUCTURE.blocks, M::Shape::NX);
        let shift = nx + M::Shape::NZ;
        let Self { lambda, gradient, mu } = self;
        mu.as_mut().fill([[T::ZERO; C]; S]);
        for (mu, lambda) in mu.as_mut().iter_mut().zip(lambda.as_ref()) {
            for (mu, b) in mu.iter_mut().zip(&coefficients.b) {
                axpy(h * *b, lambda, mu);
            }
        }
        linear.factors.solve_transposed(mu);
        for (stage, jacobian) in linear.jacobian.iter().enumerate() {
            for (r, c, value) in entries::<M, T>(jacobian, blocks[1], blocks[2]) {
                axpy(-value, &mu[slot::<M>(r)][stage], &mut lambda[c - nx]);
            }
            for (r, c, value) in entries::<M, T>(jacobian, blocks[3], blocks[5]) {
                axpy(-value, &mu[slot::<M>(r)][stage], &mut gradient[c - shift]);
            }
        }
    }
}

/// Memory of the adjoint of `C` seeds.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct AdjointMemory<M: Dae, T: Plain, const S: usize, const C: usize> {
    pub(crate) result: Adjoint<M, T, C>,
    pub(crate) backward: Backward<M, T, S, C>,
}
copy!([M: Dae, T: Plain, const S: usize, const C: usize] AdjointMemory<M, T, S, C>);

impl<M: Dae, T: Real, const S: usize, const C: usize> AdjointMemory<M, T, S, C> {
    /// # Errors
    /// [`Error::Overflow`]
    pub(crate) fn finish(&mut self, work: &Work<M, T, S>) -> Result<(), Error> {
        let Self { result, backward } = self;
        result.nominal = work.result;
        let nx = M::Shape::NX;
        let nu = M::Shape::NU;
        for column in 0..C {
            for (state, row) in backward.lambda.as_ref().iter().enumerate() {
                result.grad_x0[(state, column)] = row[column];
            }
            for (w, row) in backward.gradient.as_ref().iter().enumerate().skip(nx) {
                if w < nx + nu {
                    result.grad_u[(w - nx, column)] = row[column];
                } else {
                    result.grad_p[(w - nx - nu, column)] = row[column];
                }
            }
        }
        check(result.grad_x0.as_slice(), 0)?;
        check(result.grad_u.as_slice(), 0)?;
        check(result.grad_p.as_slice(), 0)
    }
}
