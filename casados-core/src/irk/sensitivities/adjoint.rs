//! The public interface to adjoint sensitivities.

use crate::error::{Argument, Error};
use crate::finite::check_model_input;
use crate::irk::driver::Arguments;
use crate::irk::integrator::Integrator;
use crate::memory::{Memory, WithAdjoint};
use crate::model::{Dae, MatrixXC, VectorU, VectorX};
use crate::quadrature::{OptionalIntegrand, finish_integrand, reset_integrand};
use crate::result::Adjoint;
use crate::scalar::Real;
use crate::shape::Matrix;

impl<M: Dae, B, const S: usize, T: Real, W: Memory> Integrator<M, B, S, T, W> {
    /// Allocates the memory of `adjoint_many` with `C` seeds (`adjoint` has one), so that its calls
    /// do not allocate.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub fn reserve_adjoint<const C: usize>(&mut self) -> Result<(), Error>
    where
        W: WithAdjoint<C>,
    {
        W::adjoint(&mut self.adjoint)?;
        self.run.reserve()
    }

    /// Returns the solution, and the gradient of `λᵀx₊` with respect to `x₀`, `u` and `p`.
    ///
    /// # Errors
    /// See [`Integrator`].
    pub fn adjoint(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
    ) -> Result<&Adjoint<M, T>, Error>
    where
        W: WithAdjoint<1>,
    {
        self.solve_adjoint(&Arguments { x0, u, h }, lambda.as_slice(), None)
    }

    /// Returns the solution, and the gradients of `λᵀx₊` for `C` seeds `λ`, the columns of
    /// `lambdas`.
    ///
    /// # Errors
    /// See [`Integrator`].
    pub fn adjoint_many<const C: usize>(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambdas: &MatrixXC<M, T, C>,
    ) -> Result<&Adjoint<M, T, C>, Error>
    where
        W: WithAdjoint<C>,
    {
        self.solve_adjoint(&Arguments { x0, u, h }, lambdas.as_slice(), None)
    }

    pub(in crate::irk) fn solve_adjoint<const C: usize>(
        &mut self,
        arguments: &Arguments<'_, M, T>,
        seeds: &[T],
        mut integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Adjoint<M, T, C>, Error>
    where
        W: WithAdjoint<C>,
    {
        self.run.invalidate_solution_on_error(check_model_input::<M, T>(Argument::Lambda, seeds))?;
        reset_integrand(&mut integrand);
        let memory = self.run.invalidate_solution_on_error(W::adjoint(&mut self.adjoint))?;
        let count = self.run.options.steps;
        // The forward pass linearises only the last step, where the backward pass begins.
        let mut context = self.run.run_steps(arguments, |parts, n, step, exact| {
            if let Some(integrand) = &mut integrand {
                parts.workspace.add_integrand_value(parts.coefficients, n, step, &mut **integrand)?;
            }
            if n + 1 == count { parts.linearize(n, step, exact) } else { Ok(()) }
        })?;
        memory.backward.set_seeds(seeds, &[]);
        for (n, step) in context.steps.iter().enumerate().rev() {
            if n + 1 < count {
                context.linearize(n, step, false)?;
            }
            memory.backward.step_backwards(&mut context, &mut None, n, step, &mut integrand)?;
        }
        memory.finish(context.workspace)?;
        finish_integrand(&mut integrand)?;
        self.differentiated_step = None;
        self.run.commit()?;
        Ok(&memory.result)
    }
}
