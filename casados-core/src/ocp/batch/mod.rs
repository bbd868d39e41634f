//! Batches: many problems of one formulation, solved and differentiated in threads.
//!
//! | | |
//! | --- | --- |
//! | `real_time` | real-time iterations for many plants |
//! | `derivatives` | adjoint derivatives, gradients of optimal values, forward derivatives |
//! | `gradients` | the memory of adjoint derivatives and gradients |

mod derivatives;
mod gradients;
mod real_time;

pub use gradients::{Gradient, Gradients};
pub use real_time::{BatchPrepared, BatchRealTime};

use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::HeapOcp;
use crate::ocp::formulation::problem::Formulation;
use crate::ocp::nlp::ocp_solver::OcpSolver;
use crate::ocp::nlp::sqp::HeapSqp;
use crate::ocp::solution::outcome::Outcome;
use crate::ocp::solution::sensitivities::{Sensitivities, SolutionFactors};
use crate::qp::{HeapSolution, each, threads, try_reserve};
use crate::scalar::Real;
use alloc::vec::Vec;
use gradients::GradientMemory;

/// Many problems of one formulation, each with its own initial state, parameters, references,
/// bounds, guess, outcome and derivatives: to learn the weights of a controller, for scenarios with
/// uncertain parameters, or for multi-start.
///
/// Each instance is an [`Ocp`](crate::ocp::Ocp); set its data there. With the feature `parallel`
/// the threads of rayon share the instances: each thread takes the next instance when it is idle.
/// Iterates and outcomes are bitwise those of single solves, for any number of threads. A failed
/// instance has an error as its outcome, and does not affect the others. [`BatchOcp::new`] and the
/// first call of each kind allocate memory.
///
/// `S` is the solver: [`HeapSqp`], [`HeapIpm`](crate::ocp::HeapIpm), or a user-defined
/// [`OcpSolver`].
///
/// # Example
/// A mass is pushed towards zero from many initial positions.
/// ```
/// use casados::ocp::{BatchOcp, Exact, HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
/// use casados::prelude::*;
///
/// #[function]
/// fn push(x: f64, u: f64) -> f64 { x + u }
/// #[function]
/// fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
///
/// let mut ocp = Problem::new(Map::<Push, f64>::new())
///     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
///     .on(Horizon::uniform(20, 0.1))?;
/// ocp.fix_initial_state(&[0.0])?.guess(&[0.0], &[0.0])?;
///
/// let mut batch = BatchOcp::new(&ocp, 100, HeapSqp::new(&ocp)?)?;
/// for (i, instance) in batch.instances_mut().iter_mut().enumerate() {
///     instance.fix_initial_state(&[i as f64])?;
/// }
/// // One that makes no sense says so by itself.
/// batch.instances_mut()[7].iterate_mut().stage_mut(0).ok_or("a stage")?.u[0] = f64::NAN;
/// let outcomes = batch.solve()?;
/// assert!(outcomes[7].is_err() && outcomes.iter().filter(|outcome| outcome.is_ok()).count() == 99);
/// // The law of the linear-quadratic regulator, u = −0.618 x, and its derivative.
/// let u = batch.instances()[50].stage(0)?.u[0];
/// assert!((u + 0.618 * 50.0).abs() < 0.01);
/// let gradients = batch.adjoint(Exact::default(), |_, _, seed| {
///     seed.stage_mut(0).into_iter().for_each(|stage| stage.u[0] = 1.0); // of the first control
/// })?;
/// assert!((gradients.get(50)?.x0[0] + 0.618).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct BatchOcp<P, S = HeapSqp, T = f64> {
    /// The maximum number of threads; by default that of rayon.
    pub threads: usize,
    /// The barrier parameter of smoothed derivatives, see [`SolutionFactors::smoothing`]. Default
    /// 0.
    pub smoothing: T,
    instances: Vec<HeapOcp<P, T>>,
    outcomes: Vec<Result<Outcome, OcpError>>,
    /// A worker for each thread.
    workers: Vec<Worker<S, T>>,
    gradient_memory: GradientMemory<T>,
    /// The derivatives of every instance; empty before the first [`BatchOcp::differentiate`].
    sensitivities: Vec<Sensitivities<T>>,
    statuses: Vec<Result<(), OcpError>>,
}

/// The solver and the memory of a thread.
#[derive(Clone)]
struct Worker<S, T> {
    solver: S,
    /// Factors of a solution, and a seed; none before the first adjoint derivatives.
    adjoint: Option<(SolutionFactors<T>, HeapSolution<T>)>,
}

impl<P, S, T> BatchOcp<P, S, T>
where
    P: Formulation<T> + Clone + Send + Sync,
    S: OcpSolver<P, T>,
    T: Real,
{
    /// Creates `count` instances with the bounds, data and iterate of a problem, and a solver.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn new(ocp: &HeapOcp<P, T>, count: usize, solver: S) -> Result<Self, OcpError> {
        let (mut instances, mut workers) = (Vec::new(), Vec::new());
        try_reserve(&mut instances, count)?;
        instances.resize_with(count, || ocp.clone());
        try_reserve(&mut workers, 1)?;
        workers.push(Worker { solver, adjoint: None });
        Ok(Self {
            threads: usize::MAX,
            smoothing: T::ZERO,
            instances,
            outcomes: Vec::new(),
            workers,
            gradient_memory: GradientMemory::new::<P>(ocp.intervals()),
            sensitivities: Vec::new(),
            statuses: Vec::new(),
        })
    }

    /// Returns the instances; their iterates are the solutions.
    #[must_use]
    pub fn instances(&self) -> &[HeapOcp<P, T>] {
        &self.instances
    }

    /// Returns the instances, to change initial states, parameters, references, bounds and guesses.
    pub fn instances_mut(&mut self) -> &mut [HeapOcp<P, T>] {
        &mut self.instances
    }

    /// Changes the solver and its options, for all instances.
    ///
    /// ```
    /// # use casados::ocp::{BatchOcp, HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
    /// # use casados::prelude::*;
    /// # #[function]
    /// # fn push(x: f64, u: f64) -> f64 { x + u }
    /// # #[function]
    /// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
    /// # let mut ocp = Problem::new(Map::<Push, f64>::new())
    /// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
    /// #     .on(Horizon::uniform(20, 0.1))?;
    /// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
    /// let mut batch = BatchOcp::new(&ocp, 4, HeapSqp::new(&ocp)?)?;
    /// batch.configure(|sqp| sqp.options.max_iterations = 0);
    /// assert!(batch.solve()?.iter().flatten().all(|outcome| !outcome.is_solved()));
    /// # Ok::<(), casados::ocp::OcpError>(())
    /// ```
    pub fn configure(&mut self, change: impl FnMut(&mut S)) {
        self.workers.iter_mut().map(|worker| &mut worker.solver).for_each(change);
    }

    /// Solves all instances, each from its own iterate. Returns the outcome of each, as of a single
    /// solve.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]: nothing was solved. The errors of instances are their outcomes.
    pub fn solve(&mut self) -> Result<&[Result<Outcome, OcpError>], OcpError> {
        let threads = self.prepare_workers()?;
        reset_list(&mut self.outcomes, self.instances.len(), || Ok(Outcome::new()))?;
        let workers = self.workers.get_mut(..threads).unwrap_or_default();
        each(workers, self.instances.iter_mut().zip(&mut self.outcomes), |worker, (ocp, outcome)| {
            *outcome = worker.solver.solve(ocp);
        });
        Ok(&self.outcomes)
    }

    /// Returns the outcomes of the last [`BatchOcp::solve`]; empty before the first one.
    pub fn outcomes(&self) -> &[Result<Outcome, OcpError>] {
        &self.outcomes
    }

    /// Returns the number of workers, one for each thread, after creating missing ones.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    fn prepare_workers(&mut self) -> Result<usize, OcpError> {
        let threads = threads(self.threads.min(self.instances.len()));
        let missing_workers = threads.saturating_sub(self.workers.len());
        try_reserve(&mut self.workers, missing_workers)?;
        while let Some(worker) = self.workers.first().filter(|_| self.workers.len() < threads) {
            let worker = worker.clone();
            self.workers.push(worker);
        }
        Ok(threads)
    }
}

/// Resets a list to `count` new values.
fn reset_list<V>(list: &mut Vec<V>, count: usize, value: impl FnMut() -> V) -> Result<(), OcpError> {
    list.clear();
    try_reserve(list, count)?;
    list.resize_with(count, value);
    Ok(())
}
