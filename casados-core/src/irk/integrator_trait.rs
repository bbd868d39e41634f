//! The trait of all integrators.

use super::driver::Arguments;
use super::integrator::Integrator;
use crate::error::Error;
use crate::integrator;
use crate::memory::{Memory, WithAdjoint, WithForward, WithHessian};
use crate::model::{Dae, VectorP, VectorU, VectorX};
use crate::quadrature::{OptionalIntegrand, finish_integrand, reset_integrand};
use crate::result::{Adjoint, Forward, Hessian, Nominal};
use crate::scalar::Real;
use crate::shape::Matrix;
use crate::statistics::Statistics;

impl<M: Dae, B, const S: usize, T: Real, W: Memory> integrator::Integrator for Integrator<M, B, S, T, W> {
    type Model = M;
    type Number = T;
    type Memory = W;

    fn set_parameters(&mut self, p: &VectorP<M, T>) -> Result<(), Error> {
        self.run.set_parameters(p)
    }

    fn set_time(&mut self, t: T) -> Result<(), Error> {
        self.run.set_time(t)
    }

    fn reset(&mut self) {
        self.run.reset();
    }

    fn statistics(&self) -> Statistics {
        self.run.statistics
    }

    fn solve_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        mut integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Nominal<M, T>, Error> {
        reset_integrand(&mut integrand);
        self.run.run_steps(&Arguments { x0, u, h }, |parts, n, step, _| match &mut integrand {
            Some(integrand) => {
                parts.workspace.add_integrand_value(parts.coefficients, n, step, &mut **integrand)
            }
            None => Ok(()),
        })?;
        finish_integrand(&mut integrand)?;
        self.differentiated_step = None;
        Ok(&self.run.commit()?.result)
    }

    fn forward_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Forward<M, T>, Error>
    where
        W: WithForward,
    {
        self.differentiate::<false>(&Arguments { x0, u, h }, integrand, None)?;
        self.commit_forward()
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
        self.solve_adjoint(&Arguments { x0, u, h }, lambda.as_slice(), integrand)
    }

    fn hessian_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Hessian<M, T>, Error>
    where
        W: WithHessian,
    {
        Self::hessian_with_quadrature(self, x0, u, h, lambda, &[], integrand)
    }
}
