//! Derivatives of integrals over intervals with their own controls.
//!
//! An integrand has derivatives with respect to `(x_k, u_k, p)` of one interval; this module
//! converts them to derivatives with respect to `W = (x₀, u₀, …, u_{N−1}, p)`:
//!
//! ```text
//! dq/dW = Σ_k dq_k/d(x_k, u_k, p) D_k        H = Σ_k D_kᵀ H_k D_k        D_k = d(x_k, u_k, p)/dW
//! ```

use super::direction_layout::DirectionLayout;
use crate::adaptive::segment::filled_vec;
use crate::error::Error;
use crate::function::{Function, MatrixYP, MatrixYU, MatrixYX};
use crate::integrator::chain_rule::fill_matrix;
use crate::model::{
    ArrayW, Dae, MatrixPP, MatrixUP, MatrixUU, MatrixXP, MatrixXU, MatrixXX, VectorP, VectorU, VectorX,
};
use crate::quadrature::{Integrand, LeastSquares, Quadrature};
use crate::scalar::Real;
use crate::shape::{Matrix, Plain, Shape, listed};
use alloc::vec::Vec;
use bytemuck::Zeroable;

/// The derivatives of the integrals of [`Quadrature`] over several intervals.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// Grows at the rate u, in 1/s: x = x₀ exp(Σ u_k h_k).
/// # #[ode]
/// # fn growth(x: f64, u: f64) -> f64 { u * x }
/// # #[function]
/// # fn amount(x: f64, _u: f64) -> f64 { x }
/// # let mut horizon = Piecewise::new(Adaptive::<Growth, Radau>::new(AdaptiveOptions::default())?);
/// // q = ∫ x dt of no growth in the first second, and of growth by u in the second.
/// let mut integral = Quadrature::<Amount>::new();
/// let (x0, controls, ends) = (vector![2.0], [vector![0.0], vector![0.0]], [1.0, 2.0]);
/// let (_, derivatives) = horizon.with(&mut integral).forward(&x0, &controls, &ends)?;
/// assert!((integral.q[0] - 4.0).abs() < 1e-6);
/// // NY × NX, and NY × NU for each interval: ∂x(t)/∂u_0 is 2 t, later on 2; ∂x(t)/∂u_1 is
/// // 2 (t − 1).
/// assert!((derivatives.dq_dx0[0] - 2.0).abs() < 1e-6);
/// assert!((derivatives.dq_du[0][0] - 3.0).abs() < 1e-6);
/// assert!((derivatives.dq_du[1][0] - 1.0).abs() < 1e-6);
/// # Ok::<(), casados::Error>(())
/// ```
pub struct PiecewiseQuadrature<F: Function, T: Plain = f64> {
    /// `∂q/∂x₀`
    pub dq_dx0: MatrixYX<F, T>,
    /// `∂q/∂u_k`
    pub dq_du: Vec<MatrixYU<F, T>>,
    /// `∂q/∂p`
    pub dq_dp: MatrixYP<F, T>,
}

/// The derivatives of [`LeastSquares`] over several intervals, with the Gauss-Newton matrix.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// Grows at the rate u, in 1/s: x = x₀ exp(Σ u_k h_k).
/// # #[ode]
/// # fn growth(x: f64, u: f64) -> f64 { u * x }
/// # #[function]
/// # fn amount(x: f64, _u: f64) -> f64 { x }
/// # let mut horizon = Piecewise::new(Adaptive::<Growth, Radau>::new(AdaptiveOptions::default())?);
/// // φ = ½ ∫ x² dt where x = 2: H is the integral of squares of derivatives of x.
/// let mut squares = LeastSquares::<Amount>::new(&vector![1.0]); // weights W
/// let (x0, controls, ends) = (vector![2.0], [vector![0.0]], [1.0]);
/// let (_, derivatives) = horizon.with(&mut squares).forward(&x0, &controls, &ends)?;
/// assert!((derivatives.grad_x0[0] - 2.0).abs() < 1e-6); // ∫ x ∂x/∂x₀ dt
/// assert!((derivatives.h_xx[0] - 1.0).abs() < 1e-6); // ∫ (∂x/∂x₀)² dt
/// assert!((derivatives.h_uu[0][0] - 4.0 / 3.0).abs() < 1e-5); // ∫ (2 t)² dt
/// # Ok::<(), casados::Error>(())
/// ```
pub struct PiecewiseLeastSquares<M: Dae, T: Real = f64> {
    /// `∇φ` with respect to `x₀`
    pub grad_x0: VectorX<M, T>,
    /// `∇φ` with respect to `u_k`
    pub grad_u: Vec<VectorU<M, T>>,
    /// `∇φ` with respect to `p`
    pub grad_p: VectorP<M, T>,
    /// The block `(x₀, x₀)` of the Gauss-Newton matrix `H`.
    pub h_xx: MatrixXX<M, T>,
    /// The blocks `(x₀, u_k)` of `H`.
    pub h_xu: Vec<MatrixXU<M, T>>,
    /// The blocks `(u_j, u_k)` of `H`, row by row.
    pub h_uu: Vec<MatrixUU<M, T>>,
    /// The block `(x₀, p)` of `H`.
    pub h_xp: MatrixXP<M, T>,
    /// The blocks `(u_k, p)` of `H`.
    pub h_up: Vec<MatrixUP<M, T>>,
    /// The block `(p, p)` of `H`.
    pub h_pp: MatrixPP<M, T>,
}

listed!([F: Function, T: Plain] PiecewiseQuadrature<F, T> { dq_dx0, dq_du, dq_dp });
listed!([M: Dae, T: Real] PiecewiseLeastSquares<M, T> { grad_x0, grad_u, grad_p, h_xx, h_xu, h_uu, h_xp, h_up, h_pp });

/// An integrand with its own type of derivatives over several intervals: [`Quadrature`] and
/// [`LeastSquares`].
///
/// ```
/// # use casados::adaptive::{PiecewiseQuadrature, Spanning};
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// Grows at the rate u, in 1/s: x = x₀ exp(Σ u_k h_k).
/// # #[ode]
/// # fn growth(x: f64, u: f64) -> f64 { u * x }
/// # #[function]
/// # fn amount(x: f64, _u: f64) -> f64 { x }
/// # let mut horizon = Piecewise::new(Adaptive::<Growth, Radau>::new(AdaptiveOptions::default())?);
/// /// What `with(&mut integrand).forward(..)` returns beside the derivatives of the solution.
/// type Found = <Quadrature<Amount> as Spanning<Growth, f64>>::Derivatives;
/// let mut integral = Quadrature::<Amount>::new();
/// let (_, found): (_, Found) =
///     horizon.with(&mut integral).forward(&vector![2.0], &[vector![0.0]], &[1.0])?;
/// let found: PiecewiseQuadrature<Amount> = found;
/// assert!((found.dq_dx0[0] - 1.0).abs() < 1e-9);
/// # Ok::<(), casados::Error>(())
/// ```
pub trait Spanning<M: Dae, T: Real>: Integrand<M, T> {
    /// The type of the derivatives.
    type Derivatives;
    /// The derivatives from rows and a matrix with respect to all directions.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    #[doc(hidden)]
    fn derivatives(sums: &QuadratureSums<M, T>) -> Result<Self::Derivatives, Error>;
}

impl<M: Dae, F: Function<Shape = M::Shape>, T: Real> Spanning<M, T> for Quadrature<F, T> {
    type Derivatives = PiecewiseQuadrature<F, T>;
    fn derivatives(sums: &QuadratureSums<M, T>) -> Result<Self::Derivatives, Error> {
        let (at, width) = (&sums.layout, sums.layout.column_count());
        let q = |r: usize, c: usize| sums.gradients[r * width + c];
        let mut all = PiecewiseQuadrature {
            dq_dx0: Zeroable::zeroed(),
            dq_du: filled_vec(at.intervals, MatrixYU::<F, T>::zeroed())?,
            dq_dp: Zeroable::zeroed(),
        };
        fill_matrix(&mut all.dq_dx0, q);
        fill_matrix(&mut all.dq_dp, |r, c| q(r, at.parameter_column() + c));
        for (k, du) in all.dq_du.iter_mut().enumerate() {
            fill_matrix(du, |r, c| q(r, at.control_column(k) + c));
        }
        Ok(all)
    }
}

impl<M: Dae, F: Function<Shape = M::Shape>, T: Real> Spanning<M, T> for LeastSquares<F, T> {
    type Derivatives = PiecewiseLeastSquares<M, T>;
    fn derivatives(sums: &QuadratureSums<M, T>) -> Result<Self::Derivatives, Error> {
        let at = &sums.layout;
        let (mut grad_x0, mut grad_p) = (VectorX::<M, T>::zeroed(), VectorP::<M, T>::zeroed());
        let mut grad_u = filled_vec(at.intervals, VectorU::<M, T>::zeroed())?;
        let gradient = |from: usize, to: &mut [T]| {
            to.copy_from_slice(sums.gradients.get(from..from + to.len()).unwrap_or_default())
        };
        gradient(0, grad_x0.as_mut_slice());
        gradient(at.parameter_column(), grad_p.as_mut_slice());
        for (k, grad_u) in grad_u.iter_mut().enumerate() {
            gradient(at.control_column(k), grad_u.as_mut_slice());
        }
        let HessianBlocks { h_xx, h_xu, h_uu, h_xp, h_up, h_pp } =
            at.hessian_blocks(&sums.gauss_newton_matrix)?;
        Ok(PiecewiseLeastSquares { grad_x0, grad_u, grad_p, h_xx, h_xu, h_uu, h_xp, h_up, h_pp })
    }
}

/// A symmetric matrix with respect to all directions, in blocks.
pub(super) struct HessianBlocks<M: Dae, T: Real> {
    pub h_xx: MatrixXX<M, T>,
    pub h_xu: Vec<MatrixXU<M, T>>,
    pub h_uu: Vec<MatrixUU<M, T>>,
    pub h_xp: MatrixXP<M, T>,
    pub h_up: Vec<MatrixUP<M, T>>,
    pub h_pp: MatrixPP<M, T>,
}

impl<M: Dae> DirectionLayout<M> {
    /// The blocks of a matrix; the lower triangle is used, since both differ by rounding.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub(super) fn hessian_blocks<T: Real>(&self, sum: &[T]) -> Result<HessianBlocks<M, T>, Error> {
        let h = |r: usize, c: usize| sum[r.max(c) * self.column_count() + r.min(c)];
        let count = self.intervals;
        let mut blocks = HessianBlocks {
            h_xx: Zeroable::zeroed(),
            h_xu: filled_vec(count, MatrixXU::<M, T>::zeroed())?,
            h_uu: filled_vec(count * count, MatrixUU::<M, T>::zeroed())?,
            h_xp: Zeroable::zeroed(),
            h_up: filled_vec(count, MatrixUP::<M, T>::zeroed())?,
            h_pp: Zeroable::zeroed(),
        };
        fill_matrix(&mut blocks.h_xx, h);
        fill_matrix(&mut blocks.h_xp, |r, c| h(r, self.parameter_column() + c));
        fill_matrix(&mut blocks.h_pp, |r, c| h(self.parameter_column() + r, self.parameter_column() + c));
        for (k, (xu, up)) in blocks.h_xu.iter_mut().zip(&mut blocks.h_up).enumerate() {
            fill_matrix(xu, |r, c| h(r, self.control_column(k) + c));
            fill_matrix(up, |r, c| h(self.control_column(k) + r, self.parameter_column() + c));
        }
        for (index, uu) in blocks.h_uu.iter_mut().enumerate() {
            fill_matrix(uu, |r, c| {
                h(self.control_column(index / count) + r, self.control_column(index % count) + c)
            });
        }
        Ok(blocks)
    }
}

/// The sums of an integrand with respect to all directions.
pub struct QuadratureSums<M: Dae, T: Real> {
    pub(super) layout: DirectionLayout<M>,
    /// One gradient for each output.
    gradients: Vec<T>,
    /// The Gauss-Newton matrix.
    gauss_newton_matrix: Vec<T>,
    /// The second derivatives of the integrand itself.
    pub(super) second_derivatives: Vec<T>,
    product: Vec<T>,
}

impl<M: Dae, T: Real> QuadratureSums<M, T> {
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub(super) fn new(
        intervals: usize,
        integrand: &dyn Integrand<M, T>,
        second: bool,
    ) -> Result<Self, Error> {
        let at = DirectionLayout { intervals, model: core::marker::PhantomData };
        let width = at.column_count();
        let square = |wanted: bool| filled_vec(if wanted { width * width } else { 0 }, T::ZERO);
        let matrix = square(integrand.gauss_newton_sum().is_some())?;
        let second = square(second)?;
        let product =
            filled_vec(if matrix.len() + second.len() > 0 { M::Shape::NW * width } else { 0 }, T::ZERO)?;
        let gradients = filled_vec(integrand.gradients().len() * width, T::ZERO)?;
        Ok(Self { layout: at, gradients, gauss_newton_matrix: matrix, second_derivatives: second, product })
    }

    /// Adds interval `k`, whose start has the derivatives `v`, and clears the sums of the
    /// integrand.
    pub(super) fn add_interval(&mut self, k: usize, integrand: &mut dyn Integrand<M, T>, v: &[T]) {
        let Self { layout: at, gradients, gauss_newton_matrix: matrix, second_derivatives: second, product } =
            self;
        for (row, sum) in
            integrand.gradients().iter().zip(gradients.chunks_exact_mut(at.column_count().max(1)))
        {
            at.add_gradient(k, row.as_ref(), v, sum);
        }
        let mut project = |lower: &[ArrayW<M, T>], sums: [&mut [T]; 2]| {
            for sum in sums {
                if !sum.is_empty() {
                    at.add_projected_hessian(k, |r, c| lower[r.max(c)][r.min(c)], v, product, sum);
                }
            }
        };
        // The exact second derivatives include the Gauss-Newton matrix.
        if let Some(lower) = integrand.gauss_newton_sum() {
            project(lower, [matrix, second]);
        }
        if let Some(lower) = integrand.hessian_sum() {
            project(lower, [&mut [], second]);
        }
        integrand.reset_derivatives();
    }

    /// # Errors
    /// [`Error::Overflow`]
    pub(super) fn check(&self) -> Result<(), Error> {
        let mut all = self.gradients.iter().chain(&self.gauss_newton_matrix).chain(&self.second_derivatives);
        match all.position(|value| !value.is_finite()) {
            Some(index) => Err(Error::Overflow { step: 0, index }),
            None => Ok(()),
        }
    }
}
