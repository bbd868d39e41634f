//! Many problems of one formulation at once, solved and differentiated.
//!
//! | | |
//! | --- | --- |
//! | `real_time` | real-time iterations of many plants |
//! | `derivatives` | adjoints, gradients of values and forward derivatives of all |
//! | `gradients` | what adjoints and gradients of values are |

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
/// bounds, guess, outcome and derivatives: for learning the weights of a controller, runs with
/// uncertain parameters, many starts.
///
/// The instances are problems as any other: what is different about each is said to itself. With
/// the feature `parallel` they are shared among the threads of rayon, and each thread takes the
/// next instance when it is free. Iterates and outcomes are those of single solves to the bit,
/// whatever the number of threads; an instance that fails says so by itself, and leaves the others
/// as they are. Memory is allocated by [`BatchOcp::new`] and by the first call of a kind.
///
/// `S` is the solver: [`HeapSqp`], [`HeapIpm`](crate::ocp::HeapIpm), or an [`OcpSolver`] of one's
/// own.
///
/// # Example
/// A mass is pushed towards zero, from many places.
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
    /// How many threads share the instances at most; as many as rayon has by default.
    pub threads: usize,
    /// The barrier parameter of smoothed derivatives, see
    /// [`SolutionFactors::smoothing`]; zero by default.
    pub smoothing: T,
    instances: Vec<HeapOcp<P, T>>,
    outcomes: Vec<Result<Outcome, OcpError>>,
    /// One for each thread.
    workers: Vec<Worker<S, T>>,
    gradient_memory: GradientMemory<T>,
    /// Of every instance; none until they are asked for.
    sensitivities: Vec<Sensitivities<T>>,
    statuses: Vec<Result<(), OcpError>>,
}

/// What a thread works with.
#[derive(Clone)]
struct Worker<S, T> {
    solver: S,
    /// Factors of a solution, and a seed, if derivatives were asked for.
    adjoint: Option<(SolutionFactors<T>, HeapSolution<T>)>,
}

impl<P, S, T> BatchOcp<P, S, T>
where
    P: Formulation<T> + Clone + Send + Sync,
    S: OcpSolver<P, T>,
    T: Real,
{
    /// As many instances as that of a problem, with its bounds, data and iterate, and a solver.
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

    /// The instances, to be looked at: their iterates are the solutions.
    #[must_use]
    pub fn instances(&self) -> &[HeapOcp<P, T>] {
        &self.instances
    }

    /// The instances, to be changed: initial states, parameters, references, bounds, guesses.
    pub fn instances_mut(&mut self) -> &mut [HeapOcp<P, T>] {
        &mut self.instances
    }

    /// Changes the solver: its options, for all instances.
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

    /// Solves all instances, each from its own iterate: the outcome of each, as a single solve has
    /// it.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]: nothing was solved. Errors of an instance are its outcome.
    pub fn solve(&mut self) -> Result<&[Result<Outcome, OcpError>], OcpError> {
        let threads = self.prepare_workers()?;
        reset_list(&mut self.outcomes, self.instances.len(), || Ok(Outcome::new()))?;
        let workers = self.workers.get_mut(..threads).unwrap_or_default();
        each(workers, self.instances.iter_mut().zip(&mut self.outcomes), |worker, (ocp, outcome)| {
            *outcome = worker.solver.solve(ocp);
        });
        Ok(&self.outcomes)
    }

    /// The outcomes of the last [`BatchOcp::solve`]; empty before the first one.
    pub fn outcomes(&self) -> &[Result<Outcome, OcpError>] {
        &self.outcomes
    }

    /// The number of workers: one for each thread.
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

/// As many as that, all new.
fn reset_list<V>(list: &mut Vec<V>, count: usize, value: impl FnMut() -> V) -> Result<(), OcpError> {
    list.clear();
    try_reserve(list, count)?;
    list.resize_with(count, value);
    Ok(())
}
