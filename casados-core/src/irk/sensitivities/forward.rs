//! The public interface to forward sensitivities, in all or in given directions.

use crate::error::{Argument, Error};
use crate::finite::check_model_input;
use crate::irk::dense_output::StepPoint;
use crate::irk::driver::{Arguments, CallContext};
use crate::irk::forward::gradient::checked_gradient;
use crate::irk::forward::memory::{ForwardMemory, StepIndex};
use crate::irk::integrator::Integrator;
use crate::memory::{Memory, WithDirectional, WithForward};
use crate::model::{Dae, VectorU, VectorX};
use crate::quadrature::{OptionalIntegrand, finish_integrand, reset_integrand};
use crate::result::{DenseForward, Directional, Forward, ForwardAdjoint, Seeds};
use crate::scalar::Real;
use crate::shape::{InBounds, Matrix};
use crate::statistics::Statistics;

impl<M: Dae, B, const S: usize, T: Real, W: Memory> Integrator<M, B, S, T, W> {
    /// Allocates the memory of `forward`, so that its calls do not allocate.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub fn reserve_forward(&mut self) -> Result<(), Error>
    where
        W: WithForward,
    {
        W::forward(&mut self.forward)?;
        self.run.reserve()
    }

    /// Returns the solution, and its derivatives with respect to `x₀`, `u` and `p`.
    ///
    /// # Errors
    /// See [`Integrator`].
    pub fn forward(&mut self, x0: &VectorX<M, T>, u: &VectorU<M, T>, h: T) -> Result<&Forward<M, T>, Error>
    where
        W: WithForward,
    {
        self.differentiate::<false>(&Arguments { x0, u, h }, None, None)?;
        self.commit_forward()
    }

    /// [`Integrator::forward`] with a result of the caller, which is invalid after an error.
    #[cfg(feature = "alloc")]
    pub(crate) fn forward_to(
        &mut self,
        arguments: &Arguments<'_, M, T>,
        to: &mut Forward<M, T>,
    ) -> Result<(), Error>
    where
        W: WithForward,
    {
        self.differentiate::<false>(arguments, None, Some(to))?;
        self.commit_forward().map(|_| ())
    }

    /// [`Integrator::forward`] with an integrand, and with refinement of derivatives that lost
    /// digits.
    #[cfg(feature = "alloc")]
    pub(crate) fn forward_refined(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Forward<M, T>, Error>
    where
        W: WithForward,
    {
        self.differentiate::<true>(&Arguments { x0, u, h }, integrand, None)?;
        self.commit_forward()
    }

    /// Returns the solution, its derivatives, and the gradient of `λᵀx₊`: the product of `λ` with
    /// the derivatives.
    ///
    /// # Errors
    /// See [`Integrator`].
    pub fn forward_adjoint(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
    ) -> Result<&ForwardAdjoint<M, T>, Error>
    where
        W: WithForward,
    {
        self.run
            .invalidate_solution_on_error(check_model_input::<M, T>(Argument::Lambda, lambda.as_slice()))?;
        self.differentiate::<false>(&Arguments { x0, u, h }, None, None)?;
        checked_gradient(&mut W::forward(&mut self.forward)?.result, lambda.as_slice())?;
        self.commit_forward()?;
        Ok(&W::forward(&mut self.forward)?.result)
    }

    /// [`Integrator::forward_adjoint`] with a result of the caller, which is invalid after an
    /// error.
    #[cfg(feature = "alloc")]
    pub(crate) fn forward_adjoint_to(
        &mut self,
        arguments: &Arguments<'_, M, T>,
        lambda: &[T],
        to: &mut ForwardAdjoint<M, T>,
    ) -> Result<(), Error>
    where
        W: WithForward,
    {
        self.run.invalidate_solution_on_error(check_model_input::<M, T>(Argument::Lambda, lambda))?;
        self.differentiate::<false>(arguments, None, Some(&mut to.forward))?;
        checked_gradient(to, lambda)?;
        self.commit_forward().map(|_| ())
    }

    /// Computes derivatives, into the memory of `forward` or of the caller. Not inlined, so that it
    /// is optimised once.
    #[cfg_attr(feature = "std", inline(never))]
    pub(in crate::irk) fn differentiate<const REFINED: bool>(
        &mut self,
        arguments: &Arguments<'_, M, T>,
        mut integrand: OptionalIntegrand<'_, '_, M, T>,
        to: Option<&mut Forward<M, T>>,
    ) -> Result<(), Error>
    where
        W: WithForward,
    {
        self.differentiated_step = None;
        reset_integrand(&mut integrand);
        let ForwardMemory { result, pass, .. } =
            self.run.invalidate_solution_on_error(W::forward(&mut self.forward))?;
        let prefetch_output = to.is_some();
        let to = to.unwrap_or(&mut result.forward);
        let count = self.run.options.steps;
        let context = self.run.run_steps(arguments, |parts, n, step, exact| {
            parts.linearize(n, step, exact)?;
            pass.step::<_, REFINED>(parts, StepIndex { n, count, prefetch_output }, None, to)?;
            match &mut integrand {
                Some(integrand) => parts.add_integrand_forward(n, step, &pass.sweep, false, &mut **integrand),
                None => Ok(()),
            }
        })?;
        pass.finish::<W::Fallback>(&context.workspace.result, count - 1, to)?;
        finish_integrand(&mut integrand)
    }

    /// Commits a successful call, with its steps and the stage derivatives.
    pub(in crate::irk) fn commit_forward(&mut self) -> Result<&Forward<M, T>, Error>
    where
        W: WithForward,
    {
        self.run.commit()?;
        self.differentiated_step = Some(self.run.options.steps - 1);
        Ok(&W::forward(&mut self.forward)?.result.forward)
    }

    /// Returns the derivatives of `Σ_i weight_i k_i` of the last step after
    /// [`Integrator::forward`], one row per direction.
    ///
    /// # Errors
    /// [`Error::NoResult`]
    #[cfg(feature = "alloc")]
    pub(crate) fn slope_derivatives(
        &mut self,
        weights: &[f64],
        to: &mut crate::model::ArrayW<M, crate::model::ArrayX<M, T>>,
    ) -> Result<(), Error>
    where
        W: WithForward,
    {
        let weights: &[f64; S] = weights.first_chunk().ok_or(Error::NoResult)?;
        W::forward(&mut self.forward)?.pass.slope_derivatives(&weights.map(T::from_f64), to);
        Ok(())
    }

    /// Returns the solution at the time `t` (time of the model) inside the interval of the last
    /// successful call, and its derivatives with respect to `x₀`, `u` and `p`.
    ///
    /// The steps of that call are differentiated up to the one that contains `t`; a following call
    /// with a time in the same step or a later one continues from there.
    ///
    /// # Errors
    /// Those of [`Integrator::dense`] and [`Integrator::forward`].
    pub fn dense_forward(&mut self, t: T) -> Result<&DenseForward<M, T>, Error>
    where
        W: WithForward,
    {
        let forward = W::forward(&mut self.forward)?;
        let last = self.run.last_call()?;
        let point =
            StepPoint::new(t, &last.workspace.last_inputs, last.steps.len(), &last.coefficients.tableau)?;
        let differentiated = self.differentiated_step.take().filter(|done| *done <= point.step);
        // The statistics of the last call remain unchanged.
        let mut statistics = Statistics::default();
        let mut context = CallContext { statistics: &mut statistics, ..last };
        context.workspace.inputs = context.workspace.last_inputs;
        // The factors in the workspace may belong to a failed call.
        context.workspace.begin_call();
        let first = differentiated.map_or(0, |done| done + 1);
        for (n, step) in context.steps.iter().enumerate().take(point.step + 1).skip(first) {
            context.linearize(n, step, false)?;
            let ForwardMemory { result, pass, .. } = &mut *forward;
            // No step counts as the last, since the result exists already.
            let at = StepIndex { n, count: usize::MAX, prefetch_output: false };
            pass.step::<_, false>(&mut context, at, None, &mut result.forward)?;
        }
        self.differentiated_step = Some(point.step);
        let h = context.workspace.last_inputs.time.step;
        if let Some(step) = context.steps.get(point.step).in_bounds() {
            point.evaluate(step, h, &mut forward.dense.dense)?;
        }
        point.differentiate::<_, W::Fallback>(h, forward)?;
        Ok(&forward.dense)
    }
}

impl<M: Dae, B, const S: usize, T: Real, W: Memory> Integrator<M, B, S, T, W> {
    /// Allocates the memory of `directional` with `C` directions, so that its calls do not
    /// allocate.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub fn reserve_directional<const C: usize>(&mut self) -> Result<(), Error>
    where
        W: WithDirectional<C>,
    {
        W::directional(&mut self.directional)?;
        self.run.reserve()
    }

    /// Returns the solution, and its derivatives in `C` directions.
    ///
    /// # Errors
    /// See [`Integrator`].
    pub fn directional<const C: usize>(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        seeds: &Seeds<M, T, C>,
    ) -> Result<&Directional<M, T, C>, Error>
    where
        W: WithDirectional<C>,
    {
        self.run
            .invalidate_solution_on_error(check_model_input::<M, T>(Argument::SeedX, seeds.x0.as_slice()))?;
        self.run
            .invalidate_solution_on_error(check_model_input::<M, T>(Argument::SeedU, seeds.u.as_slice()))?;
        self.run
            .invalidate_solution_on_error(check_model_input::<M, T>(Argument::SeedP, seeds.p.as_slice()))?;
        let memory = self.run.invalidate_solution_on_error(W::directional(&mut self.directional))?;
        memory.set_seeds(seeds);
        let count = self.run.options.steps;
        let context = self.run.run_steps(&Arguments { x0, u, h }, |parts, n, step, exact| {
            parts.linearize(n, step, exact)?;
            memory.step(parts, n, count)
        })?;
        memory.finish(context.workspace, count - 1)?;
        self.differentiated_step = None;
        self.run.commit()?;
        Ok(&memory.result)
    }

    /// Adds the derivatives of the stages of every step in one direction to `to`.
    #[cfg(feature = "alloc")]
    pub(crate) fn add_stage_derivatives(
        &mut self,
        arguments: &Arguments<'_, M, T>,
        seeds: &Seeds<M, T, 1>,
        to: &mut [crate::model::ArrayK<M, [T; S]>],
    ) -> Result<(), Error>
    where
        W: WithDirectional<1>,
    {
        let memory = W::directional(&mut self.directional)?;
        memory.set_seeds(seeds);
        let count = self.run.options.steps;
        self.run.run_steps(arguments, |parts, n, step, exact| {
            parts.linearize(n, step, exact)?;
            memory.step(parts, n, count)?;
            let to = to.get_mut(n).map_or(&mut [][..], |to| to.as_mut().as_flattened_mut());
            for (to, &derivative) in to.iter_mut().zip(memory.stage_derivatives()) {
                *to = *to + derivative;
            }
            Ok(())
        })?;
        self.differentiated_step = None;
        self.run.commit().map(|_| ())
    }
}
