//! The interface of all QP solvers.

use super::error::QpError;
use super::problem::QpView;
use super::solution::SolutionView;
use super::statistics::QpStatistics;

/// The start of a solver.
///
/// ```
/// # use casados::qp::*;
/// # // x₊ = x + u from x₀ = 1, with |u| ≤ 0.4, three intervals of ½ (x² + 0.1 u²).
/// # let mut dims = [StageDims::new(1, 1, 0); 4];
/// # dims[3].nu = 0;
/// # let mut qp = HeapQp::<f64>::new(&dims)?;
/// # for mut stage in qp.stages_mut() {
/// #     stage.a_mut().set(0, 0, 1.0);
/// #     stage.b_mut().set(0, 0, 1.0);
/// #     stage.q_mut().set(0, 0, 1.0);
/// #     stage.r_mut().set(0, 0, 0.1);
/// #     stage.u_bounds_mut().set(0, -0.4, 0.4);
/// # }
/// # qp.fix_initial_state(&[1.0])?;
/// let (mut solver, mut solution) = (HeapInteriorPoint::new(), HeapSolution::new(&dims)?);
/// let cold = solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
/// qp.fix_initial_state(&[0.99])?;
/// let warm = solver.solve(qp.view(), QpStart::Warm, solution.view_mut())?;
/// assert!(warm.iterations <= cold.iterations);
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum QpStart {
    /// A cold start, independent of the memory of the solution.
    #[default]
    Cold,
    /// The point and multipliers in the memory of the solution, as of a similar QP. Solvers without
    /// warm starts start cold.
    Warm,
}

/// A solver of QPs with the structure of optimal control.
///
/// ```
/// # use casados::qp::*;
/// # // x₊ = x + u from x₀ = 1, with |u| ≤ 0.4, three intervals of ½ (x² + 0.1 u²).
/// # let mut dims = [StageDims::new(1, 1, 0); 4];
/// # dims[3].nu = 0;
/// # let mut qp = HeapQp::<f64>::new(&dims)?;
/// # for mut stage in qp.stages_mut() {
/// #     stage.a_mut().set(0, 0, 1.0);
/// #     stage.b_mut().set(0, 0, 1.0);
/// #     stage.q_mut().set(0, 0, 1.0);
/// #     stage.r_mut().set(0, 0, 0.1);
/// #     stage.u_bounds_mut().set(0, -0.4, 0.4);
/// # }
/// # qp.fix_initial_state(&[1.0])?;
/// /// The first control, by any solver.
/// fn first<S: QpSolver<f64>>(mut solver: S, qp: &HeapQp) -> Result<f64, QpError> {
///     let mut solution = HeapSolution::new(qp.view().dims())?;
///     solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
///     Ok(solution.stages().next().map_or(f64::NAN, |stage| stage.u[0]))
/// }
/// let one = first(HeapInteriorPoint::new(), &qp)?;
/// let other = first(Condensing::new(2, HeapInteriorPoint::new()), &qp)?;
/// assert!((one + 0.4).abs() < 1e-7 && (one - other).abs() < 1e-7);
/// # Ok::<(), casados::qp::QpError>(())
/// ```
pub trait QpSolver<T> {
    /// Solves a QP. Afterwards `solution` has the solution; after an error of the run, the best
    /// iterate.
    ///
    /// # Errors
    /// [`QpError`]
    fn solve(
        &mut self,
        qp: QpView<'_, T>,
        start: QpStart,
        solution: SolutionView<'_, T>,
    ) -> Result<QpStatistics, QpError> {
        self.solve_until(qp, start, solution, &mut || false)
    }

    /// As [`QpSolver::solve`], with a time limit: `over`, a clock or a cycle counter, is called
    /// before each iteration of an interior point. Solvers without this feature ignore it.
    ///
    /// # Errors
    /// As [`QpSolver::solve`], and [`QpError::OutOfTime`], after which the solution has the
    /// iterate.
    ///
    /// # Example
    /// ```
    /// use casados::qp::*;
    /// use std::time::{Duration, Instant};
    ///
    /// let dims = [StageDims::new(1, 1, 0), StageDims::new(1, 0, 0)];
    /// let mut qp = HeapQp::<f64>::new(&dims)?;
    /// for mut stage in qp.stages_mut().take(1) {
    ///     stage.a_mut().set(0, 0, 1.0);
    ///     stage.b_mut().set(0, 0, 1.0);
    ///     stage.r_mut().set(0, 0, 1.0);
    ///     stage.u_bounds_mut().set(0, 0.5, 1.0);
    /// }
    /// qp.fix_initial_state(&[1.0])?;
    /// let (mut solver, mut solution) = (HeapInteriorPoint::new(), HeapSolution::new(&dims)?);
    /// let deadline = Instant::now() + Duration::from_secs(60);
    /// let mut over = || Instant::now() > deadline;
    /// solver.solve_until(qp.view(), QpStart::Cold, solution.view_mut(), &mut over)?;
    /// let late = solver.solve_until(qp.view(), QpStart::Cold, solution.view_mut(), &mut || true);
    /// assert!(matches!(late, Err(QpError::OutOfTime { .. })));
    /// # Ok::<(), QpError>(())
    /// ```
    fn solve_until(
        &mut self,
        qp: QpView<'_, T>,
        start: QpStart,
        solution: SolutionView<'_, T>,
        over: &mut dyn FnMut() -> bool,
    ) -> Result<QpStatistics, QpError>;

    /// Permits residuals up to a tolerance from now on; the tolerance of the options holds if it is
    /// larger. Solvers without this feature ignore it.
    fn permit(&mut self, tolerance: f64) {
        let _ = tolerance;
    }

    /// Requires solutions accurate enough for residuals below a tolerance in the problem whose
    /// steps they are. It may be below the tolerance of the options. Solvers that are always
    /// accurate enough, or as accurate as possible, ignore it.
    fn require(&mut self, tolerance: f64) {
        let _ = tolerance;
    }

    /// Limits the iterations of each later call, over all its attempts, for callers with their own
    /// elastic mode. A call then ends with [`QpError::Infeasible`] if its multipliers are nearly a
    /// certificate of infeasibility, without locating the violated constraints. `None` restores the
    /// options. Solvers without this feature ignore it.
    ///
    /// # Example
    /// ```
    /// use casados::qp::*;
    ///
    /// // x₊ = x + u with |u| ≤ 1 does not get from 0 to 5.
    /// let dims = [StageDims::new(1, 1, 0), StageDims::new(1, 0, 0)];
    /// let mut qp = HeapQp::<f64>::new(&dims)?;
    /// for (k, mut stage) in qp.stages_mut().enumerate() {
    ///     if k == 1 {
    ///         stage.x_bounds_mut().set(0, 5.0, 6.0);
    ///         continue;
    ///     }
    ///     stage.a_mut().set(0, 0, 1.0);
    ///     stage.b_mut().set(0, 0, 1.0);
    ///     stage.r_mut().set(0, 0, 1.0);
    ///     stage.u_bounds_mut().set(0, -1.0, 1.0);
    /// }
    /// qp.fix_initial_state(&[0.0])?;
    /// let (mut solver, mut solution) = (HeapInteriorPoint::new(), HeapSolution::new(&dims)?);
    /// solver.limit(Some(30));
    /// let result = solver.solve(qp.view(), QpStart::Cold, solution.view_mut());
    /// assert!(matches!(result, Err(QpError::Infeasible { .. })));
    /// # Ok::<(), casados::qp::QpError>(())
    /// ```
    fn limit(&mut self, iterations: Option<usize>) {
        let _ = iterations;
    }
}
