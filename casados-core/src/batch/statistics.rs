//! Statistics of batches.

use crate::statistics::Statistics;

/// Statistics of the last call of a batch.
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
    /// Number of groups that were computed in SIMD lanes.
    pub groups: usize,
    /// Number of intervals that were computed alone from the start, or differentiated alone after a
    /// simulation in a group.
    pub alone: usize,
    /// Number of intervals that were recomputed alone, after the result or the simulation of their
    /// group was not accepted.
    pub redone: usize,
    /// Number of intervals without a result.
    pub failed: usize,
    /// Total work of groups and single intervals: an iteration of a group counts once.
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
