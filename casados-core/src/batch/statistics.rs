//! What the last call did.

use crate::statistics::Statistics;

/// What the last call did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct BatchStatistics {
    /// How many times several intervals were computed side by side.
    pub groups: usize,
    /// Intervals that were computed alone from the beginning, or differentiated alone after their
    /// stages were found side by side.
    pub alone: usize,
    /// Intervals that were computed alone after the group did not arrive at a trustworthy result,
    /// or at stages, for them.
    pub redone: usize,
    /// Intervals without a result.
    pub failed: usize,
    /// What was done for groups and single intervals together: an iteration of a group counts once.
    pub work: Statistics,
}

impl BatchStatistics {
    pub(super) fn add(&mut self, other: &Self) {
        self.groups += other.groups;
        self.alone += other.alone;
        self.redone += other.redone;
        self.failed += other.failed;
        self.add_work(&other.work);
    }

    pub(super) fn add_work(&mut self, other: &Statistics) {
        let work = &mut self.work;
        work.steps += other.steps;
        work.iterations += other.iterations;
        work.residuals += other.residuals;
        work.jacobians += other.jacobians;
        work.factorizations += other.factorizations;
        work.dense += other.dense;
    }
}
