//! Partial condensing: elimination of the states inside blocks of intervals.
//!
//! A block of stages `k .. k + m` becomes one stage with the state `x_k` and the controls
//! `(u_{k+m−1}, …, u_k)`, latest first. Bounds of eliminated states become general constraints. The
//! recursion goes backwards over the block, with the Hessian `V` of the cost to go and the rows `Z`
//! that depend on `x_{j+1}` (mixed second derivatives, constraints, and `x_{k+m}` itself):
//!
//! ```text
//! V ← H_j + [A B]ᵀ V [A B]        Z ← Z [A B]
//! ```
//!
//! Short blocks are faster for problems with few controls: the Riccati recursion has fewer stages
//! with larger matrices, and less memory traffic per iteration.

mod block;
mod expand;
mod plan;

use super::error::QpError;
use super::layout::{StageDims, StageOffsetsIter, padded_len, part};
use super::memory::{try_reserve, try_resize};
use super::problem::{HeapQp, QpView};
use super::solution::{HeapSolution, SolutionView};
use super::solver::{QpSolver, QpStart};
use super::statistics::QpStatistics;
use crate::scalar::Real;
use alloc::vec::Vec;
use block::{Condense, MaxDimensions, Work};
use expand::{Expand, copy, stage_cost_and_product};
use plan::{CondensedRow, Kind, blocks, expand_error, is_bounded, row_bounds_and_penalties};

/// Condenses problems in blocks of intervals, and solves them by another solver.
///
/// Memory is on the heap; only the first call and calls with larger problems allocate it.
///
/// ```
/// use casados::qp::{Condensing, HeapInteriorPoint, HeapQp, HeapSolution, QpSolver, QpStart, StageDims};
///
/// // x₊ = x + u from x₀ = 1, two intervals, ½ Σ (x² + u²).
/// let mut dims = [StageDims::new(1, 1, 0); 3];
/// dims[2].nu = 0;
/// let mut qp = HeapQp::<f64>::new(&dims)?;
/// for mut stage in qp.stages_mut() {
///     stage.a_mut().set(0, 0, 1.0);
///     stage.b_mut().set(0, 0, 1.0);
///     stage.q_mut().set(0, 0, 1.0);
///     stage.r_mut().set(0, 0, 1.0);
/// }
/// qp.fix_initial_state(&[1.0])?;
/// let mut solution = HeapSolution::new(&dims)?;
/// // Both intervals in one block.
/// let mut solver = Condensing::new(2, HeapInteriorPoint::new());
/// solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
/// let u0 = solution.stages().next().map_or(f64::NAN, |stage| stage.u[0]);
/// assert!((u0 + 0.6).abs() < 1e-7);
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Condensing<T, S> {
    /// The solver of condensed problems.
    pub solver: S,
    /// The number of intervals of a block.
    block: usize,
    qp: Option<(HeapQp<T>, HeapSolution<T>)>,
    dims: Vec<StageDims>,
    /// The dimensions of the previous call.
    old: Vec<StageDims>,
    /// The origins of general constraints.
    rows: Vec<CondensedRow>,
    /// The origins of the rows of `Z`.
    origins: Vec<CondensedRow>,
    work: Vec<T>,
}

impl<T: Real, S> Condensing<T, S> {
    /// A solver for blocks of `block` intervals. Blocks of zero or one interval are not condensed;
    /// a block of all intervals or more leaves one state.
    #[must_use]
    pub fn new(block: usize, solver: S) -> Self {
        let (dims, old, rows, origins, work) = (Vec::new(), Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self { solver, block: block.max(1), qp: None, dims, old, rows, origins, work }
    }
}

impl<T: Real, S> Condensing<T, S> {
    /// Computes the dimensions of the condensed problem, and the origins of its general
    /// constraints, stage by stage.
    fn plan(&mut self, qp: QpView<'_, T>) -> Result<(), QpError> {
        core::mem::swap(&mut self.dims, &mut self.old);
        self.dims.clear();
        self.rows.clear();
        // Reserves the maximum, so that later calls need no more.
        try_reserve(&mut self.dims, qp.dims.len())?;
        try_reserve(&mut self.rows, qp.dims.iter().map(|d| d.nx + d.ng).sum())?;
        let mut places = StageOffsetsIter::<T>::new(qp.dims);
        for block in blocks(qp.dims.len(), self.block) {
            let mut condensed = StageDims::default();
            for stage in block.clone() {
                let Some(place) = places.next() else { break };
                let data = part(qp.data, place.data, place.data_len());
                condensed.nu += place.nu;
                if stage == block.start {
                    condensed.nx = place.nx;
                }
                let inner = if stage > block.start { 0..place.nx } else { 0..0 };
                for index in inner.chain(place.ld..place.ld + place.ng) {
                    if index >= place.ld || is_bounded(row_bounds_and_penalties(data, &place, index)) {
                        condensed.ng += 1;
                        self.rows.push(CondensedRow { kind: Kind::Constraint, stage, index });
                    }
                }
            }
            self.dims.push(condensed);
        }
        if self.dims != self.old || self.qp.is_none() {
            self.qp = Some((HeapQp::new(&self.dims)?, HeapSolution::new(&self.dims)?));
        }
        Ok(())
    }
}

impl<T: Real, S: QpSolver<T>> QpSolver<T> for Condensing<T, S> {
    fn permit(&mut self, tolerance: f64) {
        self.solver.permit(tolerance);
    }
    fn require(&mut self, tolerance: f64) {
        self.solver.require(tolerance);
    }
    fn limit(&mut self, iterations: Option<usize>) {
        self.solver.limit(iterations);
    }

    fn solve_until(
        &mut self,
        qp: QpView<'_, T>,
        start: QpStart,
        mut solution: SolutionView<'_, T>,
        over: &mut dyn FnMut() -> bool,
    ) -> Result<QpStatistics, QpError> {
        super::check::check_all_bounds(qp)?;
        solution.check_dimensions(qp)?;
        if qp.is_coupled() {
            return Err(QpError::Coupled);
        }
        self.plan(qp)?;
        let Self {
            solver, block, qp: Some((condensed, start_and_solution)), dims, rows, origins, work, ..
        } = self
        else {
            return Err(QpError::OutOfMemory { bytes: 0 });
        };
        let places = StageOffsetsIter::<T>::new(qp.dims);
        let largest = MaxDimensions {
            n: places.clone().map(|p| p.n).max().unwrap_or(0),
            nx: places.clone().map(|p| p.nx).max().unwrap_or(0),
            rows: StageOffsetsIter::<T>::new(dims).map(|p| p.next + p.nu + p.ng).max().unwrap_or(0),
        };
        let most = places.map(|p| padded_len::<T>(p.next + p.ng)).max().unwrap_or(0);
        let condensed_n = dims.iter().map(|d| d.nx + d.nu).max().unwrap_or(0);
        let others = most + padded_len::<T>(largest.n) + padded_len::<T>(condensed_n);
        try_resize(work, Work::<T>::lengths(&largest).iter().sum::<usize>() + others)?;
        origins.clear();
        try_reserve(origins, largest.rows)?;
        let target = condensed.data_mut();
        let matrices = Work::new(&largest, work);
        T::registers(Condense { qp, block: *block, rows, work: matrices, dims, target, origins });
        if start == QpStart::Warm {
            copy((qp, *block, rows), solution.reborrow(), start_and_solution.view_mut(), false);
        }
        let result = solver.solve_until(condensed.view(), start, start_and_solution.view_mut(), over);
        copy((qp, *block, rows), solution.reborrow(), start_and_solution.view_mut(), true);
        let (minus, g) = work.split_at_mut_checked(most).unwrap_or_default();
        T::registers(Expand { qp, block: *block, solution: solution.reborrow(), minus, g });
        result.map_err(|error| expand_error(error, qp, *block, dims, rows)).map(|statistics| {
            // Penalties are equal; the condensed costs lack the constants of eliminated states.
            let g = work.get_mut(..padded_len::<T>(largest.n.max(condensed_n))).unwrap_or_default();
            let difference = stage_cost_and_product(qp, solution.v, g)
                - stage_cost_and_product(condensed.view(), start_and_solution.view_mut().v, g);
            QpStatistics { objective: statistics.objective + difference, ..statistics }
        })
    }
}
