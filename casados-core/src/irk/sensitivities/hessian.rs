//! Second-order sensitivities as users see them.

use crate::error::{Argument, Error};
use crate::finite::check_named;
use crate::irk::driver::Arguments;
use crate::irk::forward::memory::StepOf;
use crate::irk::hessian::pass::HessianMemory;
use crate::irk::integrator::Integrator;
use crate::memory::{Memory, WithHessian};
use crate::model::{Dae, VectorU, VectorX, VectorZ};
use crate::quadrature::{OptionalIntegrand, finish_integrand, reborrow, reset_integrand};
use crate::result::Hessian;
use crate::scalar::Real;
use crate::shape::Matrix;

impl<M: Dae, B, const S: usize, T: Real, W: Memory> Integrator<M, B, S, T, W> {
    /// Allocates what `hessian` needs, so that no call of it will.
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

    /// The solution, its derivatives, and the gradient and the Hessian of `λᵀx₊`, in one pass.
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

    /// The solution, its derivatives, and the gradient and the Hessian of `λᵀx₊ + νᵀz₀`, with the
    /// algebraic states `z₀` at the start of the interval, which are
    /// [`z0`](crate::result::Nominal::z0) of the results: in the same pass.
    ///
    /// `νᵀ∂²z₀/∂(x₀, u, p)²` is what a Lagrangian needs of costs and constraints that depend on
    /// algebraic states.
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

    /// As [`Integrator::hessian`], with weights of `z₀` if they are not empty, and with an
    /// integrand.
    pub(crate) fn hessian_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        nu: &[T],
        along: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Hessian<M, T>, Error>
    where
        W: WithHessian,
    {
        self.hessian_to(&Arguments { x0, u, h }, lambda.as_slice(), nu, along, None)?;
        Ok(&W::hessian(&mut self.hessian)?.result)
    }

    /// The same, written to the memory of `hessian` or elsewhere, where there is no result if there
    /// is an error.
    pub(crate) fn hessian_to(
        &mut self,
        arguments: &Arguments<'_, M, T>,
        lambda: &[T],
        nu: &[T],
        mut along: OptionalIntegrand<'_, '_, M, T>,
        to: Option<&mut Hessian<M, T>>,
    ) -> Result<(), Error>
    where
        W: WithHessian,
    {
        self.run.needs(check_named::<M, T>(Argument::Lambda, lambda))?;
        self.run.needs(check_named::<M, T>(Argument::Nu, nu))?;
        reset_integrand(&mut along);
        self.sweep = None;
        let count = self.run.options.steps;
        let forward = &mut self.run.needs(W::forward(&mut self.forward))?.pass;
        let HessianMemory { result, pass } = self.run.needs(W::hessian(&mut self.hessian))?;
        let distant = to.is_some();
        let to = to.unwrap_or(result);
        let kept = self.run.needs(W::hessian_tape(&mut self.hessian_tape, count))?;
        let parts = self.run.steps(arguments, |parts, n, step, exact| {
            parts.linearize(n, step, exact)?;
            let Some(kept) = kept.get_mut(n) else { return Ok(()) };
            let (at, to) = (StepOf { n, count, distant }, &mut to.first.forward);
            forward.step::<_, false>(parts, at, Some(kept.curved()), to)?;
            if let Some(integrand) = &mut along {
                parts.along_forward(n, step, &forward.sweep, true, &mut **integrand)?;
            }
            // That of the last step is still there on the way back.
            if n + 1 < count {
                kept.remember(parts.work);
            }
            Ok(())
        })?;
        forward.finish::<W::Fallback>(&parts.work.result, count - 1, &mut to.first.forward)?;
        finish_integrand(&mut along)?;
        let ahead = if distant { to.h_xx.as_slice() } else { &[] };
        pass.run(parts, kept, [lambda, nu], ahead, reborrow(&mut along))?;
        pass.finish::<W::Fallback>(along.as_ref().and_then(|integrand| integrand.second()), to)?;
        self.keep_forward().map(|_| ())
    }
}
