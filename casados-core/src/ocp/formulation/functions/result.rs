//! The results of an interval.

use crate::model::Dae;
use crate::result::{Forward, Hessian, Nominal};
use crate::scalar::Real;
use crate::shape::Matrix;

/// The results of an interval, with matrices as slices, column after column. Parts that were not
/// requested are empty.
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub struct IntervalResult<'a, T> {
    /// The state at the end, `φ(x, u, p)`.
    pub x: &'a [T],
    /// The algebraic states at the start; empty if there are none.
    pub z: &'a [T],
    /// `∂z/∂x`, `∂z/∂u` and `∂z/∂p`
    pub dz: [&'a [T]; 3],
    /// `∂φ/∂x`
    pub dx: &'a [T],
    /// `∂φ/∂u`
    pub du: &'a [T],
    /// `∂φ/∂p`
    pub dp: &'a [T],
    /// `∇²(πᵀφ + νᵀζ + integral)`: blocks `xx`, `xu`, `uu`.
    pub hessian: [&'a [T]; 3],
    /// The blocks `xp`, `up`, `pp` of the same Hessian.
    pub hessian_p: [&'a [T]; 3],
    /// The integral cost.
    pub cost: IntegralTerms<'a, T>,
    /// The sum and the maximum of the residuals of stage equations; zero if these are solved.
    pub stage_residuals: [T; 2],
}

impl<T: Real> Default for IntervalResult<'_, T> {
    fn default() -> Self {
        Self {
            x: &[],
            z: &[],
            dz: [&[]; 3],
            dx: &[],
            du: &[],
            dp: &[],
            hessian: [&[]; 3],
            hessian_p: [&[]; 3],
            cost: IntegralTerms::default(),
            stage_residuals: [T::ZERO; 2],
        }
    }
}

impl<'a, M: Dae, T: Real> From<&'a Nominal<M, T>> for IntervalResult<'a, T> {
    fn from(result: &'a Nominal<M, T>) -> Self {
        Self { x: result.x.as_slice(), z: result.z0.as_slice(), ..Self::default() }
    }
}

impl<'a, M: Dae, T: Real> From<&'a Forward<M, T>> for IntervalResult<'a, T> {
    fn from(result: &'a Forward<M, T>) -> Self {
        Self {
            dx: result.dx_dx0.as_slice(),
            du: result.dx_du.as_slice(),
            dp: result.dx_dp.as_slice(),
            dz: [result.dz0_dx0.as_slice(), result.dz0_du.as_slice(), result.dz0_dp.as_slice()],
            ..Self::from(&result.nominal)
        }
    }
}

impl<'a, M: Dae, T: Real> From<&'a Hessian<M, T>> for IntervalResult<'a, T> {
    fn from(result: &'a Hessian<M, T>) -> Self {
        let hessian = [result.h_xx.as_slice(), result.h_xu.as_slice(), result.h_uu.as_slice()];
        let hessian_p = [result.h_xp.as_slice(), result.h_up.as_slice(), result.h_pp.as_slice()];
        Self { hessian, hessian_p, ..Self::from(&result.first.forward) }
    }
}

/// An integral cost of an interval and its derivatives.
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub struct IntegralTerms<'a, T> {
    /// The value.
    pub value: T,
    /// Its gradient with respect to `x`.
    pub x: &'a [T],
    /// Its gradient with respect to `u`.
    pub u: &'a [T],
    /// Its gradient with respect to `p`.
    pub p: &'a [T],
    /// The Gauss-Newton matrix: blocks `xx`, `xu`, `uu`.
    pub hessian: [&'a [T]; 3],
    /// Its blocks `xp`, `up`, `pp`.
    pub hessian_p: [&'a [T]; 3],
}

impl<T: Real> Default for IntegralTerms<'_, T> {
    fn default() -> Self {
        Self { value: T::ZERO, x: &[], u: &[], p: &[], hessian: [&[]; 3], hessian_p: [&[]; 3] }
    }
}
