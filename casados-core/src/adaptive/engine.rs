//! What integrates with steps of variable size. Nobody outside can name it.

use super::replay::{AcceptedStep, DynStepDifferentiator, StepDifferentiator};
use super::step::{AfterStep, Run, Span};
use super::tape::TapeEntry;
use crate::error::Error;
use crate::model::{ArrayW, ArrayX, Dae, VectorX};
use crate::result::{Dense, Forward};
use crate::scalar::Real;
use core::marker::PhantomData;

/// What a method remembers. Nobody outside can name it.
pub trait MethodState<M: Dae, T: Real>: 'static {
    /// Its memory.
    type State: Default + Send + Sync;
}

/// What integrates with steps of variable size, for the models that it can.
pub trait Engine<M: Dae, T: Real>: MethodState<M, T> {
    /// Whether `z` at the end of a step is that of a stage; else it is found from the
    /// equations.
    const ENDS_ON_STAGE: bool;
    /// What takes its steps again.
    type Differentiator: StepDifferentiator<M, T>;
    /// Integrates an interval; `after` is called after each accepted step.
    ///
    /// # Errors
    /// Whatever ends a run early.
    fn integrate(
        state: &mut Self::State,
        run: &mut Run<'_, M, T>,
        x0: &VectorX<M, T>,
        span: Span<T>,
        after: AfterStep<'_, M, T>,
    ) -> Result<(), Error>;
    /// The solution inside a step, from its numbers; `inputs` are variables of the model, of
    /// which `u` and `p` count.
    ///
    /// # Errors
    /// A value of the model that is not finite.
    fn interpolate(
        state: &mut Self::State,
        inputs: &[T],
        entry: &TapeEntry<T>,
        numbers: (&[T], &[T]),
        t: T,
        dense: &mut Dense<M, T>,
    ) -> Result<(), Error>;
    /// What takes a step again.
    fn replays(state: &mut Self::State) -> &mut Self::Differentiator;
}

/// The steps of a method again, for derivatives that take part in the choice of its steps.
pub struct MethodStepDifferentiator<M: Dae, B: Engine<M, T>, T: Real> {
    method_state: B::State,
    model: PhantomData<fn() -> (M, T)>,
}

impl<M: Dae, B: Engine<M, T>, T: Real> Default for MethodStepDifferentiator<M, B, T> {
    fn default() -> Self {
        Self { method_state: B::State::default(), model: PhantomData }
    }
}

impl<M: Dae, B: Engine<M, T>, T: Real> DynStepDifferentiator<M, T> for MethodStepDifferentiator<M, B, T> {
    fn forward(&mut self, step: &AcceptedStep<'_, M, T>) -> Result<&Forward<M, T>, Error> {
        B::replays(&mut self.method_state).forward(step, None)
    }

    fn rate_derivatives(
        &mut self,
        level: usize,
        weights: &[f64],
        to: &mut ArrayW<M, ArrayX<M, T>>,
    ) -> Result<(), Error> {
        B::replays(&mut self.method_state).slopes(level, weights, to)
    }
}
