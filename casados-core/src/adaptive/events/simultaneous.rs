//! Simultaneous events.
//!
//! 1. The earliest crossing of a step is located; if another function has crossed zero before it,
//!    that one instead.
//! 2. All functions that are zero at this time, to the rounding of the time and of their terms, and
//!    change sign in the direction of their `Crossing`, happen.
//! 3. They happen in the order of the list. Each is evaluated again after the jumps before it, and
//!    happens if its function is still zero.
//! 4. A sign change caused by a jump is not a crossing.

use super::{Hybrid, Occurrence};
use crate::adaptive::engine::Engine;
use crate::adaptive::point::ModelPoint;
use crate::adaptive::segment::push_segment;
use crate::adaptive::step::Span;
use crate::error::Error;
use crate::memory::push;
use crate::model::{Dae, VectorU, VectorX};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};

use super::evaluate::check_finite;

impl<M: Dae, B: Engine<M, T>, T: Real> Hybrid<M, B, T> {
    /// Ends the last step of a segment at the earliest event in it, given an event found near `t`.
    /// Records all events that are zero there; returns their time.
    pub(super) fn locate_earliest_event(
        &mut self,
        k: usize,
        found: usize,
        near: T,
        u: &VectorU<M, T>,
    ) -> Result<T, Error> {
        let (mut index, mut t) = (found, near);
        for _ in 0..self.events.len() {
            let Some(event) = self.events.get(index).copied() else { return Err(Error::NoResult) };
            t = self.end_step_at_event(k, &event, t)?;
            match self.find_simultaneous_events(k, index, t, u)? {
                Some(earlier) => index = earlier,
                None => break,
            }
        }
        Ok(t)
    }

    /// Records the events at the end of a segment, `index` among them; returns an event that
    /// happened earlier, if any.
    fn find_simultaneous_events(
        &mut self,
        k: usize,
        index: usize,
        t: T,
        u: &VectorU<M, T>,
    ) -> Result<Option<usize>, Error> {
        self.pending_events.clear();
        let x = self.integrator.workspace.result.x;
        let y = self.consistent_derivatives(&x, u, t)?;
        let time = self.time_magnitude(k, t);
        let forward =
            if self.segments.get(k).is_some_and(|at| at.span.end < at.span.start) { -1.0 } else { 1.0 };
        for other in 0..self.events.len() {
            let Some(event) = self.events.get(other).copied() else { break };
            if other == index {
                push(&mut self.pending_events, other)?;
                continue;
            }
            let sign = self.function_signs.get(other).copied().unwrap_or_default();
            let guard = self.event_function_at(k, &event, (&x, u, t), &y)?;
            let has_crossed = event.crossing.matches(sign, guard.value.to_f64());
            if !guard.is_zero(time) {
                if has_crossed {
                    return Ok(Some(other));
                }
                continue;
            }
            let towards = guard.rate.to_f64() * forward * sign < 0.0;
            if has_crossed || towards && event.crossing.matches(sign, -sign) {
                push(&mut self.pending_events, other)?;
            }
        }
        Ok(None)
    }

    /// The magnitude of times, for their rounding errors.
    fn time_magnitude(&self, k: usize, t: T) -> T {
        let last = self.segments.get(k).and_then(|segment| segment.tape.entries().last());
        t.abs() + last.map_or(T::ZERO, |entry| entry.h.abs())
    }

    /// Applies the recorded events at the end of the last segment; returns the state after them, or
    /// nothing if one of them ends the integration.
    pub(super) fn apply_pending_events(
        &mut self,
        t: T,
        u: &VectorU<M, T>,
    ) -> Result<Option<VectorX<M, T>>, Error> {
        let (mut x, mut k) = (self.integrator.workspace.result.x, self.segment_count - 1);
        let time = self.time_magnitude(k, t);
        let mut is_first = true;
        for place in 0..self.pending_events.len() {
            let Some(index) = self.pending_events.get(place).copied() else { break };
            let Some(event) = self.events.get(index).copied() else { return Err(Error::NoResult) };
            let y = if is_first {
                self.consistent_derivatives(&x, u, t)?
            } else {
                self.integrator.workspace.start_guess
            };
            if !is_first {
                let guard = self.event_function_at(k, &event, (&x, u, t), &y)?;
                if !guard.is_zero(time) {
                    continue;
                }
                k = self.push_empty_segment(&x, u, t)?;
            }
            is_first = false;
            let occurrences = &mut self.solution.occurrences;
            if occurrences.len() >= self.max_events {
                return Err(self.too_many_events_error(t));
            }
            push(occurrences, Occurrence { event: index, t, before: x, after: x })?;
            self.check_accumulation(index)?;
            let Some(jump) = event.jump else {
                // `z` is consistent with the new state.
                self.solution.nominal.x = x;
                self.solution.nominal.z.as_mut_slice().copy_from_slice(&y.as_ref()[M::Shape::NX..]);
                (self.solution.t, self.solution.terminal) = (t, true);
                return Ok(None);
            };
            self.move_to_event(k);
            x.as_mut_slice().copy_from_slice(jump.all_outputs(&self.variables).as_ref());
            check_finite(jump.name, x.as_slice(), k)?;
            if let Some(occurrence) = self.solution.occurrences.get_mut(k) {
                occurrence.after = x;
            }
            // The branch of the solution on which the next steps start.
            let parameters = self.integrator.workspace.parameters;
            let mut y = y;
            self.integrator.consistent.solve(&ModelPoint { x: &x, u, p: &parameters, t }, &mut y)?;
            self.integrator.workspace.start_guess = y;
        }
        Ok(Some(x))
    }

    /// Adds a segment of length zero between two simultaneous events.
    fn push_empty_segment(&mut self, x: &VectorX<M, T>, u: &VectorU<M, T>, t: T) -> Result<usize, Error> {
        let k = self.segment_count;
        if self.segments.len() <= k {
            push_segment(&mut self.segments)?;
        }
        self.segment_count += 1;
        if let Some(segment) = self.segments.get_mut(k) {
            segment.tape.clear();
            segment.span = Span { start: t, end: t };
            (segment.x, segment.u, segment.start_guess) = (*x, *u, self.integrator.workspace.start_guess);
            segment.steps_were_chosen = true;
        }
        Ok(k)
    }
}
