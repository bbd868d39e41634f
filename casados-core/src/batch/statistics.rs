//! What the last call did.

use crate::statistics::Statistics;

/// What the last call did.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
///
/// let mut batch = Batch::<Cart, Gauss<2>>::new(Options::default())?;
/// let (x0, mut ends) = ([vector![0.0, 1.0]; 16], vec![casados::result::Nominal::default(); 16]);
/// batch.solve(&Intervals { x0: &x0, u: &[vector![1.0]], h: &[0.1], ..Default::default() }, &mut ends)?;
/// assert_eq!((batch.statistics().failed, batch.statistics().redone), (0, 0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
        self.work.add(&other.work);
    }
}
