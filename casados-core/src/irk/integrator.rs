//! The integrator as its users see it.

use super::along::{Along, begin, finish, reborrow};
use super::dense::Point;
use super::forward::ForwardMemory;
use super::hessian::{HessianMemory, HessianStep};
use super::run::{Arguments, Run, check};
use crate::error::{Argument, Error};
#[cfg(feature = "alloc")]
use crate::memory::Heap;
use crate::memory::{Fallback, Inline, Memory, WithAdjoint, WithDirectional, WithForward, WithHessian};
use crate::model::{Dae, MatrixXC, VectorP, VectorU, VectorX, VectorZ};
use crate::options::Options;
use crate::result::{
    Adjoint, Dense, DenseForward, Directional, Forward, ForwardAdjoint, Hessian, Nominal, Seeds,
};
use crate::scalar::Real;
use crate::shape::Matrix;
use crate::statistics::Statistics;
use crate::tableau::{Custom, Method, Tableau};
use core::marker::PhantomData;

/// An implicit Runge-Kutta integrator with `S` stages of the method `B` for the model `M`; see
/// [`Irk`](super::Irk).
///
/// All calls take the state at the start of the interval, the control, and the length of the interval,
/// which may be negative or zero. They return a reference to results in the memory of the integrator.
///
/// # Errors
/// Of every call: [`Error::NonFiniteInput`], [`Error::ParametersNotSet`], [`Error::StartNotGiven`],
/// [`Error::NonFiniteModel`], [`Error::Singular`], [`Error::NotConverged`], [`Error::Overflow`], and
/// [`Error::OutOfMemory`] of the first call of its kind. Then the integrator is as it was before the call:
/// usable, with the same warm start and the same dense output.
pub struct Integrator<M: Dae, B, const S: usize, T: Real, W: Memory> {
    run: Run<M, T, S, W>,
    forward: W::Forward<ForwardMemory<M, T, S>>,
    directional: W::Directional<M, T, S>,
    adjoint: W::Adjoint<M, T, S>,
    hessian: W::Hessian<HessianMemory<M, T, S>>,
    hessian_tape: W::HessianTape<HessianStep<M, T, S, W::Fallback>>,
    /// The step of the last successful call whose derivatives are in the memory of `forward`.
    sweep: Option<usize>,
    method: PhantomData<fn() -> B>,
}

#[cfg(feature = "alloc")]
impl<M: Dae, B: Method<S>, const S: usize, T: Real> Integrator<M, B, S, T, Heap> {
    /// An integrator with its memory on the heap.
    ///
    /// # Errors
    /// [`Error::InvalidOption`]
    pub fn new(options: Options) -> Result<Self, Error> {
        Self::build(options, B::TABLEAU)
    }
}

#[cfg(feature = "alloc")]
impl<M: Dae, const S: usize, T: Real> Integrator<M, Custom<S>, S, T, Heap> {
    /// An integrator for a tableau of the user's own, with its memory on the heap.
    ///
    /// # Errors
    /// [`Error::InvalidOption`]; [`Error::NoInterpolation`] if the model has algebraic states and two nodes
    /// are equal.
    pub fn with_tableau(options: Options, tableau: Tableau<S>) -> Result<Self, Error> {
        Self::build(options, tableau)
    }
}

impl<M: Dae, B: Method<S>, const S: usize, T: Real, Mode: 'static, const STEPS: usize, F: Fallback>
    Integrator<M, B, S, T, Inline<Mode, STEPS, F>>
where
    Inline<Mode, STEPS, F>: Memory,
{
    /// An integrator that is its own memory, for at most `STEPS` steps.
    ///
    /// # Errors
    /// [`Error::InvalidOption`]
    pub fn inline(options: Options) -> Result<Self, Error> {
        Self::ready(options, B::TABLEAU)
    }
}

impl<M: Dae, const S: usize, T: Real, Mode: 'static, const STEPS: usize, F: Fallback>
    Integrator<M, Custom<S>, S, T, Inline<Mode, STEPS, F>>
where
    Inline<Mode, STEPS, F>: Memory,
{
    /// An integrator for a tableau of the user's own that is its own memory, for at most `STEPS` steps.
    ///
    /// # Errors
    /// As `with_tableau`.
    pub fn inline_with_tableau(options: Options, tableau: Tableau<S>) -> Result<Self, Error> {
        Self::ready(options, tableau)
    }
}

impl<M: Dae, B, const S: usize, T: Real, W: Memory> Integrator<M, B, S, T, W> {
    /// Bytes of the integrator itself. With [`Inline`] memory this is all there is.
    pub const SIZE: usize = size_of::<Self>();

    pub(crate) fn build(options: Options, tableau: Tableau<S>) -> Result<Self, Error> {
        Ok(Self {
            run: Run::new(options, tableau)?,
            forward: Default::default(),
            directional: Default::default(),
            adjoint: Default::default(),
            hessian: Default::default(),
            hessian_tape: Default::default(),
            sweep: None,
            method: PhantomData,
        })
    }

    /// As `build`, and what a first call would prepare: none takes longer than the others.
    fn ready(options: Options, tableau: Tableau<S>) -> Result<Self, Error> {
        let mut integrator = Self::build(options, tableau)?;
        integrator.reserve()?;
        Ok(integrator)
    }

    /// The parameters `p` of all following calls.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]: then the last parameters stay.
    pub fn set_parameters(&mut self, p: &VectorP<M, T>) -> Result<(), Error> {
        self.run.set_parameters(p)
    }

    /// The time at the start of the interval of all following calls; zero if never set.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]: then the last time stays.
    pub fn set_time(&mut self, t: T) -> Result<(), Error> {
        self.run.set_time(t)
    }

    /// Start values `ẋ` and `z` for Newton's method, at all stages: read with
    /// [`Start::Given`](crate::options::Start), and with `Start::Warm` where there is no warm start.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]: then the last values stay.
    pub fn set_start(&mut self, xdot: &VectorX<M, T>, z: &VectorZ<M, T>) -> Result<(), Error> {
        self.run.set_start(xdot, z)
    }

    /// Forgets the warm start.
    pub fn reset(&mut self) {
        self.run.reset();
    }

    /// The options.
    #[must_use]
    pub fn options(&self) -> &Options {
        &self.run.options
    }

    /// The tableau.
    #[must_use]
    pub fn tableau(&self) -> &Tableau<S> {
        &self.run.coefficients.tableau
    }

    /// What the last call did, successful or not.
    #[must_use]
    pub fn statistics(&self) -> &Statistics {
        &self.run.statistics
    }

    /// Whether the start values of all following calls are solutions but for their last digits.
    #[cfg(feature = "alloc")]
    pub(crate) fn set_near(&mut self, near: bool) -> Result<(), Error> {
        self.run.set_near(near)
    }

    /// Start values of the stages of the first step, for an integrator with a warm start.
    #[cfg(feature = "alloc")]
    pub(crate) fn set_stages(&mut self, y: &[T]) -> Result<(), Error> {
        self.run.set_stages(y)
    }

    /// The stages of every step, for an integrator with a warm start.
    #[cfg(feature = "alloc")]
    pub(crate) fn set_record(&mut self, record: &[crate::model::ArrayK<M, [T; S]>]) -> Result<(), Error> {
        self.run.set_record(record)
    }

    /// Copies the stages of every step of the last successful call.
    #[cfg(feature = "alloc")]
    pub(crate) fn record(&mut self, record: &mut [crate::model::ArrayK<M, [T; S]>]) -> Result<(), Error> {
        for (y, step) in record.iter_mut().zip(self.run.last()?.steps) {
            crate::shape::assign(y, &step.y);
        }
        Ok(())
    }

    /// The variables at the stages where the last call ended, successful or not.
    #[cfg(feature = "alloc")]
    pub(crate) fn points(&mut self) -> Result<&crate::model::ArrayV<M, [T; S]>, Error> {
        self.run.points()
    }

    /// The unknowns `(k, z)` at the stages of the first step of the last successful call, stages innermost.
    #[cfg(feature = "alloc")]
    pub(crate) fn stages(&mut self) -> Result<&[T], Error> {
        let steps = self.run.last()?.steps;
        Ok(steps.first().map_or(&[], |step| step.y.as_ref().as_flattened()))
    }

    /// Allocates what `solve` needs, so that no call of it will.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub fn reserve(&mut self) -> Result<(), Error> {
        self.run.reserve()
    }

    /// `x₊`, and `z` at both ends.
    ///
    /// # Errors
    /// See [`Integrator`].
    pub fn solve(&mut self, x0: &VectorX<M, T>, u: &VectorU<M, T>, h: T) -> Result<&Nominal<M, T>, Error> {
        self.solve_along(x0, u, h, None)
    }

    /// As [`Integrator::solve`], with an integrand.
    pub(crate) fn solve_along(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        mut along: Along<'_, '_, M, T>,
    ) -> Result<&Nominal<M, T>, Error> {
        begin(&mut along);
        self.run.steps(&Arguments { x0, u, h }, |parts, n, step, _| match &mut along {
            Some(integrand) => parts.work.along_value(parts.coefficients, n, step, &mut **integrand),
            None => Ok(()),
        })?;
        finish(&mut along)?;
        self.sweep = None;
        Ok(&self.run.keep()?.result)
    }

    /// The solution at a time inside the interval of the last successful call.
    ///
    /// # Errors
    /// [`Error::NoResult`], [`Error::OutsideInterval`], [`Error::NonFiniteInput`], [`Error::Overflow`];
    /// [`Error::NoInterpolation`] if the tableau is not one of collocation.
    pub fn dense(&mut self, t: T) -> Result<&Dense<M, T>, Error> {
        let last = self.run.last()?;
        let work = last.work;
        let point = Point::new(t, &work.kept, last.steps.len(), &last.coefficients.tableau)?;
        let h = work.kept.time.step;
        if let Some(step) = last.steps.get(point.step) {
            point.evaluate(step, h, &mut work.dense)?;
        }
        Ok(&work.dense)
    }
}

impl<M: Dae, B, const S: usize, T: Real, W: Memory> Integrator<M, B, S, T, W> {
    /// Allocates what `forward` needs, so that no call of it will.
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

    /// The solution, and its derivatives with respect to `x₀`, `u` and `p`.
    ///
    /// # Errors
    /// See [`Integrator`].
    pub fn forward(&mut self, x0: &VectorX<M, T>, u: &VectorU<M, T>, h: T) -> Result<&Forward<M, T>, Error>
    where
        W: WithForward,
    {
        self.forward_along(x0, u, h, None)
    }

    /// As [`Integrator::forward`], with an integrand.
    pub(crate) fn forward_along(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        along: Along<'_, '_, M, T>,
    ) -> Result<&Forward<M, T>, Error>
    where
        W: WithForward,
    {
        Ok(&self.differentiate::<false>(&Arguments { x0, u, h }, None, along)?.forward)
    }

    /// The same, with derivatives refined where digits were lost.
    #[cfg(feature = "alloc")]
    pub(crate) fn forward_refined(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        along: Along<'_, '_, M, T>,
    ) -> Result<&Forward<M, T>, Error>
    where
        W: WithForward,
    {
        Ok(&self.differentiate::<true>(&Arguments { x0, u, h }, None, along)?.forward)
    }

    /// The solution, its derivatives, and the gradient of `λᵀx₊`: the product of `λ` with the derivatives.
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
        check(Argument::Lambda, lambda.as_slice())?;
        self.differentiate::<false>(&Arguments { x0, u, h }, Some(lambda.as_slice()), None)
    }

    fn differentiate<const REFINED: bool>(
        &mut self,
        arguments: &Arguments<'_, M, T>,
        lambda: Option<&[T]>,
        mut along: Along<'_, '_, M, T>,
    ) -> Result<&ForwardAdjoint<M, T>, Error>
    where
        W: WithForward,
    {
        self.sweep = None;
        begin(&mut along);
        let forward = W::forward(&mut self.forward)?;
        let count = self.run.options.steps;
        let parts = self.run.steps(arguments, |parts, n, step, exact| {
            parts.linearize(n, step, exact)?;
            forward.step::<_, REFINED>(parts.work, parts.coefficients, n, count, parts.statistics, None)?;
            match &mut along {
                Some(integrand) => parts.along_forward(n, step, &forward.sweep, false, &mut **integrand),
                None => Ok(()),
            }
        })?;
        forward.finish(&parts.work.result, count - 1, None)?;
        finish(&mut along)?;
        if let Some(lambda) = lambda {
            forward.gradient(lambda)?;
        }
        self.run.keep()?;
        self.sweep = Some(count - 1);
        Ok(&forward.result)
    }

    /// After [`Integrator::forward`]: the derivatives of `Σ_i weight_i k_i` of the last step, a row for each direction.
    ///
    /// # Errors
    /// [`Error::NoResult`]
    #[cfg(feature = "alloc")]
    pub(crate) fn slopes(
        &mut self,
        weights: &[f64],
        to: &mut crate::model::ArrayW<M, crate::model::ArrayX<M, T>>,
    ) -> Result<(), Error>
    where
        W: WithForward,
    {
        let weights: &[f64; S] = weights.first_chunk().ok_or(Error::NoResult)?;
        W::forward(&mut self.forward)?.slopes(&weights.map(T::from_f64), to);
        Ok(())
    }

    /// The solution at a time inside the interval of the last successful call, and its derivatives with
    /// respect to `x₀`, `u` and `p`.
    ///
    /// The stages of that call are differentiated step by step up to the one that contains the time; times
    /// in the same step or a later one go on from there.
    ///
    /// # Errors
    /// Those of [`Integrator::dense`], and of [`Integrator::forward`].
    pub fn dense_forward(&mut self, t: T) -> Result<&DenseForward<M, T>, Error>
    where
        W: WithForward,
    {
        let forward = W::forward(&mut self.forward)?;
        let last = self.run.last()?;
        let point = Point::new(t, &last.work.kept, last.steps.len(), &last.coefficients.tableau)?;
        let done = self.sweep.take().filter(|done| *done <= point.step);
        let mut parts = last;
        parts.work.inputs = parts.work.kept;
        parts.work.place_inputs();
        let first = done.map_or(0, |done| done + 1);
        for (n, step) in parts.steps.iter().enumerate().take(point.step + 1).skip(first) {
            parts.linearize(n, step, false)?;
            forward.step::<_, false>(
                parts.work,
                parts.coefficients,
                n,
                usize::MAX,
                parts.statistics,
                None,
            )?;
        }
        self.sweep = Some(point.step);
        let h = parts.work.kept.time.step;
        if let Some(step) = parts.steps.get(point.step) {
            point.evaluate(step, h, &mut forward.dense.dense)?;
        }
        point.differentiate(h, forward)?;
        Ok(&forward.dense)
    }
}

impl<M: Dae, B, const S: usize, T: Real, W: Memory> Integrator<M, B, S, T, W> {
    /// Allocates what `directional` with `C` directions needs, so that no call of it will.
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

    /// The solution, and its derivatives in `C` directions.
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
        check(Argument::SeedX, seeds.x0.as_slice())?;
        check(Argument::SeedU, seeds.u.as_slice())?;
        check(Argument::SeedP, seeds.p.as_slice())?;
        let memory = W::directional(&mut self.directional)?;
        memory.seed(seeds);
        let count = self.run.options.steps;
        let parts = self.run.steps(&Arguments { x0, u, h }, |parts, n, step, exact| {
            parts.linearize(n, step, exact)?;
            memory.step(parts.work, parts.coefficients, n, count, parts.statistics)
        })?;
        memory.finish(parts.work, count - 1)?;
        self.sweep = None;
        self.run.keep()?;
        Ok(&memory.result)
    }

    /// Allocates what `adjoint_many` with `C` seeds needs, so that no call of it will. `adjoint` has one.
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

    /// As [`Integrator::adjoint`], with an integrand.
    pub(crate) fn adjoint_along(
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
        self.backward(&Arguments { x0, u, h }, lambda.as_slice(), along)
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

    fn backward<const C: usize>(
        &mut self,
        arguments: &Arguments<'_, M, T>,
        seeds: &[T],
        mut along: Along<'_, '_, M, T>,
    ) -> Result<&Adjoint<M, T, C>, Error>
    where
        W: WithAdjoint<C>,
    {
        check(Argument::Lambda, seeds)?;
        begin(&mut along);
        let memory = W::adjoint(&mut self.adjoint)?;
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
            memory.backward.step(parts.work, parts.coefficients, n, step, parts.statistics, &mut along)?;
        }
        memory.finish(parts.work)?;
        finish(&mut along)?;
        self.sweep = None;
        self.run.keep()?;
        Ok(&memory.result)
    }
}

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
        self.hessian_along(x0, u, h, lambda, &[], None)
    }

    /// The solution, its derivatives, and the gradient and the Hessian of `λᵀx₊ + νᵀz₀`, with the algebraic states `z₀` at the
    /// start of the interval, which are [`z0`](Nominal::z0) of the results: in the same pass.
    ///
    /// `νᵀ∂²z₀/∂(x₀, u, p)²` is what a Lagrangian needs of costs and constraints that depend on algebraic states.
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
        self.hessian_along(x0, u, h, lambda, nu.as_slice(), None)
    }

    /// As [`Integrator::hessian`], with weights of `z₀` if they are not empty, and with an integrand.
    pub(crate) fn hessian_along(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        nu: &[T],
        mut along: Along<'_, '_, M, T>,
    ) -> Result<&Hessian<M, T>, Error>
    where
        W: WithHessian,
    {
        check(Argument::Lambda, lambda.as_slice())?;
        check(Argument::Nu, nu)?;
        begin(&mut along);
        self.sweep = None;
        let count = self.run.options.steps;
        let forward = W::forward(&mut self.forward)?;
        let memory = W::hessian(&mut self.hessian)?;
        let records = W::hessian_tape(&mut self.hessian_tape, count)?;
        let parts = self.run.steps(&Arguments { x0, u, h }, |parts, n, step, exact| {
            parts.linearize(n, step, exact)?;
            let Some(record) = records.get_mut(n) else { return Ok(()) };
            let curved = Some(record.curved());
            forward.step::<_, false>(parts.work, parts.coefficients, n, count, parts.statistics, curved)?;
            if let Some(integrand) = &mut along {
                parts.along_forward(n, step, &forward.sweep, true, &mut **integrand)?;
            }
            // That of the last step is still there on the way back.
            if n + 1 < count {
                record.record(parts.work);
            }
            Ok(())
        })?;
        forward.finish(&parts.work.result, count - 1, Some(&mut memory.result.first.forward))?;
        finish(&mut along)?;
        memory.run(
            parts.work,
            parts.coefficients,
            parts.steps,
            records,
            lambda.as_slice(),
            nu,
            parts.statistics,
            reborrow(&mut along),
        )?;
        memory.finish(along.as_ref().and_then(|integrand| integrand.second()))?;
        self.run.keep()?;
        self.sweep = Some(count - 1);
        Ok(&memory.result)
    }
}
