//! Step-size controllers: from the estimated error of a step to the size of the next one.
//!
//! E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, section IV.8; K. Gustafsson,
//! Control-theoretic techniques for stepsize selection in implicit Runge-Kutta methods, ACM Trans.
//! Math. Softw. 20 (1994).

use super::discontinuity::BranchChange;
use crate::scalar::{Real, Scalar};

/// Safety factor of the step size of implicit methods.
const SAFETY: f64 = 0.9;
/// Minimum ratio of successive step sizes.
const MAX_REDUCTION: f64 = 0.2;
/// Maximum ratio of successive step sizes.
const MAX_GROWTH: f64 = 8.0;

/// Gustafsson's predictive controller, with the data of the last accepted step.
#[derive(Clone, Copy, Debug, Default)]
pub struct GustafssonController {
    last_step_and_error: Option<(f64, f64)>,
}

impl GustafssonController {
    /// The factor for the step size after a step of size `h` whose error, relative to the
    /// tolerance, is `error`, proportional to `h^(1/exponent)`. `effort` is one, or less after many
    /// iterations.
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

    /// Forgets the last step, since the method changes.
    pub fn reset(&mut self) {
        self.last_step_and_error = None;
    }
}

/// Parameters of the step-size controller of an explicit method.
#[derive(Clone, Copy, Debug)]
pub struct PiParameters {
    /// The order of the local error, a power of `h`.
    pub order: f64,
    /// The coefficient `β` of the last error.
    pub beta: f64,
    /// The initial value of the last error.
    pub initial_error: f64,
    /// The safety factor of the step size.
    pub safety: f64,
    /// Whether Gustafsson's prediction also limits the step size, as for implicit methods.
    pub uses_prediction: bool,
    /// The range of ratios of successive step sizes.
    pub factor_range: (f64, f64),
}

/// Error, relative to the tolerance, of a strong rejection.
const STRONG_REJECTION: f64 = 8.0;

/// The PI controller of explicit methods, which includes the error of the last step (K. Gustafsson,
/// Control theoretic techniques for stepsize selection in explicit Runge-Kutta methods, ACM Trans.
/// Math. Softw. 17 (1991)).
#[derive(Clone, Copy, Debug)]
pub struct PiController {
    parameters: PiParameters,
    /// The size of the last accepted step, and its error.
    last_step_and_error: (f64, f64),
    /// The farthest end of strongly rejected steps: up to here a force or its derivative may jump.
    strong_rejection_end: f64,
}

/// A step of an explicit method.
#[derive(Clone, Copy, Debug)]
pub struct ExplicitStep {
    /// The start time, in the direction of the run.
    pub t: f64,
    /// The size of the step.
    pub h: f64,
    /// The change of branches over the step, if any.
    pub branch_change: Option<BranchChange>,
}

impl ExplicitStep {
    /// Whether the step is well above the roundoff errors of the time: shorter steps do not help.
    fn is_above_rounding<T: Real>(self) -> bool {
        self.h > 1e4 * T::EPSILON * self.t.abs()
    }
}

impl PiController {
    /// Factor of the error if a force or its derivative jumps between two stages, where the weights
    /// of the difference cancel.
    const DISCONTINUITY_ERROR_FACTOR: f64 = 8.0;
    /// Factor of the error if the model changes its branch: a run may have many such steps.
    const BRANCH_ERROR_FACTOR: f64 = 30.0;

    pub fn new(control: PiParameters) -> Self {
        Self {
            parameters: control,
            last_step_and_error: (f64::INFINITY, control.initial_error),
            strong_rejection_end: f64::NEG_INFINITY,
        }
    }

    /// The error of a step from the difference of the two methods, increased up to the end of a
    /// strongly rejected step and across branches: among ever shorter steps over a jump one has a
    /// small difference by chance.
    pub fn error_of_difference<T: Real>(&mut self, step: ExplicitStep, difference: f64) -> f64 {
        let is_over_jump = step.t < self.strong_rejection_end;
        if difference >= STRONG_REJECTION {
            self.strong_rejection_end = self.strong_rejection_end.max(step.t + step.h);
        }
        let count = match step.branch_change {
            _ if !step.is_above_rounding::<T>() => 1.0,
            Some(BranchChange::Switch) => Self::BRANCH_ERROR_FACTOR,
            _ if is_over_jump => Self::DISCONTINUITY_ERROR_FACTOR,
            _ => 1.0,
        };
        count * difference
    }

    /// The factor for the step size after a step with this error, within a range.
    pub fn step_size_factor(&mut self, step: ExplicitStep, error: f64) -> f64 {
        let PiParameters {
            order, beta: memory, safety, uses_prediction: predicts, factor_range: range, ..
        } = self.parameters;
        let exponent = 1.0 / order;
        let present = fractional_power(error, exponent - 0.75 * memory);
        if error > 1.0 {
            return (0.9 / present).clamp(range.0, range.1);
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

/// `aᵇ`, by roots for the exponents of methods with 3, 5 and 7 stages.
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

/// The size of the first step, at most the longest: an explicit Euler step changes the solution and
/// its derivative by a hundredth (E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary
/// Differential Equations I, section II.4). `change` is the change of the slope over such a step.
/// If the sizes overflow, with a tiny absolute tolerance, the step is short.
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
