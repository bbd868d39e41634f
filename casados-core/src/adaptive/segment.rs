//! The steps of one of several successive intervals.

use super::engine::Engine;
use super::integrator::{Integrator, is_inside_interval};
use super::point::write_inputs;
use super::sensitivities::{RecordedSteps, SensitivityMemory};
use super::step::Span;
use super::tape::Tape;
use crate::error::{Argument, Error};
use crate::finite::check_input;
use crate::memory::push;
use crate::model::{ArrayK, Dae, VectorU, VectorX};
use crate::result::{Dense, Nominal};
use crate::scalar::Real;
use alloc::vec::Vec;
use bytemuck::Zeroable;

/// The steps of one interval.
pub(super) struct Segment<M: Dae, T: Real> {
    pub tape: Tape<T>,
    /// See `RecordedSteps::steps_were_chosen`.
    pub steps_were_chosen: bool,
    pub span: Span<T>,
    /// The interval of the frozen steps, before they are scaled.
    pub frozen_span: Span<T>,
    pub u: VectorU<M, T>,
    pub x: VectorX<M, T>,
    /// Initial guess of `(ẋ, z)`.
    pub start_guess: ArrayK<M, T>,
    /// Sensitivities at the start of each step.
    pub step_sensitivities: Vec<T>,
    /// `V_k`, row by row.
    pub start_sensitivities: Vec<T>,
}

impl<M: Dae, T: Real> Default for Segment<M, T> {
    fn default() -> Self {
        Self {
            tape: Tape::default(),
            steps_were_chosen: false,
            span: Span { start: T::ZERO, end: T::ZERO },
            frozen_span: Span { start: T::ZERO, end: T::ZERO },
            u: Zeroable::zeroed(),
            x: Zeroable::zeroed(),
            start_guess: Zeroable::zeroed(),
            step_sensitivities: Vec::new(),
            start_sensitivities: Vec::new(),
        }
    }
}

impl<M: Dae, T: Real> Segment<M, T> {
    /// The steps of this interval, to be replayed and differentiated, and `V_k`.
    #[allow(clippy::type_complexity)]
    pub fn load<'a, B: Engine<M, T>>(
        &'a mut self,
        integrator: &'a mut Integrator<M, B, T>,
    ) -> Result<(RecordedSteps<'a, M, T>, &'a mut B::State, &'a mut SensitivityMemory<M, T>, &'a [T]), Error>
    {
        let Integrator {
            workspace: base, consistent, method_state: state, derivative_memory: memory, ..
        } = integrator;
        base.u = self.u;
        let missing = Error::OutOfMemory { bytes: size_of::<SensitivityMemory<M, T>>() };
        let memory = memory.as_deref_mut().ok_or(missing)?;
        let Self {
            tape, steps_were_chosen: chosen, span, start_guess: given, start_sensitivities: v, ..
        } = self;
        Ok((
            RecordedSteps {
                workspace: base,
                consistent,
                tape,
                span: *span,
                start_guess: *given,
                steps_were_chosen: *chosen,
            },
            state,
            memory,
            v,
        ))
    }
}

/// Adds a segment.
///
/// # Errors
/// [`Error::OutOfMemory`]
pub(super) fn push_segment<M: Dae, T: Real>(segments: &mut Vec<Segment<M, T>>) -> Result<(), Error> {
    push(segments, Segment::default())
}

/// The solution at a time within the intervals; where two intervals meet, that of the first one.
///
/// # Errors
/// [`Error::NoResult`], [`Error::OutsideInterval`], [`Error::NonFiniteInput`].
pub(super) fn dense_at<'a, M: Dae, B: Engine<M, T>, T: Real>(
    integrator: &'a mut Integrator<M, B, T>,
    segments: &mut [Segment<M, T>],
    end: &Nominal<M, T>,
    t: T,
) -> Result<&'a Dense<M, T>, Error> {
    check_input(Argument::T, &[t])?;
    let (Some(first), Some(last)) = (segments.first(), segments.last()) else {
        return Err(Error::NoResult);
    };
    let (start, last) = (first.span.start.to_f64(), last.span.end.to_f64());
    let outside = Error::OutsideInterval { t: t.to_f64(), start, end: last };
    let holds = |segment: &&mut Segment<M, T>| is_inside_interval(t, segment.span.start, segment.span.end);
    let segment = segments.iter_mut().find(holds);
    let segment = segment.ok_or(outside)?;
    if segment.tape.entries().is_empty() {
        // An interval of length zero; if all are, `z` is that of the end.
        (integrator.workspace.dense.x, integrator.workspace.dense.z) = (segment.x, end.z);
        return Ok(&integrator.workspace.dense);
    }
    let parameters = integrator.workspace.parameters;
    write_inputs::<M, T>(integrator.workspace.point.as_mut(), &segment.u, &parameters);
    core::mem::swap(&mut integrator.tape, &mut segment.tape);
    let result = integrator.dense_in(segment.span, t).map(|_| ());
    core::mem::swap(&mut integrator.tape, &mut segment.tape);
    result?;
    Ok(&integrator.workspace.dense)
}

/// # Errors
/// [`Error::OutOfMemory`]
pub(super) fn filled_vec<V: Copy>(length: usize, value: V) -> Result<Vec<V>, Error> {
    let mut list = Vec::new();
    refill_vec(&mut list, length, value)?;
    Ok(list)
}

/// Resizes and fills a list; it allocates only if the list grows beyond its capacity.
///
/// # Errors
/// [`Error::OutOfMemory`]
pub(super) fn refill_vec<V: Copy>(list: &mut Vec<V>, length: usize, value: V) -> Result<(), Error> {
    let bytes = length.saturating_mul(size_of::<V>());
    list.clear();
    list.try_reserve_exact(length).map_err(|_| Error::OutOfMemory { bytes })?;
    list.resize(length, value);
    Ok(())
}
