//! The integrals of all outputs of a function.

use super::memory::{ArrayW, StageMemory};
use super::{Integrand, sealed};
use crate::error::{Error, Place};
use crate::finite::check_output;
use crate::function::{ArrayY, Function, MatrixYP, MatrixYU, MatrixYX, VectorY};
use crate::linalg::axpy;
use crate::model::Dae;
use crate::result::write_row;
use crate::scalar::Real;
use crate::shape::{Matrix, Plain, plain};
use bytemuck::Zeroable;

/// Quadrature `q = ∫ l dt` of the outputs of a function `F` along the solution of an integrator.
///
/// | call of the integrator | results |
/// | --- | --- |
/// | `solve` | `q` |
/// | `forward` | `q` and its derivatives |
/// | `adjoint` | `q`; the gradient is that of `λᵀx + νᵀq` |
/// | `hessian` | `q` and its derivatives; gradient and Hessian are those of `λᵀx + νᵀq` |
///
/// Values that a call does not compute are zero. After an error all values are invalid.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
/// #[function]
/// fn way(x: [f64; 2], _u: [f64; 1]) -> [f64; 1] {
///     [x[1]]
/// }
///
/// let mut irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
/// let mut way = Quadrature::<Way>::new();
/// let end = irk.with(&mut way).solve(&vector![1.0, 1.0], &vector![2.0], 0.5)?.x[0];
/// // The integral of the velocity is what the position has changed by.
/// assert!((way.q[0] - (end - 1.0)).abs() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct Quadrature<F: Function, T: Plain = f64> {
    /// `q`
    pub q: VectorY<F, T>,
    /// `∂q/∂x₀`
    pub dq_dx0: MatrixYX<F, T>,
    /// `∂q/∂u`
    pub dq_du: MatrixYU<F, T>,
    /// `∂q/∂p`
    pub dq_dp: MatrixYP<F, T>,
    /// Weights `ν` of the outputs in gradients and Hessians; zero by default.
    pub nu: VectorY<F, T>,
    dq: ArrayY<F, ArrayW<F, T>>,
    memory: StageMemory<F, T>,
}

plain!([F: Function, T: Plain] Quadrature<F, T> { q, dq_dx0, dq_du, dq_dp, nu, dq, memory });

impl<F: Function, T: Plain> Default for Quadrature<F, T> {
    fn default() -> Self {
        Self::zeroed()
    }
}

impl<F: Function, T: Plain> Quadrature<F, T> {
    /// Returns a quadrature that contains its memory.
    #[must_use]
    pub fn new() -> Self {
        Self::zeroed()
    }

    /// Returns a quadrature on the heap, for large models.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    #[cfg(feature = "alloc")]
    pub fn boxed() -> Result<alloc::boxed::Box<Self>, Error> {
        crate::memory::allocate()
    }
}

impl<F: Function, T: Plain> sealed::Sealed for Quadrature<F, T> {}

#[diagnostic::do_not_recommend]
impl<M: Dae, F: Function<Shape = M::Shape>, T: Real> Integrand<M, T> for Quadrature<F, T> {
    fn reset(&mut self) {
        self.q.as_mut_slice().fill(T::ZERO);
        Integrand::<M, T>::reset_derivatives(self);
    }

    fn variables(&self) -> &'static [u32] {
        F::STRUCTURE.variables
    }

    fn stage_variables_mut(&mut self) -> (&mut [T], &mut [ArrayW<F, T>]) {
        (self.memory.v.as_mut(), self.memory.d.as_mut())
    }

    fn add_value(&mut self, weight: T, at: Place) -> Result<(), Error> {
        self.memory.evaluate(at)?;
        axpy(weight, self.memory.y.as_ref(), self.q.as_mut_slice());
        Ok(())
    }

    fn add_forward(&mut self, weight: T, with_hessian: bool, at: Place) -> Result<(), Error> {
        let Self { q, dq, memory, nu, .. } = self;
        memory.evaluate_forward(at)?;
        axpy(weight, memory.y.as_ref(), q.as_mut_slice());
        for (dq, dy) in dq.as_mut().iter_mut().zip(memory.dy.as_ref()) {
            axpy(weight, dy.as_ref(), dq.as_mut());
        }
        if with_hessian {
            memory.mu.as_mut().copy_from_slice(nu.as_slice());
            memory.add_second_derivatives(weight);
        }
        Ok(())
    }

    fn weighted_gradient(&mut self, weight: T, _: Place) -> Result<&[T], Error> {
        self.memory.mu.as_mut().copy_from_slice(self.nu.as_slice());
        Ok(self.memory.weighted_gradient(weight))
    }

    fn hessian_sum(&self) -> Option<&[ArrayW<F, T>]> {
        Some(self.memory.second.as_ref())
    }

    fn gradients(&self) -> &[ArrayW<F, T>] {
        self.dq.as_ref()
    }

    fn reset_derivatives(&mut self) {
        for row in self.dq.as_mut() {
            row.as_mut().fill(T::ZERO);
        }
        self.memory.reset();
    }

    fn integrand_value(&mut self, at: Place) -> Result<T, Error> {
        self.memory.evaluate(at)?;
        let products = self.memory.y.as_ref().iter().zip(self.nu.as_slice());
        Ok(products.fold(T::ZERO, |sum, (y, nu)| sum + *y * *nu))
    }

    fn add_end_time_gradient(&mut self, weight: T, time: &ArrayW<F, T>, at: Place) -> Result<(), Error> {
        self.memory.evaluate(at)?;
        for (dq, y) in self.dq.as_mut().iter_mut().zip(self.memory.y.as_ref()) {
            axpy(weight * *y, time.as_ref(), dq.as_mut());
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<(), Error> {
        let Self { q, dq, dq_dx0, dq_du, dq_dp, .. } = self;
        for (output, row) in dq.as_ref().iter().enumerate() {
            write_row(row.as_ref(), output, dq_dx0, dq_du, dq_dp);
        }
        check_output(q.as_slice(), 0)?;
        check_output(dq_dx0.as_slice(), 0)?;
        check_output(dq_du.as_slice(), 0)?;
        check_output(dq_dp.as_slice(), 0)
    }
}
