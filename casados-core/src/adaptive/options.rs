//! Options of an adaptive integrator.

use crate::error::Error;
use crate::scalar::Real;

/// Options of an adaptive integrator.
///
/// Later versions may add fields: write `..Default::default()`.
///
/// # Errors
/// Integrators return [`Error::InvalidOption`] for values out of range.
///
/// # Example
/// ```
/// use casados::prelude::*;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
///
/// let options = AdaptiveOptions { rtol: 1e-9, max_step: 0.1, ..Default::default() };
/// assert!(Adaptive::<Cart, Radau>::new(options).is_ok());
/// let coarse = AdaptiveOptions { rtol: 2.0, ..options };
/// assert!(Adaptive::<Cart, Radau>::new(coarse).is_err());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptiveOptions {
    /// Relative tolerance of the local error, between 10 ε of the number type and 1. Default 1e-6.
    pub rtol: f64,
    /// Absolute tolerance of the local error, finite and positive in the number type. Default 1e-9.
    pub atol: f64,
    /// The size of the first step, finite and positive; `None`, the default, selects it
    /// automatically.
    pub initial_step: Option<f64>,
    /// The maximum step size, positive; infinite by default. After a long rest steps are long, and
    /// may pass a short pulse without an evaluation in it: set the duration of the pulse.
    pub max_step: f64,
    /// The minimum step size; smaller steps are the error `StepSizeUnderflow`. Between zero, the
    /// default, and `max_step`.
    pub min_step: f64,
    /// The maximum number of steps, rejected ones included; more are the error `TooManySteps`. At
    /// least one, default 100,000.
    pub max_steps: usize,
    /// Whether accepted steps are recorded, for sensitivities and dense output over the whole
    /// interval. Default true.
    pub keep_steps: bool,
}

impl Default for AdaptiveOptions {
    /// Six digits, an absolute error of 1e-9 for values below `1e-3`; all steps are recorded.
    fn default() -> Self {
        Self {
            rtol: 1e-6,
            atol: 1e-9,
            initial_step: None,
            max_step: f64::INFINITY,
            min_step: 0.0,
            max_steps: 100_000,
            keep_steps: true,
        }
    }
}

/// Minimum relative tolerance, in ε: below it rounding errors exceed the errors of the method.
const MIN_RTOL_ROUNDOFFS: f64 = 10.0;

impl AdaptiveOptions {
    /// # Errors
    /// [`Error::InvalidOption`] for the first value out of range for the number type.
    pub fn check<T: Real>(&self) -> Result<(), Error> {
        let invalid = |option, value, reason| Err(Error::InvalidOption { option, value, reason });
        check_rtol::<T>(self.rtol)?;
        check_atol::<T>(self.atol)?;
        if let Some(step) = self.initial_step
            && !(step > 0.0 && step.is_finite())
        {
            return invalid("initial_step", step, "a step has a finite length above 0");
        }
        if self.max_step.is_nan() || self.max_step <= 0.0 {
            return invalid("max_step", self.max_step, "a step has a length above 0");
        }
        if !(self.min_step >= 0.0 && self.min_step <= self.max_step) {
            return invalid("min_step", self.min_step, "it is between 0 and `max_step`");
        }
        if self.max_steps == 0 {
            return invalid("max_steps", 0.0, "an interval has at least one step");
        }
        Ok(())
    }
}

/// # Errors
/// [`Error::InvalidOption`]
pub(super) fn check_rtol<T: Real>(rtol: f64) -> Result<(), Error> {
    if rtol >= MIN_RTOL_ROUNDOFFS * T::EPSILON && rtol <= 1.0 {
        return Ok(());
    }
    Err(Error::InvalidOption {
        option: "rtol",
        value: rtol,
        reason: "a relative tolerance is between 10 ε of the number type and 1",
    })
}

/// # Errors
/// [`Error::InvalidOption`]
pub(super) fn check_atol<T: Real>(atol: f64) -> Result<(), Error> {
    let number = T::from_f64(atol);
    if number > T::ZERO && number.is_finite() {
        return Ok(());
    }
    Err(Error::InvalidOption {
        option: "atol",
        value: atol,
        reason: "an absolute tolerance is finite and above 0 in the number type",
    })
}
