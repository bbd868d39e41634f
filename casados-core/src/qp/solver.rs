//! What every solver does.

use super::error::QpError;
use super::problem::QpView;
use super::solution::SolutionView;
use super::statistics::QpStatistics;

/// Where a solver begins.
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
    ) -> Result<QpStatistics, QpError>;

    /// Asks for residuals below a tolerance for now, but not for less than its options say. A
    /// solver that cannot make use of it solves as well as always.
    fn relax(&mut self, tolerance: f64) {
        let _ = tolerance;
    }

    /// Asks for solutions that are good enough for residuals below a tolerance in the problem whose
    /// steps they are, which may be less than options say. A solver whose solutions are always
    /// good enough, or as good as they get, does nothing.
    fn refine(&mut self, tolerance: f64) {
        let _ = tolerance;
    }
}
