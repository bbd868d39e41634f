//! Multi-start: solutions from several guesses.

use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::HeapOcp;
use crate::ocp::formulation::problem::Formulation;
use crate::ocp::solution::outcome::Outcome;
use crate::qp::{HeapSolution, nan_max};
use crate::scalar::Real;
use alloc::vec::Vec;
use core::cmp::Ordering;

/// The outcomes of all starts, best first; see [`Ocp::multi_start`](crate::ocp::Ocp::multi_start).
///
/// ```
/// # use casados::ocp::{GeneralCost, HeapOcp, HeapSqp, Horizon, Map, Problem};
/// # use casados::prelude::*;
/// # #[function]
/// # fn constant(x: f64) -> f64 { x }
/// # /// Two minima: 0.23 at −0.97, and −0.23 at 1.03.
/// # #[function]
/// # fn valleys(x: f64) -> f64 { (x * x - 1.0) * (x * x - 1.0) - 0.23 * x }
/// # let mut ocp = Problem::new(Map::<Constant, f64>::new())
/// #     .terminal_cost(GeneralCost::<Valleys>::new())
/// #     .on(Horizon::uniform(1, 1.0))?;
/// # ocp.free_initial_state();
/// # let starts = [-1.5, -0.8, 1.2];
/// let found = ocp.multi_start(
///     starts.len(),
///     |ocp, start| ocp.guess(&[starts[start]], &[]).map(|_| ()),
///     |ocp| {
///         let mut sqp = HeapSqp::new(ocp)?;
///         Ok(move |ocp: &mut HeapOcp<_>| sqp.solve(ocp))
///     },
/// )?;
/// let best = found.best().ok_or("no start ends at a solution")?;
/// assert!((best.objective + 0.23).abs() < 0.01);
/// // Of the other valley both starts know.
/// assert_eq!(found.ranked.len(), 3);
/// assert!(found.ranked[1..].iter().all(|start| start.solution.stages().all(|stage| stage.x[0] < 0.0)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct MultiStart<T> {
    /// Solutions by objective, then other points by residual, then errors.
    pub ranked: Vec<StartOutcome<T>>,
}

/// The outcome of one start.
///
/// ```
/// # use casados::ocp::{GeneralCost, HeapOcp, HeapSqp, Horizon, Map, Problem};
/// # use casados::prelude::*;
/// # #[function]
/// # fn constant(x: f64) -> f64 { x }
/// # /// Two minima: 0.23 at −0.97, and −0.23 at 1.03.
/// # #[function]
/// # fn valleys(x: f64) -> f64 { (x * x - 1.0) * (x * x - 1.0) - 0.23 * x }
/// # let mut ocp = Problem::new(Map::<Constant, f64>::new())
/// #     .terminal_cost(GeneralCost::<Valleys>::new())
/// #     .on(Horizon::uniform(1, 1.0))?;
/// # ocp.free_initial_state();
/// # let starts = [-1.5, -0.8, 1.2];
/// let found = ocp.multi_start(
///     starts.len(),
///     |ocp, start| ocp.guess(&[starts[start]], &[]).map(|_| ()),
///     |ocp| {
///         let mut sqp = HeapSqp::new(ocp)?;
///         Ok(move |ocp: &mut HeapOcp<_>| sqp.solve(ocp))
///     },
/// )?;
/// for start in &found.ranked {
///     match &start.outcome {
///         Ok(outcome) => println!("start {}: {outcome}", start.start),
///         Err(error) => println!("start {}: {error}", start.start),
///     }
/// }
/// // Another local solution as the iterate: the second best one.
/// ocp.iterate_mut().clone_from(&found.ranked[1].solution);
/// assert!(ocp.stage(0)?.x[0] < 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct StartOutcome<T> {
    /// The index of the start.
    pub start: usize,
    /// The outcome of its run.
    pub outcome: Result<Outcome, OcpError>,
    /// The last point of the run, for [`Ocp::iterate_mut`](crate::ocp::Ocp::iterate_mut).
    pub solution: HeapSolution<T>,
}

impl<T> MultiStart<T> {
    /// The best outcome, if it is a solution.
    #[must_use]
    pub fn best(&self) -> Option<&Outcome> {
        let outcome = self.ranked.first()?.outcome.as_ref().ok()?;
        outcome.is_solved().then_some(outcome)
    }
}

impl<T> StartOutcome<T> {
    /// The rank of a start: its kind, then a number to be minimised.
    fn rank(&self) -> (u8, f64) {
        match &self.outcome {
            Ok(outcome) if outcome.is_solved() => (0, outcome.objective),
            Ok(outcome) => (1, nan_max(outcome.residuals.largest(), 0.0)),
            Err(_) => (2, 0.0),
        }
    }
    fn compare(&self, other: &Self) -> Ordering {
        let ((kind, value), (other_kind, other_value)) = (self.rank(), other.rank());
        kind.cmp(&other_kind).then(value.total_cmp(&other_value)).then(self.start.cmp(&other.start))
    }
}

impl<P: Formulation<T> + Clone + Send + Sync, T: Real> HeapOcp<P, T> {
    /// Solves the problem from each of `starts` guesses, and makes the best solution the iterate.
    ///
    /// `guess` writes the guess of a start. `solver` creates a solver, one for each thread: with
    /// the feature `parallel` threads share the starts, with the same outcomes. Solutions are local
    /// minima; the best one need not be the global minimum.
    ///
    /// # Errors
    /// The errors of `solver`, and [`OcpError::OutOfMemory`]. Errors of a start are its outcome.
    ///
    /// # Example
    /// ```
    /// use casados::ocp::{GeneralCost, HeapOcp, HeapSqp, Horizon, Map, Problem};
    /// use casados::prelude::*;
    ///
    /// #[function]
    /// fn constant(x: f64) -> f64 { x }
    /// /// Two minima: 0.23 at −0.97, and −0.23 at 1.03.
    /// #[function]
    /// fn valleys(x: f64) -> f64 { (x * x - 1.0) * (x * x - 1.0) - 0.23 * x }
    ///
    /// let mut ocp = Problem::new(Map::<Constant, f64>::new())
    ///     .terminal_cost(GeneralCost::<Valleys>::new())
    ///     .on(Horizon::uniform(1, 1.0))?;
    /// ocp.free_initial_state();
    /// let starts = [-1.5, -0.8, 1.2];
    /// let found = ocp.multi_start(
    ///     starts.len(),
    ///     |ocp, start| ocp.guess(&[starts[start]], &[]).map(|_| ()),
    ///     |ocp| {
    ///         let mut sqp = HeapSqp::new(ocp)?;
    ///         Ok(move |ocp: &mut HeapOcp<_>| sqp.solve(ocp))
    ///     },
    /// )?;
    /// assert_eq!(found.ranked[0].start, 2);
    /// assert!(found.best().is_some() && ocp.stage(0)?.x[0] > 1.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn multi_start<S>(
        &mut self,
        starts: usize,
        guess: impl Fn(&mut Self, usize) -> Result<(), OcpError> + Sync,
        solver: impl Fn(&Self) -> Result<S, OcpError> + Sync,
    ) -> Result<MultiStart<T>, OcpError>
    where
        S: FnMut(&mut Self) -> Result<Outcome, OcpError>,
    {
        let template = &*self;
        let solve_share = |thread: usize, threads: usize| -> Result<Vec<StartOutcome<T>>, OcpError> {
            let mut ocp = template.clone();
            let mut solve = solver(&ocp)?;
            let mut outcomes = Vec::new();
            for start in (thread..starts).step_by(threads) {
                let outcome = guess(&mut ocp, start).and_then(|()| solve(&mut ocp));
                outcomes.push(StartOutcome { start, outcome, solution: ocp.iterate.clone() });
            }
            Ok(outcomes)
        };
        let mut ranked = run_on_threads(starts, solve_share)?;
        ranked.sort_by(StartOutcome::compare);
        if let Some(best) = ranked.first() {
            self.iterate.copy_from(&best.solution);
        }
        Ok(MultiStart { ranked })
    }
}

/// Runs the shares of all threads.
#[cfg(feature = "parallel")]
fn run_on_threads<R: Send>(
    starts: usize,
    solve_share: impl Fn(usize, usize) -> Result<Vec<R>, OcpError> + Sync,
) -> Result<Vec<R>, OcpError> {
    use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};
    let threads = rayon::current_num_threads().min(starts).max(1);
    let shares = (0..threads).into_par_iter().map(|thread| solve_share(thread, threads));
    Ok(shares.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
}

/// Runs all starts on the only thread.
#[cfg(not(feature = "parallel"))]
fn run_on_threads<R>(
    _starts: usize,
    share: impl Fn(usize, usize) -> Result<Vec<R>, OcpError>,
) -> Result<Vec<R>, OcpError> {
    share(0, 1)
}
