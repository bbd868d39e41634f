//! The state of a run, and the selection of the next step.

use super::*;
use crate::adaptive::newton_monitor::NewtonMonitor;
use crate::adaptive::step_size::GustafssonController;

/// The step size and the matrix are kept if the step would grow by at most this factor.
const MAX_RATIO_WITH_SAME_MATRIX: f64 = 1.2;
/// The run is in its starting phase while each step is longer than the last by this factor.
const MIN_STARTING_GROWTH: f64 = 2.0;

/// The update of the matrix before the next attempt.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
pub(super) enum MatrixUpdate {
    Nothing,
    Factors,
    Jacobian,
}

/// The state of a run.
pub(super) struct StepState<T> {
    span: Span<T>,
    direction: f64,
    /// The maximum step size.
    pub max_step: f64,
    /// The current time, and the size of the step to be attempted.
    pub t: T,
    pub h: T,
    /// Whether this step ends the interval.
    pub is_last: bool,
    /// The size of the last accepted step.
    pub last_step_size: Option<T>,
    /// The size of the longest accepted step, or of the first one.
    pub longest_so_far: T,
    /// Whether the run is in its starting phase.
    pub is_starting: bool,
    pub matrix_update: MatrixUpdate,
    /// Whether the Jacobian is that of the start of the step.
    pub jacobian_is_current: bool,
    /// Whether a step from the current point was rejected.
    was_rejected: bool,
    pub order: OrderSelection,
    pub newton: NewtonMonitor,
    pub controller: GustafssonController,
    /// The cause of the last rejection.
    pub last_refusal: Refusal,
    /// The number of attempts.
    pub attempts: usize,
    /// The number of successive singular matrices.
    pub singular_matrices: usize,
    /// Whether the matrices of this step are factorised with pivoting.
    pub uses_pivoting: bool,
    /// Whether planned factors are tested before use, after one has failed.
    pub verifies_pivots: bool,
}

impl<T: Real> StepState<T> {
    pub fn new(span: Span<T>, max_step: f64, order: OrderSelection) -> Self {
        let length = span.end - span.start;
        Self {
            span,
            direction: if length < T::ZERO { -1.0 } else { 1.0 },
            max_step: length.to_f64().abs().min(max_step),
            t: span.start,
            h: length,
            is_last: false,
            last_step_size: None,
            longest_so_far: T::ZERO,
            is_starting: true,
            matrix_update: MatrixUpdate::Jacobian,
            jacobian_is_current: false,
            was_rejected: false,
            order,
            newton: NewtonMonitor::default(),
            controller: GustafssonController::default(),
            last_refusal: Refusal::Error,
            attempts: 0,
            singular_matrices: 0,
            uses_pivoting: false,
            verifies_pivots: false,
        }
    }

    /// Starts with a first step of this size.
    pub fn set_first_step(&mut self, first: f64) {
        self.h = T::from_f64(self.direction * first);
        if self.overshoot(self.h * T::from_f64(1.0001)) >= 0.0 {
            (self.h, self.is_last) = (self.span.end - self.t, true);
        }
        self.longest_so_far = self.h.abs();
    }

    /// The length by which a step exceeds the interval.
    fn overshoot(&self, h: T) -> f64 {
        ((self.t + h - self.span.end) * T::from_f64(self.direction)).to_f64()
    }

    /// Whether a second evaluation of a large estimate is worthwhile: in the first step, and after
    /// a rejection.
    pub fn needs_second_estimate(&self) -> bool {
        self.last_step_size.is_none() || self.was_rejected
    }

    /// Whether an iteration from the current point has failed.
    pub fn is_unsolved(&self) -> bool {
        self.was_rejected && self.last_refusal == Refusal::NotConverged
    }

    /// The end of the step.
    pub fn end_time(&self) -> T {
        if self.is_last { self.span.end } else { self.t + self.h }
    }

    /// Repeats the step with another size.
    pub fn retry(&mut self, factor: f64) {
        self.h = self.h * T::from_f64(factor);
        (self.was_rejected, self.is_last) = (true, false);
        self.matrix_update =
            if self.jacobian_is_current { MatrixUpdate::Factors } else { MatrixUpdate::Jacobian };
    }

    /// Rejects a step whose iteration failed, or that crosses a discontinuity.
    pub fn reject_failed_iteration(&mut self, failure: NewtonFailure) {
        self.last_refusal = match failure {
            NewtonFailure::NotFinite => Refusal::NotFinite,
            NewtonFailure::TooSlow(_) | NewtonFailure::Diverges | NewtonFailure::StaleJacobian => {
                Refusal::NotConverged
            }
            NewtonFailure::Discontinuity(_) => Refusal::Error,
        };
        let factor = match failure {
            NewtonFailure::StaleJacobian => {
                self.matrix_update = MatrixUpdate::Jacobian;
                return;
            }
            NewtonFailure::TooSlow(factor) => {
                self.order.step_was_halved = factor <= 0.5;
                factor
            }
            NewtonFailure::Discontinuity(factor) => factor,
            NewtonFailure::Diverges | NewtonFailure::NotFinite => {
                self.order.iteration_failed = true;
                0.5
            }
        };
        self.retry(factor);
    }

    /// The factor for the step size after a step with this error.
    pub fn step_size_factor(&mut self, error: f64, stages: usize) -> f64 {
        let order = stages as f64 + 1.0;
        let most = 2.0 * self.newton.max_iterations as f64;
        let effort = (1.0 + most) / (self.newton.iterations as f64 + most);
        self.controller.step_size_factor(self.h.to_f64(), error, 1.0 / order, effort)
    }

    /// Restarts from the current point with the present number of stages.
    pub fn restart(&mut self, t: T, first: f64) {
        *self = Self { attempts: self.attempts, ..Self::new(self.span, self.max_step, self.order) };
        self.t = t;
        self.set_first_step(first);
    }

    /// Rejects a step because of its error.
    pub fn reject_error(&mut self, factor: f64) {
        self.last_refusal = Refusal::Error;
        self.retry(if self.last_step_size.is_none() { 0.1 } else { factor });
    }

    /// Selects the next step after an accepted one; `fast`: the Jacobian is reused.
    pub fn advance(&mut self, end: T, factor: f64, fast: bool) {
        let size = self.h.to_f64().abs();
        self.is_starting = self.is_starting && factor > MIN_STARTING_GROWTH;
        self.last_step_size = Some(self.h);
        self.longest_so_far = self.longest_so_far.max(self.h.abs());
        (self.t, self.jacobian_is_current) = (end, false);
        self.newton.jacobian_is_current = false;
        let mut next = (size * factor).min(self.max_step);
        if core::mem::take(&mut self.was_rejected) {
            next = next.min(size);
        }
        let next_h = T::from_f64(self.direction * next);
        // A remainder of the interval below rounding is no step.
        let slack = 16.0 * T::EPSILON * end.abs().max(self.span.end.abs()).to_f64();
        self.matrix_update = if fast { MatrixUpdate::Factors } else { MatrixUpdate::Jacobian };
        if self.overshoot(next_h) >= -slack {
            (self.h, self.is_last) = (self.span.end - end, true);
        } else if fast
            && (1.0..=MAX_RATIO_WITH_SAME_MATRIX).contains(&(next / size))
            && !self.order.may_increase(&self.newton)
        {
            self.matrix_update = MatrixUpdate::Nothing;
        } else {
            self.h = next_h;
        }
    }
}
