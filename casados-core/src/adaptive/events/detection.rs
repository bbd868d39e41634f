//! Integration from event to event: the steps up to each event, the last one shortened to its time,
//! and the jump.

use super::evaluate::{check_finite, evaluate_event_function, write_point};
use super::event_function::EventFunctionPoint;
use super::{Event, EventLinearisation, Hybrid};
use crate::adaptive::engine::Engine;
use crate::adaptive::point::{ModelPoint, write_inputs};
use crate::adaptive::replay::{StepDifferentiator, StepRecord};
use crate::adaptive::segment::push_segment;
use crate::adaptive::statistics::AdaptiveStatistics;
use crate::adaptive::step::Span;
use crate::error::{Argument, Error};
use crate::finite::check_model_input;
use crate::memory::{extend, push};
use crate::model::{ArrayK, Dae, VectorP, VectorU, VectorX};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};
use bytemuck::Zeroable;

/// Subintervals of a step that are tested for a sign change: two zero crossings within one of them
/// are missed.
const PARTS_PER_STEP: usize = 4;
/// Bisections that enclose a crossing, to a millionth of a subinterval; then the length of the step
/// itself is solved for.
const MAX_BISECTIONS: usize = 20;
/// Iterations of Newton's method for the length of the step that ends at the event.
pub(super) const MAX_NEWTON_ITERATIONS: usize = 20;
/// A zero whose rate, relative to the mean rate over the step, is below this is a tangency.
const MIN_CROSSING_RATE_RATIO: f64 = 1e-8;

/// The index of an event and the approximate time of its crossing.
type CrossingEstimate<T> = Option<(usize, T)>;

impl<M: Dae, B: Engine<M, T>, T: Real> Hybrid<M, B, T> {
    /// Integrates an interval of length `h`, from event to event. The caller marks the result as
    /// valid.
    pub(super) fn integrate_with_events(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
    ) -> Result<Span<T>, Error> {
        self.requested_span = None;
        self.statistics = AdaptiveStatistics::default();
        self.integrator.allocate_derivatives()?;
        check_model_input::<M, T>(Argument::X0, x0.as_slice())?;
        let (start, given) = (self.integrator.start_time, self.integrator.workspace.start_guess);
        let t_end = self.integrator.interval_end(h)?;
        let result = match self.frozen_span {
            Some(frozen) => self.solve_frozen_events(x0, u, t_end, frozen),
            None => {
                self.segment_count = 0;
                self.solution.occurrences.clear();
                self.solution.terminal = false;
                self.integrate_segments(x0, u, t_end)
            }
        };
        (self.integrator.start_time, self.integrator.workspace.start_guess) = (start, given);
        result.map(|()| Span { start, end: t_end })
    }

    fn integrate_segments(&mut self, x0: &VectorX<M, T>, u: &VectorU<M, T>, t_end: T) -> Result<(), Error> {
        let mut x = *x0;
        loop {
            let k = self.segment_count;
            if self.segments.len() <= k {
                push_segment(&mut self.segments)?;
            }
            let found = self.integrate_until_event(k, &x, u, t_end)?;
            self.segment_count += 1;
            if k == 0 {
                self.solution.nominal = self.integrator.workspace.result;
            }
            let Some((index, t)) = found else {
                let result = self.integrator.workspace.result;
                (self.solution.nominal.x, self.solution.nominal.z) = (result.x, result.z);
                self.solution.t = t_end;
                return Ok(());
            };
            let t = self.locate_earliest_event(k, index, t, u)?;
            match self.apply_pending_events(t, u)? {
                Some(after) => x = after,
                None => return Ok(()),
            }
            self.integrator.start_time = t;
        }
    }

    /// Takes the steps up to the one in which an event happens, or to the end.
    fn integrate_until_event(
        &mut self,
        k: usize,
        x: &VectorX<M, T>,
        u: &VectorU<M, T>,
        t_end: T,
    ) -> Result<CrossingEstimate<T>, Error> {
        let start = self.integrator.start_time;
        self.set_function_signs(k, x, u, t_end)?;
        let Self {
            integrator,
            segments,
            events,
            statistics,
            variables: v,
            function_signs: signs,
            function_values: values,
            ..
        } = self;
        let Some(segment) = segments.get_mut(k) else { return Ok(None) };
        segment.span = Span { start, end: t_end };
        (segment.x, segment.u, segment.start_guess) = (*x, *u, integrator.workspace.start_guess);
        segment.steps_were_chosen = true;
        let allowed = integrator.options.max_steps;
        let tried = statistics.steps + statistics.rejected + statistics.failed;
        if tried >= allowed {
            return Err(Error::TooManySteps {
                t: start.to_f64(),
                steps: tried,
                stiff: false,
                rounding: None,
            });
        }
        let (parameters, mut found, mut begin) = (integrator.workspace.parameters, None, start);
        write_inputs::<M, T>(v.as_mut().as_mut(), u, &parameters);
        // Each segment has a tape of its own, which later calls reuse.
        core::mem::swap(&mut integrator.tape, &mut segment.tape);
        integrator.options.max_steps = allowed - tried;
        let run = integrator.run_to(x, u, t_end, true, |step, dense| {
            let length = step.end - begin;
            let mut low = begin;
            for piece in 1..=PARTS_PER_STEP {
                let part = T::from_f64(piece as f64 / PARTS_PER_STEP as f64);
                let high = if piece == PARTS_PER_STEP { step.end } else { begin + part * length };
                (step.evaluate_dense)(high, dense)?;
                for (index, (event, sign)) in events.iter().zip(signs.iter()).enumerate() {
                    let value = evaluate_event_function(event, v, dense, high, k)?;
                    if let Some(to) = values.get_mut(index) {
                        *to = value;
                    }
                    if !event.crossing.matches(*sign, value) {
                        continue;
                    }
                    let (mut a, mut b) = (low, high);
                    for _ in 0..MAX_BISECTIONS {
                        let middle = a + T::from_f64(0.5) * (b - a);
                        (step.evaluate_dense)(middle, dense)?;
                        let value = evaluate_event_function(event, v, dense, middle, k)?;
                        if event.crossing.matches(*sign, value) {
                            b = middle;
                        } else {
                            a = middle;
                        }
                    }
                    let earlier =
                        found.is_none_or(|(_, t): (usize, T)| (b - begin).abs() < (t - begin).abs());
                    if earlier {
                        found = Some((index, b));
                    }
                    // The bisection left the dense output at another time.
                    (step.evaluate_dense)(high, dense)?;
                }
                if found.is_some() {
                    step.stop = true;
                    return Ok(());
                }
                // A zero keeps the sign of the side that the function comes from.
                for (sign, value) in signs.iter_mut().zip(values.iter()).filter(|(_, value)| **value != 0.0) {
                    *sign = *value;
                }
                low = high;
            }
            begin = step.end;
            Ok(())
        });
        integrator.options.max_steps = allowed;
        core::mem::swap(&mut integrator.tape, &mut segment.tape);
        statistics.add(&integrator.statistics);
        match run {
            Err(Error::TooManySteps { t, steps, stiff, rounding }) => {
                Err(Error::TooManySteps { t, steps: steps + tried, stiff, rounding })
            }
            run => run.map(|_| found),
        }
    }

    /// Sets the sign of each function at the start of the segment. A function that is zero to
    /// rounding has the sign that it takes next.
    fn set_function_signs(
        &mut self,
        k: usize,
        x: &VectorX<M, T>,
        u: &VectorU<M, T>,
        t_end: T,
    ) -> Result<(), Error> {
        let start = self.integrator.start_time;
        let forward = if t_end < start { -1.0 } else { 1.0 };
        // A segment after an event starts at a zero of its function, to the rounding of the time.
        let time = if k == 0 { T::ZERO } else { start };
        let given = self.integrator.workspace.start_guess;
        // If there are no consistent derivatives, the integration returns the error.
        let y = if self.events.is_empty() {
            given
        } else {
            self.consistent_derivatives_from(given, x, u, start).unwrap_or(given)
        };
        self.function_signs.clear();
        for index in 0..self.events.len() {
            let Some(event) = self.events.get(index).copied() else { break };
            let guard = self.event_function_at(k, &event, (x, u, start), &y)?;
            let side = if guard.is_zero(time) { forward * guard.rate.to_f64() } else { guard.value.to_f64() };
            push(&mut self.function_signs, side)?;
        }
        self.function_values.clear();
        extend(&mut self.function_values, &self.function_signs)
    }

    /// Changes the length of the last step of a segment so that it ends at the event; returns the
    /// time.
    pub(super) fn end_step_at_event(&mut self, k: usize, event: &Event<M, T>, t: T) -> Result<T, Error> {
        let Some(step) = self.segments.get(k).and_then(|segment| segment.tape.entries().len().checked_sub(1))
        else {
            return Ok(t);
        };
        let Some(entry) = self.segments.get(k).and_then(|segment| segment.tape.entries().get(step).copied())
        else {
            return Ok(t);
        };
        let u = self.segments.get(k).map_or_else(Zeroable::zeroed, |segment| segment.u);
        let (mut h, mut last) = (t - entry.t, T::ZERO);
        for iteration in 0..MAX_NEWTON_ITERATIONS {
            let x = self.step_end(k, step, h)?;
            let time = entry.t + h;
            let y = self.consistent_derivatives(&x, &u, time)?;
            let guard = self.event_function_at(k, event, (&x, &u, time), &y)?;
            let change = -(guard.value / guard.rate);
            let next = h + change;
            // The time stays within the step, up to the error of the polynomial; a crossing with
            // rate zero keeps the time from bisection.
            let slack = T::from_f64(1e-3) * entry.h.abs();
            let inside =
                (next - h).abs() <= entry.h.abs() && (next - (t - entry.t)).abs() <= entry.h.abs() + slack;
            if !change.is_finite() || !inside || (iteration > 3 && change.abs() >= last) {
                break;
            }
            (h, last) = (next, change.abs());
            let resolution = T::from_f64(T::EPSILON) * time.abs().max(entry.h.abs());
            if last <= resolution {
                break;
            }
        }
        let x = self.step_end(k, step, h)?;
        let end = entry.t + h;
        if let Some(segment) = self.segments.get_mut(k) {
            let stages = B::differentiator(&mut self.integrator.method_state).stages(entry.order_index)?;
            segment.tape.replace_last_step(h, M::Shape::NX, stages);
            segment.span.end = end;
        }
        self.integrator.workspace.result.x = x;
        Ok(end)
    }

    /// The state at the end of a step with the length `h`.
    fn step_end(&mut self, k: usize, step: usize, h: T) -> Result<VectorX<M, T>, Error> {
        let Self { integrator, segments, .. } = self;
        let (Some(segment), mut x) = (segments.get(k), VectorX::<M, T>::zeroed()) else {
            return Err(Error::NoResult);
        };
        let Some(entry) = segment.tape.entries().get(step) else { return Err(Error::NoResult) };
        let (states, y) = segment.tape.step_numbers(step, M::Shape::NX);
        x.as_mut_slice().copy_from_slice(states);
        let at = ModelPoint { x: &x, u: &segment.u, p: &integrator.workspace.parameters, t: entry.t };
        let taken = StepRecord {
            start: at,
            h,
            stage_unknowns: y,
            order_index: entry.order_index,
            stages_are_solved: false,
        };
        Ok(B::differentiator(&mut integrator.method_state).solve(&taken, None)?.x)
    }

    /// The consistent `(ẋ, z)` at a state.
    pub(super) fn consistent_derivatives(
        &mut self,
        x: &VectorX<M, T>,
        u: &VectorU<M, T>,
        t: T,
    ) -> Result<ArrayK<M, T>, Error> {
        let (nx, point) = (M::Shape::NX, self.integrator.workspace.point.as_ref());
        // Starts from the end of the last step.
        let mut y = ArrayK::<M, T>::zeroed();
        for (y, from) in y.as_mut().iter_mut().zip(point[..nx].iter().chain(&point[2 * nx..])) {
            *y = *from;
        }
        self.consistent_derivatives_from(y, x, u, t)
    }

    /// As `consistent_derivatives`, from the initial guess `y`.
    pub(super) fn consistent_derivatives_from(
        &mut self,
        mut y: ArrayK<M, T>,
        x: &VectorX<M, T>,
        u: &VectorU<M, T>,
        t: T,
    ) -> Result<ArrayK<M, T>, Error> {
        let parameters: VectorP<M, T> = self.integrator.workspace.parameters;
        let at = ModelPoint { x, u, p: &parameters, t };
        self.integrator.consistent.solve(&at, &mut y)?;
        Ok(y)
    }

    /// Moves the state and the time to the event.
    pub(super) fn move_to_event(&mut self, k: usize) {
        let parameters = self.integrator.workspace.parameters;
        let (Some(segment), Some(at)) = (self.segments.get(k), self.solution.occurrences.get(k)) else {
            return;
        };
        write_inputs::<M, T>(self.variables.as_mut().as_mut(), &segment.u, &parameters);
        write_point::<M, T>(&mut self.variables, &at.before, &[], at.t);
    }

    /// Linearises the event that ends a segment, whose steps have just been replayed.
    ///
    /// # Errors
    /// [`Error::Grazing`]; no consistent derivatives; a jump that is not finite.
    #[allow(clippy::type_complexity)]
    pub(super) fn linearise_event(
        &mut self,
        k: usize,
    ) -> Result<Option<(Event<M, T>, EventLinearisation<M, T>)>, Error> {
        let (Some(at), Some(segment)) = (self.solution.occurrences.get_mut(k), self.segments.get(k)) else {
            return Ok(None);
        };
        at.before = self.integrator.workspace.result.x;
        at.after = at.before;
        let (index, t, u, before) = (at.event, at.t, segment.u, at.before);
        let Some(event) = self.events.get(index).copied() else { return Ok(None) };
        let xdot = self.consistent_derivatives(&before, &u, t)?;
        if event.guard.reads_algebraic_states && self.depends_on_time(k, &before, &xdot, t).is_some() {
            return Err(Error::DependsOnTime { function: "the model" });
        }
        let EventFunctionPoint { gradient: guard, rate, .. } =
            self.event_function_at(k, &event, (&before, &u, t), &xdot)?;
        self.check_transversality(k, &event, index, rate)?;
        self.move_to_event(k);
        let mut moment = EventLinearisation {
            function_gradient: guard,
            function_rate: rate,
            derivatives_before: xdot,
            derivatives_after: ArrayK::<M, T>::zeroed(),
        };
        if let Some(jump) = event.jump {
            let mut after = VectorX::<M, T>::zeroed();
            after.as_mut_slice().copy_from_slice(jump.all_outputs(&self.variables).as_ref());
            check_finite(jump.name, after.as_slice(), k)?;
            moment.derivatives_after = self.consistent_derivatives(&after, &u, t)?;
            if let Some(at) = self.solution.occurrences.get_mut(k) {
                at.after = after;
            }
        }
        Ok(Some((event, moment)))
    }
}

impl<M: Dae, B: Engine<M, T>, T: Real> Hybrid<M, B, T> {
    /// Tests that the crossing is transversal: the rate at the event is not small relative to the
    /// mean rate over the last step.
    ///
    /// # Errors
    /// [`Error::Grazing`]
    fn check_transversality(
        &mut self,
        k: usize,
        event: &Event<M, T>,
        index: usize,
        rate: T,
    ) -> Result<(), Error> {
        let Some(segment) = self.segments.get(k) else { return Ok(()) };
        let Some(step) = segment.tape.entries().len().checked_sub(1) else { return Ok(()) };
        let Some(entry) = segment.tape.entries().get(step).copied() else { return Ok(()) };
        let mut x = VectorX::<M, T>::zeroed();
        x.as_mut_slice().copy_from_slice(segment.tape.step_numbers(step, M::Shape::NX).0);
        let (last, u) = (self.integrator.workspace.result.x, segment.u);
        let end = self.event_function_value(k, event, &last, &u, entry.t + entry.h)?;
        let start = self.event_function_value(k, event, &x, &u, entry.t)?;
        let (change, expected) = ((end - start).to_f64().abs(), (rate * entry.h).to_f64().abs());
        if rate == T::ZERO || expected < MIN_CROSSING_RATE_RATIO * change {
            let t = (entry.t + entry.h).to_f64();
            return Err(Error::Grazing { event: index, function: event.guard.name, t });
        }
        Ok(())
    }
}
