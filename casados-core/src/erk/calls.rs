//! The calls that all integrators have in common, with an integrand or without.

use super::adjoint::Way;
use super::along::forward;
use super::forward::Unit;
use super::integrator::{ForwardMemory, HessianMemory, Integrator, finite};
use super::sensitivities::{gradient_element, write_forward, write_hessian};
use super::step::Base;
use crate::error::{Argument, Error};
use crate::integrator;
use crate::memory::{Memory, WithAdjoint, WithForward, WithHessian};
use crate::model::{Ode, VectorP, VectorU, VectorX};
use crate::quadrature::{Along, begin, finish};
use crate::result::{Adjoint, Forward, Hessian, Nominal};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};
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

    fn solve_along(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        mut along: Along<'_, '_, M, T>,
    ) -> Result<&Nominal<M, T>, Error> {
        let grid = self.begin(x0, u, h)?;
        begin(&mut along);
        let base = W::nominal(&mut self.base)?;
        let run = base.run(&self.scheme, grid, &mut along);
        self.counts = base.point.counts;
        run?;
        finish(&mut along)?;
        let Base { x, result, .. } = base;
        result.x.as_mut_slice().copy_from_slice(x.as_ref());
        Ok(result)
    }

    fn forward_along(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        mut along: Along<'_, '_, M, T>,
    ) -> Result<&Forward<M, T>, Error>
    where
        W: WithForward,
    {
        let grid = self.begin(x0, u, h)?;
        begin(&mut along);
        let base = W::nominal(&mut self.base)?;
        let ForwardMemory { sweep, result } = W::forward(&mut self.forward)?;
        let scheme = &self.scheme;
        let run = sweep.forward.run(scheme, grid, base, Unit, |point, dxi, at| {
            forward(&mut along, point, dxi, grid.h * scheme.b[at.stage], false, at)
        });
        self.counts = base.point.counts;
        run?;
        finish(&mut along)?;
        write_forward(grid, base, &sweep.forward, &mut result.forward)?;
        Ok(&result.forward)
    }

    fn adjoint_along(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        along: Along<'_, '_, M, T>,
    ) -> Result<&Adjoint<M, T>, Error>
    where
        W: WithAdjoint<1>,
    {
        self.backward(x0, u, h, lambda, along)
    }

    fn hessian_along(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        mut along: Along<'_, '_, M, T>,
    ) -> Result<&Hessian<M, T>, Error>
    where
        W: WithHessian,
    {
        begin(&mut along);
        finite::<M, T>(lambda.as_slice(), Argument::Lambda)?;
        let grid = self.begin(x0, u, h)?;
        let base = W::nominal(&mut self.base)?;
        let sweep = &mut W::nominal(&mut self.adjoint)?.sweep;
        let variation = &mut W::forward(&mut self.forward)?.sweep.forward;
        let HessianMemory { curvature, result } = W::hessian(&mut self.hessian)?;
        let records = W::tape(&mut self.trajectory, grid.steps)?;
        let multipliers = W::hessian_tape(&mut self.multipliers, grid.steps)?;
        let scheme = &self.scheme;

        // The adjoint first: then the forward sweep meets each stage with its multipliers known,
        // and no derivative of a stage has to be kept.
        let start = base.x;
        sweep.seed(1, |x, _| lambda.as_slice()[x]);
        curvature.start();
        let mut run = || {
            base.record(scheme, grid, records, &mut None)?;
            sweep.run(
                Way { scheme, grid, columns: 1 },
                &mut base.point,
                records,
                Some(multipliers),
                &mut along,
            )?;
            base.x = start;
            base.point.counts.steps = 0;
            variation.run(scheme, grid, base, Unit, |point, dxi, at| {
                let multipliers = multipliers.get(at.step).and_then(|of_stages| of_stages.get(at.stage));
                let (Some(mu), Some(&b)) = (multipliers, scheme.b.get(at.stage)) else { return Ok(()) };
                forward(&mut along, point, dxi, grid.h * b, true, at)?;
                curvature.add(scheme, point, mu, dxi, at)
            })
        };
        let run = run();
        self.counts = base.point.counts;
        run?;
        finish(&mut along)?;

        write_forward(grid, base, variation, &mut result.first.forward)?;
        let (nx, nu) = (M::Shape::NX, M::Shape::NU);
        for (w, lambda) in sweep.lambda.as_ref().iter().enumerate() {
            let [value] = *lambda;
            if !value.is_finite() {
                return Err(Error::Overflow { step: 0, index: w });
            }
            *gradient_element(&mut result.first, w, nx, nu) = value;
        }
        if let Some(second) = along.as_ref().and_then(|integrand| integrand.second()) {
            curvature.add_lower(second);
        }
        write_hessian(curvature, result)?;
        Ok(result)
    }
}
