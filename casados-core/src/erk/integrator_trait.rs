//! The trait of all integrators, with or without an integrand.

use super::forward_sweep::AllColumns;
use super::integrator::{Integrator, check_finite_input};
use crate::error::{Argument, Error};
use crate::integrator::{self, With};
use crate::memory::{Memory, WithAdjoint, WithForward, WithHessian};
use crate::model::{Ode, VectorP, VectorU, VectorX};
use crate::quadrature::{Integrand, OptionalIntegrand};
use crate::result::{Adjoint, Forward, Hessian, Nominal};
use crate::scalar::Real;
use crate::shape::Matrix;
use crate::statistics::Statistics;

impl<M: Ode, B, const S: usize, T: Real, W: Memory> integrator::Integrator for Integrator<M, B, S, T, W> {
    type Model = M;
    type Number = T;
    type Memory = W;

    fn set_parameters(&mut self, p: &VectorP<M, T>) -> Result<(), Error> {
        Self::set_parameters(self, p)
    }

    fn set_time(&mut self, t: T) -> Result<(), Error> {
        Self::set_time(self, t)
    }

    fn reset(&mut self) {}

    fn statistics(&self) -> Statistics {
        Self::statistics(self)
    }

    fn solve_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        mut integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Nominal<M, T>, Error> {
        let grid = self.begin_call(x0, u, h)?;
        Ok(self.engine.solve(&grid, &mut integrand)?.1)
    }

    fn forward_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        mut integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Forward<M, T>, Error>
    where
        W: WithForward,
    {
        let grid = self.begin_call(x0, u, h)?;
        Ok(self.engine.forward(&grid, &mut AllColumns, &mut integrand)?.1)
    }

    fn adjoint_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Adjoint<M, T>, Error>
    where
        W: WithAdjoint<1>,
    {
        self.solve_adjoint(x0, u, h, lambda, integrand)
    }

    fn hessian_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        mut integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Hessian<M, T>, Error>
    where
        W: WithHessian,
    {
        check_finite_input::<M, T>(lambda.as_slice(), Argument::Lambda)?;
        let grid = self.begin_call(x0, u, h)?;
        Ok(self.engine.hessian(&grid, lambda.as_slice(), &mut AllColumns, &mut integrand)?.1)
    }
}

impl<M: Ode, B, const S: usize, T: Real, W: Memory> Integrator<M, B, S, T, W> {
    /// Adds a quadrature: computes the value and the derivatives of `∫ l(x, u, p, t) dt` together
    /// with the solution; see [`quadrature`](crate::quadrature).
    pub fn with<'a, 'b, Q: Integrand<M, T> + ?Sized>(
        &'a mut self,
        integrand: &'b mut Q,
    ) -> With<'a, 'b, Self, Q> {
        With { integrator: self, integrand }
    }
}
