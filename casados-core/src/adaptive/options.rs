//! What can be chosen about an adaptive integrator.

use crate::error::Error;
use crate::scalar::Real;

/// What can be chosen about an adaptive integrator.
///
/// A later version may have more fields: write `..Default::default()`.
///
/// # Errors
/// What makes no sense is [`Error::InvalidOption`] of the integrator that is made with it.
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
    /// Relative tolerance of the error of one step, between 10 ε of the number type and 1.
    /// Default 1e-6.
    pub rtol: f64,
    /// Absolute tolerance of the error of one step, finite and above zero in the number type.
    /// Default 1e-9.
    pub atol: f64,
    /// The length of the first step, finite and above zero; chosen if it is `None`, the
    /// default.
    pub initial_step: Option<f64>,
    /// No step is longer; above zero, infinite by default. After a long rest steps are long, and
    /// all points at which the model is evaluated may lie beside a short pulse: give its length.
    pub max_step: f64,
    /// A step that would have to be shorter is the error `StepSizeUnderflow`; between zero, the
    /// default, and `max_step`.
    pub min_step: f64,
    /// More steps than these, refused ones included, are the error `TooManySteps`; at least one.
    /// Default 100,000.
    pub max_steps: usize,
    /// Whether steps are remembered: dense output over the whole interval and sensitivities need
    /// them. Default true.
    pub keep_steps: bool,
}

impl Default for AdaptiveOptions {
    /// Six digits, nine for values below `1e-3`; all steps are remembered.
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

/// The smallest relative tolerance, in ε: below, rounding errors are taken for errors of the
/// method.
const MIN_RTOL_ROUNDOFFS: f64 = 10.0;

impl AdaptiveOptions {
    /// # Errors
    /// [`Error::InvalidOption`] for the first value that makes no sense with the number type.
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
