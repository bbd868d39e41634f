//! Events that happen at one time.
//!
//! 1. The earliest crossing of a step is located: where another function has crossed zero before
//!    it, that one.
//! 2. All functions that are zero at this time, to the rounding of the time and of their terms, and
//!    go to the side that their crossing asks for, happen.
//! 3. They happen in the order of the list. Each is looked at again after the jumps before it, and
//!    happens if its function is still zero.
//! 4. What a jump itself takes from one side of zero to the other is no crossing.

use super::{Hybrid, Occurrence};
use crate::adaptive::engine::Engine;
use crate::adaptive::point::At;
use crate::adaptive::segment::add;
use crate::adaptive::step::Span;
use crate::error::Error;
use crate::memory::push;
use crate::model::{Dae, VectorU, VectorX};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};

use super::evaluate::finite;

impl<M: Dae, B: Engine<M, T>, T: Real> Hybrid<M, B, T> {
    /// The last step of a segment ends where the earliest of the events is that cross zero in it,
    /// one of which was found near `t`. Notes all that are zero then; when that is.
    pub(super) fn locate(&mut self, k: usize, found: usize, near: T, u: &VectorU<M, T>) -> Result<T, Error> {
        let (mut index, mut t) = (found, near);
        for _ in 0..self.events.len() {
            let Some(event) = self.events.get(index).copied() else { return Err(Error::NoResult) };
            t = self.shorten(k, &event, t)?;
            match self.find_pending(k, index, t, u)? {
                Some(earlier) => index = earlier,
                None => break,
            }
        }
        Ok(t)
    }

    /// Notes the events that happen where a segment ends, `index` among them; one that has happened
    /// before, if there is one.
    fn find_pending(
        &mut self,
        k: usize,
        index: usize,
        t: T,
        u: &VectorU<M, T>,
    ) -> Result<Option<usize>, Error> {
        self.pending.clear();
        let x = self.integrator.base.result.x;
        let y = self.slope(&x, u, t)?;
        let time = self.resolution(k, t);
        let forward =
            if self.segments.get(k).is_some_and(|at| at.span.end < at.span.start) { -1.0 } else { 1.0 };
        for other in 0..self.events.len() {
            let Some(event) = self.events.get(other).copied() else { break };
            if other == index {
                push(&mut self.pending, other)?;
                continue;
            }
            let sign = self.signs.get(other).copied().unwrap_or_default();
            let guard = self.guard(k, &event, (&x, u, t), &y)?;
            let has_crossed = event.crossing.matches(sign, guard.value.to_f64());
            if !guard.is_zero(time) {
                if has_crossed {
                    return Ok(Some(other));
                }
                continue;
            }
            let towards = guard.rate.to_f64() * forward * sign < 0.0;
            if has_crossed || towards && event.crossing.matches(sign, -sign) {
                push(&mut self.pending, other)?;
            }
        }
        Ok(None)
    }

    /// What the time is rounded relative to.
    fn resolution(&self, k: usize, t: T) -> T {
        let last = self.segments.get(k).and_then(|segment| segment.tape.entries().last());
        t.abs() + last.map_or(T::ZERO, |entry| entry.h.abs())
    }

    /// The events that were noted happen at the end of the last segment: the state after them, or
    /// nothing if one of them ends the integration.
    pub(super) fn happen(&mut self, t: T, u: &VectorU<M, T>) -> Result<Option<VectorX<M, T>>, Error> {
        let (mut x, mut k) = (self.integrator.base.result.x, self.count - 1);
        let time = self.resolution(k, t);
        let mut is_first = true;
        for place in 0..self.pending.len() {
            let Some(index) = self.pending.get(place).copied() else { break };
            let Some(event) = self.events.get(index).copied() else { return Err(Error::NoResult) };
            let y = if is_first { self.slope(&x, u, t)? } else { self.integrator.base.given };
            if !is_first {
                let guard = self.guard(k, &event, (&x, u, t), &y)?;
                if !guard.is_zero(time) {
                    continue;
                }
                k = self.segment_without_length(&x, u, t)?;
            }
            is_first = false;
            let occurrences = &mut self.solution.occurrences;
            if occurrences.len() >= self.most {
                return Err(self.too_many(t));
            }
            push(occurrences, Occurrence { event: index, t, before: x, after: x })?;
            self.check_accumulation(index)?;
            let Some(jump) = event.jump else {
                // Where the state is, `z` is that of the equations there.
                self.solution.nominal.x = x;
                self.solution.nominal.z.as_mut_slice().copy_from_slice(&y.as_ref()[M::Shape::NX..]);
                (self.solution.t, self.solution.terminal) = (t, true);
                return Ok(None);
            };
            self.go(k);
            x.as_mut_slice().copy_from_slice(jump.all(&self.v).as_ref());
            finite(jump.name, x.as_slice(), k)?;
            if let Some(occurrence) = self.solution.occurrences.get_mut(k) {
                occurrence.after = x;
            }
            // The side of the solution on which the next steps begin.
            let parameters = self.integrator.base.parameters;
            let mut y = y;
            self.integrator.consistent.solve(&At { x: &x, u, p: &parameters, t }, &mut y)?;
            self.integrator.base.given = y;
        }
        Ok(Some(x))
    }

    /// A segment between two events at one time.
    fn segment_without_length(&mut self, x: &VectorX<M, T>, u: &VectorU<M, T>, t: T) -> Result<usize, Error> {
        let k = self.count;
        if self.segments.len() <= k {
            add(&mut self.segments)?;
        }
        self.count += 1;
        if let Some(segment) = self.segments.get_mut(k) {
            segment.tape.clear();
            segment.span = Span { start: t, end: t };
            (segment.x, segment.u, segment.given) = (*x, *u, self.integrator.base.given);
            segment.chosen = true;
        }
        Ok(k)
    }
}
