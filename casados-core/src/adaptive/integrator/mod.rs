//! The public adaptive integrator.

mod calls;
mod derivatives;
mod settings;

use crate::adaptive::consistent::Consistent;
use crate::adaptive::engine::{Engine, MethodState, MethodStepDifferentiator};
use crate::adaptive::options::{AdaptiveOptions, check_atol, check_rtol};
use crate::adaptive::point::write_inputs;
use crate::adaptive::sensitivities::{RecordedSteps, SensitivityMemory};
use crate::adaptive::statistics::AdaptiveStatistics;
use crate::adaptive::step::{AcceptedStepOutput, Run, Span, Workspace};
use crate::adaptive::tape::Tape;
use crate::adaptive::variational::Variational;
use crate::error::{Argument, Error, Refusal};
use crate::finite::{check_input, check_model_input};
use crate::integrator::{self, Integrator as _};
use crate::memory::allocate;
use crate::model::{ArrayK, Dae, VectorP, VectorU, VectorX, VectorZ};
use crate::result::{Adjoint, Dense, Forward, Hessian, Nominal};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};
use alloc::boxed::Box;
use alloc::vec::Vec;
use core::marker::PhantomData;

/// An adaptive integrator of the method `B` for the model `M`; see [`Adaptive`](super::Adaptive).
///
/// All calls take the state at the start of the interval, the control, and the length `h` of the
/// interval, as those of [`Irk`](crate::Irk) and [`Erk`](crate::Erk); `h` may be negative or zero.
/// The interval starts at the time of [`set_time`](Self::set_time). Times in arguments and results,
/// as in [`dense`](Self::dense), are absolute. All calls return a reference to results in the
/// memory of the integrator.
///
/// # Errors
/// Every call: [`Error::NonFiniteInput`], [`Error::ParametersNotSet`]; [`Error::InconsistentStart`]
/// if there are no consistent `ẋ` and `z` at the start, [`Error::Singular`] if no step can be
/// solved; [`Error::NonFiniteModel`] if the model is not finite at a point of the solution;
/// [`Error::StepSizeUnderflow`], [`Error::TooManySteps`]; [`Error::OutOfMemory`]. After an error
/// the integrator remains usable, and frozen steps remain frozen; until a call succeeds, dense
/// output and freezing return [`Error::NoResult`].
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// let mut cart = Adaptive::<Cart, Radau>::new(AdaptiveOptions::default())?;
/// cart.set_time(10.0)?;
/// // From rest, with 2 m/s², for 3 s: from t = 10 s to 13 s.
/// let end = cart.solve(&vector![0.0, 0.0], &vector![2.0], 3.0)?;
/// assert!((end.x - vector![9.0, 6.0]).norm() < 1e-9);
/// assert!((cart.dense(11.0)?.x - vector![1.0, 2.0]).norm() < 1e-9);
/// # Ok::<(), casados::Error>(())
/// ```
pub struct Integrator<M: Dae, B: MethodState<M, T>, T: Real> {
    pub(super) options: AdaptiveOptions,
    pub(super) workspace: Box<Workspace<M, T>>,
    pub(super) consistent: Consistent<M, T>,
    pub(super) method_state: B::State,
    /// Sensitivities, if they are error controlled.
    sensitivities: Option<Box<Variational<M, T>>>,
    pub(super) tape: Tape<T>,
    pub(super) statistics: AdaptiveStatistics,
    has_parameters: bool,
    pub(super) start_time: T,
    /// The interval of the last successful call.
    last_span: Option<Span<T>>,
    frozen: Option<FrozenSteps<M, B, T>>,
    pub(super) derivative_memory: Option<Box<SensitivityMemory<M, T>>>,
    /// Sensitivities at the start of each step.
    step_sensitivities: Vec<T>,
    method: PhantomData<fn() -> B>,
}

/// Steps that later calls repeat.
struct FrozenSteps<M: Dae, B: MethodState<M, T>, T: Real> {
    /// Their interval.
    span: Span<T>,
    /// Repeats the steps without derivatives. A function pointer: programs that freeze no steps do
    /// not contain it.
    solve_frozen: SolveFrozen<M, B, T>,
}

type SolveFrozen<M, B, T> =
    fn(&mut Integrator<M, B, T>, &VectorX<M, T>, &VectorU<M, T>, T) -> Result<Span<T>, Error>;

impl<M: Dae, B: Engine<M, T>, T: Real> Integrator<M, B, T> {
    /// Creates an integrator with its memory on the heap.
    ///
    /// # Errors
    /// [`Error::InvalidOption`], [`Error::OutOfMemory`]
    pub fn new(options: AdaptiveOptions) -> Result<Self, Error> {
        options.check::<T>()?;
        let mut base: Box<Workspace<M, T>> = allocate()?;
        base.tolerances.rtol.as_mut().fill(T::from_f64(options.rtol));
        base.tolerances.atol.as_mut().fill(T::from_f64(options.atol));
        for (given, start) in base.start_guess.as_mut().iter_mut().zip(M::START) {
            *given = T::from_f64(*start);
        }
        Ok(Self {
            options,
            workspace: base,
            consistent: Consistent::default(),
            method_state: Default::default(),
            sensitivities: None,
            tape: Tape::default(),
            statistics: AdaptiveStatistics::default(),
            has_parameters: M::Shape::NP == 0,
            start_time: T::ZERO,
            last_span: None,
            frozen: None,
            derivative_memory: None,
            step_sensitivities: Vec::new(),
            method: PhantomData,
        })
    }

    /// The options.
    #[must_use]
    pub fn options(&self) -> &AdaptiveOptions {
        &self.options
    }

    /// Statistics of the step selection of the last call, successful or not.
    #[must_use]
    pub fn statistics(&self) -> &AdaptiveStatistics {
        &self.statistics
    }

    /// The start and the end times of the accepted steps of the last call, if
    /// [`AdaptiveOptions::keep_steps`] is set.
    pub fn times(&self) -> impl Iterator<Item = T> {
        let end = self.last_span.map(|span| span.end);
        self.tape.entries().iter().map(|entry| entry.t).chain(end)
    }

    /// Integrates over an interval of length `h`; returns `x` and `z` at its end, and the
    /// consistent `z` at its start.
    ///
    /// # Errors
    /// See [`Integrator`].
    ///
    /// ```
    /// # use casados_core::{Adaptive, AdaptiveOptions, Dae, Error, Radau, model::{VectorU, VectorX}};
    /// # fn example<Reactor: Dae>(x0: VectorX<Reactor, f64>, u: VectorU<Reactor, f64>) -> Result<(), Error> {
    /// let mut radau = Adaptive::<Reactor, Radau>::new(AdaptiveOptions::default())?;
    /// radau.set_time(1.0)?;
    /// let end = radau.solve(&x0, &u, 0.1)?.x; // at t = 1.1
    /// let middle = radau.dense(1.05)?.x;
    /// # Ok(())
    /// # }
    /// ```
    pub fn solve(&mut self, x0: &VectorX<M, T>, u: &VectorU<M, T>, h: T) -> Result<&Nominal<M, T>, Error> {
        self.last_span = None;
        let span = if let Some(FrozenSteps { solve_frozen: solve, .. }) = self.frozen {
            solve(self, x0, u, h)?
        } else {
            let (t_end, record) = (self.interval_end(h)?, self.options.keep_steps);
            self.run_to(x0, u, t_end, record, |_, _| Ok(()))?
        };
        self.last_span = Some(span);
        Ok(&self.workspace.result)
    }

    /// As [`Integrator::solve`]; during the integration `output` is called with the solution at
    /// each of these times, which are between the start `t` and `t + h`. It does not need
    /// [`AdaptiveOptions::keep_steps`].
    ///
    /// # Errors
    /// See [`Integrator`]; [`Error::Unordered`] if a time is outside of the interval or before the
    /// preceding one.
    pub fn solve_at(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        times: &[T],
        mut output: impl FnMut(T, &Dense<M, T>),
    ) -> Result<&Nominal<M, T>, Error> {
        self.last_span = None;
        check_input(Argument::T, times)?;
        let (start, end) = (self.start_time, self.interval_end(h)?);
        let mut before = start;
        for (index, t) in times.iter().enumerate() {
            if !is_inside_interval(*t, before, end) {
                let (t, before, end) = (t.to_f64(), before.to_f64(), end.to_f64());
                return Err(Error::Unordered { index, t, before, end });
            }
            before = *t;
        }
        if self.frozen.is_some() {
            self.solve(x0, u, h)?;
            for t in times {
                output(*t, self.dense(*t)?);
            }
            return Ok(&self.workspace.result);
        }
        let mut times = times.iter().copied().peekable();
        let record = self.options.keep_steps;
        let span = self.run_to(x0, u, end, record, |step, dense| {
            while let Some(t) = times.next_if(|t| is_inside_interval(*t, start, step.end)) {
                (step.evaluate_dense)(t, dense)?;
                output(t, dense);
            }
            Ok(())
        })?;
        // An interval of length zero.
        let Workspace { result, dense, .. } = &mut *self.workspace;
        (dense.x, dense.z) = (result.x, result.z);
        for t in times {
            output(t, dense);
        }
        self.last_span = Some(span);
        Ok(&self.workspace.result)
    }

    /// Dense output: the solution at the model's time `t` within the interval of the last call.
    ///
    /// # Errors
    /// [`Error::NoResult`], also if that call failed or steps are not kept;
    /// [`Error::OutsideInterval`], [`Error::NonFiniteInput`], [`Error::Overflow`].
    pub fn dense(&mut self, t: T) -> Result<&Dense<M, T>, Error> {
        check_input(Argument::T, &[t])?;
        let span = self.last_span.ok_or(Error::NoResult)?;
        self.dense_in(span, t)
    }

    /// The solution at a time within the interval whose steps are on the tape.
    pub(super) fn dense_in(&mut self, span: Span<T>, t: T) -> Result<&Dense<M, T>, Error> {
        if !is_inside_interval(t, span.start, span.end) {
            let (t, start, end) = (t.to_f64(), span.start.to_f64(), span.end.to_f64());
            return Err(Error::OutsideInterval { t, start, end });
        }
        let step = self.tape.find_step(t);
        let Workspace { point, result, dense, .. } = &mut *self.workspace;
        match self.tape.entries().get(step) {
            Some(entry) => {
                let numbers = self.tape.step_numbers(step, M::Shape::NX);
                B::interpolate(&mut self.method_state, point.as_ref(), entry, numbers, t, dense)?;
            }
            None if span.start == span.end => (dense.x, dense.z) = (result.x, result.z),
            None => return Err(Error::NoResult),
        }
        Ok(dense)
    }

    /// Freezes the steps of the last successful call: later calls repeat them for all inputs and
    /// solve them to rounding. They are a smooth function of `x₀`, `u` and `p`. The interval has to
    /// be the same.
    ///
    /// # Errors
    /// [`Error::NoResult`], also if steps were not kept.
    pub fn freeze(&mut self) -> Result<(), Error> {
        let span = self.last_span.ok_or(Error::NoResult)?;
        if self.tape.entries().is_empty() && span.start != span.end {
            return Err(Error::NoResult);
        }
        self.frozen = Some(FrozenSteps { span, solve_frozen: Self::solve_frozen });
        Ok(())
    }

    /// Solves the frozen steps, without derivatives.
    fn solve_frozen(&mut self, x0: &VectorX<M, T>, u: &VectorU<M, T>, h: T) -> Result<Span<T>, Error> {
        let span = self.begin_frozen_call(x0, u, h)?;
        let Self { workspace: base, consistent, tape, method_state: state, .. } = self;
        let given = base.start_guess;
        RecordedSteps {
            workspace: base,
            consistent,
            tape,
            span,
            start_guess: given,
            steps_were_chosen: false,
        }
        .solve::<B>(state, x0, None)?;
        Ok(span)
    }

    /// Ends the effect of [`freeze`](Self::freeze): later calls choose their steps.
    pub fn thaw(&mut self) {
        self.frozen = None;
    }

    /// The end of an interval of length `h`.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]; [`Error::StepSizeUnderflow`] for a length below the rounding of
    /// the time.
    pub(super) fn interval_end(&self, h: T) -> Result<T, Error> {
        check_input(Argument::H, &[h])?;
        let end = self.start_time + h;
        if end == self.start_time && h != T::ZERO {
            let (t, h) = (self.start_time.to_f64(), h.to_f64());
            return Err(Error::StepSizeUnderflow { t, h, reason: Refusal::Resolution, unsettled: None });
        }
        Ok(end)
    }

    /// Checks and copies the inputs of a call.
    fn begin_call(&mut self, x0: &VectorX<M, T>, u: &VectorU<M, T>, t_end: T) -> Result<Span<T>, Error> {
        self.statistics = AdaptiveStatistics::default();
        check_model_input::<M, T>(Argument::X0, x0.as_slice())?;
        check_model_input::<M, T>(Argument::U, u.as_slice())?;
        check_input(Argument::T, &[t_end, t_end - self.start_time])?;
        if !self.has_parameters {
            return Err(Error::ParametersNotSet);
        }
        self.workspace.u = *u;
        Ok(Span { start: self.start_time, end: t_end })
    }

    /// Allocates the memory of derivatives.
    pub(super) fn allocate_derivatives(&mut self) -> Result<(), Error> {
        if self.derivative_memory.is_none() {
            self.derivative_memory = Some(allocate()?);
        }
        Ok(())
    }

    /// Chooses the steps to be differentiated, or prepares the frozen ones. The result is invalid
    /// until they are solved.
    fn prepare_steps(&mut self, x0: &VectorX<M, T>, u: &VectorU<M, T>, h: T) -> Result<Span<T>, Error> {
        self.last_span = None;
        self.allocate_derivatives()?;
        if self.frozen.is_some() {
            return self.begin_frozen_call(x0, u, h);
        }
        let t_end = self.interval_end(h)?;
        self.run_to(x0, u, t_end, true, |_, _| Ok(()))
    }

    /// Begins a call with frozen steps.
    ///
    /// # Errors
    /// [`Error::OutsideInterval`] if the interval is not that of the frozen steps.
    fn begin_frozen_call(&mut self, x0: &VectorX<M, T>, u: &VectorU<M, T>, h: T) -> Result<Span<T>, Error> {
        let t_end = self.interval_end(h)?;
        let span = self.begin_call(x0, u, t_end)?;
        let Some(FrozenSteps { span: frozen, .. }) = self.frozen else { return Ok(span) };
        frozen.check_same(span.start, span.end)?;
        // Dense output of explicit methods repeats steps.
        let Workspace { point, u, parameters, .. } = &mut *self.workspace;
        write_inputs::<M, T>(point.as_mut(), u, parameters);
        Ok(span)
    }

    #[allow(clippy::type_complexity)]
    fn differentiation_parts(
        &mut self,
        span: Span<T>,
    ) -> Result<(RecordedSteps<'_, M, T>, &mut B::State, &mut SensitivityMemory<M, T>, &mut Vec<T>), Error>
    {
        let Self {
            workspace: base,
            consistent,
            tape,
            method_state: state,
            derivative_memory: memory,
            step_sensitivities: history,
            frozen,
            ..
        } = self;
        let missing = Error::OutOfMemory { bytes: size_of::<SensitivityMemory<M, T>>() };
        let memory = memory.as_deref_mut().ok_or(missing)?;
        let given = base.start_guess;
        let chosen = frozen.is_none();
        Ok((
            RecordedSteps {
                workspace: base,
                consistent,
                tape,
                span,
                start_guess: given,
                steps_were_chosen: chosen,
            },
            state,
            memory,
            history,
        ))
    }

    /// Marks the result with derivatives as valid.
    fn finish_derivatives(&mut self, span: Span<T>) -> Result<&SensitivityMemory<M, T>, Error> {
        self.last_span = Some(span);
        self.derivative_memory
            .as_deref()
            .ok_or(Error::OutOfMemory { bytes: size_of::<SensitivityMemory<M, T>>() })
    }

    /// Integrates to a time. The caller marks the result as valid.
    pub(super) fn run_to(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        t_end: T,
        record: bool,
        mut after: impl FnMut(&mut AcceptedStepOutput<'_, M, T>, &mut Dense<M, T>) -> Result<(), Error>,
    ) -> Result<Span<T>, Error> {
        self.last_span = None;
        let span = self.begin_call(x0, u, t_end)?;
        let Self {
            options,
            workspace: base,
            consistent,
            method_state: state,
            tape,
            statistics,
            sensitivities,
            ..
        } = self;
        tape.clear();
        let sensitivities = sensitivities.as_deref_mut();
        let mut run = Run {
            options,
            workspace: base,
            consistent,
            tape,
            record_steps: record,
            sensitivities,
            statistics,
        };
        B::integrate(state, &mut run, x0, span, &mut after)?;
        Ok(span)
    }
}

/// Whether a time is within an interval of either direction.
pub(super) fn is_inside_interval<T: Real>(t: T, start: T, end: T) -> bool {
    if start <= end { start <= t && t <= end } else { end <= t && t <= start }
}

/// `(x, z)` as one array.
fn stack_states<M: Dae, T: Real>(to: &mut ArrayK<M, T>, x: &VectorX<M, T>, z: &VectorZ<M, T>) {
    for (to, from) in to.as_mut().iter_mut().zip(x.as_slice().iter().chain(z.as_slice())) {
        *to = *from;
    }
}
