//! The calls that all integrators have in common, with and without an integrand.

use super::*;
use crate::memory::Heap;
use crate::quadrature::{OptionalIntegrand, reborrow};
use crate::statistics::Statistics;

impl<M: Dae, B: Engine<M, T>, T: Real> integrator::Integrator for Integrator<M, B, T> {
    type Model = M;
    type Number = T;
    type Memory = Heap;

    fn set_parameters(&mut self, p: &VectorP<M, T>) -> Result<(), Error> {
        Self::set_parameters(self, p)
    }

    fn set_time(&mut self, t: T) -> Result<(), Error> {
        Self::set_time(self, t)
    }

    fn reset(&mut self) {}

    fn statistics(&self) -> Statistics {
        let AdaptiveStatistics { steps, residuals, jacobians, factorizations, dense, iterations, .. } =
            self.statistics;
        Statistics { steps, iterations, residuals, jacobians, factorizations, dense }
    }

    fn solve_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Nominal<M, T>, Error> {
        let span = self.prepare_steps(x0, u, h)?;
        let (mut frozen, state, ..) = self.differentiation_parts(span)?;
        frozen.solve::<B>(state, x0, integrand)?;
        self.last_span = Some(span);
        Ok(&self.workspace.result)
    }

    fn forward_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Forward<M, T>, Error> {
        let span = self.prepare_steps(x0, u, h)?;
        let (mut frozen, state, memory, _) = self.differentiation_parts(span)?;
        frozen.forward::<B>(state, x0, memory, None, integrand)?;
        Ok(&self.finish_derivatives(span)?.hessian.first.forward)
    }

    fn adjoint_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        mut integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Adjoint<M, T>, Error> {
        self.last_span = None;
        check_model_input::<M, T>(Argument::Lambda, lambda.as_slice())?;
        let span = self.prepare_steps(x0, u, h)?;
        let (mut frozen, state, memory, _) = self.differentiation_parts(span)?;
        frozen.solve::<B>(state, x0, reborrow(&mut integrand))?;
        frozen.adjoint::<B>(state, lambda, memory, integrand)?;
        Ok(&self.finish_derivatives(span)?.adjoint)
    }

    fn hessian_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        mut integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Hessian<M, T>, Error> {
        self.last_span = None;
        check_model_input::<M, T>(Argument::Lambda, lambda.as_slice())?;
        let span = self.prepare_steps(x0, u, h)?;
        let (mut frozen, state, memory, history) = self.differentiation_parts(span)?;
        history.clear();
        frozen.forward::<B>(state, x0, memory, Some(history), reborrow(&mut integrand))?;
        frozen.hessian::<B>(state, lambda, memory, history, integrand)?;
        Ok(&self.finish_derivatives(span)?.hessian)
    }
}
