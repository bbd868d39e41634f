//! Quadratures: integrals of functions along the solution, with the sensitivities of the
//! integrator.
//!
//! ```text
//! q = ∫ l(x, z, u, p, t) dt ≈ Σ_n Σ_i h b_i l_i        l_i = l(ξ_i, z_i, u, p, t_n + c_i h)
//! ```
//!
//! is the result of the method for additional states `q̇ = l`, at the cost of evaluating `l` at the
//! stages. The derivatives are exact derivatives of this sum, with `D_i = d(ξ_i, z_i, u, p)/dw`:
//!
//! ```text
//! dq/dw = Σ h b_i l_v D_i
//! Jᵀ μ = h (b ⊗ λ, 0) + ∂/∂(k, z) Σ h b_i νᵀl_i        the adjoint of λᵀx + νᵀq
//! d²(λᵀx + νᵀq)/dw² = Σ D_iᵀ (h b_i ∇²(νᵀl) − ∇²(μ_iᵀ f))_i D_i
//! ```
//!
//! [`Quadrature`] integrates all outputs of a [`Function`](crate::Function), [`LeastSquares`] half
//! a weighted square of them, with the Gauss-Newton matrix. An integrator takes an integrand by
//! `with`: `irk.with(&mut cost).hessian(...)`.
//!
//! Integrands are evaluated stage by stage. Batches do not support them. An adaptive integrator
//! controls the error of the states, not of the integral. Over several intervals with different
//! controls, the derivatives by all of them are returned besides those of the solution.

mod chained_integrands;
mod integral;
// The derive of `Zeroable` repeats the bounds of `T`.
#[allow(clippy::multiple_bound_locations)]
mod least_squares;
mod memory;
mod product;

pub(crate) use chained_integrands::{AdjointOnlyIntegrand, ChainRuleIntegrand};
pub use integral::Quadrature;
pub use least_squares::LeastSquares;

use crate::error::{Error, Place};
use crate::model::{ArrayW, Dae};
use crate::scalar::Real;

pub(crate) mod sealed {
    pub trait Sealed {}
}

/// An integrand of an integrator: [`Quadrature`] and [`LeastSquares`].
///
/// Its methods are called by integrators. Provided methods are called on the integrand of the user
/// only, not on the integrands of single steps.
///
/// ```
/// use casados::integrator::Integrand;
/// use casados::prelude::*;
/// use nalgebra::vector;
///
/// /// A cart on a rail: position, m; velocity, m/s.
/// #[ode]
/// fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// #[function]
/// fn position(x: [f64; 2], _u: f64) -> f64 { x[0] }
///
/// /// An interval of one second from rest, whatever is integrated beside it.
/// fn accelerate<Q: Integrand<Cart, f64>>(integrand: &mut Q) -> Result<(), Error> {
///     let mut irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
///     irk.with(integrand).solve(&vector![0.0, 0.0], &vector![2.0], 1.0)?;
///     Ok(())
/// }
///
/// // x₀ = t²: the integral is 1/3, that of half its square 1/10, which Gauss with two stages misses.
/// let mut mean = Quadrature::<Position>::new();
/// accelerate(&mut mean)?;
/// assert!((mean.q[0] - 1.0 / 3.0).abs() < 1e-14);
/// let mut square = LeastSquares::<Position>::new(&nalgebra::matrix![1.0]);
/// accelerate(&mut square)?;
/// assert!((square.value - 0.1).abs() < 0.01);
/// # Ok::<(), casados::Error>(())
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not an integrand for the model `{M}` with numbers `{T}`",
    note = "`Quadrature<F, T>` and `LeastSquares<F, T>` are, of a `#[function]` `F` whose arguments have the dimensions of those \
            of the model"
)]
pub trait Integrand<M: Dae, T: Real>: sealed::Sealed {
    /// Discards the sums of the last interval.
    #[doc(hidden)]
    fn reset(&mut self) {}
    /// Returns the variables on which it depends.
    #[doc(hidden)]
    fn variables(&self) -> &'static [u32];
    /// Returns the memory of the variables at a stage, and of their derivatives `D`, of which the
    /// rows of [`Integrand::variables`] are used.
    #[doc(hidden)]
    fn stage_variables_mut(&mut self) -> (&mut [T], &mut [ArrayW<M, T>]);
    /// Adds the value at the stage.
    ///
    /// # Errors
    /// [`Error::NonFiniteFunction`]
    #[doc(hidden)]
    fn add_value(&mut self, weight: T, at: Place) -> Result<(), Error>;
    /// Adds the value at the stage and its derivatives; with `with_hessian` also those of second
    /// order for `hessian`.
    ///
    /// # Errors
    /// [`Error::NonFiniteFunction`]
    #[doc(hidden)]
    fn add_forward(&mut self, weight: T, with_hessian: bool, at: Place) -> Result<(), Error>;
    /// Returns the gradient at the stage by all variables, times the weight.
    ///
    /// # Errors
    /// [`Error::NonFiniteFunction`]
    #[doc(hidden)]
    fn weighted_gradient(&mut self, weight: T, at: Place) -> Result<&[T], Error>;
    /// Returns the lower triangle of the sum of `Dᵀ ∇² D`, if it was computed.
    #[doc(hidden)]
    fn hessian_sum(&self) -> Option<&[ArrayW<M, T>]> {
        None
    }
    /// Returns the sums of the gradients, one row per output.
    #[doc(hidden)]
    fn gradients(&self) -> &[ArrayW<M, T>] {
        &[]
    }
    /// Returns the lower triangle of the Gauss-Newton matrix, if it was computed.
    #[doc(hidden)]
    fn gauss_newton_sum(&self) -> Option<&[ArrayW<M, T>]> {
        None
    }
    /// Discards derivatives, but not values.
    #[doc(hidden)]
    fn reset_derivatives(&mut self) {}
    /// Returns the integrand at the stage, times the multipliers.
    ///
    /// # Errors
    /// [`Error::NonFiniteFunction`]
    #[doc(hidden)]
    fn integrand_value(&mut self, at: Place) -> Result<T, Error> {
        let _ = at;
        Ok(T::ZERO)
    }
    /// Adds the derivative of the integral by the end time: `dt = weight · time`, times the
    /// integrand at the end.
    ///
    /// # Errors
    /// [`Error::NonFiniteFunction`]
    #[doc(hidden)]
    fn add_end_time_gradient(&mut self, weight: T, time: &ArrayW<M, T>, at: Place) -> Result<(), Error> {
        let _ = (weight, time, at);
        Ok(())
    }
    /// Computes the results from the sums.
    ///
    /// # Errors
    /// [`Error::Overflow`]
    #[doc(hidden)]
    fn finish(&mut self) -> Result<(), Error> {
        Ok(())
    }
}

/// An optional integrand.
pub(crate) type OptionalIntegrand<'a, 'b, M, T> = Option<&'a mut (dyn Integrand<M, T> + 'b)>;

pub(crate) fn reset_integrand<M: Dae, T: Real>(integrand: &mut OptionalIntegrand<'_, '_, M, T>) {
    if let Some(integrand) = integrand {
        integrand.reset();
    }
}

pub(crate) fn finish_integrand<M: Dae, T: Real>(
    integrand: &mut OptionalIntegrand<'_, '_, M, T>,
) -> Result<(), Error> {
    integrand.as_mut().map_or(Ok(()), |integrand| integrand.finish())
}

/// Reborrows an optional integrand.
pub(crate) fn reborrow<'a, M: Dae, T: Real>(
    integrand: &'a mut OptionalIntegrand<'_, '_, M, T>,
) -> OptionalIntegrand<'a, 'a, M, T> {
    match integrand {
        Some(integrand) => Some(&mut **integrand),
        None => None,
    }
}
