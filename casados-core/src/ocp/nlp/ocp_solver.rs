//! The trait of solvers.

use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::HeapOcp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::{Curvature, Exact};
use crate::ocp::nlp::ipm::HeapIpm;
use crate::ocp::nlp::sqp::HeapSqp;
use crate::ocp::solution::outcome::Outcome;
use crate::qp::QpSolver;
use crate::scalar::Real;

/// A solver of optimal control problems: [`HeapSqp`], [`HeapIpm`], or a user's own, for example one
/// method as the fallback of another.
///
/// ```
/// use casados::ocp::*;
/// use casados::prelude::*;
///
/// /// Sequential quadratic programming, and an interior point where that does not converge.
/// #[derive(Clone)]
/// struct Both(HeapSqp, HeapIpm);
///
/// impl<P: ExactFormulation<f64>> OcpSolver<P, f64> for Both {
///     fn solve(&mut self, ocp: &mut HeapOcp<P>) -> Result<Outcome, OcpError> {
///         match self.0.solve(ocp)? {
///             outcome if outcome.is_solved() => Ok(outcome),
///             _ => self.1.solve(ocp),
///         }
///     }
/// }
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn all(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<All>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(20, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// let mut batch = BatchOcp::new(&ocp, 8, Both(HeapSqp::new(&ocp)?, HeapIpm::new(&ocp)?))?;
/// assert!(batch.solve()?.iter().all(Result::is_ok));
/// # Ok::<(), OcpError>(())
/// ```
pub trait OcpSolver<P, T: Real>: Clone + Send {
    /// Solves a problem. Its iterate is the guess before, and the solution afterwards.
    ///
    /// # Errors
    /// The errors of [`Sqp::solve`](crate::ocp::Sqp::solve), or of the user's solver.
    fn solve(&mut self, ocp: &mut HeapOcp<P, T>) -> Result<Outcome, OcpError>;
}

impl<P: Program<T>, T: Real, S, C> OcpSolver<P, T> for HeapSqp<S, C, T>
where
    S: QpSolver<T> + Clone + Send,
    C: Curvature<P::Dynamics, T> + Send,
{
    fn solve(&mut self, ocp: &mut HeapOcp<P, T>) -> Result<Outcome, OcpError> {
        HeapSqp::solve(self, ocp)
    }
}

impl<P: Program<T>, T: Real> OcpSolver<P, T> for HeapIpm<T>
where
    Exact: Curvature<P::Dynamics, T>,
{
    fn solve(&mut self, ocp: &mut HeapOcp<P, T>) -> Result<Outcome, OcpError> {
        HeapIpm::solve(self, ocp)
    }
}
