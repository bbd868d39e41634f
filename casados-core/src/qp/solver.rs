//! What every solver does.

use super::error::QpError;
use super::problem::QpView;
use super::solution::SolutionView;
use super::statistics::QpStatistics;

/// Where a solver begins.
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
    /// Somewhere.
    #[default]
    Cold,
    /// At the point and multipliers in the memory of the solution: the solution of a similar QP. A
    /// solver that cannot make use of it begins somewhere.
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
    /// Solves a QP. The solution is in `solution` afterwards; after an error that comes from the
    /// run, the best iterate is.
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

    /// As [`QpSolver::solve`], until the time is over: `over`, a clock or a counter of cycles, is
    /// asked before each iteration of an interior point. A solver that cannot make use of it takes
    /// the time that it takes.
    ///
    /// # Errors
    /// As [`QpSolver::solve`], and [`QpError::OutOfTime`]; then the solution holds the iterate.
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

    /// Permits residuals up to a tolerance for now, or what its options say if that is more. A
    /// solver that cannot make use of it solves as well as always.
    fn permit(&mut self, tolerance: f64) {
        let _ = tolerance;
    }

    /// Requires solutions that are good enough for residuals below a tolerance in the problem whose
    /// steps they are, which may be less than options say. A solver whose solutions are always
    /// good enough, or as good as they get, does nothing.
    fn require(&mut self, tolerance: f64) {
        let _ = tolerance;
    }

    /// Limits the iterations of each call to come, all attempts in sum, for a caller that has ways
    /// out of its own: a call ends with [`QpError::Infeasible`] where multipliers are nearly a
    /// proof, and nobody looks for what cannot be satisfied. With nothing calls are as options say
    /// again. A solver that cannot make use of it does nothing.
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
