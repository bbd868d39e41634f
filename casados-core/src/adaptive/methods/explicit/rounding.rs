//! Rounding errors in the error estimate of an explicit pair.
//!
//! The Jacobian of the model amplifies the rounding errors of the stages. With the coefficients `e`
//! of the difference of both methods and random signs `s_i`, the rounding error of that difference
//! is about
//!
//! ```text
//! h ‖e‖₂ ‖f(x_i (1 + 2 ε s_i)) − f(x)‖
//! ```
//!
//! Rounding errors of different steps are independent: their sum over `n` steps is `√n` times a
//! single one. They therefore count once, and the rest of the estimate is multiplied by the global
//! error factor.

use crate::scalar::Scalar;

/// Attempted steps between two measurements of the rounding error.
const ATTEMPTS_PER_MEASUREMENT: usize = 20;
/// Attempts with an error estimate above this part of the tolerance limit the step size.
const LIMITING_ERROR: f64 = 0.1;

/// Statistics of the rounding errors of a run.
#[derive(Clone, Copy, Debug)]
pub struct RoundingErrors {
    /// The state of a shift register (random numbers).
    generator_state: u64,
    /// The mean square of the rounding errors of steps of length one, relative to the tolerance.
    mean_square: Option<f64>,
    attempts: usize,
    /// The number of attempts limited by rounding errors, minus the number of others.
    limited_minus_unlimited: i64,
}

impl Default for RoundingErrors {
    fn default() -> Self {
        Self {
            generator_state: 0x9E37_79B9_7F4A_7C15,
            mean_square: None,
            attempts: 0,
            limited_minus_unlimited: 0,
        }
    }
}

impl RoundingErrors {
    /// Whether a measurement is due before this attempt.
    pub fn is_measurement_due(&mut self) -> bool {
        let due = self.attempts.is_multiple_of(ATTEMPTS_PER_MEASUREMENT);
        self.attempts += 1;
        due
    }

    /// A random sign, 1 or −1 (G. Marsaglia, Xorshift RNGs, J. Stat. Softw. 8 (2003)).
    pub fn random_sign(&mut self) -> f64 {
        self.generator_state ^= self.generator_state << 13;
        self.generator_state ^= self.generator_state >> 7;
        self.generator_state ^= self.generator_state << 17;
        if self.generator_state >> 63 == 0 { 1.0 } else { -1.0 }
    }

    /// Includes the measured rounding error of a step of length `h` in the mean.
    pub fn record_measurement(&mut self, error: f64, h: f64) {
        let square = (error / h) * (error / h);
        if square.is_finite() {
            self.mean_square = Some(self.mean_square.map_or(square, |before| 0.5 * (before + square)));
        }
    }

    /// The truncation error in a difference of the methods over a step of length `h`:
    /// `√(d² − rounding²)`, since variances add up.
    pub fn truncation_error(&self, difference: f64, h: f64) -> f64 {
        let square = difference * difference - self.mean_square.unwrap_or(0.0) * h * h;
        // NaN is returned.
        if square < 0.0 { 0.0 } else { Scalar::sqrt(square) }
    }

    /// Counts an attempt with this error estimate and its truncation error.
    pub fn count_attempt(&mut self, estimate: f64, truncation: f64) {
        let limits = estimate > LIMITING_ERROR && truncation < estimate;
        self.limited_minus_unlimited += if limits { 1 } else { -1 };
    }

    /// Whether rounding errors limited most of the attempts.
    pub fn limited_most_attempts(&self) -> bool {
        self.limited_minus_unlimited > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn truncation_error_without_rounding() {
        let mut rounding = RoundingErrors::default();
        assert_eq!(rounding.truncation_error(5.0, 0.1), 5.0);
        rounding.record_measurement(0.3, 0.1);
        assert!((rounding.truncation_error(0.5, 0.1) - 0.4).abs() < 1e-15);
        assert_eq!(rounding.truncation_error(0.3, 0.2), 0.0);
        assert!(rounding.truncation_error(f64::NAN, 0.1).is_nan());
        rounding.record_measurement(f64::NAN, 0.1);
        assert!((rounding.truncation_error(0.5, 0.1) - 0.4).abs() < 1e-15);
    }

    #[test]
    fn random_signs() {
        let mut rounding = RoundingErrors::default();
        let sum: f64 = (0..10_000).map(|_| rounding.random_sign()).sum();
        // Five standard deviations.
        assert!(sum.abs() < 500.0, "{sum}");
    }
}
