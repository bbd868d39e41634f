//! The step size: from the estimated error of a step to the length of the next one.
//!
//! E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, section IV.8; K. Gustafsson,
//! Control-theoretic techniques for stepsize selection in implicit Runge-Kutta methods, ACM Trans.
//! Math. Softw. 20 (1994).

use super::discontinuity::BranchChange;
use crate::scalar::{Real, Scalar};

/// A step of an implicit method is this much shorter than the one that would just be accepted,
const SAFETY: f64 = 0.9;
/// by no more than this shorter than the one before,
const MAX_REDUCTION: f64 = 0.2;
/// and by no more than this longer.
const MAX_GROWTH: f64 = 8.0;

/// What is remembered of the last accepted step.
#[derive(Clone, Copy, Debug, Default)]
pub struct GustafssonController {
    last_step_and_error: Option<(f64, f64)>,
}

impl GustafssonController {
    /// The factor for the step size after a step of size `h` with the estimated error `error`,
    /// relative to the tolerance, that behaves like `h^(1/exponent)`. `effort` is one, or less if
    /// the step took many iterations.
    pub fn step_size_factor(&mut self, h: f64, error: f64, exponent: f64, effort: f64) -> f64 {
        let safety = SAFETY * effort;
        let (least, most) = (1.0 / MAX_GROWTH, 1.0 / MAX_REDUCTION);
        let mut quotient = (fractional_power(error, exponent) / safety).clamp(least, most);
        if error < 1.0 {
            if let Some((step, before)) = self.last_step_and_error {
                let predicted = step / h * fractional_power(error * error / before, exponent) / SAFETY;
                quotient = quotient.max(predicted.clamp(least, most));
            }
            self.last_step_and_error = Some((h, error.max(1e-2)));
        }
        1.0 / quotient
    }

    /// Forgets the last step: the next one is of another method.
    pub fn reset(&mut self) {
        self.last_step_and_error = None;
    }
}

/// How the step size of an explicit method follows its error.
#[derive(Clone, Copy, Debug)]
pub struct PiParameters {
    /// The error of one step behaves like `h` to this power.
    pub order: f64,
    /// How much of the last error takes part,
    pub beta: f64,
    /// and what stands for it at first.
    pub initial_error: f64,
    /// A step is this much shorter than the one that would just be accepted.
    pub safety: f64,
    /// Whether a step is no longer than what the trend of the last two asks for, as with implicit
    /// methods.
    pub uses_prediction: bool,
    /// By how much a step size may shrink and grow.
    pub factor_range: (f64, f64),
}

/// An error that is refused by much.
const STRONG_REJECTION: f64 = 8.0;

/// The controller of explicit methods: what the error of the last step was takes part (K.
/// Gustafsson, Control theoretic techniques for stepsize selection in explicit Runge-Kutta methods,
/// ACM Trans. Math. Softw. 17 (1991)).
#[derive(Clone, Copy, Debug)]
pub struct PiController {
    parameters: PiParameters,
    /// The length of the last accepted step, and its error.
    last_step_and_error: (f64, f64),
    /// The farthest end of a step that was refused by much: up to here a force may jump, or its
    /// slope.
    strong_rejection_end: f64,
}

/// A step of an explicit method.
#[derive(Clone, Copy, Debug)]
pub struct ExplicitStep {
    /// Where it begins, in the direction of the run,
    pub t: f64,
    /// its length,
    pub h: f64,
    /// and how it changes the branches of the model, if it does.
    pub branch_change: Option<BranchChange>,
}

impl ExplicitStep {
    /// Whether it is long beside roundoff errors of the time, shortened by a factor: no shorter
    /// step helps.
    fn is_above_rounding<T: Real>(self, factor: f64) -> bool {
        factor * self.h > 1e4 * T::EPSILON * self.t.abs()
    }
}

impl PiController {
    /// Where a force jumps between two stages, or its slope, the error of a step is up to so many
    /// times the difference of the two methods, whose weights cancel there.
    const DISCONTINUITY_ERROR_FACTOR: f64 = 8.0;
    /// Where the model changes its branch it counts so often: there may be many such steps.
    const BRANCH_ERROR_FACTOR: f64 = 30.0;

    pub fn new(control: PiParameters) -> Self {
        Self {
            parameters: control,
            last_step_and_error: (f64::INFINITY, control.initial_error),
            strong_rejection_end: f64::NEG_INFINITY,
        }
    }

    /// The error of a step out of the difference of the two methods: larger before the end of a
    /// step that was refused by much, and where the model changes its branch. Of ever shorter steps
    /// over a jump one has a small difference by chance, and would be accepted.
    pub fn error_of_difference<T: Real>(&mut self, step: ExplicitStep, difference: f64) -> f64 {
        let is_over_jump = step.t < self.strong_rejection_end;
        if difference >= STRONG_REJECTION {
            self.strong_rejection_end = self.strong_rejection_end.max(step.t + step.h);
        }
        let count = match step.branch_change {
            _ if !step.is_above_rounding::<T>(1.0) => 1.0,
            Some(BranchChange::Switch) => Self::BRANCH_ERROR_FACTOR,
            None if !is_over_jump => 1.0,
            _ => Self::DISCONTINUITY_ERROR_FACTOR,
        };
        count * difference
    }

    /// The factor for the step size after a step with this error, within a range. Where the model
    /// changes its branch the error behaves like `h³` or a lower power.
    pub fn step_size_factor<T: Real>(&mut self, step: ExplicitStep, error: f64) -> f64 {
        let PiParameters {
            order, beta: memory, safety, uses_prediction: predicts, factor_range: range, ..
        } = self.parameters;
        let exponent = 1.0 / order;
        let present = fractional_power(error, exponent - 0.75 * memory);
        if error > 1.0 {
            let over_branch = (0.9 / Scalar::cbrt(error)).clamp(0.1, 0.9);
            let is_over_branch = step.branch_change == Some(BranchChange::Switch);
            return if is_over_branch && step.is_above_rounding::<T>(over_branch) {
                over_branch
            } else {
                (0.9 / present).clamp(range.0, range.1)
            };
        }
        let (length, before) = core::mem::replace(&mut self.last_step_and_error, (step.h, error.max(1e-4)));
        let past = if memory > 0.0 { fractional_power(before, memory) } else { 1.0 };
        let mut factor = safety * past / present;
        if predicts && length.is_finite() {
            factor =
                factor.min(0.9 * (step.h / length) * fractional_power(before / (error * error), exponent));
        }
        factor.clamp(range.0, range.1)
    }
}

/// `aᵇ`, by roots where these are enough: those of methods with 3, 5 and 7 stages.
pub(super) fn fractional_power(a: f64, b: f64) -> f64 {
    let root = Scalar::sqrt(a);
    if b == 0.25 {
        Scalar::sqrt(root)
    } else if b == 1.0 / 6.0 {
        Scalar::cbrt(root)
    } else if b == 0.125 {
        Scalar::sqrt(Scalar::sqrt(root))
    } else {
        Scalar::powf(a, b)
    }
}

/// The length of a first step, at most the longest: that in which an explicit Euler step changes
/// the solution, and its derivative, by a hundredth of their size (E. Hairer, S. P. Nørsett,
/// G. Wanner, Solving Ordinary Differential Equations I, section II.4). `change` is that of the
/// slope over such a step. Where sizes overflow beside a tiny absolute tolerance nothing is
/// foreseen: then a short one.
pub(super) fn first_step_size(
    [size, slope]: [f64; 2],
    longest: f64,
    exponent: f64,
    change: impl FnOnce(f64) -> f64,
) -> f64 {
    let step = if size < 1e-5 || slope < 1e-5 { 1e-6 } else { 0.01 * size / slope };
    let step = step.min(longest);
    let largest = slope.max(change(step) / step);
    let second =
        if largest <= 1e-15 { (step * 1e-3).max(1e-6) } else { fractional_power(0.01 / largest, exponent) };
    let step = (100.0 * step).min(second);
    if step > 0.0 { step.min(longest) } else { 1e-8 * longest }
}
