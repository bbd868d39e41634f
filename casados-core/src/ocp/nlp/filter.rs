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
pub(in crate::ocp) struct Measure {
    pub objective: f64,
    pub violation: f64,
}

impl Measure {
    pub fn is_finite(&self) -> bool {
        self.objective.is_finite() && self.violation.is_finite()
    }

    /// Both in a unit of forces.
    pub fn over(self, force: f64) -> Self {
        Self { objective: self.objective / force, violation: self.violation / force }
    }

    /// The merit function, where violations have their weights.
    pub fn merit(&self) -> f64 {
        self.objective + self.violation
    }

    /// Whether violation or objective are smaller by a margin: `γ_θ` and `γ_φ`, parts of the
    /// violation. Differences of the objective up to `noise` are none.
    pub fn is_better(&self, other: &Self, noise: f64) -> bool {
        self.violation <= (1.0 - GAMMA_THETA) * other.violation
            || self.objective <= other.objective - GAMMA_PHI * other.violation + noise
    }
}

impl core::ops::AddAssign for Measure {
    fn add_assign(&mut self, other: Self) {
        self.objective += other.objective;
        self.violation += other.violation;
    }
}

/// Whether a step of this length is expected to make the objective far smaller than there is
/// violation: then the objective decides (equation (19)).
pub(in crate::ocp) fn objective_decides(length: f64, slope: f64, violation: f64) -> bool {
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
const ENTRIES: usize = 64;

/// See the [module](self).
#[derive(Clone, Copy, Debug)]
pub(in crate::ocp) struct Filter {
    entries: [Measure; ENTRIES],
    count: usize,
    /// `θ_max`: no iterate may violate more.
    largest_violation: f64,
}

impl Filter {
    /// An empty one.
    pub fn new(largest_violation: f64) -> Self {
        Self { entries: [Measure::default(); ENTRIES], count: 0, largest_violation }
    }

    /// Forgets all entries: their objectives are others.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Whether a point is better than every entry.
    pub fn admits(&self, there: &Measure, noise: f64) -> bool {
        let mut entries = self.entries.iter().take(self.count.min(ENTRIES));
        there.violation <= self.largest_violation && entries.all(|entry| there.is_better(entry, noise))
    }

    /// Whether a point is better than the iterate, which is an entry then.
    pub fn improves(&mut self, there: &Measure, here: &Measure, noise: f64) -> bool {
        let improves = there.is_better(here, noise);
        if improves {
            if let Some(entry) = self.entries.get_mut(self.count % ENTRIES) {
                *entry = *here;
            }
            self.count += 1;
        }
        improves
    }
}
