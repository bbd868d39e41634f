//! Integration with events: zero crossings of functions, located by dense output and then to
//! rounding, where the integration ends or the state jumps, with the jump of the sensitivities.
//!
//! At the time `t*(w)` of an event, with `f⁻` and `f⁺` the derivatives of the state on both sides:
//!
//! ```text
//! dt*/dw = −(g_x V⁻ + g_w)/ġ        ġ = g_x f⁻ + g_t        dx(t*)/dw = V⁻ + f⁻ dt*/dw
//! V⁺ = j_x (V⁻ + f⁻ dt*/dw) + j_w + (j_t − f⁺) dt*/dw
//! λ⁻ = j_xᵀ λ⁺ − (σ/ġ) g_x        λ_w += j_wᵀ λ⁺ − (σ/ġ) g_w        σ = λ⁺ᵀ (j_x f⁻ + j_t − f⁺)
//! ```
//!
//! `second` differentiates them once more, `frozen` keeps steps and events. Between events
//! derivatives are those of the steps that were taken. At events they are those of the solution: a
//! step's derivative by its length is `ẋ`, but for the error of the step.

mod event;
mod frozen;
mod second;
mod trace;

pub use event::{Crossing, Event};
pub use second::HybridHessian;

use super::integrator::Integrator;
use super::run::Span;
use super::sealed::Engine;
use super::segment::{Segment, dense, refill};
use super::sensitivities::{chain, dynamic, fill};
use super::statistics::AdaptiveStatistics;
use crate::error::{Argument, Error, Place};
use crate::irk::{check, not_finite};
use crate::linalg::axpy;
use crate::model::{
    ArrayK, ArrayV, ArrayW, ArrayX, Dae, MatrixXP, MatrixXU, MatrixXX, VectorP, VectorU, VectorX,
};
use crate::quadrature::{Along, Integrand, begin, finish, reborrow};
use crate::result::{Dense, Nominal};
use crate::scalar::Real;
use crate::shape::{Array, Matrix, Shape, listed, plain};
use alloc::boxed::Box;
use alloc::vec::Vec;
use bytemuck::Zeroable;
use bytemuck::allocation::try_zeroed_box;

/// An adaptive integrator with events.
///
/// ```text
/// let bounce = Event::jump::<Height, Bounce>(Crossing::Falling);
/// let mut ball = Hybrid::new(Adaptive::<Ball, Radau>::new(options)?, &[bounce])?;
/// let end = ball.forward(&x0, &u, 3.0)?;      // end.x, end.dx_dx0, end.occurrences[0].t
/// ```
///
/// All calls take the length `h` of the interval, as those of the integrator. Times of events are
/// times as the model sees them, and so is that of [`dense`](Self::dense).
///
/// Later calls of a kind do not allocate, but for the lists that results of derivatives own.
///
/// # Errors
/// Of every call: those of [`Integrator`]; [`Error::InconsistentStart`] after a jump too;
/// [`Error::TooManyEvents`]; [`Error::NonFiniteFunction`] of an event or a jump. Of calls with
/// derivatives [`Error::Grazing`]: the time of the event has no derivative.
pub struct Hybrid<M: Dae, B: Engine<M, T>, T: Real> {
    integrator: Integrator<M, B, T>,
    events: Box<[Event<M, T>]>,
    /// More events than these are an error.
    most: usize,
    segments: Vec<Segment<M, T>>,
    /// How many of them belong to the last successful call.
    count: usize,
    /// The interval that the last call was asked for, if it succeeded, and that of steps and events
    /// that are kept.
    asked: Option<Span<T>>,
    frozen: Option<Span<T>>,
    statistics: AdaptiveStatistics,
    solution: Solution<M, T>,
    /// Where a function is evaluated.
    v: Box<ArrayV<M, T>>,
    /// On which side of zero each function was.
    signs: Vec<f64>,
    /// What is known about the moments of the events of a call.
    moments: Moments<M, T>,
    /// Derivatives over the parts up to now, and memory for the next ones.
    sensitivities: Option<[Box<Rows<M, T>>; 2]>,
    /// Memory of second derivatives.
    second: Option<Box<second::Second<M, T>>>,
}

/// A row for each state, with a column for each direction.
type Rows<M, T> = ArrayX<M, ArrayW<M, T>>;
/// The events of a call that happened, in order.
type Moments<M, T> = Vec<(Event<M, T>, Moment<M, T>)>;

/// An event that happened.
pub struct Occurrence<M: Dae, T: Real = f64> {
    /// Which.
    pub event: usize,
    /// The time at which it happened: that of the model, not since the start of the interval.
    pub t: T,
    /// The state before it.
    pub before: VectorX<M, T>,
    /// The state after it.
    pub after: VectorX<M, T>,
}

/// The solution at the end, and what happened before.
pub struct Solution<M: Dae, T: Real = f64> {
    /// `x` and `z` at the end, `z0` at the start.
    pub nominal: Nominal<M, T>,
    /// The time at the end: that of the interval, or the time of the event that ended the
    /// integration.
    pub t: T,
    /// Whether an event ended it: the last of the occurrences.
    pub terminal: bool,
    /// The events, one after the other.
    pub occurrences: Vec<Occurrence<M, T>>,
}

/// The solution at the end and its derivatives; if an event ended the integration, with the change
/// of its time.
pub struct HybridForward<M: Dae, T: Real = f64> {
    /// The solution.
    pub solution: Solution<M, T>,
    /// `∂x/∂x₀`
    pub dx_dx0: MatrixXX<M, T>,
    /// `∂x/∂u`
    pub dx_du: MatrixXU<M, T>,
    /// `∂x/∂p`
    pub dx_dp: MatrixXP<M, T>,
    /// Of the time of each event: its derivatives with respect to `x₀`, `u` and `p`.
    pub times: Vec<TimeGradient<M, T>>,
}

/// The derivatives of the time of an event.
pub struct TimeGradient<M: Dae, T: Real = f64> {
    /// `∂t/∂x₀`
    pub x0: VectorX<M, T>,
    /// `∂t/∂u`
    pub u: VectorU<M, T>,
    /// `∂t/∂p`
    pub p: VectorP<M, T>,
}

/// The solution at the end and the gradient of `λᵀx`.
pub struct HybridAdjoint<M: Dae, T: Real = f64> {
    /// The solution.
    pub solution: Solution<M, T>,
    /// `∇(λᵀx)` with respect to `x₀`
    pub grad_x0: VectorX<M, T>,
    /// `∇(λᵀx)` with respect to `u`
    pub grad_u: VectorU<M, T>,
    /// `∇(λᵀx)` with respect to `p`
    pub grad_p: VectorP<M, T>,
}

plain!([M: Dae, T: Real] Occurrence<M, T> { event, t, before, after });
plain!([M: Dae, T: Real] TimeGradient<M, T> { x0, u, p });
listed!([M: Dae, T: Real] Solution<M, T> { nominal, t, terminal, occurrences });
listed!([M: Dae, T: Real] HybridForward<M, T> { solution, dx_dx0, dx_du, dx_dp, times });
listed!([M: Dae, T: Real] HybridAdjoint<M, T> { solution, grad_x0, grad_u, grad_p });

/// What is known about the moment of an event.
struct Moment<M: Dae, T: Real> {
    /// `g_v`, and `ġ`.
    guard: ArrayV<M, T>,
    rate: T,
    /// `(ẋ, z)` on both sides.
    before: ArrayK<M, T>,
    after: ArrayK<M, T>,
}

impl<M: Dae, B: Engine<M, T>, T: Real> Hybrid<M, B, T> {
    /// Of an integrator, which keeps its options, tolerances, parameters and start time; at most a
    /// thousand events may happen in a call.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub fn new(integrator: Integrator<M, B, T>, events: &[Event<M, T>]) -> Result<Self, Error> {
        let bytes = size_of::<ArrayV<M, T>>();
        let solution =
            Solution { nominal: Nominal::zeroed(), t: T::ZERO, terminal: false, occurrences: Vec::new() };
        Ok(Self {
            integrator,
            events: events.into(),
            most: 1000,
            segments: Vec::new(),
            count: 0,
            asked: None,
            frozen: None,
            statistics: AdaptiveStatistics::default(),
            solution,
            v: try_zeroed_box().map_err(|()| Error::OutOfMemory { bytes })?,
            signs: Vec::new(),
            moments: Vec::new(),
            sensitivities: None,
            second: None,
        })
    }

    /// The integrator, to set its parameters or its start time.
    pub fn integrator(&mut self) -> &mut Integrator<M, B, T> {
        &mut self.integrator
    }

    /// More events in one call are the error `TooManyEvents`.
    pub fn set_most_events(&mut self, most: usize) {
        self.most = most;
    }

    /// What the last call did between all events.
    #[must_use]
    pub fn statistics(&self) -> &AdaptiveStatistics {
        &self.statistics
    }

    /// The solution at the end, and the events.
    ///
    /// # Errors
    /// See [`Hybrid`].
    pub fn solve(&mut self, x0: &VectorX<M, T>, u: &VectorU<M, T>, h: T) -> Result<&Solution<M, T>, Error> {
        self.asked = Some(self.trace(x0, u, h)?);
        Ok(&self.solution)
    }

    /// The solution at the time `t`, as the model sees it, inside the interval of the last call;
    /// where it jumps, that before.
    ///
    /// # Errors
    /// [`Error::NoResult`], also if that call failed; [`Error::OutsideInterval`],
    /// [`Error::NonFiniteInput`].
    pub fn dense(&mut self, t: T) -> Result<&Dense<M, T>, Error> {
        let Self { integrator, segments, count, solution, asked, .. } = self;
        asked.ok_or(Error::NoResult)?;
        dense(integrator, segments.get_mut(..*count).unwrap_or_default(), &solution.nominal, t)
    }

    /// The solution at the end, and its derivatives and those of the times of the events.
    ///
    /// # Errors
    /// See [`Hybrid`].
    pub fn forward(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
    ) -> Result<HybridForward<M, T>, Error> {
        self.forward_along(x0, u, h, None)
    }

    /// As [`Hybrid::forward`], with an integrand.
    pub(super) fn forward_along(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        along: Along<'_, '_, M, T>,
    ) -> Result<HybridForward<M, T>, Error> {
        let span = self.trace(x0, u, h)?;
        let (result, moments) = self.sweep(x0, false, along)?;
        (self.moments, self.asked) = (moments, Some(span));
        Ok(result)
    }

    /// Derivatives of all steps and over all events, and what is known about the moments of these;
    /// for `second` derivatives, what these need.
    #[allow(clippy::type_complexity)]
    fn sweep(
        &mut self,
        x0: &VectorX<M, T>,
        second: bool,
        mut along: Along<'_, '_, M, T>,
    ) -> Result<(HybridForward<M, T>, Moments<M, T>), Error> {
        begin(&mut along);
        let (nx, nu, nw) = (M::Shape::NX, M::Shape::NU, M::Shape::NW);
        let bytes = size_of::<ArrayX<M, ArrayW<M, T>>>();
        let zeroed = || try_zeroed_box().map_err(|()| Error::OutOfMemory { bytes });
        let [mut v, mut next] = match self.sensitivities.take() {
            Some(there) => there,
            None => [zeroed()?, zeroed()?],
        };
        for (x, row) in v.as_mut().as_mut().iter_mut().enumerate() {
            row.as_mut().fill(T::ZERO);
            row[x] = T::ONE;
        }
        let (mut times, mut moments) = (Vec::new(), core::mem::take(&mut self.moments));
        moments.clear();
        let mut x = *x0;
        for k in 0..self.count {
            let Self { integrator, segments, solution, .. } = self;
            let Some(segment) = segments.get_mut(k) else { break };
            segment.x = x;
            let mut history = core::mem::take(&mut segment.history);
            let mut own = core::mem::take(&mut segment.v);
            history.clear();
            let (mut frozen, state, memory, _) = segment.open(integrator)?;
            // Its derivatives by where a segment begins are multiplied by those of that.
            let mut part = chain(&mut along, Some(&*v), false);
            frozen.forward::<B>(state, &x, memory, second.then_some(&mut history), dynamic(&mut part))?;
            let local = &memory.hessian.first.forward;
            if k == 0 {
                solution.nominal.z0 = local.nominal.z0;
            }
            for (r, row) in next.as_mut().as_mut().iter_mut().enumerate() {
                let row = row.as_mut();
                row.fill(T::ZERO);
                for (c, v) in v.as_ref().as_ref().iter().enumerate() {
                    axpy(local.dx_dx0[(r, c)], v.as_ref(), row);
                }
                for (c, element) in row[nx..].iter_mut().enumerate() {
                    let part = if c < nu { local.dx_du[(r, c)] } else { local.dx_dp[(r, c - nu)] };
                    *element = *element + part;
                }
            }
            core::mem::swap(&mut v, &mut next);
            if second {
                // Over this segment alone.
                refill(&mut own, nx * nw, T::ZERO)?;
                for (index, element) in own.iter_mut().enumerate() {
                    let (r, w) = (index / nw, index % nw);
                    *element = if w < nx {
                        local.dx_dx0[(r, w)]
                    } else if w < nx + nu {
                        local.dx_du[(r, w - nx)]
                    } else {
                        local.dx_dp[(r, w - nx - nu)]
                    };
                }
            }
            (segment.history, segment.v) = (history, own);
            let Some((event, moment)) = self.moment(k)? else { break };
            let [v, next] = [&mut v, &mut next].map(|v| ArrayW::<M, T>::flat_mut(v.as_mut().as_mut()));
            let time = self.forward_jump(event, &moment, v, next)?;
            if let Some(integrand) = &mut along {
                self.beside(k, &event, &moment, &mut **integrand, |integrand, sign, at| {
                    integrand.prolong(sign, &time, at)
                })?;
            }
            let mut gradient =
                TimeGradient::<M, T> { x0: Zeroable::zeroed(), u: Zeroable::zeroed(), p: Zeroable::zeroed() };
            gradient.x0.as_mut_slice().copy_from_slice(&time.as_ref()[..nx]);
            gradient.u.as_mut_slice().copy_from_slice(&time.as_ref()[nx..nx + nu]);
            gradient.p.as_mut_slice().copy_from_slice(&time.as_ref()[nx + nu..]);
            times.try_reserve(1).map_err(|_| Error::OutOfMemory { bytes: size_of_val(&gradient) })?;
            times.push(gradient);
            let moment = (event, moment);
            moments.try_reserve(1).map_err(|_| Error::OutOfMemory { bytes: size_of_val(&moment) })?;
            moments.push(moment);
            x = self.solution.occurrences.get(k).map_or(x, |occurrence| occurrence.after);
        }
        self.collect();
        finish(&mut along)?;
        let [v, _] = self.sensitivities.insert([v, next]);
        let v = ArrayW::<M, T>::flat(v.as_ref().as_ref());
        if let Some((index, _)) = not_finite(v) {
            return Err(Error::Overflow { step: 0, index });
        }
        let mut result = HybridForward {
            solution: self.solution.clone(),
            dx_dx0: Zeroable::zeroed(),
            dx_du: Zeroable::zeroed(),
            dx_dp: Zeroable::zeroed(),
            times,
        };
        fill(&mut result.dx_dx0, |r, c| v[r * nw + c]);
        fill(&mut result.dx_du, |r, c| v[r * nw + nx + c]);
        fill(&mut result.dx_dp, |r, c| v[r * nw + nx + nu + c]);
        Ok((result, moments))
    }

    /// The solution at the end, and the gradient of `λᵀx`.
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
        self.adjoint_along(x0, u, h, lambda, None)
    }

    /// As [`Hybrid::solve`], with an integrand: the steps are taken again, to rounding.
    pub(super) fn solve_along(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        along: Along<'_, '_, M, T>,
    ) -> Result<&Solution<M, T>, Error> {
        let span = self.trace(x0, u, h)?;
        self.moments = self.replay(x0, along)?;
        self.asked = Some(span);
        Ok(&self.solution)
    }

    /// All steps again, to rounding, and what is known about the moments of the events.
    fn replay(&mut self, x0: &VectorX<M, T>, mut along: Along<'_, '_, M, T>) -> Result<Moments<M, T>, Error> {
        begin(&mut along);
        let mut moments = core::mem::take(&mut self.moments);
        moments.clear();
        let mut x = *x0;
        for k in 0..self.count {
            let Self { integrator, segments, solution, .. } = self;
            let Some(segment) = segments.get_mut(k) else { break };
            segment.x = x;
            let (mut frozen, state, ..) = segment.open(integrator)?;
            let mut part = chain(&mut along, None, false);
            frozen.solve::<B>(state, &x, dynamic(&mut part))?;
            if k == 0 {
                solution.nominal.z0 = integrator.base.result.z0;
            }
            let Some(moment) = self.moment(k)? else { break };
            moments.try_reserve(1).map_err(|_| Error::OutOfMemory { bytes: size_of_val(&moment) })?;
            moments.push(moment);
            x = self.solution.occurrences.get(k).map_or(x, |occurrence| occurrence.after);
        }
        self.collect();
        finish(&mut along)?;
        Ok(moments)
    }

    /// As [`Hybrid::adjoint`], with an integrand.
    pub(super) fn adjoint_along(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
        lambda: &VectorX<M, T>,
        mut along: Along<'_, '_, M, T>,
    ) -> Result<HybridAdjoint<M, T>, Error> {
        self.asked = None;
        check(Argument::Lambda, lambda.as_slice())?;
        let span = self.trace(x0, u, h)?;
        let moments = self.replay(x0, reborrow(&mut along))?;
        let mut result = HybridAdjoint {
            solution: self.solution.clone(),
            grad_x0: *lambda,
            grad_u: Zeroable::zeroed(),
            grad_p: Zeroable::zeroed(),
        };
        for k in (0..self.count).rev() {
            if let Some((event, moment)) = moments.get(k) {
                let mut density = T::ZERO;
                if let Some(integrand) = &mut along {
                    self.beside(k, event, moment, &mut **integrand, |integrand, sign, at| {
                        density = density + sign * integrand.density(at)?;
                        Ok(())
                    })?;
                }
                self.adjoint_jump(k, *event, moment, density, &mut result);
            }
            let Self { integrator, segments, .. } = self;
            let Some(segment) = segments.get_mut(k) else { break };
            let (mut frozen, state, memory, _) = segment.open(integrator)?;
            frozen.adjoint::<B>(state, &result.grad_x0, memory, reborrow(&mut along))?;
            let gradient = &memory.adjoint;
            result.grad_x0.as_mut_slice().copy_from_slice(gradient.grad_x0.as_slice());
            axpy(T::ONE, gradient.grad_u.as_slice(), result.grad_u.as_mut_slice());
            axpy(T::ONE, gradient.grad_p.as_slice(), result.grad_p.as_mut_slice());
        }
        (self.moments, self.asked) = (moments, Some(span));
        Ok(result)
    }

    /// The solution at the end, from the segment that was integrated last.
    fn collect(&mut self) {
        let result = &self.integrator.base.result;
        let Solution { nominal, terminal, occurrences, .. } = &mut self.solution;
        (nominal.x, nominal.z) = (result.x, result.z);
        if let (true, Some(last)) = (*terminal, occurrences.last()) {
            nominal.x = last.before;
        }
    }

    /// `V⁻` becomes `V⁺`, or the derivative of the last state; the derivative of the time.
    fn forward_jump(
        &mut self,
        event: Event<M, T>,
        moment: &Moment<M, T>,
        v: &mut [T],
        next: &mut [T],
    ) -> Result<ArrayW<M, T>, Error> {
        let (nx, nz, nw) = (M::Shape::NX, M::Shape::NZ, M::Shape::NW);
        let guard = moment.guard.as_ref();
        let factor = -(T::ONE / moment.rate);
        let mut time = ArrayW::<M, T>::zeroed();
        for (w, element) in time.as_mut().iter_mut().enumerate().skip(nx) {
            *element = factor * guard[nx + nz + w];
        }
        for (g, v) in guard[nx..].iter().zip(v.chunks_exact(nw.max(1))) {
            axpy(factor * *g, v, time.as_mut());
        }
        for (f, v) in moment.before.as_ref().iter().zip(v.chunks_exact_mut(nw.max(1))) {
            axpy(*f, time.as_ref(), v);
        }
        let Some(jump) = event.jump else { return Ok(time) };
        for (r, row) in next.chunks_exact_mut(nw.max(1)).enumerate() {
            let unit = ArrayX::<M, T>::from_fn(|x| if x == r { T::ONE } else { T::ZERO });
            let (gradient, rate) = jump.gradient(&self.v, unit.as_ref());
            row.fill(T::ZERO);
            row[nx..].copy_from_slice(&gradient.as_ref()[2 * nx + nz..2 * nx + nz + nw - nx]);
            for (j, v) in gradient.as_ref()[nx..2 * nx].iter().zip(v.chunks_exact(nw.max(1))) {
                axpy(*j, v, row);
            }
            axpy(rate - moment.after.as_ref()[r], time.as_ref(), row);
        }
        v.copy_from_slice(next);
        Ok(time)
    }

    /// Shows an integrand what is before an event, and with the sign of a lower limit what is after
    /// it.
    fn beside(
        &mut self,
        k: usize,
        event: &Event<M, T>,
        moment: &Moment<M, T>,
        integrand: &mut dyn Integrand<M, T>,
        mut each: impl FnMut(&mut dyn Integrand<M, T>, T, Place) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.go(k);
        let Some(occurrence) = self.solution.occurrences.get(k) else { return Ok(()) };
        let (nx, nk, at) = (M::Shape::NX, M::Shape::NK, Place { step: k, stage: 0, iteration: 0 });
        let sides =
            [(&occurrence.before, &moment.before, T::ONE), (&occurrence.after, &moment.after, -T::ONE)];
        for (x, y, sign) in sides.into_iter().take(if event.jump.is_some() { 2 } else { 1 }) {
            let (point, _) = integrand.point();
            point.copy_from_slice(self.v.as_ref().as_ref());
            point[nx..2 * nx].copy_from_slice(x.as_slice());
            point[2 * nx..nx + nk].copy_from_slice(&y.as_ref()[nx..]);
            each(integrand, sign, at)?;
        }
        Ok(())
    }

    /// `λ⁺` becomes `λ⁻`; `κ = −σ/ġ`. `density` is what an integrand gains where the event is
    /// later.
    fn adjoint_jump(
        &mut self,
        k: usize,
        event: Event<M, T>,
        moment: &Moment<M, T>,
        density: T,
        result: &mut HybridAdjoint<M, T>,
    ) -> T {
        let (nx, nz, nu) = (M::Shape::NX, M::Shape::NZ, M::Shape::NU);
        let dot = |a: &[T], b: &[T]| a.iter().zip(b).fold(T::ZERO, |sum, (a, b)| sum + *a * *b);
        let inputs = 2 * nx + nz;
        let sigma = match event.jump {
            None => dot(result.grad_x0.as_slice(), moment.before.as_ref()),
            Some(jump) => {
                self.go(k);
                let lambda = result.grad_x0;
                let (gradient, rate) = jump.gradient(&self.v, lambda.as_slice());
                let gradient = gradient.as_ref();
                result.grad_x0.as_mut_slice().copy_from_slice(&gradient[nx..2 * nx]);
                axpy(T::ONE, &gradient[inputs..inputs + nu], result.grad_u.as_mut_slice());
                axpy(T::ONE, &gradient[inputs + nu..], result.grad_p.as_mut_slice());
                dot(&gradient[nx..2 * nx], moment.before.as_ref()) + rate
                    - dot(lambda.as_slice(), moment.after.as_ref())
            }
        };
        let (factor, guard) = (-((sigma + density) / moment.rate), moment.guard.as_ref());
        axpy(factor, &guard[nx..2 * nx], result.grad_x0.as_mut_slice());
        axpy(factor, &guard[inputs..inputs + nu], result.grad_u.as_mut_slice());
        axpy(factor, &guard[inputs + nu..], result.grad_p.as_mut_slice());
        factor
    }
}
