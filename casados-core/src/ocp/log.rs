//! What happened, as data.

use super::elastic::Worst;
use super::error::{ConstraintName, OcpError};
use super::instance::Ocp;
use super::problem::Formulation;
use crate::qp::{QpError, Residuals, StageDims};
use crate::scalar::Real;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;
use core::fmt;

/// Seconds that an iteration took; zero without the feature `std`.
///
/// ```
/// # use casados::ocp::{HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(10, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// let outcome = HeapSqp::new(&ocp)?.solve(&mut ocp)?;
/// let times = outcome.times;
/// println!("QPs took {:.0} % of it", 100.0 * times.qp / times.total());
/// assert!(times.total() >= times.linearise && times.linearise > 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Times {
    /// Integration and derivatives of all functions.
    pub linearise: f64,
    /// The QP, and those of corrections.
    pub qp: f64,
    /// The line search without its QPs.
    pub search: f64,
}

impl Times {
    /// All together.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.linearise + self.qp + self.search
    }
}

/// An iteration: where it began, and how it went on.
///
/// ```
/// # use casados::ocp::{HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
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
/// // A linear problem takes one step; the last row is about the solution, from which there is none.
/// let [first, .., last] = sqp.log().0 else { return Err("too short".into()) };
/// assert_eq!((first.iteration, first.step, last.step), (0, 1.0, 0.0));
/// assert!(last.residuals.largest() < 1e-6 && last.objective == outcome.objective);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Iteration {
    /// Counted from zero.
    pub iteration: usize,
    /// The objective at the iterate, with penalties of soft bounds.
    pub objective: f64,
    /// The conditions of optimality at the iterate.
    pub residuals: Residuals,
    /// The part of the step that was taken; zero in the last iteration.
    pub step: f64,
    /// Iterations of QPs.
    pub qp_iterations: usize,
    /// What was added to the diagonal of the Hessian because the QP was not convex
    /// ([`Convexification::Reduced`](super::Convexification)).
    pub regularisation: f64,
    /// Whether bounds had penalties because the QP was infeasible.
    pub elastic: bool,
    /// Whether the step has a second-order correction.
    pub corrected: bool,
    /// The barrier parameter `μ`; zero in sequential quadratic programming.
    pub barrier: f64,
    /// How long it took.
    pub times: Times,
}

/// How a run ended.
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
    /// The conditions of optimality hold.
    Converged,
    /// The conditions of optimality hold to the acceptable tolerance, and no better point was
    /// found.
    Acceptable,
    /// The iterations were used up.
    MaxIterations,
    /// The observer stopped it.
    Stopped,
    /// The time was over.
    OutOfTime,
    /// Variables grow without end at points that satisfy all constraints: something is missing that
    /// bounds the objective. [`Ipm`](super::Ipm) says so.
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
    /// Locally infeasible: gaps are less than violations, and no step makes the sum of both smaller
    /// by a thousandth, to first order. Elsewhere there may be points that satisfy all constraints.
    /// This is the one that the iterate violates most.
    Infeasible {
        /// The constraint.
        constraint: ConstraintName,
        /// By how much it is violated.
        violation: f64,
    },
    /// A QP was infeasible, and elastic mode is off.
    InfeasibleQp {
        /// A constraint that cannot be satisfied.
        constraint: ConstraintName,
        /// By how much it is violated at least.
        violation: f64,
    },
    /// A QP was not solved for another reason.
    QpFailed(QpError),
    /// No step was short enough to make progress.
    NoProgress,
}

/// The outcome of a run. The iterate of the problem is the best one, whatever the status.
///
/// Runs return it; it prints itself in a line. Whether the iterate is a solution, `is_converged`
/// says.
///
/// ```
/// use casados::ocp::{GeneralCost, HeapSqp, Horizon, Map, Problem, Status};
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
/// match outcome.status {
///     Status::Converged | Status::Acceptable => println!("{}", outcome.objective),
///     status => panic!("{status}"),
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Outcome {
    /// How it ended.
    pub status: Status,
    /// Steps.
    pub iterations: usize,
    /// The objective at the iterate.
    pub objective: f64,
    /// The conditions of optimality at the iterate.
    pub residuals: Residuals,
    /// Iterations of all QPs.
    pub qp_iterations: usize,
    /// How long all of it took.
    pub times: Times,
}

impl Outcome {
    /// Of a run that begins.
    pub(super) fn new() -> Self {
        Self {
            status: Status::MaxIterations,
            iterations: 0,
            objective: 0.0,
            residuals: Residuals::default(),
            qp_iterations: 0,
            times: Times::default(),
        }
    }

    /// Counts what an iteration took.
    pub(super) fn count(&mut self, row: &Iteration) {
        self.qp_iterations += row.qp_iterations;
        self.times.linearise += row.times.linearise;
        self.times.qp += row.times.qp;
        self.times.search += row.times.search;
    }

    /// Whether the conditions of optimality hold.
    #[must_use]
    pub fn is_converged(&self) -> bool {
        self.status == Status::Converged
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Converged => f.write_str("converged"),
            Self::Acceptable => f.write_str("converged to the acceptable tolerance"),
            Self::MaxIterations => f.write_str(
                "not converged: the iterations were used up; more of them (`options.max_iterations`), exact Hessians \
                 (`Sqp::exact`) or another guess may help",
            ),
            Self::Stopped => f.write_str("stopped by the observer"),
            Self::OutOfTime => f.write_str("not converged: the time was over"),
            Self::Unbounded => f.write_str(
                "unbounded: variables grow without end; bounds of states and controls, or a cost of them, are missing",
            ),
            Self::Infeasible { constraint, violation } => {
                write!(f, "locally infeasible: {constraint} is violated by {violation:e}; another guess may help")
            }
            Self::InfeasibleQp { constraint, violation } => {
                write!(
                    f,
                    "the QP is infeasible: {constraint} is violated by {violation:e} at least; `options.elastic` goes on \
                     where only QPs are"
                )
            }
            Self::QpFailed(error @ QpError::NotConvex { .. }) => {
                write!(f, "the QP was not solved: {error}; `Convexification::Reduced` adds what is missing")
            }
            Self::QpFailed(error) => write!(f, "the QP was not solved: {error}; another guess may help"),
            Self::NoProgress => f.write_str(
                "no step makes progress; another guess may help, in sequential quadratic programming also exact \
                 Hessians (`Sqp::exact`), another `options.globalisation` or a smaller `options.shortest_step`",
            ),
        }
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} after {} iterations: objective {:.8e}, {}",
            self.status, self.iterations, self.objective, self.residuals
        )
    }
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// The status of a run whose violations cannot be made smaller.
    pub(super) fn status_of_worst(&self, worst: &Worst) -> Status {
        let Worst { field, stage, index, side, violation } = *worst;
        Status::Infeasible { constraint: self.name(field, stage, index, side), violation }
    }

    /// The status of a run whose QP or Newton's equations have no solution.
    ///
    /// # Errors
    /// [`OcpError::NonFiniteDerivative`] if there is no such QP.
    pub(super) fn status_of_error(&self, error: QpError) -> Result<Status, OcpError> {
        match (self.infeasible(&error), error) {
            (Some(constraint), QpError::Infeasible { violation, .. }) => {
                Ok(Status::InfeasibleQp { constraint, violation })
            }
            _ => self.derivative(&error).map_or(Ok(Status::QpFailed(error)), Err),
        }
    }
}

/// Room for more rows.
///
/// # Errors
/// [`OcpError::OutOfMemory`]
#[cfg(feature = "alloc")]
pub(super) fn reserve(log: &mut Vec<Iteration>, more: usize) -> Result<(), OcpError> {
    let bytes = more.saturating_mul(size_of::<Iteration>());
    log.try_reserve(more).map_err(|_| OcpError::OutOfMemory { bytes })
}

/// A row of the table that [`Log`] prints, without the end of the line: for an observer that shows
/// how a run goes on.
///
/// ```
/// use casados::ocp::{HeapSqp, Horizon, LeastSquaresCost, Log, Map, Problem};
/// use casados::prelude::*;
/// use std::ops::ControlFlow;
///
/// #[function]
/// fn push(x: f64, u: f64) -> f64 { x + u }
/// #[function]
/// fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
///
/// let mut ocp = Problem::new(Map::<Push, f64>::new())
///     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
///     .on(Horizon::uniform(10, 0.1))?;
/// ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// print!("{}", Log(&[])); // the head of the table
/// HeapSqp::new(&ocp)?.solve_observed(&mut ocp, &mut |iteration| {
///     println!("{iteration}");
///     ControlFlow::Continue(())
/// })?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
impl fmt::Display for Iteration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Residuals { stationarity, dynamics, inequalities, complementarity } = self.residuals;
        let mark = match (self.elastic, self.corrected) {
            (true, _) => "e",
            (_, true) => "s",
            _ => " ",
        };
        write!(
            f,
            "{:4} {:17.9e} {:11.2e} {:9.2e} {:9.2e} {:9.2e} {:9.2e}{mark} {:8.1e} {:6} {:8.3} {:8.3} {:10.3}",
            self.iteration,
            self.objective,
            stationarity,
            dynamics,
            inequalities,
            complementarity,
            self.step,
            self.regularisation,
            self.qp_iterations,
            1e3 * self.times.linearise,
            1e3 * self.times.qp,
            1e3 * self.times.search,
        )
    }
}

/// Iterations, to be printed as the familiar table. Marks behind the length of a step are explained
/// below it.
///
/// ```
/// # use casados::ocp::{HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
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
/// println!("{}", sqp.log());
/// assert_eq!(sqp.log().0.len(), outcome.iterations + 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Log<'a>(pub &'a [Iteration]);

impl fmt::Display for Log<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "iter       objective   stationar.  dynamics  inequal.  complem.      step  regular.  QP it.   lin ms    QP ms  search ms"
        )?;
        for row in self.0 {
            writeln!(f, "{row}")?;
        }
        if self.0.iter().any(|i| i.elastic) {
            writeln!(f, "e: hard bounds had penalties, since no step satisfies all of them")?;
        }
        if self.0.iter().any(|i| i.corrected && !i.elastic) {
            writeln!(f, "s: the step has a second-order correction of the constraints")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;
    use alloc::vec::Vec;

    /// What stands below the rows.
    fn marks(rows: &[Iteration]) -> Vec<alloc::string::String> {
        Log(rows).to_string().lines().skip(1 + rows.len()).map(ToString::to_string).collect()
    }

    #[test]
    fn marks_are_explained_where_they_occur() {
        let plain = Iteration::default();
        let elastic = Iteration { elastic: true, corrected: true, ..plain };
        let corrected = Iteration { corrected: true, ..plain };
        assert!(marks(&[plain]).is_empty());
        assert_eq!(
            marks(&[plain, elastic]),
            ["e: hard bounds had penalties, since no step satisfies all of them"]
        );
        assert_eq!(
            marks(&[corrected, elastic]),
            [
                "e: hard bounds had penalties, since no step satisfies all of them",
                "s: the step has a second-order correction of the constraints"
            ]
        );
    }
}
