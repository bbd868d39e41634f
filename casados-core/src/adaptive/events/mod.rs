//! Integration with events: zero crossings of functions, located by dense output and then to
//! rounding, at which the integration ends or the state jumps, with the jump of the sensitivities.
//!
//! At the time `t*(w)` of an event, with the derivatives `f⁻` and `f⁺` of the state on both sides:
//!
//! ```text
//! dt*/dw = −(g_x V⁻ + g_w)/ġ        ġ = g_x f⁻ + g_t        dx(t*)/dw = V⁻ + f⁻ dt*/dw
//! V⁺ = j_x (V⁻ + f⁻ dt*/dw) + j_w + (j_t − f⁺) dt*/dw
//! λ⁻ = j_xᵀ λ⁺ − (σ/ġ) g_x        λ_w += j_wᵀ λ⁺ − (σ/ġ) g_w        σ = λ⁺ᵀ (j_x f⁻ + j_t − f⁺)
//! ```
//!
//! `second_order` differentiates them once more, `frozen` repeats steps and events. Between events
//! derivatives are those of the accepted steps. At events they are those of the solution: the
//! derivative of a step with respect to its length is `ẋ`, up to the local error.

mod accumulation;
mod detection;
mod evaluate;
mod event;
mod event_function;
mod forward;
mod frozen;
mod jump;
mod results;
mod second_order;
mod simultaneous;

pub use event::{Crossing, Event};
pub use results::{HybridAdjoint, HybridForward, Occurrence, Solution, TimeGradient};
pub use second_order::HybridHessian;

use crate::adaptive::engine::Engine;
use crate::adaptive::integrator::Integrator;
use crate::adaptive::segment::{Segment, dense_at, refill_vec};
use crate::adaptive::sensitivities::{chain_rule_integrand, dyn_integrand};
use crate::adaptive::statistics::AdaptiveStatistics;
use crate::adaptive::step::Span;
use crate::error::{Argument, Error, Place};
use crate::finite::{check_model_input, find_non_finite};
use crate::integrator::chain_rule::StateSensitivities;
use crate::linalg::axpy;
use crate::memory::{allocate, push};
use crate::model::{
    ArrayK, ArrayV, ArrayW, ArrayX, Dae, MatrixXP, MatrixXU, MatrixXX, VectorP, VectorU, VectorX,
};
use crate::quadrature::{Integrand, OptionalIntegrand, finish_integrand, reborrow, reset_integrand};
use crate::result::{Dense, Nominal};
use crate::scalar::Real;
use crate::shape::{Array, Matrix, Shape, listed, plain};
use alloc::boxed::Box;
use alloc::vec::Vec;
use bytemuck::Zeroable;

/// An adaptive integrator with events.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::{SVector, vector};
///
/// /// A ball that falls: height m, velocity m/s.
/// #[ode]
/// fn ball(x: [f64; 2]) -> [f64; 2] { [x[1], -10.0] }
/// #[function]
/// fn height(x: [f64; 2]) -> f64 { x[0] }
/// /// A fifth of the velocity is lost.
/// #[function]
/// fn bounce(x: [f64; 2]) -> [f64; 2] { [x[0], -0.8 * x[1]] }
///
/// let bounces = Event::jump::<Height, Bounce>(Crossing::Falling);
/// let radau = Adaptive::<Ball, Radau>::new(AdaptiveOptions::default())?;
/// let mut ball = Hybrid::new(radau, &[bounces])?;
/// let end = ball.forward(&vector![5.0, 0.0], &SVector::<f64, 0>::zeros(), 1.5)?;
/// // It hits the ground after a second, at 10 m/s.
/// assert!((end.solution.occurrences[0].t - 1.0).abs() < 1e-12);
/// assert!((end.solution.nominal.x - vector![8.0 * 0.5 - 1.25, 8.0 - 5.0]).norm() < 1e-11);
/// # Ok::<(), casados::Error>(())
/// ```
///
/// **Simultaneous events.** Events happen where the solution brings their functions to zero. All
/// functions that are zero at the same time, to rounding, happen in the order of the list. Each is
/// evaluated again after the jumps before it, and happens if it is still zero. A terminal event
/// ends the integration before the later events of the list. A sign change caused by a jump is not
/// an event, and neither is a zero at the start: a function that starts at zero has the sign that
/// it takes next.
///
/// **Algebraic states.** Event functions may depend on `z`; jumps change only `x`. The first
/// derivatives of such an event follow from the implicit function theorem, if the equations of the
/// model do not depend on time.
///
/// All calls take the length `h` of the interval, as those of the integrator. Times of events, and
/// the argument of [`dense`](Self::dense), are absolute: the time `t` of the model.
///
/// Repeated calls of one kind allocate only the lists that results of derivatives own.
///
/// # Errors
/// Every call: the errors of [`Integrator`]; [`Error::InconsistentStart`], also after a jump;
/// [`Error::TooManyEvents`]; [`Error::AccumulatingEvents`] if the times between events shrink to
/// zero; [`Error::TooManySteps`] for the sum of steps of a call; [`Error::NonFiniteFunction`] of an
/// event function or jump. Calls with derivatives: [`Error::Grazing`] if the time of the event has
/// no derivative, and [`Error::DependsOnTime`] for an event function of `z`.
pub struct Hybrid<M: Dae, B: Engine<M, T>, T: Real> {
    integrator: Integrator<M, B, T>,
    events: Box<[Event<M, T>]>,
    /// The maximum number of events in a call.
    max_events: usize,
    segments: Vec<Segment<M, T>>,
    /// The number of segments of the last successful call.
    segment_count: usize,
    /// The interval of the last call, if it succeeded, and that of the frozen steps and events.
    requested_span: Option<Span<T>>,
    frozen_span: Option<Span<T>>,
    statistics: AdaptiveStatistics,
    solution: Solution<M, T>,
    /// The variables at which functions are evaluated.
    variables: Box<ArrayV<M, T>>,
    /// The sign of each function, followed by its value.
    function_signs: Vec<f64>,
    function_values: Vec<f64>,
    /// The events at the end of the last segment, in the order of the list.
    pending_events: Vec<usize>,
    /// The linearised events of a call.
    linearised_events: LinearisedEvents<M, T>,
    /// The derivatives over the segments so far, and memory for those over the next one.
    sensitivities: Option<[Box<StateSensitivities<M, T>>; 2]>,
    /// Memory for second derivatives.
    second_order: Option<Box<second_order::SecondOrderMemory<M, T>>>,
}

/// The events of a call that happened, in order.
type LinearisedEvents<M, T> = Vec<(Event<M, T>, EventLinearisation<M, T>)>;

/// The linearisation of an event.
struct EventLinearisation<M: Dae, T: Real> {
    /// `g_v`, and `ġ`.
    function_gradient: ArrayV<M, T>,
    function_rate: T,
    /// `(ẋ, z)` on both sides.
    derivatives_before: ArrayK<M, T>,
    derivatives_after: ArrayK<M, T>,
}

impl<M: Dae, B: Engine<M, T>, T: Real> Hybrid<M, B, T> {
    /// Adds events to an integrator, which keeps its options, tolerances, parameters and start
    /// time; the limit is a thousand events in a call.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub fn new(integrator: Integrator<M, B, T>, events: &[Event<M, T>]) -> Result<Self, Error> {
        let solution =
            Solution { nominal: Nominal::zeroed(), t: T::ZERO, terminal: false, occurrences: Vec::new() };
        Ok(Self {
            integrator,
            events: events.into(),
            max_events: 1000,
            segments: Vec::new(),
            segment_count: 0,
            requested_span: None,
            frozen_span: None,
            statistics: AdaptiveStatistics::default(),
            solution,
            variables: allocate()?,
            function_signs: Vec::new(),
            function_values: Vec::new(),
            pending_events: Vec::new(),
            linearised_events: Vec::new(),
            sensitivities: None,
            second_order: None,
        })
    }

    /// The integrator, to set its parameters or its start time.
    pub fn integrator(&mut self) -> &mut Integrator<M, B, T> {
        &mut self.integrator
    }

    /// Sets the maximum number of events in one call; more are the error `TooManyEvents`.
    pub fn set_most_events(&mut self, most: usize) {
        self.max_events = most;
    }

    /// Statistics of the step selection of the last call, over all segments.
    #[must_use]
    pub fn statistics(&self) -> &AdaptiveStatistics {
        &self.statistics
    }

    /// Integrates; returns the solution at the end and the events.
    ///
    /// # Errors
    /// See [`Hybrid`].
    pub fn solve(&mut self, x0: &VectorX<M, T>, u: &VectorU<M, T>, h: T) -> Result<&Solution<M, T>, Error> {
        self.requested_span = Some(self.integrate_with_events(x0, u, h)?);
        Ok(&self.solution)
    }

    /// The solution at the model's time `t` within the interval of the last call; at a jump, the
    /// solution before it.
    ///
    /// # Errors
    /// [`Error::NoResult`], also if that call failed; [`Error::OutsideInterval`],
    /// [`Error::NonFiniteInput`].
    pub fn dense(&mut self, t: T) -> Result<&Dense<M, T>, Error> {
        let Self { integrator, segments, segment_count: count, solution, requested_span: asked, .. } = self;
        asked.ok_or(Error::NoResult)?;
        dense_at(integrator, segments.get_mut(..*count).unwrap_or_default(), &solution.nominal, t)
    }

    /// Integrates with forward sensitivities; returns the solution at the end, its derivatives, and
    /// those of the times of the events.
    ///
    /// # Errors
    /// See [`Hybrid`].
    pub fn forward(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
    ) -> Result<HybridForward<M, T>, Error> {
        self.forward_with_quadrature(x0, u, h, None)
    }

    /// As [`Hybrid::forward`], with an integrand.
    pub(super) fn forward_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<HybridForward<M, T>, Error> {
        let span = self.integrate_with_events(x0, u, h)?;
        let (result, moments) = self.forward_sweep(x0, false, integrand)?;
        (self.linearised_events, self.requested_span) = (moments, Some(span));
        Ok(result)
    }

    /// Integrates with the adjoint; returns the solution at the end and the gradient of `λᵀx`.
    ///
    /// # Errors
    /// See [`Hybrid`].
    pub fn adjoint(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
    ) -> Result<HybridAdjoint<M, T>, Error> {
        self.adjoint_with_quadrature(x0, u, h, lambda, None)
    }

    /// As [`Hybrid::solve`], with an integrand: the steps are replayed, solved to rounding.
    pub(super) fn solve_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<&Solution<M, T>, Error> {
        let span = self.integrate_with_events(x0, u, h)?;
        self.linearised_events = self.replay_steps(x0, integrand)?;
        self.requested_span = Some(span);
        Ok(&self.solution)
    }

    /// Replays all steps, solved to rounding, and linearises the events.
    fn replay_steps(
        &mut self,
        x0: &VectorX<M, T>,
        mut integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<LinearisedEvents<M, T>, Error> {
        reset_integrand(&mut integrand);
        let mut moments = core::mem::take(&mut self.linearised_events);
        moments.clear();
        let mut x = *x0;
        for k in 0..self.segment_count {
            let Self { integrator, segments, solution, .. } = self;
            let Some(segment) = segments.get_mut(k) else { break };
            segment.x = x;
            let (mut frozen, state, ..) = segment.load(integrator)?;
            let mut part = chain_rule_integrand(&mut integrand, None, false);
            frozen.solve::<B>(state, &x, dyn_integrand(&mut part))?;
            if k == 0 {
                solution.nominal.z0 = integrator.workspace.result.z0;
            }
            let Some(moment) = self.linearise_event(k)? else { break };
            push(&mut moments, moment)?;
            x = self.solution.occurrences.get(k).map_or(x, |occurrence| occurrence.after);
        }
        self.collect_solution();
        finish_integrand(&mut integrand)?;
        Ok(moments)
    }

    /// As [`Hybrid::adjoint`], with an integrand.
    pub(super) fn adjoint_with_quadrature(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        mut along: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<HybridAdjoint<M, T>, Error> {
        self.requested_span = None;
        check_model_input::<M, T>(Argument::Lambda, lambda.as_slice())?;
        let span = self.integrate_with_events(x0, u, h)?;
        let moments = self.replay_steps(x0, reborrow(&mut along))?;
        let mut result = HybridAdjoint {
            solution: self.solution.clone(),
            grad_x0: *lambda,
            grad_u: Zeroable::zeroed(),
            grad_p: Zeroable::zeroed(),
        };
        for k in (0..self.segment_count).rev() {
            if let Some((event, moment)) = moments.get(k) {
                let mut density = T::ZERO;
                if let Some(integrand) = &mut along {
                    self.integrand_at_jump(k, event, moment, &mut **integrand, |integrand, sign, at| {
                        density = density + sign * integrand.integrand_value(at)?;
                        Ok(())
                    })?;
                }
                self.adjoint_over_jump(k, *event, moment, density, &mut result);
            }
            let Self { integrator, segments, .. } = self;
            let Some(segment) = segments.get_mut(k) else { break };
            let (mut frozen, state, memory, _) = segment.load(integrator)?;
            frozen.adjoint::<B>(state, &result.grad_x0, memory, reborrow(&mut along))?;
            let gradient = &memory.adjoint;
            result.grad_x0.as_mut_slice().copy_from_slice(gradient.grad_x0.as_slice());
            axpy(T::ONE, gradient.grad_u.as_slice(), result.grad_u.as_mut_slice());
            axpy(T::ONE, gradient.grad_p.as_slice(), result.grad_p.as_mut_slice());
        }
        result.check()?;
        (self.linearised_events, self.requested_span) = (moments, Some(span));
        Ok(result)
    }

    /// Collects the solution at the end from the last segment.
    fn collect_solution(&mut self) {
        let result = &self.integrator.workspace.result;
        let Solution { nominal, terminal, occurrences, .. } = &mut self.solution;
        (nominal.x, nominal.z) = (result.x, result.z);
        if let (true, Some(last)) = (*terminal, occurrences.last()) {
            nominal.x = last.before;
        }
    }
}
