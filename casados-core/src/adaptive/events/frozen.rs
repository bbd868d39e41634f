//! Frozen steps and events: each segment keeps the relative lengths of its steps, and ends at the
//! present time of its event.

use super::detection::MAX_NEWTON_ITERATIONS;
use super::evaluate::check_finite;
use super::{Event, Hybrid};
use crate::adaptive::engine::Engine;
use crate::adaptive::step::Span;
use crate::error::{Argument, Error, Refusal};
use crate::finite::check_model_input;
use crate::model::{Dae, VectorU, VectorX};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};

impl<M: Dae, B: Engine<M, T>, T: Real> Hybrid<M, B, T> {
    /// Freezes the steps and events of the last successful call: later calls repeat them for all
    /// inputs. They are a smooth function of `x₀`, `u` and `p`, solved to rounding. The interval
    /// has to be the same, unless an event ends it earlier.
    ///
    /// Times of events still depend on all inputs, and the steps between two events are scaled with
    /// the time between them. Simultaneous events have to remain simultaneous. The order of the
    /// events is not checked again, and new events are not detected. Derivatives at events are
    /// those of the solution, as without freezing; they equal those of the frozen function up to
    /// the local errors of its steps.
    ///
    /// # Errors
    /// [`Error::NoResult`], also if the last call failed; [`Error::OutOfMemory`]. Later calls
    /// return [`Error::OutsideInterval`] for another interval, and [`Error::StepSizeUnderflow`] if
    /// an event no longer exists.
    pub fn freeze(&mut self) -> Result<(), Error> {
        let asked = self.requested_span.ok_or(Error::NoResult)?;
        if self.segment_count == 0 {
            return Err(Error::NoResult);
        }
        for segment in self.segments.iter_mut().take(self.segment_count) {
            (segment.frozen_span, segment.steps_were_chosen) = (segment.span, false);
            segment.tape.freeze()?;
        }
        self.frozen_span = Some(asked);
        Ok(())
    }

    /// Ends the effect of [`freeze`](Self::freeze): later calls choose steps and detect events.
    pub fn thaw(&mut self) {
        self.frozen_span = None;
    }

    /// Solves all segments with the frozen events.
    ///
    /// # Errors
    /// See [`Hybrid::freeze`]; the errors of Newton's method.
    pub(super) fn solve_frozen_events(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        t_end: T,
        frozen: Span<T>,
    ) -> Result<(), Error> {
        check_model_input::<M, T>(Argument::U, u.as_slice())?;
        frozen.check_same(self.integrator.start_time, t_end)?;
        let (mut x, mut start) = (*x0, frozen.start);
        for k in 0..self.segment_count {
            let Some(segment) = self.segments.get_mut(k) else { break };
            (segment.x, segment.u) = (x, *u);
            if k > 0 {
                segment.start_guess = self.integrator.workspace.start_guess;
            }
            let event = self.solution.occurrences.get(k).and_then(|at| self.events.get(at.event)).copied();
            let Some(event) = event else {
                self.solve_stretched_segment(k, start, t_end)?;
                (self.solution.nominal.x, self.solution.nominal.z) =
                    (self.integrator.workspace.result.x, self.integrator.workspace.result.z);
                break;
            };
            let t = self.solve_event_time(k, &event, start)?;
            let before = self.integrator.workspace.result.x;
            let y = self.consistent_derivatives(&before, u, t)?;
            if let Some(at) = self.solution.occurrences.get_mut(k) {
                (at.t, at.before, at.after) = (t, before, before);
            }
            let Some(jump) = event.jump else {
                self.solution.nominal.x = before;
                self.solution.nominal.z.as_mut_slice().copy_from_slice(&y.as_ref()[M::Shape::NX..]);
                self.solution.t = t;
                break;
            };
            self.move_to_event(k);
            x.as_mut_slice().copy_from_slice(jump.all_outputs(&self.variables).as_ref());
            check_finite(jump.name, x.as_slice(), k)?;
            if let Some(at) = self.solution.occurrences.get_mut(k) {
                at.after = x;
            }
            self.integrator.workspace.start_guess = self.consistent_derivatives(&x, u, t)?;
            start = t;
        }
        Ok(())
    }

    /// Solves the steps of a segment, scaled to new times.
    fn solve_stretched_segment(&mut self, k: usize, start: T, end: T) -> Result<(), Error> {
        let Self { integrator, segments, solution, .. } = self;
        let Some(segment) = segments.get_mut(k) else { return Ok(()) };
        segment.tape.stretch(start, end);
        segment.span = Span { start, end };
        let x = segment.x;
        let (mut frozen, state, ..) = segment.load(integrator)?;
        frozen.solve::<B>(state, &x, None)?;
        if k == 0 {
            solution.nominal.z0 = integrator.workspace.result.z0;
        }
        Ok(())
    }

    /// The time of the event that ends a segment: Newton's method for the length of the segment,
    /// from the frozen length.
    fn solve_event_time(&mut self, k: usize, event: &Event<M, T>, start: T) -> Result<T, Error> {
        let Some((kept, u)) = self.segments.get(k).map(|segment| (segment.frozen_span, segment.u)) else {
            return Err(Error::NoResult);
        };
        let whole = kept.end - kept.start;
        let (mut length, mut last) = (whole, T::ZERO);
        for iteration in 0..MAX_NEWTON_ITERATIONS {
            let t = start + length;
            self.solve_stretched_segment(k, start, t)?;
            let x = self.integrator.workspace.result.x;
            let y = self.consistent_derivatives(&x, &u, t)?;
            let guard = self.event_function_at(k, event, (&x, &u, t), &y)?;
            if whole == T::ZERO {
                // A simultaneous event has to remain one.
                if guard.is_zero(t) {
                    return Ok(t);
                }
                break;
            }
            let change = -(guard.value / guard.rate);
            let resolution = T::from_f64(T::EPSILON) * t.abs().max(whole.abs());
            if change.abs() <= resolution
                || (iteration > 3 && change.abs() >= last && last <= T::from_f64(64.0) * resolution)
            {
                return Ok(t);
            }
            (length, last) = (length + change, change.abs());
            // The length keeps its sign.
            if !(length / whole > T::ZERO && length.is_finite()) {
                break;
            }
        }
        let (t, h) = (start.to_f64(), length.to_f64());
        Err(Error::StepSizeUnderflow { t, h, reason: Refusal::NotConverged, unsettled: None })
    }
}
