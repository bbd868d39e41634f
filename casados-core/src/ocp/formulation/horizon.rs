//! The nodes in time.

use crate::ocp::formulation::error::OcpError;
use crate::scalar::Real;

/// The nodes in time.
///
/// Nodes increase; times are those that the model sees, in its units.
///
/// ```
/// use casados::ocp::Horizon;
///
/// assert_eq!(Horizon::uniform(20, 0.05).intervals(), 20);
/// // Short intervals first, where it matters.
/// assert_eq!(Horizon::nodes(&[0.0, 0.1, 0.3, 0.7]).intervals(), 3);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Horizon<'a, T> {
    /// Intervals of equal length, from time zero on.
    Uniform {
        /// How many.
        intervals: usize,
        /// The length of each.
        length: T,
    },
    /// The times of all nodes, one more than there are intervals.
    Nodes(&'a [T]),
}

impl<'a, T: Real> Horizon<'a, T> {
    /// Intervals of equal length.
    #[must_use]
    pub fn uniform(intervals: usize, length: T) -> Self {
        Self::Uniform { intervals, length }
    }
    /// The times of all nodes.
    #[must_use]
    pub fn nodes(times: &'a [T]) -> Self {
        Self::Nodes(times)
    }
    /// How many intervals.
    #[must_use]
    pub fn intervals(&self) -> usize {
        match self {
            Self::Uniform { intervals, .. } => *intervals,
            Self::Nodes(times) => times.len().saturating_sub(1),
        }
    }
    fn time(&self, node: usize) -> T {
        match self {
            Self::Uniform { length, .. } => T::from_whole(node) * *length,
            Self::Nodes(times) => times.get(node).copied().unwrap_or(T::ZERO),
        }
    }
    /// Writes the times.
    ///
    /// # Errors
    /// [`OcpError::Times`]
    pub(in crate::ocp) fn write(&self, times: &mut [T]) -> Result<(), OcpError> {
        for (node, time) in times.iter_mut().enumerate() {
            *time = self.time(node);
            let start = self.time(node.saturating_sub(1));
            let increases = node == 0 || start < *time;
            if !(increases && time.is_finite()) {
                let interval = node.saturating_sub(1);
                return Err(OcpError::Times { interval, start: start.to_f64(), end: time.to_f64() });
            }
        }
        Ok(())
    }
}
