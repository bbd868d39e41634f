//! Half the integral of a weighted square, and its Gauss-Newton matrix.

use super::memory::{ArrayW, StageMemory};
use super::{Integrand, sealed};
use crate::error::{Error, Place};
use crate::finite::check_output;
use crate::function::{Function, MatrixYY};
use crate::linalg::axpy;
use crate::model::Dae;
use crate::result::write_symmetric;
use crate::scalar::Real;
use crate::shape::{Matrix, Plain, Shape, plain};
use bytemuck::Zeroable;

/// Quadrature `φ = ½ ∫ rᵀ W r dt` of the outputs of a function `F` along the solution of an
/// integrator.
///
/// ```text
/// ∇φ = ∫ (dr/dw)ᵀ W r dt        H = ∫ (dr/dw)ᵀ W (dr/dw) dt        w = (x₀, u, p)
/// ```
///
/// `H` is the Gauss-Newton matrix, the Hessian of `φ` without the second derivatives of `r`. It is
/// positive semidefinite if `W` and the weights `b_i` of the method are.
///
/// | call of the integrator | results |
/// | --- | --- |
/// | `solve` | `φ` |
/// | `forward` | `φ`, its gradient, `H` |
/// | `adjoint` | `φ`; the returned gradient is that of `λᵀx + φ` |
/// | `hessian` | `φ`, its gradient, `H`; the returned gradient and Hessian are the exact ones of `λᵀx + φ` |
///
/// Values that a call does not compute are zero. After an error all values are invalid.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::{Matrix1, vector};
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
/// #[function]
/// fn push(_x: [f64; 2], u: [f64; 1]) -> [f64; 1] {
///     [u[0] - 1.0]
/// }
///
/// let mut irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
/// let mut effort = LeastSquares::<Push>::new(&Matrix1::new(4.0));
/// irk.with(&mut effort).forward(&vector![0.0, 0.0], &vector![3.0], 0.5)?;
/// // φ = ½ · 4 (u − 1)² h, ∂φ/∂u = 4 (u − 1) h, ∂²φ/∂u² = 4 h.
/// assert!((effort.value - 4.0).abs() < 1e-14);
/// assert!((effort.grad_u[0] - 4.0).abs() < 1e-14);
/// assert!((effort.h_uu[(0, 0)] - 2.0).abs() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct LeastSquares<F: Function, T: Plain = f64> {
    /// `φ`
    pub value: T,
    /// `∂φ/∂x₀`
    pub grad_x0: <F::Shape as Shape>::VectorX<T>,
    /// `∂φ/∂u`
    pub grad_u: <F::Shape as Shape>::VectorU<T>,
    /// `∂φ/∂p`
    pub grad_p: <F::Shape as Shape>::VectorP<T>,
    /// Block `(x₀, x₀)` of `H`.
    pub h_xx: <F::Shape as Shape>::MatrixXX<T>,
    /// Block `(x₀, u)` of `H`.
    pub h_xu: <F::Shape as Shape>::MatrixXU<T>,
    /// Block `(u, u)` of `H`.
    pub h_uu: <F::Shape as Shape>::MatrixUU<T>,
    /// Block `(x₀, p)` of `H`.
    pub h_xp: <F::Shape as Shape>::MatrixXP<T>,
    /// Block `(u, p)` of `H`.
    pub h_up: <F::Shape as Shape>::MatrixUP<T>,
    /// Block `(p, p)` of `H`.
    pub h_pp: <F::Shape as Shape>::MatrixPP<T>,
    /// The symmetric weight matrix `W`.
    pub weights: MatrixYY<F, T>,
    gradient: ArrayW<F, T>,
    /// The lower triangle of `H`.
    sum: ArrayW<F, ArrayW<F, T>>,
    row: ArrayW<F, T>,
    memory: StageMemory<F, T>,
}

plain!([F: Function, T: Plain] LeastSquares<F, T> { value, grad_x0, grad_u, grad_p, h_xx, h_xu, h_uu, h_xp, h_up, h_pp, weights, gradient, sum, row, memory });

impl<F: Function, T: Real> LeastSquares<F, T> {
    /// Returns a quadrature that contains its memory, with symmetric weights `W`.
    #[must_use]
    pub fn new(weights: &MatrixYY<F, T>) -> Self {
        Self { weights: *weights, ..Zeroable::zeroed() }
    }

    /// Returns a quadrature on the heap, for large models.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    #[cfg(feature = "alloc")]
    pub fn boxed(weights: &MatrixYY<F, T>) -> Result<alloc::boxed::Box<Self>, Error> {
        let mut boxed: alloc::boxed::Box<Self> = crate::memory::allocate()?;
        boxed.weights = *weights;
        Ok(boxed)
    }

    /// Computes `μ = W r`; returns `½ rᵀ W r`.
    fn weigh_residuals(&mut self) -> T {
        let Self { weights, memory: StageMemory { y, mu, .. }, .. } = self;
        let mut square = T::ZERO;
        for (k, mu) in mu.as_mut().iter_mut().enumerate() {
            let products = y.as_ref().iter().enumerate().map(|(l, y)| weights[(k, l)] * *y);
            *mu = products.fold(T::ZERO, |sum, product| sum + product);
            square = square + y[k] * *mu;
        }
        T::from_f64(0.5) * square
    }
}

impl<F: Function, T: Plain> sealed::Sealed for LeastSquares<F, T> {}

#[diagnostic::do_not_recommend]
impl<M: Dae, F: Function<Shape = M::Shape>, T: Real> Integrand<M, T> for LeastSquares<F, T> {
    fn reset(&mut self) {
        self.value = T::ZERO;
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
        self.value = self.value + weight * self.weigh_residuals();
        Ok(())
    }

    fn add_forward(&mut self, weight: T, with_hessian: bool, at: Place) -> Result<(), Error> {
        self.memory.evaluate_forward(at)?;
        self.value = self.value + weight * self.weigh_residuals();
        let Self { weights, gradient, sum, row, memory, .. } = self;
        let dy = memory.dy.as_ref();
        for (k, (dr, mu)) in dy.iter().zip(memory.mu.as_ref()).enumerate() {
            axpy(weight * *mu, dr.as_ref(), gradient.as_mut());
            // Row k of W dr/dw.
            row.as_mut().fill(T::ZERO);
            for (l, dr) in dy.iter().enumerate() {
                axpy(weights[(k, l)], dr.as_ref(), row.as_mut());
            }
            for (i, sum) in sum.as_mut().iter_mut().enumerate() {
                axpy(weight * dr.as_ref()[i], &row.as_ref()[..=i], &mut sum.as_mut()[..=i]);
            }
        }
        if with_hessian {
            memory.add_second_derivatives(weight);
        }
        Ok(())
    }

    fn weighted_gradient(&mut self, weight: T, at: Place) -> Result<&[T], Error> {
        self.memory.evaluate(at)?;
        self.weigh_residuals();
        Ok(self.memory.weighted_gradient(weight))
    }

    fn hessian_sum(&self) -> Option<&[ArrayW<F, T>]> {
        Some(self.memory.second.as_ref())
    }

    fn gradients(&self) -> &[ArrayW<F, T>] {
        core::slice::from_ref(&self.gradient)
    }

    fn gauss_newton_sum(&self) -> Option<&[ArrayW<F, T>]> {
        Some(self.sum.as_ref())
    }

    fn reset_derivatives(&mut self) {
        self.gradient.as_mut().fill(T::ZERO);
        for row in self.sum.as_mut() {
            row.as_mut().fill(T::ZERO);
        }
        self.memory.reset();
    }

    fn integrand_value(&mut self, at: Place) -> Result<T, Error> {
        self.memory.evaluate(at)?;
        Ok(self.weigh_residuals())
    }

    fn add_end_time_gradient(&mut self, weight: T, time: &ArrayW<F, T>, at: Place) -> Result<(), Error> {
        self.memory.evaluate(at)?;
        let weighted_square = self.weigh_residuals();
        axpy(weight * weighted_square, time.as_ref(), self.gradient.as_mut());
        Ok(())
    }

    fn finish(&mut self) -> Result<(), Error> {
        let (nx, nu) = (F::Shape::NX, F::Shape::NU);
        let (states, others) = self.gradient.as_ref().split_at(nx);
        let (controls, parameters) = others.split_at(nu);
        self.grad_x0.as_mut_slice().copy_from_slice(states);
        self.grad_u.as_mut_slice().copy_from_slice(controls);
        self.grad_p.as_mut_slice().copy_from_slice(parameters);
        let rows = self.sum.as_ref();
        write_symmetric(&mut self.h_xx, rows, 0);
        write_symmetric(&mut self.h_uu, rows, nx);
        write_symmetric(&mut self.h_pp, rows, nx + nu);
        mirror_block(&mut self.h_xu, rows, [0, nx]);
        mirror_block(&mut self.h_xp, rows, [0, nx + nu]);
        mirror_block(&mut self.h_up, rows, [nx, nx + nu]);
        // The exact Hessian contains these terms too.
        for (second, row) in self.memory.second.as_mut().iter_mut().zip(rows) {
            axpy(T::ONE, row.as_ref(), second.as_mut());
        }
        check_output(&[self.value], 0)?;
        check_output(self.gradient.as_ref(), 0)?;
        for (i, row) in self.sum.as_ref().iter().enumerate() {
            check_output(&row.as_ref()[..=i], 0)?;
        }
        Ok(())
    }
}

/// Writes a block above the diagonal from the lower triangle.
fn mirror_block<T: Plain, R: AsRef<[T]>, A: Matrix<T>>(
    block: &mut A,
    lower: &[R],
    [row, column]: [usize; 2],
) {
    for c in 0..A::COLUMNS {
        for r in 0..A::ROWS {
            block[(r, c)] = lower[column + c].as_ref()[row + r];
        }
    }
}
