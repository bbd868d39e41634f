//! The integrator: construction, settings, simulation. Its derivatives are in `sensitivities`.

use super::adjoint::Adjoints;
use super::dense_output::StepPoint;
use super::driver::Driver;
use super::forward::directional::Directionals;
use super::forward::memory::ForwardMemory;
use super::hessian::backward_pass::{HessianMemory, HessianStep};
use crate::error::Error;
use crate::integrator::Integrator as _;
#[cfg(feature = "alloc")]
use crate::memory::Heap;
use crate::memory::{Fallback, Inline, Memory};
use crate::model::{Dae, VectorP, VectorU, VectorX, VectorZ};
use crate::options::Options;
use crate::result::{Dense, Nominal};
use crate::scalar::Real;
use crate::shape::InBounds;
use crate::statistics::Statistics;
use crate::tableau::{Custom, Method, Tableau};
use core::marker::PhantomData;

/// An implicit Runge-Kutta integrator with `S` stages of the method `B` for the model `M`; see
/// [`Irk`](super::Irk).
///
/// All calls take the state at the start of the interval, the control, and the length `h` of the
/// interval, which may be negative or zero. They return a reference to results in the memory of the
/// integrator.
///
/// # Start values
/// Newton's method finds the stages of the first step. By default it starts from `ẋ = 0` and the
/// nominal values of `z` in the model, `#[dae(nominal(z = 0.1))]`, or zero without the attribute;
/// after [`set_start`](Self::set_start) from its values; with
/// [`Start::Warm`](crate::options::Start) from the stages of the last call. Later steps extrapolate
/// the preceding step. If the equations have several roots, the result is the root that Newton's
/// method reaches from the start values, not necessarily the nearest; `z0` of the result shows
/// which.
///
/// # Errors
/// Every call: [`Error::NonFiniteInput`], [`Error::ParametersNotSet`], [`Error::StartNotGiven`],
/// [`Error::NonFiniteModel`], [`Error::NonFiniteStart`], [`Error::Singular`],
/// [`Error::NotConverged`], [`Error::Overflow`]; the first call of each kind also
/// [`Error::OutOfMemory`]. After an error the integrator is as before the call: usable, with the
/// same warm start and the same dense output.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// let mut irk = Irk::<Cart, Gauss<2>>::new(Options { steps: 2, ..Default::default() })?;
/// let (x0, u, h) = (vector![0.0, 1.0], vector![2.0], 0.5);
/// let step = irk.forward(&x0, &u, h)?;
/// assert!((step.x - vector![0.75, 2.0]).norm() < 1e-14);
/// assert!((step.dx_du - vector![0.5 * h * h, h]).norm() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
pub struct Integrator<M: Dae, B, const S: usize, T: Real, W: Memory> {
    pub(crate) run: Driver<M, T, S, W>,
    pub(super) forward: W::Forward<ForwardMemory<M, T, S>>,
    pub(super) directional: W::Directional<Directionals<M, T, S>>,
    pub(super) adjoint: W::Adjoint<Adjoints<M, T, S>>,
    pub(super) hessian: W::Hessian<HessianMemory<M, T, S>>,
    pub(super) hessian_tape: W::HessianTape<HessianStep<M, T, S, W::Fallback>>,
    /// The step of the last successful call whose derivatives are in the memory of `forward`.
    pub(super) differentiated_step: Option<usize>,
    method: PhantomData<fn() -> B>,
}

#[cfg(feature = "alloc")]
impl<M: Dae, B: Method<S>, const S: usize, T: Real, F: Fallback> Integrator<M, B, S, T, Heap<F>> {
    /// Returns an integrator with its memory on the heap.
    ///
    /// # Errors
    /// [`Error::InvalidOption`]
    pub fn new(options: Options) -> Result<Self, Error> {
        Self::build(options, B::TABLEAU)
    }
}

#[cfg(feature = "alloc")]
impl<M: Dae, const S: usize, T: Real, F: Fallback> Integrator<M, Custom<S>, S, T, Heap<F>> {
    /// Returns an integrator for a user-defined tableau, with its memory on the heap.
    ///
    /// # Errors
    /// [`Error::InvalidOption`]; [`Error::NoInterpolation`] if the model has algebraic states and
    /// two nodes are equal.
    pub fn with_tableau(options: Options, tableau: Tableau<S>) -> Result<Self, Error> {
        Self::build(options, tableau)
    }
}

impl<M: Dae, B: Method<S>, const S: usize, T: Real, Mode: 'static, const STEPS: usize, F: Fallback>
    Integrator<M, B, S, T, Inline<Mode, STEPS, F>>
where
    Inline<Mode, STEPS, F>: Memory,
{
    /// Returns an integrator that contains its memory, for at most `STEPS` steps.
    ///
    /// # Errors
    /// [`Error::InvalidOption`]
    pub fn inline(options: Options) -> Result<Self, Error> {
        Self::with_reserved_memory(options, B::TABLEAU)
    }
}

impl<M: Dae, const S: usize, T: Real, Mode: 'static, const STEPS: usize, F: Fallback>
    Integrator<M, Custom<S>, S, T, Inline<Mode, STEPS, F>>
where
    Inline<Mode, STEPS, F>: Memory,
{
    /// Returns an integrator for a user-defined tableau that contains its memory, for at most
    /// `STEPS` steps.
    ///
    /// # Errors
    /// As `with_tableau`.
    pub fn inline_with_tableau(options: Options, tableau: Tableau<S>) -> Result<Self, Error> {
        Self::with_reserved_memory(options, tableau)
    }
}

/// Copies options, parameters, time and start values. The copy has its own memory, which is empty
/// until its first call.
#[cfg(feature = "alloc")]
impl<M: Dae, B, const S: usize, T: Real, F: Fallback> Clone for Integrator<M, B, S, T, Heap<F>> {
    fn clone(&self) -> Self {
        Self::without_memory(self.run.clone_settings())
    }
}

impl<M: Dae, B, const S: usize, T: Real, W: Memory> core::fmt::Debug for Integrator<M, B, S, T, W> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let model = M::STRUCTURE.name;
        f.debug_struct("Irk")
            .field("model", &model)
            .field("options", &self.run.options)
            .finish_non_exhaustive()
    }
}

impl<M: Dae, B, const S: usize, T: Real, W: Memory> Integrator<M, B, S, T, W> {
    /// Size of the integrator in bytes. With [`Inline`] memory this is its total memory.
    pub const SIZE: usize = size_of::<Self>();

    pub(crate) fn build(options: Options, tableau: Tableau<S>) -> Result<Self, Error> {
        Ok(Self::without_memory(Driver::new(options, tableau)?))
    }

    /// Returns an integrator without memory for derivatives.
    fn without_memory(run: Driver<M, T, S, W>) -> Self {
        Self {
            run,
            forward: Default::default(),
            directional: Default::default(),
            adjoint: Default::default(),
            hessian: Default::default(),
            hessian_tape: Default::default(),
            differentiated_step: None,
            method: PhantomData,
        }
    }

    /// Like `build`, with all preparations of a first call, so that no call takes longer than
    /// others.
    fn with_reserved_memory(options: Options, tableau: Tableau<S>) -> Result<Self, Error> {
        let mut integrator = Self::build(options, tableau)?;
        integrator.reserve()?;
        Ok(integrator)
    }

    /// Sets the parameters `p` of all following calls.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]; the last parameters remain valid.
    pub fn set_parameters(&mut self, p: &VectorP<M, T>) -> Result<(), Error> {
        self.run.set_parameters(p)
    }

    /// Sets the time at the start of the interval for all following calls; the default is zero.
    /// Calls do not advance it.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]; the last time remains valid.
    pub fn set_time(&mut self, t: T) -> Result<(), Error> {
        self.run.set_time(t)
    }

    /// Sets start values `ẋ` and `z` of Newton's method, at all stages, for all following calls;
    /// they replace the nominal values of the model. They are not read with
    /// [`Start::Zero`](crate::options::Start), and with `Start::Warm` only without a warm start.
    /// `ẋ` of [kinematic](crate::model::Kinematic) states is computed, not read.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]; the last values remain valid.
    pub fn set_start(&mut self, xdot: &VectorX<M, T>, z: &VectorZ<M, T>) -> Result<(), Error> {
        self.run.set_start(xdot, z)
    }

    /// Discards the warm start.
    pub fn reset(&mut self) {
        self.run.reset();
    }

    /// Returns the options.
    #[must_use]
    pub fn options(&self) -> &Options {
        &self.run.options
    }

    /// Returns the tableau.
    #[must_use]
    pub fn tableau(&self) -> &Tableau<S> {
        &self.run.coefficients.tableau
    }

    /// Returns the statistics of the last call, successful or not.
    #[must_use]
    pub fn statistics(&self) -> &Statistics {
        &self.run.statistics
    }

    /// Sets the stages of every step of the next call, which only differentiates them.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    #[doc(hidden)]
    #[cfg(feature = "alloc")]
    pub fn set_solution(&mut self, stages: &[crate::model::ArrayK<M, [T; S]>]) -> Result<(), Error> {
        self.run.set_solution(stages)
    }

    /// Copies the stages of every step of the last successful call.
    #[cfg(feature = "alloc")]
    pub(crate) fn copy_stages(&mut self, to: &mut [crate::model::ArrayK<M, [T; S]>]) -> Result<(), Error> {
        for (y, step) in to.iter_mut().zip(self.run.last_call()?.steps) {
            crate::shape::copy_into(y, &step.y);
        }
        Ok(())
    }

    /// Returns the unknowns `(k, z)` at the stages of the first step of the last successful call,
    /// stages innermost.
    #[cfg(feature = "alloc")]
    pub(crate) fn stages(&mut self) -> Result<&[T], Error> {
        let steps = self.run.last_call()?.steps;
        Ok(steps.first().map_or(&[], |step| step.y.as_ref().as_flattened()))
    }

    /// Allocates the memory of `solve`, so that its calls do not allocate.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub fn reserve(&mut self) -> Result<(), Error> {
        self.run.reserve()
    }

    /// Returns `x₊` at the end of an interval of length `h`, and `z` at both ends.
    ///
    /// # Errors
    /// See [`Integrator`].
    pub fn solve(&mut self, x0: &VectorX<M, T>, u: &VectorU<M, T>, h: T) -> Result<&Nominal<M, T>, Error> {
        self.solve_with_quadrature(x0, u, h, None)
    }

    /// Returns the solution at the time `t` (time of the model) inside the interval of the last
    /// successful call.
    ///
    /// # Errors
    /// [`Error::NoResult`], [`Error::OutsideInterval`], [`Error::NonFiniteInput`],
    /// [`Error::Overflow`]; [`Error::NoInterpolation`] if the tableau is no collocation method.
    pub fn dense(&mut self, t: T) -> Result<&Dense<M, T>, Error> {
        let last = self.run.last_call()?;
        let work = last.workspace;
        let point = StepPoint::new(t, &work.last_inputs, last.steps.len(), &last.coefficients.tableau)?;
        let h = work.last_inputs.time.step;
        if let Some(step) = last.steps.get(point.step).in_bounds() {
            point.evaluate(step, h, &mut work.dense_output)?;
        }
        Ok(&work.dense_output)
    }
}
