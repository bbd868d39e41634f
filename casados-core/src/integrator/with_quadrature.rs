//! An integrator with an integrand.

use super::{ControlOf, Integrator, StateOf};
use crate::error::Error;
use crate::memory::{WithAdjoint, WithForward, WithHessian};
use crate::quadrature::Integrand;
use crate::result::{Adjoint, Forward, Hessian, Nominal};

/// An integrator with an integrand. Its functions are those of the integrator; gradients and
/// Hessians are those of `λᵀx + νᵀq`; see [`Integrand`].
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # /// Power of a mass of one, W.
/// # #[function]
/// # fn power(x: [f64; 2], u: f64) -> f64 { u * x[1] }
/// let mut irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
/// let mut work = Quadrature::<Power>::new();
/// // q = ∫ u v dt beside the state: what it has as kinetic energy after 2 s.
/// let end = irk.with(&mut work).solve(&vector![0.0, 0.0], &vector![3.0], 2.0)?;
/// assert!((work.q[0] - 0.5 * end.x[1] * end.x[1]).abs() < 1e-12);
/// # Ok::<(), casados::Error>(())
/// ```
pub struct With<'a, 'b, I, Q: ?Sized> {
    pub(crate) integrator: &'a mut I,
    pub(crate) integrand: &'b mut Q,
}

impl<'a, I: Integrator, Q: Integrand<I::Model, I::Number>> With<'a, '_, I, Q> {
    /// [`Integrator::solve`] with the integral.
    ///
    /// # Errors
    /// Those of the integrator; [`Error::NonFiniteFunction`].
    pub fn solve(
        self,
        x0: &StateOf<I>,
        u: &ControlOf<I>,
        h: I::Number,
    ) -> Result<&'a Nominal<I::Model, I::Number>, Error> {
        self.integrator.solve_with_quadrature(x0, u, h, Some(self.integrand))
    }

    /// [`Integrator::forward`] with the integral and its derivatives.
    ///
    /// # Errors
    /// Those of the integrator; [`Error::NonFiniteFunction`].
    pub fn forward(
        self,
        x0: &StateOf<I>,
        u: &ControlOf<I>,
        h: I::Number,
    ) -> Result<&'a Forward<I::Model, I::Number>, Error>
    where
        I::Memory: WithForward,
    {
        self.integrator.forward_with_quadrature(x0, u, h, Some(self.integrand))
    }

    /// [`Integrator::adjoint`]; the gradient is that of `λᵀx` plus the integral.
    ///
    /// # Errors
    /// Those of the integrator; [`Error::NonFiniteFunction`].
    pub fn adjoint(
        self,
        x0: &StateOf<I>,
        u: &ControlOf<I>,
        h: I::Number,
        lambda: &StateOf<I>,
    ) -> Result<&'a Adjoint<I::Model, I::Number>, Error>
    where
        I::Memory: WithAdjoint<1>,
    {
        self.integrator.adjoint_with_quadrature(x0, u, h, lambda, Some(self.integrand))
    }

    /// [`Integrator::hessian`]; gradient and Hessian are those of `λᵀx` plus the integral.
    ///
    /// # Errors
    /// Those of the integrator; [`Error::NonFiniteFunction`].
    pub fn hessian(
        self,
        x0: &StateOf<I>,
        u: &ControlOf<I>,
        h: I::Number,
        lambda: &StateOf<I>,
    ) -> Result<&'a Hessian<I::Model, I::Number>, Error>
    where
        I::Memory: WithHessian,
    {
        self.integrator.hessian_with_quadrature(x0, u, h, lambda, Some(self.integrand))
    }
}
