//! Steps and events that are kept: each part between two events has the same steps, relative to its
//! length, and ends where its event happens now.

use super::evaluate::finite;
use super::trace::ITERATIONS;
use super::{Event, Hybrid};
use crate::adaptive::engine::Engine;
use crate::adaptive::step::Span;
use crate::error::{Argument, Error, Refusal};
use crate::finite::check_named;
use crate::model::{Dae, VectorU, VectorX};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};

impl<M: Dae, B: Engine<M, T>, T: Real> Hybrid<M, B, T> {
    /// Following calls keep the steps and the events of the last successful one, whatever they are
    /// given: one smooth function of `x₀`, `u` and `p`, solved to rounding. Their interval has to
    /// be the same, unless an event ends it before.
    ///
    /// Times of events still depend on everything, and the steps between two events are stretched
    /// with the time between them. Events that happened at one time have to do so still. That
    /// events happen in this order, once each, and others do not, is not looked at again.
    /// Derivatives at events are those of the solution, as without it: they belong to this function
    /// up to the errors of its steps.
    ///
    /// # Errors
    /// [`Error::NoResult`], also if the last call failed; [`Error::OutOfMemory`]. Of following
    /// calls [`Error::OutsideInterval`], if they ask for another interval, and
    /// [`Error::StepSizeUnderflow`], if an event cannot be found anymore.
    pub fn freeze(&mut self) -> Result<(), Error> {
        let asked = self.asked.ok_or(Error::NoResult)?;
        if self.count == 0 {
            return Err(Error::NoResult);
        }
        for segment in self.segments.iter_mut().take(self.count) {
            (segment.kept, segment.chosen) = (segment.span, false);
            segment.tape.keep()?;
        }
        self.frozen = Some(asked);
        Ok(())
    }

    /// Following calls choose steps and look for events again.
    pub fn thaw(&mut self) {
        self.frozen = None;
    }

    /// All parts, with the events that are kept.
    ///
    /// # Errors
    /// See [`Hybrid::freeze`]; those of Newton's method.
    pub(super) fn repeat(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        t_end: T,
        frozen: Span<T>,
    ) -> Result<(), Error> {
        check_named::<M, T>(Argument::U, u.as_slice())?;
        frozen.check_is(self.integrator.start, t_end)?;
        let (mut x, mut start) = (*x0, frozen.start);
        for k in 0..self.count {
            let Some(segment) = self.segments.get_mut(k) else { break };
            (segment.x, segment.u) = (x, *u);
            if k > 0 {
                segment.given = self.integrator.base.given;
            }
            let event = self.solution.occurrences.get(k).and_then(|at| self.events.get(at.event)).copied();
            let Some(event) = event else {
                self.stretched(k, start, t_end)?;
                (self.solution.nominal.x, self.solution.nominal.z) =
                    (self.integrator.base.result.x, self.integrator.base.result.z);
                break;
            };
            let t = self.arrive(k, &event, start)?;
            let before = self.integrator.base.result.x;
            let y = self.slope(&before, u, t)?;
            if let Some(at) = self.solution.occurrences.get_mut(k) {
                (at.t, at.before, at.after) = (t, before, before);
            }
            let Some(jump) = event.jump else {
                self.solution.nominal.x = before;
                self.solution.nominal.z.as_mut_slice().copy_from_slice(&y.as_ref()[M::Shape::NX..]);
                self.solution.t = t;
                break;
            };
            self.go(k);
            x.as_mut_slice().copy_from_slice(jump.all(&self.v).as_ref());
            finite(jump.name, x.as_slice(), k)?;
            if let Some(at) = self.solution.occurrences.get_mut(k) {
                at.after = x;
            }
            self.integrator.base.given = self.slope(&x, u, t)?;
            start = t;
        }
        Ok(())
    }

    /// The steps of a part between other times, solved.
    fn stretched(&mut self, k: usize, start: T, end: T) -> Result<(), Error> {
        let Self { integrator, segments, solution, .. } = self;
        let Some(segment) = segments.get_mut(k) else { return Ok(()) };
        segment.tape.stretch(start, end);
        segment.span = Span { start, end };
        let x = segment.x;
        let (mut frozen, state, ..) = segment.open(integrator)?;
        frozen.solve::<B>(state, &x, None)?;
        if k == 0 {
            solution.nominal.z0 = integrator.base.result.z0;
        }
        Ok(())
    }

    /// The time of the event that ends a part: by Newton's method for its length, from the one that
    /// is kept.
    fn arrive(&mut self, k: usize, event: &Event<M, T>, start: T) -> Result<T, Error> {
        let Some((kept, u)) = self.segments.get(k).map(|segment| (segment.kept, segment.u)) else {
            return Err(Error::NoResult);
        };
        let whole = kept.end - kept.start;
        let (mut length, mut last) = (whole, T::ZERO);
        for iteration in 0..ITERATIONS {
            let t = start + length;
            self.stretched(k, start, t)?;
            let x = self.integrator.base.result.x;
            let y = self.slope(&x, &u, t)?;
            let guard = self.guard(k, event, (&x, &u, t), &y)?;
            if whole == T::ZERO {
                // It happened at the time of the event before it, and does so still.
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
            // In the same direction still.
            if !(length / whole > T::ZERO && length.is_finite()) {
                break;
            }
        }
        let (t, h) = (start.to_f64(), length.to_f64());
        Err(Error::StepSizeUnderflow { t, h, reason: Refusal::NotConverged, unsettled: None })
    }
}
