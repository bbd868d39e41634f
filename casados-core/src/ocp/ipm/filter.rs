//! The filter: pairs of violation and barrier function that no later iterate may be worse than.

/// `θ`, the sum of all violations, and `φ`, the objective with the barrier.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Pair {
    pub theta: f64,
    pub phi: f64,
}

impl Pair {
    pub fn is_finite(&self) -> bool {
        self.theta.is_finite() && self.phi.is_finite()
    }
}

/// Entries; the oldest one is forgotten when there are more.
const ENTRIES: usize = 64;
/// `γ_θ`
const MARGIN_THETA: f64 = 1e-5;
/// `γ_φ`
const MARGIN_PHI: f64 = 1e-8;

/// See Wächter and Biegler, section 2.3.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filter {
    entries: [Pair; ENTRIES],
    count: usize,
    /// `θ_max`: no iterate may violate more.
    most: f64,
}

impl Filter {
    /// An empty one.
    pub fn new(most: f64) -> Self {
        Self { entries: [Pair::default(); ENTRIES], count: 0, most }
    }

    /// Forgets all entries.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Whether a point is not dominated.
    pub fn admits(&self, there: &Pair) -> bool {
        there.theta <= self.most
            && self.entries.iter().take(self.count.min(ENTRIES)).all(|entry| is_better(there, entry))
    }

    /// Remembers an iterate that is left for less violation.
    pub fn add(&mut self, here: Pair) {
        if let Some(entry) = self.entries.get_mut(self.count % ENTRIES) {
            *entry = here;
        }
        self.count += 1;
    }
}

/// Whether violation or barrier function shrink by a margin; differences of rounding are none.
pub(super) fn is_better(there: &Pair, here: &Pair) -> bool {
    there.theta <= (1.0 - MARGIN_THETA) * here.theta
        || there.phi <= here.phi - MARGIN_PHI * here.theta + noise(here)
}

/// What rounding leaves of a difference of barrier functions.
pub(super) fn noise(here: &Pair) -> f64 {
    10.0 * f64::EPSILON * here.phi.abs()
}
