//! Many quadratic programs at once, shared among threads.

use super::error::QpError;
use super::interior::{HeapInteriorPoint, InteriorPointOptions};
use super::memory::room;
use super::problem::HeapQp;
use super::solution::HeapSolution;
use super::solver::{QpSolver, QpStart};
use super::statistics::QpStatistics;
use crate::scalar::Real;
use alloc::vec::Vec;

/// A quadratic program of a batch, and the memory of its solution.
///
/// ```
/// use casados::qp::{HeapQp, HeapSolution, QpInstance, StageDims};
///
/// let dims = [StageDims::new(2, 1, 0), StageDims::new(2, 0, 0)];
/// let instance = QpInstance { qp: HeapQp::<f64>::new(&dims)?, solution: HeapSolution::new(&dims)? };
/// assert_eq!(instance.qp.dims(), instance.solution.dims());
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Clone, Debug)]
pub struct QpInstance<T: Real = f64> {
    /// The data.
    pub qp: HeapQp<T>,
    /// Where the solution is written, and read by warm starts.
    pub solution: HeapSolution<T>,
}

/// What became of a problem.
type Status = Result<QpStatistics, QpError>;

/// An [`InteriorPoint`](super::InteriorPoint) for many problems, each with its own data,
/// dimensions, solution and status.
///
/// With the feature `parallel` consecutive problems are shared among the threads of rayon, as many
/// for each. Solutions and statuses are those of single solves to the bit, whatever the number of
/// threads: a problem that is infeasible or has no finite data says so by itself. Memory is
/// allocated by the first call and by calls with larger problems only.
///
/// # Example
/// ```
/// use casados::qp::{BatchInteriorPoint, HeapQp, HeapSolution, QpError, QpInstance, QpStart, StageDims};
///
/// // x₊ = x + u with |u| ≤ 1, from x₀ to x₁ = 0: out of reach of the third one.
/// let dims = [StageDims::new(1, 1, 0), StageDims::new(1, 0, 0)];
/// let mut instances = Vec::new();
/// for x0 in [0.5, -0.25, 3.0] {
///     let mut qp = HeapQp::<f64>::new(&dims)?;
///     let mut stage = qp.stage_mut(0).unwrap();
///     stage.a_mut().set(0, 0, 1.0);
///     stage.b_mut().set(0, 0, 1.0);
///     stage.r_mut().set(0, 0, 1.0);
///     stage.u_bounds_mut().set(0, -1.0, 1.0);
///     qp.stage_mut(1).unwrap().x_bounds_mut().set(0, 0.0, 0.0);
///     qp.fix_initial_state(&[x0])?;
///     instances.push(QpInstance { qp, solution: HeapSolution::new(&dims)? });
/// }
/// let mut batch = BatchInteriorPoint::new();
/// let statuses = batch.solve(&mut instances, QpStart::Cold)?;
/// assert!(statuses[0].is_ok() && statuses[1].is_ok());
/// assert!(matches!(statuses[2], Err(QpError::Infeasible { .. })));
/// let u = instances[1].solution.stage(0).unwrap().u[0];
/// assert!((u - 0.25).abs() < 1e-7);
/// # Ok::<(), QpError>(())
/// ```
#[derive(Clone, Debug)]
pub struct BatchInteriorPoint<T: Real = f64> {
    /// Options of all problems, which may be changed between calls.
    pub options: InteriorPointOptions,
    /// How many threads share the problems at most; as many as rayon has by default.
    #[cfg(feature = "parallel")]
    pub threads: usize,
    /// A solver for each thread.
    solvers: Vec<HeapInteriorPoint<T>>,
    statuses: Vec<Status>,
}

impl<T: Real> Default for BatchInteriorPoint<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real> BatchInteriorPoint<T> {
    /// A solver without memory: the first call allocates it.
    #[must_use]
    pub fn new() -> Self {
        Self {
            options: InteriorPointOptions::new::<T>(),
            #[cfg(feature = "parallel")]
            threads: usize::MAX,
            solvers: Vec::new(),
            statuses: Vec::new(),
        }
    }

    /// Solves all problems: the status of each, as [`QpSolver::solve`] of
    /// [`InteriorPoint`](super::InteriorPoint) has it. A warm start begins at the solution that an
    /// instance holds.
    ///
    /// # Errors
    /// [`QpError::OutOfMemory`]: nothing was solved.
    pub fn solve(&mut self, instances: &mut [QpInstance<T>], start: QpStart) -> Result<&[Status], QpError> {
        let (count, threads) = (instances.len(), self.threads().min(instances.len()));
        self.statuses.clear();
        room(&mut self.statuses, count)?;
        self.statuses.resize(count, Ok(QpStatistics::default()));
        let more = threads.saturating_sub(self.solvers.len());
        room(&mut self.solvers, more)?;
        while self.solvers.len() < threads {
            self.solvers.push(HeapInteriorPoint::new());
        }
        let solvers = self.solvers.get_mut(..threads).unwrap_or_default();
        for solver in &mut *solvers {
            solver.options = self.options;
        }
        share(solvers, instances, &mut self.statuses, start);
        Ok(&self.statuses)
    }

    /// How many threads there are.
    fn threads(&self) -> usize {
        #[cfg(feature = "parallel")]
        return rayon::current_num_threads().min(self.threads).max(1);
        #[cfg(not(feature = "parallel"))]
        1
    }
}

/// Gives every solver as many problems as every other.
fn share<T: Real>(
    solvers: &mut [HeapInteriorPoint<T>],
    instances: &mut [QpInstance<T>],
    statuses: &mut [Status],
    start: QpStart,
) {
    #[cfg(feature = "parallel")]
    if solvers.len() > 1 {
        let half = solvers.len() / 2;
        let count = instances.len() * half / solvers.len();
        let (solvers, other_solvers) = solvers.split_at_mut(half);
        let (instances, other_instances) = instances.split_at_mut(count);
        let (statuses, other_statuses) = statuses.split_at_mut(count);
        rayon::join(
            || share(solvers, instances, statuses, start),
            || share(other_solvers, other_instances, other_statuses, start),
        );
        return;
    }
    let Some(solver) = solvers.first_mut() else { return };
    for (instance, status) in instances.iter_mut().zip(statuses) {
        *status = solver.solve(instance.qp.view(), start, instance.solution.view_mut());
    }
}
