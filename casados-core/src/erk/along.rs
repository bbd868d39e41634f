//! An integrand at the stages of the steps; see [`quadrature`](crate::quadrature).

use super::integrator::Integrator;
use super::step::Point;
use crate::error::{Error, Place};
use crate::memory::{Memory, WithForward, WithHessian};
use crate::model::{ArrayW, ArrayX, Ode, VectorU, VectorX};
use crate::quadrature::{Along, Integrand, With};
use crate::result::{Adjoint, Forward, Hessian, Nominal};
use crate::scalar::Real;
use crate::shape::Shape;

/// What a stage adds to the value and its derivatives, with `dξ`.
pub(super) fn forward<M: Ode, T: Real>(
    along: &mut Along<'_, '_, M, T>,
    point: &Point<M, T>,
    dxi: &ArrayX<M, ArrayW<M, T>>,
    weight: T,
    second: bool,
    at: Place,
) -> Result<(), Error> {
    let Some(integrand) = along else { return Ok(()) };
    let nx = M::Shape::NX;
    let variables = integrand.variables();
    let (v, d) = integrand.point();
    for (to, from) in v.iter_mut().zip(point.v.as_ref()) {
        *to = *from;
    }
    for &variable in variables {
        let variable = variable as usize;
        let (Some(row), Some(w)) = (d.get_mut(variable), variable.checked_sub(nx)) else { continue };
        match dxi.as_ref().get(w) {
            Some(dxi) => *row = *dxi,
            None => {
                row.as_mut().fill(T::ZERO);
                if let Some(own) = row.as_mut().get_mut(w) {
                    *own = T::ONE;
                }
            }
        }
    }
    integrand.forward(weight, second, at)
}

impl<M: Ode, B, const S: usize, T: Real, W: Memory> Integrator<M, B, S, T, W> {
    /// Takes an integrand along: the value and the derivatives of `∫ l(x, u, p, t) dt` with those
    /// of the solution; see [`quadrature`](crate::quadrature).
    pub fn with<'a, 'b, Q: Integrand<M, T> + ?Sized>(
        &'a mut self,
        integrand: &'b mut Q,
    ) -> With<'a, 'b, Self, Q> {
        With { integrator: self, integrand }
    }
}

impl<'a, M: Ode, B, const S: usize, T: Real, W: Memory, Q: Integrand<M, T>>
    With<'a, '_, Integrator<M, B, S, T, W>, Q>
{
    /// See [`Integrator::solve`]; the integral.
    ///
    /// # Errors
    /// See [`Integrator::solve`]; [`Error::NonFiniteFunction`].
    pub fn solve(self, x0: &VectorX<M, T>, u: &VectorU<M, T>, h: T) -> Result<&'a Nominal<M, T>, Error> {
        self.integrator.solve_along(x0, u, h, Some(self.integrand))
    }

    /// See [`Integrator::forward`]; the integral and its derivatives.
    ///
    /// # Errors
    /// See [`Integrator::solve`]; [`Error::NonFiniteFunction`].
    pub fn forward(self, x0: &VectorX<M, T>, u: &VectorU<M, T>, h: T) -> Result<&'a Forward<M, T>, Error>
    where
        W: WithForward,
    {
        self.integrator.forward_along(x0, u, h, Some(self.integrand))
    }

    /// See [`Integrator::adjoint`]; the gradient is that of `λᵀx` and the integral.
    ///
    /// # Errors
    /// See [`Integrator::solve`]; [`Error::NonFiniteFunction`].
    pub fn adjoint(
        self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
    ) -> Result<&'a Adjoint<M, T>, Error> {
        self.integrator.adjoint_along(x0, u, h, lambda, Some(self.integrand))
    }

    /// See [`Integrator::hessian`]; gradient and Hessian are those of `λᵀx` and the integral.
    ///
    /// # Errors
    /// See [`Integrator::solve`]; [`Error::NonFiniteFunction`].
    pub fn hessian(
        self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
    ) -> Result<&'a Hessian<M, T>, Error>
    where
        W: WithHessian,
    {
        self.integrator.hessian_along(x0, u, h, lambda, Some(self.integrand))
    }
}
