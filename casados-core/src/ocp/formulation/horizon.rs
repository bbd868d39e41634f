//! The nodes in time.

use crate::ocp::formulation::error::OcpError;
use crate::qp::element::get;
use crate::scalar::Real;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;
use core::ops::{Bound, RangeBounds};

/// The nodes in time.
///
/// Times increase from node to node, in the units of the model's time.
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
    /// Intervals of equal length, starting at time zero.
    Uniform {
        /// The number of intervals.
        intervals: usize,
        /// The length of an interval.
        length: T,
    },
    /// The times of all nodes, one more than intervals.
    Nodes(&'a [T]),
    /// From time zero to a free end time.
    Free {
        /// The number of intervals.
        intervals: usize,
        /// The nodes as fractions of the horizon, from 0 to 1, one more than intervals; empty for
        /// intervals of equal length.
        parts: &'a [T],
        /// The range of the end time.
        range: [T; 2],
        /// The guess of the end time.
        guess: T,
    },
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
    /// A free end time in a range, with intervals of equal length from time zero. The model
    /// declares one of its parameters as its duration (`#[ode(duration = p)]`), and keeps its units
    /// of time, as do costs, constraints and the times of the solution.
    ///
    /// A running cost weights each interval by its length, and has derivatives by the end time.
    ///
    /// # Example
    /// A car covers a hundred metres from rest to rest with at most 2 m/s²: in `2 √50` s.
    /// ```
    /// use casados::ocp::{GeneralCost, HeapIpm, Horizon, Problem};
    /// use casados::prelude::*;
    ///
    /// #[ode(duration = p)]
    /// fn car(x: [f64; 2], u: f64, _p: f64) -> [f64; 2] { [x[1], u] }
    /// #[function]
    /// fn time(_x: [f64; 2], _u: f64, _p: f64) -> f64 { 1.0 }
    ///
    /// let n = 20;
    /// let mut ocp = Problem::new(Irk::<Car, Gauss<2>>::new(Options::default())?)
    ///     .running_cost(GeneralCost::<Time>::new())
    ///     .on(Horizon::free(n, 1.0..=60.0, 20.0))?;
    /// ocp.fix_initial_state(&[0.0; 2])?.bound("u", .., -2.0, 2.0)?;
    /// ocp.bound("x[0]", n.., 100.0, 100.0)?.bound("x[1]", n.., 0.0, 0.0)?.guess(&[50.0, 5.0], &[0.0])?;
    /// assert!(HeapIpm::new(&ocp)?.solve(&mut ocp)?.is_converged());
    /// let solution = ocp.solution()?;
    /// assert!((solution.end_time() - 2.0 * 50.0_f64.sqrt()).abs() < 1e-6);
    /// assert_eq!(solution.times()[n / 2], solution.end_time() / 2.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn free(intervals: usize, range: impl RangeBounds<T>, guess: T) -> Self {
        Self::Free { intervals, parts: &[], range: range_limits(&range), guess }
    }
    /// As [`Horizon::free`], with nodes at these fractions of the horizon, from 0 to 1.
    #[must_use]
    pub fn free_nodes(parts: &'a [T], range: impl RangeBounds<T>, guess: T) -> Self {
        let intervals = parts.len().saturating_sub(1);
        Self::Free { intervals, parts, range: range_limits(&range), guess }
    }
    /// Returns the number of intervals.
    #[must_use]
    pub fn intervals(&self) -> usize {
        match self {
            Self::Uniform { intervals, .. } | Self::Free { intervals, .. } => *intervals,
            Self::Nodes(times) => times.len().saturating_sub(1),
        }
    }
    /// Returns the nodes with these intervals halved. `nodes` are those of
    /// [`Ocp::times`](crate::ocp::Ocp::times); the result is for [`Horizon::nodes`], or for
    /// [`Horizon::free_nodes`] if the end is free. Indices of intervals that do not exist are
    /// ignored.
    ///
    /// ```
    /// use casados::ocp::Horizon;
    ///
    /// assert_eq!(Horizon::refined(&[0.0, 1.0, 2.0, 4.0], &[0, 2]), [0.0, 0.5, 1.0, 2.0, 3.0, 4.0]);
    /// ```
    #[cfg(feature = "alloc")]
    #[must_use]
    pub fn refined(nodes: &[T], intervals: &[usize]) -> Vec<T> {
        let mut finer = Vec::new();
        for (k, pair) in nodes.windows(2).enumerate() {
            let [start, end] = [0, 1].map(|i| get(pair, i));
            finer.push(start);
            if intervals.contains(&k) {
                finer.push(start + T::from_f64(0.5) * (end - start));
            }
        }
        finer.extend(nodes.last());
        finer
    }
    fn time(&self, node: usize) -> T {
        match self {
            Self::Uniform { length, .. } => T::from_whole(node) * *length,
            Self::Nodes(times) => get(times, node),
            Self::Free { intervals, parts: [], .. } => T::from_whole(node) / T::from_whole(*intervals),
            Self::Free { parts, .. } => get(parts, node),
        }
    }
    /// Writes the times of the nodes.
    ///
    /// # Errors
    /// [`OcpError::Times`]
    pub(in crate::ocp) fn write_times(&self, times: &mut [T]) -> Result<(), OcpError> {
        if let Self::Free { parts: [start, .., end], .. } = self
            && !(*start == T::ZERO && *end == T::ONE)
        {
            let (start, end) = (start.to_f64(), end.to_f64());
            return Err(OcpError::Times { interval: self.intervals(), start, end });
        }
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

/// Returns the limits of a range.
pub(in crate::ocp) fn range_limits<T: Real>(range: &impl RangeBounds<T>) -> [T; 2] {
    let infinity = T::from_f64(f64::INFINITY);
    let limit = |bound: Bound<&T>, none: T| match bound {
        Bound::Included(&value) | Bound::Excluded(&value) => value,
        Bound::Unbounded => none,
    };
    [limit(range.start_bound(), -infinity), limit(range.end_bound(), infinity)]
}
