//! The driver of all calls of an integrator: checks arguments, takes the steps, and commits them if
//! the whole call succeeds.

use super::step::IntervalScheme;
use super::workspace::{StageWorkspace, Step};
use crate::error::{Argument, Error};
use crate::finite::{check_input, check_model_input, find_non_finite};
use crate::irk::coefficients::Coefficients;
use crate::irk::stages::initial_guess::InitialGuess;
#[cfg(feature = "alloc")]
use crate::memory::Heap;
use crate::memory::{Fallback, Memory};
#[cfg(feature = "alloc")]
use crate::model::ArrayV;
use crate::model::{Dae, VectorP, VectorU, VectorX, VectorZ};
use crate::options::{Options, Start};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};
use crate::statistics::Statistics;
use crate::tableau::Tableau;

/// The part of an integrator that all calls share.
pub(crate) struct Driver<M: Dae, T: Real, const S: usize, W: Memory> {
    pub options: Options,
    pub coefficients: Coefficients<T, S>,
    pub statistics: Statistics,
    workspace: W::Nominal<StageWorkspace<M, T, S, W::Fallback>>,
    /// The steps of the last successful call, and those of the current call.
    tapes: [W::Tape<Step<M, T, S>>; 2],
    last_tape: usize,
    /// Whether any call succeeded.
    has_result: bool,
    /// Whether the last steps serve as a warm start.
    has_warm_start: bool,
    /// Whether their stages are the solution of the next call (see
    /// [`set_solution`](Self::set_solution)).
    initial_is_solution: bool,
    start_given: bool,
    parameters_set: bool,
    time: T,
}

/// The arguments that all calls have.
pub(crate) struct Arguments<'a, M: Dae, T: Real> {
    pub x0: &'a VectorX<M, T>,
    pub u: &'a VectorU<M, T>,
    pub h: T,
}

/// The data of a call after a step, and after all steps.
pub(crate) struct CallContext<'a, M: Dae, T: Real, const S: usize, F: Fallback> {
    pub workspace: &'a mut StageWorkspace<M, T, S, F>,
    pub coefficients: &'a Coefficients<T, S>,
    /// All steps; empty while steps are being taken.
    pub steps: &'a [Step<M, T, S>],
    pub statistics: &'a mut Statistics,
}

impl<M: Dae, T: Real, const S: usize, W: Memory> Driver<M, T, S, W> {
    pub fn new(options: Options, tableau: Tableau<S>) -> Result<Self, Error> {
        options.check()?;
        if options.steps > W::STEPS {
            return Err(Error::InvalidOption {
                option: "steps",
                value: options.steps as f64,
                reason: "`Inline<_, STEPS>` has memory for fewer steps: raise `STEPS`",
            });
        }
        if !W::Fallback::HAS_MEMORY && !M::STRUCTURE.elimination.has_plan() {
            return Err(Error::NotPivoted { step: 0 });
        }
        let coefficients = Coefficients::<T, S>::new(tableau, W::Fallback::HAS_MEMORY);
        let ends = [&coefficients.lagrange_start, &coefficients.lagrange_end];
        if M::Shape::NZ > 0 && ends.iter().any(|weights| find_non_finite(*weights).is_some()) {
            return Err(Error::NoInterpolation);
        }
        Ok(Self::without_memory(options, coefficients, T::ZERO))
    }

    /// A driver without allocated memory, with these settings.
    fn without_memory(options: Options, coefficients: Coefficients<T, S>, time: T) -> Self {
        Self {
            options,
            coefficients,
            statistics: Statistics::default(),
            workspace: Default::default(),
            tapes: Default::default(),
            last_tape: 0,
            has_result: false,
            has_warm_start: false,
            initial_is_solution: false,
            start_given: false,
            parameters_set: false,
            time,
        }
    }

    /// Returns the tape of the last successful call, and that of the current call.
    fn tapes(tapes: &mut [W::Tape<Step<M, T, S>>; 2], last: usize) -> [&mut W::Tape<Step<M, T, S>>; 2] {
        let [first, second] = tapes;
        if last == 0 { [first, second] } else { [second, first] }
    }

    /// Returns the steps of the last successful call.
    #[cfg(feature = "alloc")]
    fn last_steps(&mut self) -> Result<&mut [Step<M, T, S>], Error> {
        let [last, _] = Self::tapes(&mut self.tapes, self.last_tape);
        W::tape(last, self.options.steps)
    }

    pub fn reserve(&mut self) -> Result<(), Error> {
        W::nominal(&mut self.workspace)?.write_constants();
        for tape in &mut self.tapes {
            W::tape(tape, self.options.steps)?;
        }
        Ok(())
    }

    pub fn reset(&mut self) {
        (self.has_warm_start, self.initial_is_solution) = (false, false);
    }

    pub fn set_parameters(&mut self, p: &VectorP<M, T>) -> Result<(), Error> {
        check_model_input::<M, T>(Argument::P, p.as_slice())?;
        W::nominal(&mut self.workspace)?.parameters = *p;
        self.parameters_set = true;
        Ok(())
    }

    pub fn set_time(&mut self, t: T) -> Result<(), Error> {
        check_input(Argument::T, &[t])?;
        self.time = t;
        Ok(())
    }

    pub fn set_start(&mut self, xdot: &VectorX<M, T>, z: &VectorZ<M, T>) -> Result<(), Error> {
        check_model_input::<M, T>(Argument::StartXdot, xdot.as_slice())?;
        check_model_input::<M, T>(Argument::StartZ, z.as_slice())?;
        let given = W::nominal(&mut self.workspace)?.start_values.as_mut();
        for (to, from) in given.iter_mut().zip(xdot.as_slice().iter().chain(z.as_slice())) {
            *to = *from;
        }
        self.start_given = true;
        Ok(())
    }

    /// Discards a given solution if a call fails before its first step.
    pub fn invalidate_solution_on_error<R>(&mut self, result: Result<R, Error>) -> Result<R, Error> {
        self.initial_is_solution &= result.is_ok();
        result
    }

    /// Takes the steps of a call; calls `after_step` after each.
    pub fn run_steps(
        &mut self,
        arguments: &Arguments<'_, M, T>,
        mut after_step: impl FnMut(
            &mut CallContext<'_, M, T, S, W::Fallback>,
            usize,
            &Step<M, T, S>,
            bool,
        ) -> Result<(), Error>,
    ) -> Result<CallContext<'_, M, T, S, W::Fallback>, Error> {
        let Self { options, coefficients, statistics, workspace: work, tapes, .. } = self;
        *statistics = Statistics::default();
        // A given solution is valid for one call, even if it fails.
        let initial_is_solution = core::mem::take(&mut self.initial_is_solution);
        check_model_input::<M, T>(Argument::X0, arguments.x0.as_slice())?;
        check_model_input::<M, T>(Argument::U, arguments.u.as_slice())?;
        check_input(Argument::H, &[arguments.h])?;
        if M::Shape::NP > 0 && !self.parameters_set {
            return Err(Error::ParametersNotSet);
        }
        let work = W::nominal(work)?;
        work.write_constants();
        work.inputs.u = *arguments.u;
        work.inputs.p = work.parameters;
        work.inputs.time.start = self.time;
        work.inputs.time.interval = arguments.h;
        work.inputs.time.step = arguments.h / T::from_whole(options.steps);
        work.x.as_mut().copy_from_slice(arguments.x0.as_slice());
        let [last, current_tape] = Self::tapes(tapes, self.last_tape);
        // Both tapes are allocated in the first call, so that later calls do not allocate.
        let steps = W::tape(current_tape, options.steps)?;
        let last = W::tape(last, options.steps)?;
        let guess = match options.start {
            _ if initial_is_solution => InitialGuess::Solution(last),
            Start::Zero => InitialGuess::Zero,
            Start::Given if !self.start_given => return Err(Error::StartNotGiven),
            Start::Warm if self.has_warm_start => InitialGuess::Previous(last),
            _ if self.start_given => InitialGuess::Given,
            _ => InitialGuess::Nominal,
        };
        let scheme = IntervalScheme { coefficients, options, guess };
        work.integrate(&scheme, steps, statistics, |work, n, step, exact, statistics| {
            after_step(
                &mut CallContext { workspace: work, coefficients, steps: &[], statistics },
                n,
                step,
                exact,
            )
        })?;
        Ok(CallContext { workspace: work, coefficients, steps, statistics })
    }

    /// Sets whether start values are solutions up to rounding.
    #[cfg(feature = "alloc")]
    pub fn set_start_near_solution(&mut self, near_solution: bool) -> Result<(), Error> {
        W::nominal(&mut self.workspace)?.start_near_solution = near_solution;
        Ok(())
    }

    /// Sets start values of the stages of the first step as a warm start: the unknowns `(k, z)`,
    /// stages innermost.
    #[cfg(feature = "alloc")]
    pub fn set_stages(&mut self, y: &[T]) -> Result<(), Error> {
        if let Some(step) = self.last_steps()?.first_mut() {
            for (to, from) in step.y.as_mut().as_flattened_mut().iter_mut().zip(y) {
                *to = *from;
            }
            self.has_warm_start = true;
        }
        Ok(())
    }

    /// Returns the variables at the stages of the last evaluation of the last call, successful or
    /// not.
    #[cfg(feature = "alloc")]
    pub fn points(&mut self) -> Result<&ArrayV<M, [T; S]>, Error> {
        Ok(&W::nominal(&mut self.workspace)?.points)
    }

    /// Adds to the error of the last call the algebraic state that led to it, and its value in `y`,
    /// the start values of the first step.
    #[cfg(feature = "alloc")]
    pub fn explain_with_start(&mut self, error: Error, y: &[T]) -> Error {
        let start = |unknown: usize| y.get(unknown).map(|y| y.to_f64());
        W::nominal(&mut self.workspace).map_or(error, |work| work.add_start_value(error, &start))
    }

    /// Sets the stages of every step as a warm start.
    #[cfg(feature = "alloc")]
    pub fn set_stages_of_steps(&mut self, stages: &[crate::model::ArrayK<M, [T; S]>]) -> Result<(), Error> {
        for (step, y) in self.last_steps()?.iter_mut().zip(stages) {
            crate::shape::copy_into(&mut *step.y, y);
        }
        (self.has_warm_start, self.initial_is_solution) = (true, false);
        Ok(())
    }

    /// Sets the stages of every step of the next call, which are a solution.
    #[cfg(feature = "alloc")]
    pub fn set_solution(&mut self, stages: &[crate::model::ArrayK<M, [T; S]>]) -> Result<(), Error> {
        self.set_stages_of_steps(stages)?;
        self.initial_is_solution = true;
        Ok(())
    }

    /// Commits the steps of a successful call.
    pub fn commit(&mut self) -> Result<&StageWorkspace<M, T, S, W::Fallback>, Error> {
        let work = W::nominal(&mut self.workspace)?;
        work.last_inputs = work.inputs;
        self.last_tape = 1 - self.last_tape;
        self.has_result = true;
        self.has_warm_start = true;
        Ok(work)
    }

    /// Returns the context of the last successful call.
    pub fn last_call(&mut self) -> Result<CallContext<'_, M, T, S, W::Fallback>, Error> {
        if !self.has_result {
            return Err(Error::NoResult);
        }
        let work = W::nominal(&mut self.workspace)?;
        let [last, _] = Self::tapes(&mut self.tapes, self.last_tape);
        let steps = W::tape(last, self.options.steps)?;
        Ok(CallContext {
            workspace: work,
            coefficients: &self.coefficients,
            steps,
            statistics: &mut self.statistics,
        })
    }
}

#[cfg(feature = "alloc")]
impl<M: Dae, T: Real, const S: usize, F: Fallback> Driver<M, T, S, Heap<F>> {
    /// Returns a driver with the same settings and its own memory. Parameters and start values that
    /// cannot be allocated are as if never set.
    pub fn clone_settings(&self) -> Self {
        let mut run = Self::without_memory(self.options, self.coefficients.clone(), self.time);
        let set = self.workspace.get().filter(|_| self.parameters_set || self.start_given);
        if let (Some(from), Ok(to)) = (set, <Heap<F>>::nominal(&mut run.workspace)) {
            (to.parameters, to.start_values) = (from.parameters, from.start_values);
            (run.parameters_set, run.start_given) = (self.parameters_set, self.start_given);
        }
        run
    }
}

impl<M: Dae, T: Real, const S: usize, F: Fallback> CallContext<'_, M, T, S, F> {
    /// See [`StageWorkspace::linearize`].
    pub fn linearize(&mut self, n: usize, step: &Step<M, T, S>, exact: bool) -> Result<(), Error> {
        self.workspace.linearize(self.coefficients, n, step, exact, self.statistics)
    }
}
