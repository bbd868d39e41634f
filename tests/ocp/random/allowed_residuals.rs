//! What is allowed of residuals: relative to forces.

use super::Draw;
use casados::ocp::{IpmOptions, SqpOptions};

/// Guesses are at most this, but for those that are moved to bounds or have no objective.
const MAX_GUESS: f64 = 30.0;

/// How large residuals may be, where derivatives of the objective at the guess are so large.
pub(super) trait AllowedResiduals {
    fn allowed(&self, forces: f64) -> f64;
}

/// See [`IpmOptions::scaling`].
impl AllowedResiduals for SqpOptions {
    fn allowed(&self, forces: f64) -> f64 {
        self.tolerance * (forces / 100.0).max(1.0)
    }
}

impl AllowedResiduals for IpmOptions {
    fn allowed(&self, forces: f64) -> f64 {
        self.tolerance * (forces / 100.0).max(1.0)
    }
}

impl Draw {
    /// More than what the objective changes by at the guess, where a variable changes by its size
    /// or by one.
    pub(super) fn objective_sensitivity(&self) -> f64 {
        let sizes = |i: usize| self.guess.iter().map(move |guess| guess[i].abs().min(MAX_GUESS));
        let of = |i: usize| sizes(i).fold(1.0, f64::max) + self.reference[i].abs();
        (0..3).map(|i| self.weights[i] * of(i)).fold(0.0, f64::max)
    }
}
