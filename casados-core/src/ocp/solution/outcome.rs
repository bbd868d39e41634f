//! The outcome of a run.

use crate::ocp::formulation::error::{ConstraintName, OcpError};
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::solution::log::{Iteration, Times};
use crate::qp::{QpError, Residuals, StageDims, Violation};
use crate::scalar::Real;
use core::fmt;

/// The status at the end of a run.
///
/// ```
/// # use casados::ocp::{HeapSqp, Horizon, LeastSquaresCost, Map, Problem, Status};
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(10, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// let mut sqp = HeapSqp::new(&ocp)?;
/// let outcome = sqp.solve(&mut ocp)?;
/// match outcome.status {
///     Status::Converged | Status::Acceptable => println!("u = {:?}", ocp.solution()?.control("u")?),
///     // Each of them prints what it is about, and which constraint is to blame.
///     Status::Infeasible { constraint, violation } => println!("{constraint}: {violation}"),
///     other => println!("{other}"),
/// }
/// assert_eq!(outcome.status, Status::Converged);
///
/// sqp.options.max_iterations = 0;
/// ocp.guess(&[1.0], &[0.0])?;
/// assert_eq!(sqp.solve(&mut ocp)?.status, Status::MaxIterations);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Status {
    /// The optimality conditions hold: the iterate is a local solution, and a global one if the
    /// problem is convex ([`Outcome::is_convex`]).
    Converged,
    /// The optimality conditions hold to the acceptable tolerance, and no better point was found.
    Acceptable,
    /// The maximum number of iterations was reached.
    MaxIterations,
    /// The observer stopped the run.
    Stopped,
    /// The time limit was reached.
    OutOfTime,
    /// Unbounded: variables are very large, and there is a recession direction, a ray of feasible
    /// points along which the objective decreases without bound. Add bounds or costs. A status of
    /// [`Ipm`](crate::ocp::Ipm).
    ///
    /// ```
    /// use casados::ocp::{GeneralCost, HeapIpm, Horizon, Map, Problem, Status};
    /// use casados::prelude::*;
    ///
    /// #[function]
    /// fn push(x: f64, u: f64) -> f64 { x + u }
    /// #[function]
    /// fn gain(_x: f64, u: f64) -> f64 { -u }
    ///
    /// let mut ocp = Problem::new(Map::<Push, f64>::new())
    ///     .stage_cost(GeneralCost::<Gain>::new())
    ///     .on(Horizon::uniform(5, 1.0))?;
    /// ocp.fix_initial_state(&[0.0])?.guess(&[0.0], &[0.0])?;
    /// let mut ipm = HeapIpm::new(&ocp)?;
    /// assert_eq!(ipm.solve(&mut ocp)?.status, Status::Unbounded);
    /// // With a bound there is a solution.
    /// ocp.bound("u", .., -1.0, 1.0)?.guess(&[0.0], &[0.0])?;
    /// assert!(ipm.solve(&mut ocp)?.is_converged());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    Unbounded,
    /// Locally infeasible: gaps are smaller than violations and, to first order, no step decreases
    /// the sum of both by a thousandth (in [`Ipm`](crate::ocp::Ipm) the sum of violations by 1e-4).
    /// There may be feasible points elsewhere. The constraint is the one with the largest
    /// violation.
    Infeasible {
        /// The constraint with the largest violation.
        constraint: ConstraintName,
        /// Its violation.
        violation: f64,
    },
    /// A QP was infeasible, and elastic mode is off.
    InfeasibleQp {
        /// A constraint that cannot be satisfied.
        constraint: ConstraintName,
        /// A lower bound of its violation.
        violation: f64,
    },
    /// A QP was not solved for another reason.
    QpFailed(QpError),
    /// No acceptable step was found.
    NoProgress,
}

/// The outcome of a run. The iterate of the problem is the best one, or the last one after
/// `Converged` and `Infeasible`.
///
/// It is displayed in one line. `is_converged` tests the status for the tolerance, `is_solved` for
/// the acceptable tolerance.
///
/// ```
/// use casados::ocp::{GeneralCost, HeapSqp, Horizon, Map, Problem};
/// use casados::prelude::*;
///
/// #[function]
/// fn push(x: f64, u: f64) -> f64 { x + u }
/// #[function]
/// fn price(x: f64, u: f64) -> f64 { x * x + u * u }
///
/// let mut ocp = Problem::new(Map::<Push, f64>::new())
///     .stage_cost(GeneralCost::<Price>::new())
///     .on(Horizon::uniform(5, 1.0))?;
/// ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// let outcome = HeapSqp::new(&ocp)?.solve(&mut ocp)?;
/// assert!(outcome.is_converged(), "{outcome}");
/// println!("{}", outcome.objective);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Outcome {
    /// The status at the end.
    pub status: Status,
    /// The number of steps.
    pub iterations: usize,
    /// The objective at the iterate.
    pub objective: f64,
    /// The residuals of the optimality conditions at the iterate.
    pub residuals: Residuals,
    /// The iterations of all QPs.
    pub qp_iterations: usize,
    /// The sum of the times of all iterations.
    pub times: Times,
    /// Whether the problem is known to be convex: linear dynamics and constraints, and convex
    /// costs. Then a solution is a global minimum; otherwise it is a local one, and another guess
    /// may lead to a better one ([`Ocp::multi_start`](crate::ocp::Ocp::multi_start)).
    pub is_convex: bool,
    /// The largest violation of a hard bound, if the run ends without a solution and the status
    /// names no constraint (feature `alloc`). Iterates of [`Ipm`](crate::ocp::Ipm) are inside the
    /// bounds of states and controls; their violations are the gaps, `residuals.dynamics`.
    pub violated: Option<(ConstraintName, f64)>,
}

impl Outcome {
    /// The outcome at the start of a run.
    pub(in crate::ocp) fn new() -> Self {
        Self {
            status: Status::MaxIterations,
            iterations: 0,
            objective: 0.0,
            residuals: Residuals::default(),
            qp_iterations: 0,
            times: Times::default(),
            is_convex: false,
            violated: None,
        }
    }

    /// Adds QP iterations and times of an iteration.
    pub(in crate::ocp) fn add_iteration(&mut self, row: &Iteration) {
        self.qp_iterations += row.qp_iterations;
        self.times.linearise += row.times.linearise;
        self.times.qp += row.times.qp;
        self.times.search += row.times.search;
    }

    /// Whether the optimality conditions hold to the tolerance. Then the multipliers are those of
    /// the solution, too.
    #[must_use]
    pub fn is_converged(&self) -> bool {
        self.status == Status::Converged
    }

    /// Whether states and controls are those of a solution: the optimality conditions hold to the
    /// tolerance, or to the acceptable one if no better point was found.
    ///
    /// ```
    /// # use casados::ocp::{GeneralCost, HeapIpm, Horizon, Map, Problem};
    /// # use casados::prelude::*;
    /// # #[function]
    /// # fn push(x: f64, u: f64) -> f64 { x + u }
    /// # #[function]
    /// # fn price(x: f64, u: f64) -> f64 { x * x + u * u }
    /// # let mut ocp = Problem::new(Map::<Push, f64>::new())
    /// #     .stage_cost(GeneralCost::<Price>::new())
    /// #     .on(Horizon::uniform(5, 1.0))?;
    /// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
    /// let outcome = HeapIpm::new(&ocp)?.solve(&mut ocp)?;
    /// if !outcome.is_solved() {
    ///     return Err(outcome.to_string().into());
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn is_solved(&self) -> bool {
        matches!(self.status, Status::Converged | Status::Acceptable)
    }
}

impl Status {
    /// Whether the status names a violated constraint.
    pub(in crate::ocp) fn names_constraint(&self) -> bool {
        matches!(self, Self::Infeasible { .. } | Self::InfeasibleQp { .. })
    }

    /// Writes a description.
    fn write_description(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Converged => f.write_str("converged"),
            Self::Acceptable => f.write_str("converged to the acceptable tolerance"),
            Self::MaxIterations => f.write_str("not converged: the maximum number of iterations was reached"),
            Self::Stopped => f.write_str("stopped by the observer"),
            Self::OutOfTime => f.write_str("not converged: the time limit was reached"),
            Self::Unbounded => f.write_str("unbounded"),
            Self::Infeasible { constraint, violation } => {
                write!(f, "locally infeasible: {constraint} cannot be satisfied (violation {violation:.2e})")
            }
            Self::InfeasibleQp { constraint, violation } => {
                write!(
                    f,
                    "the linearised problem is infeasible: {constraint} is violated by {violation:.2e} at least"
                )
            }
            Self::QpFailed(error) => write!(f, "the QP was not solved: {error}"),
            Self::NoProgress => f.write_str("no progress"),
        }
    }

    /// The remedy.
    fn remedy(&self) -> &'static str {
        match self {
            Self::Converged | Self::Acceptable | Self::Stopped | Self::OutOfTime => "",
            Self::MaxIterations => {
                ". Violated bounds: `ocp.solution()?.violations(1e-6)`. Raise `options.max_iterations`, or take another \
                 guess; with `Sqp` also `Globalisation::Filter` or exact Hessians (`Sqp::exact`)"
            }
            Self::Unbounded => {
                ". The objective decreases along a ray: add bounds or costs of states and controls"
            }
            Self::Infeasible { .. } => ". Soften it (`Ocp::soften`), or take another guess",
            Self::InfeasibleQp { .. } => ". Set `options.elastic` to continue with penalties",
            Self::QpFailed(QpError::NotConvex { .. }) => {
                ". Take another guess, or `Convexification::Reduced` if another one was set"
            }
            Self::QpFailed(_) => ". Take another guess",
            Self::NoProgress => {
                ". Violated bounds: `ocp.solution()?.violations(1e-6)`. Take another guess; with `Sqp` also \
                 `Globalisation::Filter`, exact Hessians (`Sqp::exact`) or a smaller `options.shortest_step`"
            }
        }
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.write_description(f)?;
        f.write_str(self.remedy())
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { status, iterations, objective, residuals, .. } = self;
        match status {
            Status::Converged if !self.is_convex => f.write_str("converged to a local solution")?,
            _ => status.write_description(f)?,
        }
        write!(f, " after {iterations} iterations: objective {objective:.8e}, {residuals}")?;
        if let Some((constraint, violation)) = &self.violated {
            write!(f, "; largest violation: {violation:.2e} of {constraint}")?;
        }
        f.write_str(status.remedy())
    }
}

impl<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Adds convexity and the largest violation to the outcome of a run.
    pub(in crate::ocp) fn complete_outcome(&mut self, outcome: &mut Outcome) {
        let needs_violation = !outcome.is_solved() && !outcome.status.names_constraint();
        let (is_convex, violated) = P::complete(self, needs_violation);
        outcome.is_convex = is_convex;
        if needs_violation {
            outcome.violated = violated;
        }
    }

    /// The status of a run with stationary violations.
    pub(in crate::ocp) fn infeasible_status(&self, worst: &Violation) -> Status {
        let Violation { field, stage, index, side, violation } = *worst;
        Status::Infeasible { constraint: self.name(field, stage, index, side), violation }
    }

    /// The status of a run whose QP or Newton equations cannot be solved.
    ///
    /// # Errors
    /// [`OcpError::NonFiniteDerivative`] if data of the QP are not finite.
    pub(in crate::ocp) fn qp_failure_status(&self, error: QpError) -> Result<Status, OcpError> {
        match (self.infeasible(&error), error) {
            (Some(constraint), QpError::Infeasible { violation, .. }) => {
                Ok(Status::InfeasibleQp { constraint, violation })
            }
            _ => self.non_finite_derivative(&error).map_or(Ok(Status::QpFailed(error)), Err),
        }
    }
}
