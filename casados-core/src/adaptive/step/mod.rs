//! The loop over the steps of an interval.

mod attempt;
mod checks;
mod crossing;
mod start;
mod state;

use crate::adaptive::consistent::Consistent;
use crate::adaptive::newton_monitor::{NewtonFailure, THET};
use crate::adaptive::options::AdaptiveOptions;
use crate::adaptive::order::{MethodFamily, MethodsByOrder, OrderSelection, interpolate_step};
use crate::adaptive::point::ModelPoint;
use crate::adaptive::stages::{StageSolver, StepContext};
use crate::adaptive::statistics::AdaptiveStatistics;
use crate::adaptive::tape::Tape;
use crate::adaptive::tolerances::Tolerances;
use crate::adaptive::variational::Variational;
use crate::error::{Error, Place, Quantity, Refusal};
use crate::finite::find_non_finite;
use crate::model::{ArrayK, ArrayV, ArrayW, Dae, VectorP, VectorU, VectorX};
use crate::result::{Dense, Nominal};
use crate::scalar::{Real, Scalar};
use crate::shape::{Matrix, Plain, Shape};
use bytemuck::Zeroable;
use state::{MatrixUpdate, StepState};

/// Maximum number of successive singular matrices; more end the run.
const MAX_SINGULAR_MATRICES: usize = 5;

/// Memory of a run.
#[derive(Zeroable)]
#[zeroable(bound = "T: Zeroable")]
pub struct Workspace<M: Dae, T: Plain> {
    /// The variables at the current time.
    pub point: ArrayV<M, T>,
    /// The variables in the middle of the step, for the Jacobian.
    midpoint: ArrayV<M, T>,
    pub jacobian: M::Jacobian<T>,
    pub f: ArrayK<M, T>,
    /// `(ẋ, z)` at the start.
    pub start: ArrayK<M, T>,
    /// The user's initial guess of them.
    pub start_guess: ArrayK<M, T>,
    pub tolerances: Tolerances<M, T>,
    pub result: Nominal<M, T>,
    pub dense: Dense<M, T>,
    pub parameters: VectorP<M, T>,
    /// Magnitudes of `(x₀, u, p)` for errors of sensitivities; zero if not set.
    pub magnitudes: ArrayW<M, T>,
    pub u: VectorU<M, T>,
    /// Whether the constant entries of the Jacobian are written.
    pub(super) jacobian_constants_written: bool,
}

impl<M: Dae, T: Real> Workspace<M, T> {
    /// The step to be attempted from the current point.
    fn step_context(&self, state: &StepState<T>) -> StepContext<'_, M, T> {
        let Self { point, tolerances, .. } = self;
        StepContext {
            start_point: point,
            estimator_scale: &tolerances.scale,
            user_ratio: &tolerances.user_ratio,
            tolerance_ratio: tolerances.tolerance_ratio,
            derivatives_are_known: state.last_step_size.is_some(),
            h: state.h,
        }
    }
}

/// The interval of a run.
#[derive(Clone, Copy)]
pub struct Span<T> {
    pub start: T,
    pub end: T,
}

impl<T: Real> Span<T> {
    /// # Errors
    /// [`Error::OutsideInterval`] if the interval differs from this one.
    pub fn check_same(&self, start: T, end: T) -> Result<(), Error> {
        let other = if start == self.start { end } else { start };
        if start == self.start && end == self.end {
            return Ok(());
        }
        let [t, start, end] = [other, self.start, self.end].map(Real::to_f64);
        Err(Error::OutsideInterval { t, start, end })
    }
}

/// The parts of a run.
pub struct Run<'a, M: Dae, T: Real> {
    pub options: &'a AdaptiveOptions,
    pub workspace: &'a mut Workspace<M, T>,
    pub consistent: &'a mut Consistent<M, T>,
    pub tape: &'a mut Tape<T>,
    /// Whether accepted steps are recorded.
    pub record_steps: bool,
    /// The controlled sensitivities.
    pub sensitivities: Option<&'a mut Variational<M, T>>,
    pub statistics: &'a mut AdaptiveStatistics,
}

/// A function that is called after each accepted step, with memory for dense output.
pub type AfterStep<'a, M, T> =
    &'a mut dyn FnMut(&mut AcceptedStepOutput<'_, M, T>, &mut Dense<M, T>) -> Result<(), Error>;

/// Dense output.
type EvaluateDense<'a, M, T> = &'a mut dyn FnMut(T, &mut Dense<M, T>) -> Result<(), Error>;

/// An accepted step, as passed to the function after it.
pub struct AcceptedStepOutput<'a, M: Dae, T: Real> {
    /// Evaluates the solution at a time within the step.
    pub evaluate_dense: EvaluateDense<'a, M, T>,
    /// The time at its end.
    pub end: T,
    /// Set by the function to end the run with this step.
    pub stop: bool,
}

impl<M: Dae, T: Real> Run<'_, M, T> {
    /// Sets the sensitivities to the identity, if they are controlled.
    ///
    /// # Errors
    /// As [`Consistent::forward`].
    pub(super) fn begin_sensitivities(&mut self, x0: &VectorX<M, T>, t: T) -> Result<(), Error> {
        let Some(sensitivities) = &mut self.sensitivities else { return Ok(()) };
        let Workspace { u, parameters, start, magnitudes, .. } = &*self.workspace;
        sensitivities.begin_run(
            &ModelPoint { x: x0, u, p: parameters, t },
            start,
            magnitudes,
            self.consistent,
        )
    }

    /// Sets the tolerances of a method with this number of stages.
    fn set_estimator_tolerances<B: MethodFamily>(&mut self, stages: usize) {
        self.workspace.tolerances.set_estimator_tolerances(stages, B::ENDS_ON_STAGE);
        self.update_scales();
    }

    /// Updates the scales at the current point.
    fn update_scales(&mut self) {
        let Workspace { tolerances, point, .. } = &mut *self.workspace;
        tolerances.update_scales(&point.as_ref()[M::Shape::NX..]);
    }

    /// Integrates the interval from `x0`; `after` is called after each accepted step.
    ///
    /// # Errors
    /// No consistent start; the errors that end a run.
    pub fn integrate<B: MethodFamily>(
        &mut self,
        levels: &mut MethodsByOrder<M, T>,
        x0: &VectorX<M, T>,
        span: Span<T>,
        after: AfterStep<'_, M, T>,
    ) -> Result<(), Error> {
        self.prepare_run(x0, span)?;
        self.begin_sensitivities(x0, span.start)?;
        let stages = levels.get::<B>(0)?.stage_count();
        self.set_estimator_tolerances::<B>(stages);
        let mut state = StepState::new(span, self.options.max_step, OrderSelection::lowest(B::ORDER_COUNT));
        let first = self.initial_step_size(span, state.max_step)?;
        if span.end == span.start {
            self.write_result();
            return Ok(());
        }
        state.set_first_step(first);
        loop {
            self.choose_order::<B>(levels, &mut state)?;
            let stages = levels.get::<B>(state.order.order_index)?;
            if !self.prepare_factors(stages, &mut state)? {
                continue;
            }
            if state.attempts >= self.options.max_steps {
                return Err(Error::TooManySteps {
                    t: state.t.to_f64(),
                    steps: state.attempts,
                    stiff: false,
                    rounding: None,
                });
            }
            self.check_step_size(state.t, state.h, state.last_refusal)?;
            state.attempts += 1;
            let attempt = self.attempt_step(stages, &mut state);
            if self.retry_with_pivoting(stages, &mut state, &attempt) {
                continue;
            }
            match attempt {
                Err(failure) => {
                    match failure {
                        NewtonFailure::Discontinuity(_) => self.statistics.rejected += 1,
                        _ => self.statistics.failed += 1,
                    }
                    state.reject_failed_iteration(failure);
                    self.cross_switching_surface(&mut state, span)?;
                    self.check_convergence(levels.get::<B>(state.order.order_index)?, &state, span)?;
                }
                Ok(error) => {
                    let factor = state.step_size_factor(error, stages.stage_count());
                    if error >= 1.0 {
                        self.statistics.rejected += 1;
                        state.reject_error(factor);
                    } else if self.accept_step(stages, &mut state, factor, &mut *after)? {
                        return Ok(());
                    }
                }
            }
        }
    }
}
