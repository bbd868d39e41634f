//! The trait `Integrator` for divided intervals.

use super::super::chain_rule;
use super::{Divided, HessianMemory, Integrator, as_dyn_integrand};
use crate::error::{Argument, Error};
use crate::finite::{check_forward, check_gradient, check_model_input, check_second_derivatives};
use crate::linalg::axpy;
use crate::memory::{Memory, WithAdjoint, WithForward, WithHessian};
use crate::model::{ArrayW, Dae, VectorP, VectorU, VectorX};
use crate::quadrature::{AdjointOnlyIntegrand, OptionalIntegrand, finish_integrand, reset_integrand};
use crate::result::{Adjoint, Forward, ForwardAdjoint, Hessian, Nominal};
use crate::scalar::Real;
use crate::shape::{Array, Matrix};
use crate::statistics::Statistics;
use bytemuck::Zeroable;

impl<M: Dae, T: Real, I: Integrator<Model = M, Number = T>, const N: usize> Integrator for Divided<I, N> {
    type Model = M;
    type Number = T;
    type Memory = I::Memory;

    fn set_parameters(&mut self, p: &VectorP<M, T>) -> Result<(), Error> {
        self.integrator.set_parameters(p)
    }

    fn set_time(&mut self, t: T) -> Result<(), Error> {
        self.integrator.set_time(t)?;
        self.time = t;
        Ok(())
    }

    fn reset(&mut self) {
        self.integrator.reset();
    }

    fn statistics(&self) -> Statistics {
        self.statistics
    }

    fn solve_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        mut integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Nominal<M, T>, Error> {
        self.begin_call(h)?;
        reset_integrand(&mut integrand);
        self.solve_parts(x0, u, h, &mut integrand)?;
        finish_integrand(&mut integrand)?;
        Ok(&I::Memory::nominal(&mut self.nominal)?.result)
    }

    fn forward_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        mut integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Forward<M, T>, Error>
    where
        I::Memory: WithForward,
    {
        self.begin_call(h)?;
        reset_integrand(&mut integrand);
        self.differentiate_parts(x0, u, h, false, &mut integrand, |_, _, _| Ok(()))?;
        finish_integrand(&mut integrand)?;
        let result = &I::Memory::forward(&mut self.forward)?.result;
        check_forward(result, 0)?;
        Ok(result)
    }

    fn adjoint_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        mut integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Adjoint<M, T>, Error>
    where
        I::Memory: WithAdjoint<1>,
    {
        check_model_input::<M, T>(Argument::Lambda, lambda.as_slice())?;
        self.begin_call(h)?;
        reset_integrand(&mut integrand);
        self.solve_parts(x0, u, h, &mut integrand)?;
        finish_integrand(&mut integrand)?;
        *I::Memory::adjoint(&mut self.adjoint)? = Adjoint::zeroed();
        let mut adjoint_state = *lambda;
        for k in (0..N).rev() {
            let length = self.begin_part(k, h)?;
            let Self { integrator, nominal, adjoint, .. } = self;
            let memory = I::Memory::nominal(nominal)?;
            let mut adjoint_integrand =
                integrand.as_mut().map(|integrand| AdjointOnlyIntegrand(&mut **integrand));
            let part = integrator.adjoint_with_quadrature(
                &memory.states[k],
                u,
                length,
                &adjoint_state,
                as_dyn_integrand(&mut adjoint_integrand),
            );
            let part = part.and_then(|part| {
                let result = I::Memory::adjoint(adjoint)?;
                adjoint_state.as_mut_slice().copy_from_slice(part.grad_x0.as_slice());
                axpy(T::ONE, part.grad_u.as_slice(), result.grad_u.as_mut_slice());
                axpy(T::ONE, part.grad_p.as_slice(), result.grad_p.as_mut_slice());
                Ok(())
            });
            self.add_part_statistics();
            part?;
        }
        let result = I::Memory::adjoint(&mut self.adjoint)?;
        result.nominal = I::Memory::nominal(&mut self.nominal)?.result;
        result.grad_x0.as_mut_slice().copy_from_slice(adjoint_state.as_slice());
        check_gradient(result.grad_x0.as_slice(), result.grad_u.as_slice(), result.grad_p.as_slice())?;
        Ok(result)
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
        I::Memory: WithHessian,
    {
        check_model_input::<M, T>(Argument::Lambda, lambda.as_slice())?;
        self.begin_call(h)?;
        reset_integrand(&mut integrand);
        self.differentiate_parts(x0, u, h, true, &mut integrand, |this, k, x| {
            I::Memory::nominal(&mut this.nominal)?.states[k] = *x;
            let v = &I::Memory::forward(&mut this.forward)?.v[0];
            I::Memory::hessian(&mut this.hessian)?.start_sensitivities[k].clone_from(v);
            Ok(())
        })?;
        finish_integrand(&mut integrand)?;
        let result = &mut I::Memory::hessian(&mut self.hessian)?.result;
        result.first.forward.clone_from(&I::Memory::forward(&mut self.forward)?.result);
        result.first.grad_u = VectorU::<M, T>::zeroed();
        result.first.grad_p = VectorP::<M, T>::zeroed();
        let mut adjoint_state = *lambda;
        for row in I::Memory::hessian(&mut self.hessian)?.sum.as_mut() {
            *row = ArrayW::<M, T>::zeroed();
        }
        for k in (0..N).rev() {
            let length = self.begin_part(k, h)?;
            let Self { integrator, nominal, hessian, .. } = self;
            let x = I::Memory::nominal(nominal)?.states[k];
            let mut adjoint_integrand =
                integrand.as_mut().map(|integrand| AdjointOnlyIntegrand(&mut **integrand));
            let part = integrator.hessian_with_quadrature(
                &x,
                u,
                length,
                &adjoint_state,
                as_dyn_integrand(&mut adjoint_integrand),
            );
            let part = part.and_then(|part| {
                let HessianMemory { result, start_sensitivities: history, product, sum } =
                    I::Memory::hessian(hessian)?;
                adjoint_state = part.first.grad_x0;
                axpy(T::ONE, part.first.grad_u.as_slice(), result.first.grad_u.as_mut_slice());
                axpy(T::ONE, part.first.grad_p.as_slice(), result.first.grad_p.as_mut_slice());
                let v = ArrayW::<M, T>::flat(history[k].as_ref());
                chain_rule::add_congruence::<M, T>(
                    |r, c| chain_rule::hessian_element(part, r, c),
                    v,
                    [product, sum],
                );
                Ok(())
            });
            self.add_part_statistics();
            part?;
        }
        let HessianMemory { result, sum, .. } = I::Memory::hessian(&mut self.hessian)?;
        result.first.grad_x0 = adjoint_state;
        if let Some(second) = integrand.as_ref().and_then(|integrand| integrand.hessian_sum()) {
            for (sum, second) in sum.as_mut().iter_mut().zip(second) {
                axpy(T::ONE, second.as_ref(), sum.as_mut());
            }
        }
        chain_rule::write_blocks(sum, result);
        let ForwardAdjoint { forward, grad_x0, grad_u, grad_p } = &result.first;
        check_forward(forward, 0)?;
        check_gradient(grad_x0.as_slice(), grad_u.as_slice(), grad_p.as_slice())?;
        check_second_derivatives(result)?;
        Ok(result)
    }
}
