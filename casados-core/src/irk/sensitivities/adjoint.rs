//! Adjoint sensitivities as users see them.

use crate::error::{Argument, Error};
use crate::finite::check_named;
use crate::irk::driver::Arguments;
use crate::irk::integrator::Integrator;
use crate::memory::{Memory, WithAdjoint};
use crate::model::{Dae, MatrixXC, VectorU, VectorX};
use crate::quadrature::{OptionalIntegrand, finish_integrand, reset_integrand};
use crate::result::Adjoint;
use crate::scalar::Real;
use crate::shape::Matrix;

impl<M: Dae, B, const S: usize, T: Real, W: Memory> Integrator<M, B, S, T, W> {
    /// Allocates what `adjoint_many` with `C` seeds needs, so that no call of it will. `adjoint`
    /// has one.
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

    /// The solution, and the gradient of `λᵀx₊` with respect to `x₀`, `u` and `p`.
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
        self.backward(&Arguments { x0, u, h }, lambda.as_slice(), None)
    }

    /// The solution, and the gradients of `λᵀx₊` for `C` seeds `λ`, the columns of `lambdas`.
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
        self.backward(&Arguments { x0, u, h }, lambdas.as_slice(), None)
    }

    pub(in crate::irk) fn backward<const C: usize>(
        &mut self,
        arguments: &Arguments<'_, M, T>,
        seeds: &[T],
        mut along: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Adjoint<M, T, C>, Error>
    where
        W: WithAdjoint<C>,
    {
        self.run.needs(check_named::<M, T>(Argument::Lambda, seeds))?;
        reset_integrand(&mut along);
        let memory = self.run.needs(W::adjoint(&mut self.adjoint))?;
        let count = self.run.options.steps;
        // On the way forth only the last step is linearised: it is where the way back begins.
        let mut parts = self.run.steps(arguments, |parts, n, step, exact| {
            if let Some(integrand) = &mut along {
                parts.work.along_value(parts.coefficients, n, step, &mut **integrand)?;
            }
            if n + 1 == count { parts.linearize(n, step, exact) } else { Ok(()) }
        })?;
        memory.backward.start(seeds, &[]);
        for (n, step) in parts.steps.iter().enumerate().rev() {
            if n + 1 < count {
                parts.linearize(n, step, false)?;
            }
            memory.backward.step(&mut parts, &mut None, n, step, &mut along)?;
        }
        memory.finish(parts.work)?;
        finish_integrand(&mut along)?;
        self.sweep = None;
        self.run.keep()?;
        Ok(&memory.result)
    }
}
