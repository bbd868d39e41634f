//! The calls that all integrators have in common, with an integrand or without.

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
        along: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Nominal<M, T>, Error> {
        let span = self.steps(x0, u, h)?;
        let (mut frozen, state, ..) = self.parts(span)?;
        frozen.solve::<B>(state, x0, along)?;
        self.last = Some(span);
        Ok(&self.base.result)
    }

    fn forward_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        along: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Forward<M, T>, Error> {
        let span = self.steps(x0, u, h)?;
        let (mut frozen, state, memory, _) = self.parts(span)?;
        frozen.forward::<B>(state, x0, memory, None, along)?;
        Ok(&self.done(span)?.hessian.first.forward)
    }

    fn adjoint_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        mut along: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Adjoint<M, T>, Error> {
        self.last = None;
        check_named::<M, T>(Argument::Lambda, lambda.as_slice())?;
        let span = self.steps(x0, u, h)?;
        let (mut frozen, state, memory, _) = self.parts(span)?;
        frozen.solve::<B>(state, x0, reborrow(&mut along))?;
        frozen.adjoint::<B>(state, lambda, memory, along)?;
        Ok(&self.done(span)?.adjoint)
    }

    fn hessian_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        mut along: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Hessian<M, T>, Error> {
        self.last = None;
        check_named::<M, T>(Argument::Lambda, lambda.as_slice())?;
        let span = self.steps(x0, u, h)?;
        let (mut frozen, state, memory, history) = self.parts(span)?;
        history.clear();
        frozen.forward::<B>(state, x0, memory, Some(history), reborrow(&mut along))?;
        frozen.hessian::<B>(state, lambda, memory, history, along)?;
        Ok(&self.done(span)?.hessian)
    }
}
