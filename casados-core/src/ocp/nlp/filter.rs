//! The filter: pairs of objective and violation that no later iterate may be worse than.
//!
//! R. Fletcher, S. Leyffer, Math. Program. 91 (2002); A. Wächter, L. T. Biegler, Math. Program. 106
//! (2006), section 2.3, whose letters these are.

use crate::scalar::Scalar;

/// Objective and violation at a point.
///
/// The objective has the penalties of soft bounds, in an interior point also the barrier (`φ`); the
/// violation (`θ`) is the sum of all violations of what is hard, in a merit function each times its
/// weight.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::ocp) struct FilterPair {
    pub objective: f64,
    pub violation: f64,
}

impl FilterPair {
    pub fn is_finite(&self) -> bool {
        self.objective.is_finite() && self.violation.is_finite()
    }

    /// Both in a unit of forces.
    pub fn divided_by(self, force: f64) -> Self {
        Self { objective: self.objective / force, violation: self.violation / force }
    }

    /// The merit function, where violations have their weights.
    pub fn merit(&self) -> f64 {
        self.objective + self.violation
    }

    /// Whether violation or objective are smaller by a margin: `γ_θ` and `γ_φ`, parts of the
    /// violation. Differences of the objective up to `noise` are none.
    pub fn is_acceptable_to(&self, other: &Self, noise: f64) -> bool {
        self.violation <= (1.0 - GAMMA_THETA) * other.violation
            || self.objective <= other.objective - GAMMA_PHI * other.violation + noise
    }
}

impl core::ops::AddAssign for FilterPair {
    fn add_assign(&mut self, other: Self) {
        self.objective += other.objective;
        self.violation += other.violation;
    }
}

/// Whether a step of this length is expected to make the objective far smaller than there is
/// violation: then the objective decides (equation (19)).
pub(in crate::ocp) fn switching_condition_holds(length: f64, slope: f64, violation: f64) -> bool {
    slope < 0.0 && length * Scalar::powf(-slope, S_PHI) > Scalar::powf(violation, S_THETA)
}

/// `s_φ`
pub(in crate::ocp) const S_PHI: f64 = 2.3;
/// `s_θ`
pub(in crate::ocp) const S_THETA: f64 = 1.1;
/// `γ_θ` and `γ_φ`
pub(in crate::ocp) const GAMMA_THETA: f64 = 1e-5;
pub(in crate::ocp) const GAMMA_PHI: f64 = 1e-5;
/// `η_φ`, as Armijo's constant usually is.
pub(in crate::ocp) const ETA_PHI: f64 = 1e-4;
/// Entries; the oldest one is forgotten when there are more.
const MAX_FILTER_ENTRIES: usize = 64;

/// See the [module](self).
#[derive(Clone, Copy, Debug)]
pub(in crate::ocp) struct Filter {
    entries: [FilterPair; MAX_FILTER_ENTRIES],
    insertion_count: usize,
    /// `θ_max`: no iterate may violate more.
    theta_max: f64,
}

impl Filter {
    /// An empty one.
    pub fn new(largest_violation: f64) -> Self {
        Self {
            entries: [FilterPair::default(); MAX_FILTER_ENTRIES],
            insertion_count: 0,
            theta_max: largest_violation,
        }
    }

    /// Forgets all entries: their objectives are others.
    pub fn clear(&mut self) {
        self.insertion_count = 0;
    }

    /// Whether a point is better than every entry.
    pub fn is_acceptable(&self, trial_pair: &FilterPair, noise: f64) -> bool {
        let mut entries = self.entries.iter().take(self.insertion_count.min(MAX_FILTER_ENTRIES));
        trial_pair.violation <= self.theta_max
            && entries.all(|entry| trial_pair.is_acceptable_to(entry, noise))
    }

    /// Whether a point is better than the iterate, which is an entry then.
    pub fn augment_if_improved(
        &mut self,
        trial_pair: &FilterPair,
        current_pair: &FilterPair,
        noise: f64,
    ) -> bool {
        let improves = trial_pair.is_acceptable_to(current_pair, noise);
        if improves {
            if let Some(entry) = self.entries.get_mut(self.insertion_count % MAX_FILTER_ENTRIES) {
                *entry = *current_pair;
            }
            self.insertion_count += 1;
        }
        improves
    }
}
