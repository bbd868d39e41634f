//! The interface of all adaptive methods. Sealed: the traits cannot be named outside of the crate.

use super::replay::{DynStepDifferentiator, StepDifferentiator, StepRecord};
use super::step::{AfterStep, Run, Span};
use super::tape::TapeEntry;
use crate::error::Error;
use crate::model::{ArrayW, ArrayX, Dae, VectorX};
use crate::result::{Dense, Forward};
use crate::scalar::Real;
use core::marker::PhantomData;

/// The memory of a method. Cannot be named outside of the crate.
pub trait MethodState<M: Dae, T: Real>: 'static {
    /// The memory.
    type State: Default + Send + Sync;
}

/// An adaptive method, for the models that it can integrate.
pub trait Engine<M: Dae, T: Real>: MethodState<M, T> {
    /// Whether `z` at the end of a step is the `z` of a stage; otherwise it is solved for.
    const ENDS_ON_STAGE: bool;
    /// Differentiates the accepted steps.
    type Differentiator: StepDifferentiator<M, T>;
    /// Integrates an interval; `after` is called after each accepted step.
    ///
    /// # Errors
    /// The error that ends the run.
    fn integrate(
        state: &mut Self::State,
        run: &mut Run<'_, M, T>,
        x0: &VectorX<M, T>,
        span: Span<T>,
        after: AfterStep<'_, M, T>,
    ) -> Result<(), Error>;
    /// Dense output of a step from its numbers on the tape; of `inputs`, variables of the model,
    /// `u` and `p` are used.
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
    /// The object that differentiates accepted steps.
    fn differentiator(state: &mut Self::State) -> &mut Self::Differentiator;
}

/// Differentiates the steps of a method for error control of the sensitivities.
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
    fn forward(&mut self, step: &StepRecord<'_, M, T>) -> Result<&Forward<M, T>, Error> {
        B::differentiator(&mut self.method_state).forward(step, None)
    }

    fn rate_derivatives(
        &mut self,
        level: usize,
        weights: &[f64],
        to: &mut ArrayW<M, ArrayX<M, T>>,
    ) -> Result<(), Error> {
        B::differentiator(&mut self.method_state).slopes(level, weights, to)
    }
}
