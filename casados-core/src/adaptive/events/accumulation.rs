//! Accumulation of events, the Zeno phenomenon (J. Zhang, K. H. Johansson, J. Lygeros, S. Sastry,
//! Zeno hybrid systems, Int. J. Robust Nonlinear Control 11 (2001)).

use super::Hybrid;
use crate::adaptive::engine::Engine;
use crate::error::Error;
use crate::model::Dae;
use crate::scalar::Real;

/// Relative tolerance of the ratios of successive times between four events.
const RATIO_TOLERANCE: f64 = 0.2;
/// The accumulation point is unresolved within this number of roundoff errors of the time.
const UNRESOLVED_ROUNDOFFS: f64 = 1e3;

impl<M: Dae, B: Engine<M, T>, T: Real> Hybrid<M, B, T> {
    /// # Errors
    /// [`Error::AccumulatingEvents`] if the time to the accumulation point is below rounding.
    pub(super) fn check_accumulation(&self, event: usize) -> Result<(), Error> {
        let Some((t, end)) = self.accumulation_time(event) else { return Ok(()) };
        if (end - t).abs() > UNRESOLVED_ROUNDOFFS * T::EPSILON * end.abs().max(t.abs()) {
            return Ok(());
        }
        Err(self.accumulating_events_error(event, end))
    }

    /// The error for too many events: `AccumulatingEvents` if they accumulate, `TooManyEvents`
    /// otherwise.
    pub(super) fn too_many_events_error(&self, t: T) -> Error {
        let events = self.solution.occurrences.len();
        let last = self.solution.occurrences.last().map_or(0, |at| at.event);
        match self.accumulation_time(last) {
            Some((_, end)) => self.accumulating_events_error(last, end),
            None => Error::TooManyEvents { t: t.to_f64(), events },
        }
    }

    fn accumulating_events_error(&self, event: usize, t: f64) -> Error {
        let function = self.events.get(event).map_or("", |event| event.guard.name);
        Error::AccumulatingEvents { t, function, event, events: self.solution.occurrences.len() }
    }

    /// The time of the last event of a kind, and the limit of the geometric series through the last
    /// four.
    fn accumulation_time(&self, event: usize) -> Option<(f64, f64)> {
        let of_kind = self.solution.occurrences.iter().rev().filter(|at| at.event == event);
        let mut times = of_kind.map(|at| at.t.to_f64());
        let [t, second, third, fourth] = [times.next()?, times.next()?, times.next()?, times.next()?];
        let [last, before, first] = [t - second, second - third, third - fourth];
        let [ratio, other] = [last / before, before / first];
        let is_series = ratio > 0.0 && ratio < 1.0 && (ratio - other).abs() <= RATIO_TOLERANCE * ratio;
        is_series.then(|| (t, t + last * ratio / (1.0 - ratio)))
    }
}
