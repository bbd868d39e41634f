//! The public interface to second-order sensitivities.

use crate::error::{Argument, Error};
use crate::finite::check_model_input;
use crate::irk::driver::Arguments;
use crate::irk::forward::memory::StepIndex;
use crate::irk::hessian::backward_pass::HessianMemory;
use crate::irk::integrator::Integrator;
use crate::memory::{Memory, WithHessian};
use crate::model::{Dae, VectorU, VectorX, VectorZ};
use crate::quadrature::{OptionalIntegrand, finish_integrand, reborrow, reset_integrand};
use crate::result::Hessian;
use crate::scalar::Real;
use crate::shape::{InBounds, Matrix};

impl<M: Dae, B, const S: usize, T: Real, W: Memory> Integrator<M, B, S, T, W> {
    /// Allocates the memory of `hessian`, so that its calls do not allocate.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub fn reserve_hessian(&mut self) -> Result<(), Error>
    where
        W: WithHessian,
    {
        W::hessian(&mut self.hessian)?;
        W::hessian_tape(&mut self.hessian_tape, self.run.options.steps)?;
        self.reserve_forward()
    }

    /// Returns the solution, its derivatives, and the gradient and the Hessian of `λᵀx₊`.
    ///
    /// # Errors
    /// See [`Integrator`].
    pub fn hessian(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
    ) -> Result<&Hessian<M, T>, Error>
    where
        W: WithHessian,
    {
        self.hessian_with_quadrature(x0, u, h, lambda, &[], None)
    }

    /// Returns the solution, its derivatives, and the gradient and the Hessian of `λᵀx₊ + νᵀz₀`,
    /// where `z₀` are the algebraic states at the start of the interval,
    /// [`z0`](crate::result::Nominal::z0) of the results. It takes the same single pass as
    /// [`hessian`](Self::hessian).
    ///
    /// `νᵀ∂²z₀/∂(x₀, u, p)²` enters the Hessian of a Lagrangian whose costs or constraints depend
    /// on algebraic states.
    ///
    /// # Errors
    /// See [`Integrator`].
    ///
    /// ```
    /// # use casados_core::{Error, Irk, Gauss, Dae, Options, model::{VectorU, VectorX, VectorZ}};
    /// # fn example<Crane: Dae>(x0: VectorX<Crane, f64>, u: VectorU<Crane, f64>, lambda: VectorX<Crane, f64>, nu: VectorZ<Crane, f64>) -> Result<(), Error> {
    /// let mut irk = Irk::<Crane, Gauss<4>>::new(Options::default())?;
    /// let step = irk.hessian_with_z0(&x0, &u, 0.05, &lambda, &nu)?;
    /// let (gradient, hessian) = (step.grad_x0, step.h_xx);
    /// # Ok(())
    /// # }
    /// ```
    pub fn hessian_with_z0(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        nu: &VectorZ<M, T>,
    ) -> Result<&Hessian<M, T>, Error>
    where
        W: WithHessian,
    {
        self.hessian_with_quadrature(x0, u, h, lambda, nu.as_slice(), None)
    }

    /// [`Integrator::hessian`] with an integrand, and with weights of `z₀` unless `nu` is empty.
    pub(crate) fn hessian_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        nu: &[T],
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Hessian<M, T>, Error>
    where
        W: WithHessian,
    {
        self.hessian_to(&Arguments { x0, u, h }, lambda.as_slice(), nu, integrand, None)?;
        Ok(&W::hessian(&mut self.hessian)?.result)
    }

    /// The same with a result in the memory of `hessian` or of the caller, which is invalid after
    /// an error.
    pub(crate) fn hessian_to(
        &mut self,
        arguments: &Arguments<'_, M, T>,
        lambda: &[T],
        nu: &[T],
        mut integrand: OptionalIntegrand<'_, '_, M, T>,
        to: Option<&mut Hessian<M, T>>,
    ) -> Result<(), Error>
    where
        W: WithHessian,
    {
        self.run.invalidate_solution_on_error(check_model_input::<M, T>(Argument::Lambda, lambda))?;
        self.run.invalidate_solution_on_error(check_model_input::<M, T>(Argument::Nu, nu))?;
        reset_integrand(&mut integrand);
        self.differentiated_step = None;
        let count = self.run.options.steps;
        let forward = &mut self.run.invalidate_solution_on_error(W::forward(&mut self.forward))?.pass;
        let HessianMemory { result, pass } =
            self.run.invalidate_solution_on_error(W::hessian(&mut self.hessian))?;
        let prefetch_output = to.is_some();
        let to = to.unwrap_or(result);
        let tape = self.run.invalidate_solution_on_error(W::hessian_tape(&mut self.hessian_tape, count))?;
        let context = self.run.run_steps(arguments, |parts, n, step, exact| {
            parts.linearize(n, step, exact)?;
            let Some(kept) = tape.get_mut(n).in_bounds() else { return Ok(()) };
            let (at, to) = (StepIndex { n, count, prefetch_output }, &mut to.first.forward);
            forward.step::<_, false>(parts, at, Some(kept.stage_sensitivities_mut()), to)?;
            if let Some(integrand) = &mut integrand {
                parts.add_integrand_forward(n, step, &forward.sweep, true, &mut **integrand)?;
            }
            // The backward pass finds the linearisation of the last step in the workspace.
            if n + 1 < count {
                kept.store_linearization(parts.workspace);
            }
            Ok(())
        })?;
        forward.finish::<W::Fallback>(&context.workspace.result, count - 1, &mut to.first.forward)?;
        finish_integrand(&mut integrand)?;
        let prefetch = if prefetch_output { to.h_xx.as_slice() } else { &[] };
        pass.run_backwards(context, tape, [lambda, nu], prefetch, reborrow(&mut integrand))?;
        pass.finish::<W::Fallback>(integrand.as_ref().and_then(|integrand| integrand.hessian_sum()), to)?;
        self.commit_forward().map(|_| ())
    }
}
