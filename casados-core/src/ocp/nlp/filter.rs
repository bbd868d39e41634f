//! The filter: pairs of objective and violation that must not dominate a later iterate.
//!
//! R. Fletcher, S. Leyffer, Math. Program. 91 (2002); A. Wächter, L. T. Biegler, Math. Program. 106
//! (2006), section 2.3, whose symbols are used.

use super::advanced::FilterOptions;
use crate::scalar::Scalar;

/// Objective and violation at a point.
///
/// The objective includes the penalties of soft bounds, and in an interior point the barrier (`φ`).
/// The violation (`θ`) is the sum of all violations of hard constraints, weighted in a merit
/// function.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::ocp) struct FilterPair {
    pub objective: f64,
    pub violation: f64,
}

impl FilterPair {
    pub fn is_finite(&self) -> bool {
        self.objective.is_finite() && self.violation.is_finite()
    }

    /// The pair in units of the objective.
    pub fn divided_by(self, force: f64) -> Self {
        Self { objective: self.objective / force, violation: self.violation / force }
    }

    /// The merit function `objective + violation`, with weighted violations.
    pub fn merit(&self) -> f64 {
        self.objective + self.violation
    }

    /// Whether the violation or the objective is smaller by a margin of `γ_θ` or `γ_φ` times the
    /// violation. Increases of the objective up to `noise` are rounding errors.
    pub fn is_acceptable_to(&self, other: &Self, options: &FilterOptions, noise: f64) -> bool {
        self.violation <= (1.0 - options.gamma_theta) * other.violation
            || self.objective <= other.objective - options.gamma_phi * other.violation + noise
    }
}

impl core::ops::AddAssign for FilterPair {
    fn add_assign(&mut self, other: Self) {
        self.objective += other.objective;
        self.violation += other.violation;
    }
}

impl FilterOptions {
    /// The switching condition (equation (19)): the predicted decrease of the objective is large
    /// relative to the violation, so that the objective must decrease sufficiently.
    pub(in crate::ocp) fn switching_condition_holds(&self, length: f64, slope: f64, violation: f64) -> bool {
        slope < 0.0 && length * Scalar::powf(-slope, self.s_phi) > Scalar::powf(violation, self.s_theta)
    }
}

/// The capacity of the filter; the oldest entry is overwritten.
const MAX_FILTER_ENTRIES: usize = 64;

/// See the [module](self).
#[derive(Clone, Copy, Debug)]
pub(in crate::ocp) struct Filter {
    pub options: FilterOptions,
    entries: [FilterPair; MAX_FILTER_ENTRIES],
    insertion_count: usize,
    /// `θ_max`: the largest acceptable violation.
    theta_max: f64,
}

impl Filter {
    /// An empty filter with `θ_max`.
    pub fn new(options: FilterOptions, largest_violation: f64) -> Self {
        Self {
            options,
            entries: [FilterPair::default(); MAX_FILTER_ENTRIES],
            insertion_count: 0,
            theta_max: largest_violation,
        }
    }

    /// Removes all entries, whose objectives are no longer comparable.
    pub fn clear(&mut self) {
        self.insertion_count = 0;
    }

    /// Whether the violation is at most `θ_max`, and every entry accepts the point.
    pub fn is_acceptable(&self, trial_pair: &FilterPair, noise: f64) -> bool {
        let mut entries = self.entries.iter().take(self.insertion_count.min(MAX_FILTER_ENTRIES));
        trial_pair.violation <= self.theta_max
            && entries.all(|entry| trial_pair.is_acceptable_to(entry, &self.options, noise))
    }

    /// Returns whether the point is acceptable to the iterate; if so, adds the iterate to the
    /// filter.
    pub fn augment_if_improved(
        &mut self,
        trial_pair: &FilterPair,
        current_pair: &FilterPair,
        noise: f64,
    ) -> bool {
        let improves = trial_pair.is_acceptable_to(current_pair, &self.options, noise);
        if improves {
            if let Some(entry) = self.entries.get_mut(self.insertion_count % MAX_FILTER_ENTRIES) {
                *entry = *current_pair;
            }
            self.insertion_count += 1;
        }
        improves
    }
}
