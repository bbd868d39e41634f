//! Integrals of functions along the solution, with the sensitivities of the integrator.
//!
//! ```text
//! q = ∫ l(x, z, u, p, t) dt ≈ Σ_n Σ_i h b_i l_i        l_i = l(ξ_i, z_i, u, p, t_n + c_i h)
//! ```
//!
//! is what the method would give for additional states `q̇ = l`, at the cost of evaluating `l` at
//! the stages. Its derivatives are exact ones of this sum, with `D_i = d(ξ_i, z_i, u, p)/dw`:
//!
//! ```text
//! dq/dw = Σ h b_i l_v D_i
//! Jᵀ μ = h (b ⊗ λ, 0) + ∂/∂(k, z) Σ h b_i νᵀl_i        the adjoint of λᵀx + νᵀq
//! d²(λᵀx + νᵀq)/dw² = Σ D_iᵀ (h b_i ∇²(νᵀl) − ∇²(μ_iᵀ f))_i D_i
//! ```
//!
//! [`Quadrature`] integrates all outputs of a [`Function`](crate::Function); [`LeastSquares`] half
//! of a weighted square of them, with the matrix of Gauss and Newton. An integrator takes one
//! along: `irk.with(&mut cost).hessian(...)`.
//!
//! Integrands are evaluated one stage after the other, and a batch takes none along. An adaptive
//! integrator chooses its steps for the states, not for the integral. Over intervals with controls
//! of their own derivatives by all of them are returned beside those of the solution.

mod integral;
// What the derive of `Zeroable` writes about a field of type `T`.
mod chained_integrands;
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

/// What an integrator can take along: [`Quadrature`] and [`LeastSquares`].
///
/// Its methods are for integrators. Those with a body are called on what a user has given alone,
/// not on what stands for it in one step of many.
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
    /// Forgets the last interval.
    #[doc(hidden)]
    fn reset(&mut self) {}
    /// The variables that it depends on.
    #[doc(hidden)]
    fn variables(&self) -> &'static [u32];
    /// A place for the variables at a stage, and one for their derivatives `D`, of which the rows
    /// of [`Integrand::variables`] count.
    #[doc(hidden)]
    fn stage_variables_mut(&mut self) -> (&mut [T], &mut [ArrayW<M, T>]);
    /// Adds the value at the point.
    ///
    /// # Errors
    /// [`Error::NonFiniteFunction`]
    #[doc(hidden)]
    fn add_value(&mut self, weight: T, at: Place) -> Result<(), Error>;
    /// Adds the value at the point and its derivatives; those of second order that `hessian` is
    /// made of, if they are wanted.
    ///
    /// # Errors
    /// [`Error::NonFiniteFunction`]
    #[doc(hidden)]
    fn add_forward(&mut self, weight: T, with_hessian: bool, at: Place) -> Result<(), Error>;
    /// The gradient at the point over all variables, times the weight.
    ///
    /// # Errors
    /// [`Error::NonFiniteFunction`]
    #[doc(hidden)]
    fn weighted_gradient(&mut self, weight: T, at: Place) -> Result<&[T], Error>;
    /// The lower triangle of the sum of `Dᵀ ∇² D`, if there is one.
    #[doc(hidden)]
    fn hessian_sum(&self) -> Option<&[ArrayW<M, T>]> {
        None
    }
    /// The gradients that were added up, a row for each output.
    #[doc(hidden)]
    fn gradients(&self) -> &[ArrayW<M, T>] {
        &[]
    }
    /// The lower triangle of the matrix of Gauss and Newton that was added up, if there is one.
    #[doc(hidden)]
    fn gauss_newton_sum(&self) -> Option<&[ArrayW<M, T>]> {
        None
    }
    /// Forgets derivatives, but no values.
    #[doc(hidden)]
    fn reset_derivatives(&mut self) {}
    /// What is integrated at the point, times multipliers.
    ///
    /// # Errors
    /// [`Error::NonFiniteFunction`]
    #[doc(hidden)]
    fn integrand_value(&mut self, at: Place) -> Result<T, Error> {
        let _ = at;
        Ok(T::ZERO)
    }
    /// The interval ends `dt = weight · time` later: adds what is integrated at the point times
    /// `dt` to the gradients.
    ///
    /// # Errors
    /// [`Error::NonFiniteFunction`]
    #[doc(hidden)]
    fn add_end_time_gradient(&mut self, weight: T, time: &ArrayW<M, T>, at: Place) -> Result<(), Error> {
        let _ = (weight, time, at);
        Ok(())
    }
    /// Writes the results.
    ///
    /// # Errors
    /// [`Error::Overflow`]
    #[doc(hidden)]
    fn finish(&mut self) -> Result<(), Error> {
        Ok(())
    }
}

/// An integrand, or none.
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

/// The same integrand for a while.
pub(crate) fn reborrow<'a, M: Dae, T: Real>(
    integrand: &'a mut OptionalIntegrand<'_, '_, M, T>,
) -> OptionalIntegrand<'a, 'a, M, T> {
    match integrand {
        Some(integrand) => Some(&mut **integrand),
        None => None,
    }
}
