//! The steps of an interval.

mod checked;
mod tolerances;

use super::consistent::{At, Consistent};
use super::control::{IMPLICIT, Predictive};
use super::defect_filter::LENIENT;
use super::levels::{Levels, interpolate};
use super::options::AdaptiveOptions;
use super::sealed::Family;
use super::stages::{Convergence, FAST, Failure, Start};
use super::statistics::AdaptiveStatistics;
use super::tape::Tape;
use super::variational::{Tolerances, Variational};
use crate::error::{Error, Place, Quantity, Refusal};
use crate::irk::not_finite;
use crate::model::{ArrayK, ArrayV, ArrayW, Dae, VectorP, VectorU, VectorX};
use crate::result::{Dense, Nominal};
use crate::scalar::{Real, Scalar};
use crate::shape::{Matrix, Plain, Shape};
use bytemuck::Zeroable;

/// The number of stages grows where Newton's method converges at this rate or faster,
const EASY: f64 = 0.01;
/// and falls where it converges at this rate or slower,
const HARD: f64 = 0.8;
/// but grows only if the step size hardly changes,
const STEADY: (f64, f64) = (0.8, 1.2);
/// and not before so many steps have been taken with it.
const SETTLED: usize = 5;
/// A step is not made longer by less than this: the factors of its matrix are worth more.
const WORTHWHILE: f64 = 1.2;
/// A run still looks for its step size while each step is longer than the last by this factor.
const LONGER: f64 = 2.0;
/// After so many singular matrices in a row the problem is.
const SINGULAR: usize = 5;

/// After so many iterations in a row that did not converge the planned elimination may be to blame.
const TROUBLES: usize = 3;
/// Refusals by so many tolerances count twice and accepted steps take one away: where so much is
/// left, as after refusals of two steps one after the other, the solution is not smooth.
const MUCH: f64 = 8.0;
const NOT_SMOOTH: usize = 3;

/// Memory of a run.
#[derive(Zeroable)]
#[zeroable(bound = "T: Zeroable")]
pub struct Base<M: Dae, T: Plain> {
    /// The variables at the time that was reached.
    pub point: ArrayV<M, T>,
    /// Those where the Jacobian is to be evaluated.
    middle: ArrayV<M, T>,
    pub jacobian: M::Jacobian<T>,
    pub f: ArrayK<M, T>,
    /// `(ẋ, z)` at the start.
    pub start: ArrayK<M, T>,
    /// Start values for them, as they were given.
    pub given: ArrayK<M, T>,
    /// Tolerances of `(x, z)` as they were asked for,
    pub rtol: ArrayK<M, T>,
    pub atol: ArrayK<M, T>,
    /// as the method needs them,
    tight: ArrayK<M, (T, T)>,
    /// the reciprocals of the errors that they tolerate,
    pub(super) scale: ArrayK<M, T>,
    /// and how many times as large those of the tolerances are that were asked for.
    asked: ArrayK<M, T>,
    /// The largest of these.
    finer: f64,
    pub result: Nominal<M, T>,
    pub dense: Dense<M, T>,
    pub parameters: VectorP<M, T>,
    /// Magnitudes of `(x₀, u, p)` by which derivatives are measured; zero if they are not given.
    pub magnitudes: ArrayW<M, T>,
    pub u: VectorU<M, T>,
    /// Whether the constant entries of the Jacobian are there.
    pub(super) ready: bool,
    /// Where Newton's method may stop.
    newton_tolerance: f64,
}

/// What has to be done before a step can be tried.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Need {
    Nothing,
    Factors,
    Jacobian,
}

/// An interval.
#[derive(Clone, Copy)]
pub struct Span<T> {
    pub start: T,
    pub end: T,
}

/// What a run works with.
pub struct Run<'a, M: Dae, T: Real> {
    pub options: &'a AdaptiveOptions,
    pub base: &'a mut Base<M, T>,
    pub consistent: &'a mut Consistent<M, T>,
    pub tape: &'a mut Tape<T>,
    /// Whether steps are to be remembered.
    pub record: bool,
    /// Derivatives, if they take part.
    pub sensitivities: Option<&'a mut Variational<M, T>>,
    pub statistics: &'a mut AdaptiveStatistics,
}

/// What is called after each accepted step, with memory for dense output.
pub type After<'a, M, T> = &'a mut dyn FnMut(&mut Accepted<'_, M, T>, &mut Dense<M, T>) -> Result<(), Error>;

/// Dense output.
type Evaluate<'a, M, T> = &'a mut dyn FnMut(T, &mut Dense<M, T>) -> Result<(), Error>;

/// An accepted step.
pub struct Accepted<'a, M: Dae, T: Real> {
    /// The solution at a time inside it.
    pub evaluate: Evaluate<'a, M, T>,
    /// The time at its end.
    pub end: T,
    /// Set if the interval is to end with it.
    pub stop: bool,
}

impl<M: Dae, T: Real> Run<'_, M, T> {
    /// Integrates the interval from `x0`; `after` is called after each accepted step.
    ///
    /// # Errors
    /// No consistent start, and whatever ends a run early.
    pub fn integrate<B: Family>(
        &mut self,
        levels: &mut Levels<M, T>,
        x0: &VectorX<M, T>,
        span: Span<T>,
        after: After<'_, M, T>,
    ) -> Result<(), Error> {
        let nx = M::Shape::NX;
        self.prepare(x0, span)?;
        self.begin_sensitivities(x0, span.start)?;
        let mut level = 0;
        self.tighten::<B>(B::STAGES);
        let mut stages = levels.get::<B>(level)?;
        let length = span.end - span.start;
        let direction = if length < T::ZERO { -1.0 } else { 1.0 };
        let longest = length.to_f64().abs().min(self.options.max_step);
        let mut t = span.start;
        let mut h = T::from_f64(direction * self.first_step(span, longest)?);
        if length == T::ZERO {
            self.finish();
            return Ok(());
        }
        let mut last = false;
        if ((t + h * T::from_f64(1.0001) - span.end) * T::from_f64(direction)).to_f64() >= 0.0 {
            (h, last) = (span.end - t, true);
        }
        let mut accepted_h: Option<T> = None;
        let mut starting = true;
        let mut need = Need::Jacobian;
        let (mut current, mut rejected) = (false, false);
        let (mut unexpected, mut much_shorter, mut same_matrix) = (false, false, false);
        let (mut rate, mut settled, mut singular, mut troubles) = (0.0f64, 0usize, 0, 0);
        let mut convergence = Convergence::default();
        let mut controller = Predictive::default();
        let mut refusal = Refusal::Error;
        let (mut tried, mut refused) = (0, 0usize);
        let mut pivoted = false;
        loop {
            let mut changed = false;
            if need >= Need::Factors {
                settled += 1;
                rate = convergence.rate.max(0.5 * rate).min(10.0);
                let ratio = accepted_h.map_or(1.0, |before| (h / before).to_f64());
                let mut next = level;
                let steady = ratio > STEADY.0 && ratio < STEADY.1;
                if convergence.iterations > 1 && rate <= EASY && steady && settled > SETTLED {
                    next = (level + 1).min(B::LEVELS - 1);
                }
                if rate >= HARD || unexpected || much_shorter {
                    next = level.saturating_sub(1);
                }
                (unexpected, much_shorter) = (false, false);
                if next != level {
                    levels.change::<B>(level, next)?;
                    (level, settled, changed) = (next, 1, true);
                    stages = levels.get::<B>(level)?;
                    self.tighten::<B>(stages.count());
                    controller.forget();
                }
            }
            match accepted_h {
                Some(before) => stages.continue_from_last((h / before).to_f64()),
                None => stages.begin(&self.base.point),
            }
            if need == Need::Jacobian {
                let start = Start {
                    point: &self.base.point,
                    scale: &self.base.scale,
                    asked: &self.base.asked,
                    finer: self.base.finer,
                    known: accepted_h.is_some(),
                    h,
                };
                // In the middle of the step, as far as that is foreseen: nearer to all stages than
                // the start is. Where the step fails, at the start.
                current = accepted_h.is_none() || rejected;
                if !current {
                    stages.predict(&start, &mut self.base.middle);
                    current = self.evaluate_jacobian(true, tried).is_err();
                }
                if current {
                    self.evaluate_jacobian(false, tried)?;
                }
            }
            if need >= Need::Factors {
                stages.set_pivoted(pivoted);
                self.statistics.factorizations += 1;
                match stages.factor(&self.base.jacobian, h) {
                    Ok(planned) => {
                        singular = 0;
                        self.statistics.dense += usize::from(!planned);
                    }
                    Err(unknown) => {
                        singular += 1;
                        if singular >= SINGULAR {
                            let at = Place { step: tried, stage: 0, iteration: 0 };
                            return Err(Error::Singular {
                                unknown: crate::irk::unknown_name::<M>(unknown),
                                at,
                            });
                        }
                        refusal = Refusal::Singular;
                        self.statistics.failed += 1;
                        h = h * T::from_f64(0.5);
                        (unexpected, rejected, last) = (true, true, false);
                        need = if current { Need::Factors } else { Need::Jacobian };
                        self.check_step(t, h, refusal)?;
                        continue;
                    }
                }
            } else if same_matrix {
                same_matrix = false;
                settled += 1;
                if settled >= SETTLED && level + 1 < B::LEVELS {
                    need = Need::Factors;
                    continue;
                }
            }
            if tried >= self.options.max_steps {
                return Err(Error::TooManySteps { t: t.to_f64(), steps: tried });
            }
            self.check_step(t, h, refusal)?;
            tried += 1;
            let start = Start {
                point: &self.base.point,
                scale: &self.base.scale,
                asked: &self.base.asked,
                finer: self.base.finer,
                known: accepted_h.is_some(),
                h,
            };
            let residuals = &mut self.statistics.residuals;
            let outcome = stages.solve(&start, self.base.newton_tolerance, &mut convergence, residuals);
            self.statistics.iterations += convergence.iterations;
            let again = accepted_h.is_none() || rejected;
            let outcome = outcome.and_then(|()| {
                stages
                    .error(&start, again, residuals)
                    .and_then(|error| if error.is_finite() { Ok(error) } else { Err(Failure::Diverges) })
            });
            let outcome = outcome.and_then(|error| match &mut self.sensitivities {
                Some(sensitivities) if error < 1.0 => {
                    let Base { point, u, parameters, tight, rtol, atol, .. } = &*self.base;
                    let mut x = VectorX::<M, T>::zeroed();
                    x.as_mut_slice().copy_from_slice(&point.as_ref()[nx..2 * nx]);
                    let at = At { x: &x, u, p: parameters, t };
                    sensitivities
                        .implicit(stages, at, level, &start, &Tolerances { tight, rtol, atol }, again)
                        .map(|other| error.max(other))
                }
                _ => Ok(error),
            });
            let error = match outcome {
                Ok(error) => error,
                Err(failure) => {
                    self.statistics.failed += 1;
                    let factor = match failure {
                        Failure::Slow(factor) => {
                            refusal = Refusal::NotConverged;
                            much_shorter = factor <= 0.5;
                            factor
                        }
                        Failure::Diverges => {
                            refusal = Refusal::NotConverged;
                            troubles += 1;
                            unexpected = true;
                            0.5
                        }
                        Failure::NotFinite => {
                            refusal = Refusal::NotFinite;
                            troubles += 1;
                            unexpected = true;
                            0.5
                        }
                    };
                    pivoted = troubles >= TROUBLES;
                    h = h * T::from_f64(factor);
                    (rejected, last) = (true, false);
                    need = if current { Need::Factors } else { Need::Jacobian };
                    continue;
                }
            };
            // Where steps are refused again and again the solution is not smooth: methods have no
            // higher order than their estimates there.
            let rough = if refused >= NOT_SMOOTH { self.base.finer / LENIENT } else { 1.0 };
            let error = error * rough.max(1.0);
            let order = stages.count() as f64 + 1.0;
            let most = 2.0 * convergence.most as f64;
            let effort = (1.0 + most) / (convergence.iterations as f64 + most);
            if changed {
                controller.forget();
            }
            let factor = controller.factor(h.to_f64(), error, 1.0 / order, effort, &IMPLICIT);
            if error >= 1.0 {
                self.statistics.rejected += 1;
                refusal = Refusal::Error;
                refused = if error < MUCH { refused } else { (refused + 2).min(2 * NOT_SMOOTH) };
                h = h * T::from_f64(if accepted_h.is_none() { 0.1 } else { factor });
                (rejected, last) = (true, false);
                need = if current { Need::Factors } else { Need::Jacobian };
                continue;
            }

            // The step is accepted.
            self.statistics.steps += 1;
            (troubles, pivoted, refused) = (0, false, refused.saturating_sub(1));
            stages.accept();
            if let Some(sensitivities) = &mut self.sensitivities {
                sensitivities.accept();
            }
            if self.record {
                let x = &self.base.point.as_ref()[nx..2 * nx];
                self.tape.push(t, h, level, x, stages.accepted())?;
            }
            let end = if last { span.end } else { t + h };
            let Base { point, dense, .. } = &mut *self.base;
            let x = &point.as_ref()[nx..2 * nx];
            let mut evaluate = |time: T, dense: &mut Dense<M, T>| {
                interpolate(stages, x, stages.accepted(), time - t, h, dense);
                Ok(())
            };
            let mut accepted = Accepted { evaluate: &mut evaluate, end, stop: false };
            after(&mut accepted, dense)?;
            if accepted.stop {
                return Ok(());
            }
            let on_stage = stages.end(h, &mut self.base.point);
            t = end;
            if let Some(time) = self.base.point.as_mut().last_mut() {
                *time = t;
            }
            if !on_stage {
                self.settle(t)?;
            }
            if starting {
                // How fast a short step converged says nothing of one that is much longer.
                convergence.factor = Convergence::UNKNOWN;
                starting = factor > LONGER;
            }
            accepted_h = Some(h);
            current = false;
            if last {
                self.finish();
                return Ok(());
            }
            self.measure();
            let mut next = (h.to_f64().abs() * factor).min(longest);
            if rejected {
                next = next.min(h.to_f64().abs());
            }
            rejected = false;
            let fast = convergence.rate <= FAST;
            let next_h = T::from_f64(direction * next);
            // What rounding leaves of the interval is no step.
            let slack = 16.0 * T::EPSILON.to_f64() * t.abs().max(span.end.abs()).to_f64();
            if ((t + next_h - span.end) * T::from_f64(direction)).to_f64() >= -slack {
                (h, last) = (span.end - t, true);
            } else {
                let ratio = next / h.to_f64().abs();
                if fast && (1.0..=WORTHWHILE).contains(&ratio) {
                    (need, same_matrix) = (Need::Nothing, true);
                    continue;
                }
                h = next_h;
            }
            need = if fast { Need::Factors } else { Need::Jacobian };
        }
    }
}
