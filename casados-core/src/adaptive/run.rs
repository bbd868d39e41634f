//! The steps of an interval.

mod checked;
mod cross;
mod step_state;
mod steps;
mod tolerances;

use super::consistent::Consistent;
use super::control::ORDER_REDUCTION_RATIO;
use super::options::AdaptiveOptions;
use super::orders::{Orders, interpolate};
use super::point::At;
use super::sealed::Family;
use super::stages::{FAST, Failure, Stages, StepContext};
use super::statistics::AdaptiveStatistics;
use super::tape::Tape;
use super::variational::{Tolerances, Variational};
use crate::error::{Error, Place, Quantity, Refusal};
use crate::finite::not_finite;
use crate::model::{ArrayK, ArrayV, ArrayW, Dae, VectorP, VectorU, VectorX};
use crate::result::{Dense, Nominal};
use crate::scalar::{Real, Scalar};
use crate::shape::{Matrix, Plain, Shape};
use bytemuck::Zeroable;
use step_state::{Need, StepState};

/// After so many singular matrices in a row the problem is.
const SINGULAR: usize = 5;

/// Memory of a run.
#[derive(Zeroable)]
#[zeroable(bound = "T: Zeroable")]
pub struct Workspace<M: Dae, T: Plain> {
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
    estimator: ArrayK<M, (T, T)>,
    /// the reciprocals of the errors that they tolerate,
    pub(super) scale: ArrayK<M, T>,
    /// and how many times as large those of the tolerances are that were asked for.
    user_ratio: ArrayK<M, T>,
    /// The largest of these.
    tolerance_ratio: f64,
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
    /// Estimated errors that are smaller are of rounding.
    noise: f64,
}

impl<M: Dae, T: Real> Workspace<M, T> {
    /// The step that is tried, from where the run is.
    fn step(&self, state: &StepState<T>) -> StepContext<'_, M, T> {
        let Self { point, scale, user_ratio, tolerance_ratio, .. } = self;
        StepContext {
            point,
            scale,
            user_ratio,
            tolerance_ratio: *tolerance_ratio,
            known: state.accepted.is_some(),
            h: state.h,
        }
    }
}

/// An interval.
#[derive(Clone, Copy)]
pub struct Span<T> {
    pub start: T,
    pub end: T,
}

impl<T: Real> Span<T> {
    /// # Errors
    /// [`Error::OutsideInterval`] if another interval is asked for than this one.
    pub fn check_is(&self, start: T, end: T) -> Result<(), Error> {
        let other = if start == self.start { end } else { start };
        if start == self.start && end == self.end {
            return Ok(());
        }
        let [t, start, end] = [other, self.start, self.end].map(Real::to_f64);
        Err(Error::OutsideInterval { t, start, end })
    }
}

/// What a run works with.
pub struct Run<'a, M: Dae, T: Real> {
    pub options: &'a AdaptiveOptions,
    pub base: &'a mut Workspace<M, T>,
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
        levels: &mut Orders<M, T>,
        x0: &VectorX<M, T>,
        span: Span<T>,
        after: After<'_, M, T>,
    ) -> Result<(), Error> {
        self.prepare(x0, span)?;
        self.begin_sensitivities(x0, span.start)?;
        let stages = levels.get::<B>(0)?.count();
        self.tighten::<B>(stages);
        let mut state = StepState::new(span, self.options.max_step);
        let first = self.first_step(span, state.longest)?;
        if span.end == span.start {
            self.finish();
            return Ok(());
        }
        state.begin(first);
        loop {
            self.choose_stages::<B>(levels, &mut state)?;
            let stages = levels.get::<B>(state.order.level)?;
            if !self.factor::<B>(stages, &mut state)? {
                continue;
            }
            if state.tried >= self.options.max_steps {
                return Err(Error::TooManySteps { t: state.t.to_f64(), steps: state.tried, stiff: false });
            }
            self.check_step(state.t, state.h, state.refusal)?;
            state.tried += 1;
            let attempt = self.attempt(stages, &mut state);
            if self.blames_pivots(stages, &mut state, &attempt) {
                continue;
            }
            match attempt {
                Err(failure) => {
                    match failure {
                        Failure::Rough(_) => self.statistics.rejected += 1,
                        _ => self.statistics.failed += 1,
                    }
                    state.fail(failure);
                    self.cross(&mut state, span)?;
                    self.check_convergence(levels.get::<B>(state.order.level)?, &state, span)?;
                }
                Ok(error) => {
                    let factor = state.factor(error, stages.count());
                    if error >= 1.0 {
                        self.statistics.rejected += 1;
                        state.refuse(error, factor);
                    } else if self.accept(stages, &mut state, factor, &mut *after)? {
                        return Ok(());
                    }
                }
            }
        }
    }
}
