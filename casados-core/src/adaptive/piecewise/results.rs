//! Results over several intervals.

use crate::model::{
    Dae, MatrixPP, MatrixUP, MatrixUU, MatrixXP, MatrixXU, MatrixXX, MatrixZP, MatrixZU, MatrixZX, VectorP,
    VectorU, VectorX,
};
use crate::result::Nominal;
use crate::scalar::Real;
use crate::shape::listed;
use alloc::vec::Vec;

/// The solution at the end and its derivatives with respect to `x₀`, all controls, and `p`.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// Grows at the rate u, in 1/s: x = x₀ exp(Σ u_k h_k).
/// # #[ode]
/// # fn growth(x: f64, u: f64) -> f64 { u * x }
/// # let mut horizon = Piecewise::new(Adaptive::<Growth, Radau>::new(AdaptiveOptions::default())?);
/// // Rates of 0.5 and −0.2 1/s, up to 1 s and up to 3 s.
/// let end = horizon.forward(&vector![2.0], &[vector![0.5], vector![-0.2]], &[1.0, 3.0])?;
/// let x = end.nominal.x[0];
/// assert!((x - 2.0 * 0.1_f64.exp()).abs() < 1e-4);
/// // One matrix for each interval, NX × NU: h_k x.
/// assert!((end.dx_dx0[0] - x / 2.0).abs() < 1e-4);
/// assert!((end.dx_du[0][0] - x).abs() < 1e-4 && (end.dx_du[1][0] - 2.0 * x).abs() < 1e-4);
/// # Ok::<(), casados::Error>(())
/// ```
#[non_exhaustive]
pub struct PiecewiseForward<M: Dae, T: Real = f64> {
    /// `x` and `z` at the end, `z0` at the start.
    pub nominal: Nominal<M, T>,
    /// `∂x/∂x₀`
    pub dx_dx0: MatrixXX<M, T>,
    /// `∂x/∂u_k`
    pub dx_du: Vec<MatrixXU<M, T>>,
    /// `∂x/∂p`
    pub dx_dp: MatrixXP<M, T>,
    /// `∂z/∂x₀` at the end.
    pub dz_dx0: MatrixZX<M, T>,
    /// `∂z/∂u_k` at the end.
    pub dz_du: Vec<MatrixZU<M, T>>,
    /// `∂z/∂p` at the end.
    pub dz_dp: MatrixZP<M, T>,
}

/// The solution at the end and the gradient of `λᵀx`.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// Grows at the rate u, in 1/s: x = x₀ exp(Σ u_k h_k).
/// # #[ode]
/// # fn growth(x: f64, u: f64) -> f64 { u * x }
/// # let mut horizon = Piecewise::new(Adaptive::<Growth, Radau>::new(AdaptiveOptions::default())?);
/// let (x0, controls, ends) = (vector![2.0], [vector![0.5], vector![-0.2]], [1.0, 3.0]);
/// let gradient = horizon.adjoint(&x0, &controls, &ends, &vector![10.0])?;
/// let x = gradient.nominal.x[0];
/// assert!((gradient.grad_x0[0] - 10.0 * x / 2.0).abs() < 1e-3);
/// assert!((gradient.grad_u[1][0] - 10.0 * 2.0 * x).abs() < 1e-3);
/// # Ok::<(), casados::Error>(())
/// ```
#[non_exhaustive]
pub struct PiecewiseAdjoint<M: Dae, T: Real = f64> {
    /// `x` and `z` at the end, `z0` at the start.
    pub nominal: Nominal<M, T>,
    /// `∇(λᵀx)` with respect to `x₀`
    pub grad_x0: VectorX<M, T>,
    /// `∇(λᵀx)` with respect to `u_k`
    pub grad_u: Vec<VectorU<M, T>>,
    /// `∇(λᵀx)` with respect to `p`
    pub grad_p: VectorP<M, T>,
}

/// The solution at the end, its derivatives, and the gradient and the Hessian of `λᵀx`.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// Grows at the rate u, in 1/s: x = x₀ exp(Σ u_k h_k).
/// # #[ode]
/// # fn growth(x: f64, u: f64) -> f64 { u * x }
/// # let mut horizon = Piecewise::new(Adaptive::<Growth, Radau>::new(AdaptiveOptions::default())?);
/// let (x0, controls, ends) = (vector![2.0], [vector![0.5], vector![-0.2]], [1.0, 3.0]);
/// let second = horizon.hessian(&x0, &controls, &ends, &vector![1.0])?;
/// let x = second.forward.nominal.x[0];
/// // ∂²x/∂u_j∂u_k = h_j h_k x, the blocks row after row; lengths are 1 s and 2 s.
/// for (found, expected) in second.h_uu.iter().zip([x, 2.0 * x, 2.0 * x, 4.0 * x]) {
///     assert!((found[0] - expected).abs() < 1e-3);
/// }
/// assert!((second.h_xu[1][0] - x).abs() < 1e-3); // h_1 x/x₀
/// # Ok::<(), casados::Error>(())
/// ```
#[non_exhaustive]
pub struct PiecewiseHessian<M: Dae, T: Real = f64> {
    /// The solution and its derivatives.
    pub forward: PiecewiseForward<M, T>,
    /// The gradient.
    pub adjoint: PiecewiseAdjoint<M, T>,
    /// `∂²(λᵀx)/∂x₀²`
    pub h_xx: MatrixXX<M, T>,
    /// `∂²(λᵀx)/∂x₀∂u_k`
    pub h_xu: Vec<MatrixXU<M, T>>,
    /// `∂²(λᵀx)/∂u_j∂u_k`, row by row.
    pub h_uu: Vec<MatrixUU<M, T>>,
    /// `∂²(λᵀx)/∂x₀∂p`
    pub h_xp: MatrixXP<M, T>,
    /// `∂²(λᵀx)/∂u_k∂p`
    pub h_up: Vec<MatrixUP<M, T>>,
    /// `∂²(λᵀx)/∂p²`
    pub h_pp: MatrixPP<M, T>,
}

listed!([M: Dae, T: Real] PiecewiseForward<M, T> { nominal, dx_dx0, dx_du, dx_dp, dz_dx0, dz_du, dz_dp });
listed!([M: Dae, T: Real] PiecewiseAdjoint<M, T> { nominal, grad_x0, grad_u, grad_p });
listed!([M: Dae, T: Real] PiecewiseHessian<M, T> { forward, adjoint, h_xx, h_xu, h_uu, h_xp, h_up, h_pp });
