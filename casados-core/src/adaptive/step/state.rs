//! Where a run is, and what its steps have told it.

use super::*;
use crate::adaptive::newton_monitor::Convergence;
use crate::adaptive::order::Order;
use crate::adaptive::step_size::GustafssonController;

/// A step is not made longer by less than this: the factors of its matrix are worth more.
const WORTHWHILE: f64 = 1.2;
/// A run still looks for its step size while each step is longer than the last by this factor.
const LONGER: f64 = 2.0;

/// What has to be done before a step can be tried.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
pub(super) enum Need {
    Nothing,
    Factors,
    Jacobian,
}

/// A run on its way.
pub(super) struct StepState<T> {
    span: Span<T>,
    direction: f64,
    /// The longest step.
    pub longest: f64,
    /// The time that was reached, and the length of the step that is tried from there.
    pub t: T,
    pub h: T,
    /// Whether this step ends the interval.
    pub last: bool,
    /// The length of the last accepted step.
    pub accepted: Option<T>,
    /// The longest step that was accepted, or the first one.
    pub longest_so_far: T,
    /// Whether the run still looks for its step size.
    pub starting: bool,
    pub need: Need,
    /// Whether the Jacobian is that of the start of the step.
    pub current: bool,
    /// Whether a step from here was tried in vain.
    rejected: bool,
    /// Whether the step is as long as the last one, so that the matrix is the same.
    same_matrix: bool,
    pub order: Order,
    pub convergence: Convergence,
    pub controller: GustafssonController,
    /// Why the last step was tried in vain.
    pub refusal: Refusal,
    /// How many steps were tried.
    pub tried: usize,
    /// How many matrices in a row were singular.
    pub singular: usize,
    /// Whether the matrices of this step are pivoted as a whole.
    pub pivoted: bool,
    /// Whether the planned elimination has lost its digits before.
    pub verifies_pivots: bool,
}

impl<T: Real> StepState<T> {
    pub fn new(span: Span<T>, max_step: f64) -> Self {
        let length = span.end - span.start;
        Self {
            span,
            direction: if length < T::ZERO { -1.0 } else { 1.0 },
            longest: length.to_f64().abs().min(max_step),
            t: span.start,
            h: length,
            last: false,
            accepted: None,
            longest_so_far: T::ZERO,
            starting: true,
            need: Need::Jacobian,
            current: false,
            rejected: false,
            same_matrix: false,
            order: Order::default(),
            convergence: Convergence::default(),
            controller: GustafssonController::default(),
            refusal: Refusal::Error,
            tried: 0,
            singular: 0,
            pivoted: false,
            verifies_pivots: false,
        }
    }

    /// With the first step of this length.
    pub fn begin(&mut self, first: f64) {
        self.h = T::from_f64(self.direction * first);
        if self.beyond(self.h * T::from_f64(1.0001)) >= 0.0 {
            (self.h, self.last) = (self.span.end - self.t, true);
        }
        self.longest_so_far = self.h.abs();
    }

    /// How far a step leads beyond the end of the interval.
    fn beyond(&self, h: T) -> f64 {
        ((self.t + h - self.span.end) * T::from_f64(self.direction)).to_f64()
    }

    /// Whether a second look is worth its work: at the first step, and after one that was tried in
    /// vain.
    pub fn is_careful(&self) -> bool {
        self.accepted.is_none() || self.rejected
    }

    /// Whether the stages of a step from here were not solved.
    pub fn is_unsolved(&self) -> bool {
        self.rejected && self.refusal == Refusal::NotConverged
    }

    /// The end of the step.
    pub fn end(&self) -> T {
        if self.last { self.span.end } else { self.t + self.h }
    }

    /// Counts a step with the matrix of the last one; whether the number of stages is worth a new
    /// matrix instead.
    pub fn keeps_matrix(&mut self, levels: usize) -> bool {
        if !core::mem::take(&mut self.same_matrix) {
            return false;
        }
        let grows = self.order.keeps(levels);
        if grows {
            self.need = Need::Factors;
        }
        grows
    }

    /// The step is tried again, with another length.
    pub fn again(&mut self, factor: f64) {
        self.h = self.h * T::from_f64(factor);
        (self.rejected, self.last) = (true, false);
        self.need = if self.current { Need::Factors } else { Need::Jacobian };
    }

    /// The stages were not solved, or are those of a solution that is not smooth.
    pub fn fail(&mut self, failure: Failure) {
        self.refusal = match failure {
            Failure::NotFinite => Refusal::NotFinite,
            Failure::Slow(_) | Failure::Diverges | Failure::Stale => Refusal::NotConverged,
            Failure::Rough(_) => Refusal::Error,
        };
        let factor = match failure {
            Failure::Stale => {
                self.need = Need::Jacobian;
                return;
            }
            Failure::Slow(factor) => {
                self.order.much_shorter = factor <= 0.5;
                factor
            }
            Failure::Rough(factor) => factor,
            Failure::Diverges | Failure::NotFinite => {
                self.order.unexpected = true;
                0.5
            }
        };
        self.again(factor);
    }

    /// The factor for the step size after a step with this error.
    pub fn factor(&mut self, error: f64, stages: usize) -> f64 {
        let order = stages as f64 + 1.0;
        let most = 2.0 * self.convergence.most as f64;
        let effort = (1.0 + most) / (self.convergence.iterations as f64 + most);
        self.controller.factor(self.h.to_f64(), error, 1.0 / order, effort)
    }

    /// Goes on from here as at the start of an interval, with the number of stages that is there.
    pub fn restart(&mut self, t: T, first: f64) {
        *self = Self { order: self.order, tried: self.tried, ..Self::new(self.span, self.longest) };
        self.t = t;
        self.begin(first);
    }

    /// The error is too large.
    pub fn refuse(&mut self, factor: f64) {
        self.refusal = Refusal::Error;
        self.again(if self.accepted.is_none() { 0.1 } else { factor });
    }

    /// Chooses the next step after one that was accepted, whose iteration may have been so fast
    /// that its Jacobian is kept.
    pub fn advance(&mut self, end: T, factor: f64, fast: bool) {
        let size = self.h.to_f64().abs();
        self.starting = self.starting && factor > LONGER;
        self.accepted = Some(self.h);
        self.longest_so_far = self.longest_so_far.max(self.h.abs());
        (self.t, self.current) = (end, false);
        self.convergence.fresh = false;
        let mut next = (size * factor).min(self.longest);
        if core::mem::take(&mut self.rejected) {
            next = next.min(size);
        }
        let next_h = T::from_f64(self.direction * next);
        // What rounding leaves of the interval is no step.
        let slack = 16.0 * T::EPSILON * end.abs().max(self.span.end.abs()).to_f64();
        self.need = if fast { Need::Factors } else { Need::Jacobian };
        if self.beyond(next_h) >= -slack {
            (self.h, self.last) = (self.span.end - end, true);
        } else if fast && (1.0..=WORTHWHILE).contains(&(next / size)) {
            (self.need, self.same_matrix) = (Need::Nothing, true);
        } else {
            self.h = next_h;
        }
    }
}
