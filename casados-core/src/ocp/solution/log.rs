//! The log of a run.

use crate::qp::Residuals;
use core::fmt;

/// Seconds of an iteration; zero without the feature `std`.
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
    /// QPs with their inertia corrections, or Newton steps.
    pub qp: f64,
    /// The line search, with its second-order corrections.
    pub search: f64,
}

impl Times {
    /// The sum of all parts.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.linearise + self.qp + self.search
    }
}

/// An iteration: its iterate, and the step from there.
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
    /// The index, from zero.
    pub iteration: usize,
    /// The objective at the iterate, with penalties of soft bounds.
    pub objective: f64,
    /// The residuals of the optimality conditions at the iterate.
    pub residuals: Residuals,
    /// The step length; zero in the last iteration, and if the iterate is unchanged since the line
    /// search or the QP failed.
    pub step: f64,
    /// QP iterations; zero for an interior point, printed as `-`.
    pub qp_iterations: usize,
    /// The regularisation of the Hessian: the inertia correction
    /// ([`Convexification::Reduced`](crate::ocp::Convexification); `δ_w` of an interior point), or
    /// damping.
    pub regularisation: f64,
    /// Whether hard bounds have penalties: elastic mode or restoration phase.
    pub elastic: bool,
    /// Whether the step has a second-order correction.
    pub corrected: bool,
    /// Whether the guess was perturbed, since the gradient of a violated constraint vanishes there.
    /// Set in the first iteration.
    pub perturbed: bool,
    /// The barrier parameter `μ`; zero in sequential quadratic programming.
    pub barrier: f64,
    /// The times of the parts.
    pub times: Times,
}

/// A row of the table that [`Log`] prints, without the end of the line, for an observer that shows
/// the progress of a run.
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
            "{:4} {:17.9e} {:11.2e} {:9.2e} {:9.2e} {:9.2e} {:9.2e}{mark} {:8.1e} ",
            self.iteration,
            self.objective,
            stationarity,
            dynamics,
            inequalities,
            complementarity,
            self.step,
            self.regularisation,
        )?;
        // An interior point has Newton steps instead of QPs.
        match self.barrier > 0.0 {
            true => f.write_str("     -")?,
            false => write!(f, "{:6}", self.qp_iterations)?,
        }
        let Times { linearise, qp, search } = self.times;
        write!(f, " {:8.3} {:8.3} {:10.3}", 1e3 * linearise, 1e3 * qp, 1e3 * search)
    }
}

/// Iterations, printed as a table. Marks after the step length are explained below it.
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
            writeln!(f, "e: elastic mode or restoration phase: hard bounds have penalties")?;
        }
        if self.0.iter().any(|i| i.corrected && !i.elastic) {
            writeln!(f, "s: second-order correction")?;
        }
        if self.0.iter().any(|i| i.perturbed) {
            writeln!(
                f,
                "warning: the gradient of a violated constraint vanishes at the guess; the guess was perturbed"
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;
    use alloc::vec::Vec;

    /// The lines below the rows.
    fn explained_marks(rows: &[Iteration]) -> Vec<alloc::string::String> {
        Log(rows).to_string().lines().skip(1 + rows.len()).map(ToString::to_string).collect()
    }

    #[test]
    fn an_interior_point_has_no_iterations_of_qps() {
        let plain = Iteration::default();
        let row = |row: Iteration| row.to_string().split_whitespace().nth(8).map(ToString::to_string);
        assert_eq!(row(Iteration { qp_iterations: 7, ..plain }).as_deref(), Some("7"));
        assert_eq!(row(Iteration { barrier: 1e-9, ..plain }).as_deref(), Some("-"));
        // The columns are aligned.
        let length = |row: Iteration| row.to_string().len();
        assert_eq!(length(plain), length(Iteration { barrier: 0.1, ..plain }));
    }

    #[test]
    fn marks_are_explained_where_they_occur() {
        let plain = Iteration::default();
        let elastic = Iteration { elastic: true, corrected: true, ..plain };
        let corrected = Iteration { corrected: true, ..plain };
        assert!(explained_marks(&[plain]).is_empty());
        assert_eq!(
            explained_marks(&[plain, elastic]),
            ["e: elastic mode or restoration phase: hard bounds have penalties"]
        );
        assert_eq!(
            explained_marks(&[corrected, elastic]),
            [
                "e: elastic mode or restoration phase: hard bounds have penalties",
                "s: second-order correction"
            ]
        );
    }
}
