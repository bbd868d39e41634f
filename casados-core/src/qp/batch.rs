//! Batches of quadratic programs, solved in threads and SIMD lanes.

use super::error::QpError;
use super::instance::QpInstance;
use super::interior::{HeapInteriorPoint, InteriorPointOptions};
use super::lanes::{self, LaneWorkspace, Size};
use super::layout::take_mut;
use super::memory::try_reserve;
use super::queue::{each, threads};
use super::solver::{QpSolver, QpStart};
use super::statistics::QpStatistics;
use crate::scalar::Real;
use alloc::vec::Vec;

/// The status of a problem.
type Status = Result<QpStatistics, QpError>;

/// An [`InteriorPoint`](super::InteriorPoint) for many problems, each with its own data,
/// dimensions, solution and status.
///
/// Problems of equal dimensions with a fixed initial state, hard bounds of controls and no other
/// bounds are solved side by side in SIMD lanes, by active sets: their solutions are exact, where
/// an interior point stops at its tolerance. All other problems are solved one by one. An
/// infeasible problem or one with non-finite data has an error as its status. Statuses are those of
/// single solves. Solutions are bitwise those of single solves for problems solved one by one, and
/// equal up to the tolerance for problems solved [together](BatchInteriorPoint::together).
///
/// With the feature `parallel` the threads of rayon share the problems; solutions do not depend on
/// the number of threads. Only the first call and calls with larger problems allocate memory.
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
    /// Options for all problems, which may be changed between calls.
    pub options: InteriorPointOptions,
    /// The maximum number of threads; by default that of rayon.
    #[cfg(feature = "parallel")]
    pub threads: usize,
    /// Whether problems may be solved side by side in SIMD lanes. Default true.
    pub together: bool,
    /// A worker for each thread.
    workers: Vec<Worker<T>>,
    statuses: Vec<Status>,
}

/// The solver and the memory of a thread.
#[derive(Clone, Debug)]
struct Worker<T: Real> {
    solver: HeapInteriorPoint<T>,
    together: LaneWorkspace<T>,
}

impl<T: Real> Default for BatchInteriorPoint<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real> BatchInteriorPoint<T> {
    /// A solver without memory, which the first call allocates.
    #[must_use]
    pub fn new() -> Self {
        Self {
            options: InteriorPointOptions::new::<T>(),
            #[cfg(feature = "parallel")]
            threads: usize::MAX,
            together: true,
            workers: Vec::new(),
            statuses: Vec::new(),
        }
    }

    /// Solves all problems, and returns the status of each, as [`QpSolver::solve`] of
    /// [`InteriorPoint`](super::InteriorPoint) does. A warm start begins at the solution of the
    /// instance.
    ///
    /// # Errors
    /// [`QpError::OutOfMemory`]: nothing was solved.
    pub fn solve(&mut self, instances: &mut [QpInstance<T>], start: QpStart) -> Result<&[Status], QpError> {
        let (count, threads) = (instances.len(), self.threads().min(instances.len()));
        self.statuses.clear();
        try_reserve(&mut self.statuses, count)?;
        self.statuses.resize(count, Ok(QpStatistics::default()));
        let more = threads.saturating_sub(self.workers.len());
        try_reserve(&mut self.workers, more)?;
        while self.workers.len() < threads {
            self.workers
                .push(Worker { solver: HeapInteriorPoint::new(), together: LaneWorkspace::default() });
        }
        let (options, together) = (self.options, self.together);
        let size_of = |instance: &QpInstance<T>| lanes::size(instance, &options).filter(|_| together);
        // A thread takes a multiple of the lanes of a register, or, without lanes, one problem.
        let portion = match instances.first().and_then(size_of) {
            Some(_) => count.div_ceil(threads.max(1)).next_multiple_of(CHUNK_GRANULARITY).min(MAX_CHUNK_SIZE),
            None => 1,
        };
        let workers = self.workers.get_mut(..threads).unwrap_or_default();
        let items = instances.chunks_mut(portion).zip(self.statuses.chunks_mut(portion));
        each(workers, items, |worker, (instances, statuses)| {
            worker.solver.options = options;
            worker.solve(instances, statuses, start, size_of);
        });
        Ok(&self.statuses)
    }

    /// Returns the number of threads.
    fn threads(&self) -> usize {
        #[cfg(feature = "parallel")]
        return threads(self.threads);
        #[cfg(not(feature = "parallel"))]
        threads(1)
    }
}

/// The number of problems that a thread takes at a time is a multiple of `CHUNK_GRANULARITY`, which
/// fills whole registers, and at most `MAX_GRANULES_PER_CHUNK`.
const CHUNK_GRANULARITY: usize = 16;
const MAX_CHUNK_SIZE: usize = 64;

impl<T: Real> Worker<T> {
    /// Solves problems; consecutive problems of equal dimensions are solved together.
    fn solve(
        &mut self,
        mut instances: &mut [QpInstance<T>],
        mut statuses: &mut [Status],
        start: QpStart,
        size_of: impl Fn(&QpInstance<T>) -> Option<Size>,
    ) {
        let Self { solver, together } = self;
        while let Some(first) = instances.first() {
            let size = size_of(first);
            let equal_sized = instances.iter().take_while(|instance| size_of(instance) == size).count();
            let own = take_mut(&mut instances, equal_sized);
            let statuses = take_mut(&mut statuses, equal_sized);
            let solved = match size {
                Some(size) => lanes::solve(together, size, (own, statuses), (&solver.options, start)).is_ok(),
                None => false,
            };
            let mut alone = |index: usize| {
                if let (Some(instance), Some(status)) = (own.get_mut(index), statuses.get_mut(index)) {
                    *status = solver.solve(instance.qp.view(), start, instance.solution.view_mut());
                }
            };
            if solved {
                together.unsolved_indices().for_each(alone);
            } else {
                (0..equal_sized).for_each(&mut alone);
            }
        }
    }
}
