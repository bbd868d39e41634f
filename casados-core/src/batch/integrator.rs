//! The public interface to batches.

use super::batch_output::BatchOutput;
use super::chunk::{BatchTask, IntervalChunk, Sink, lanes_per_group, try_resize};
use super::error::BatchError;
use super::intervals::{BatchInputs, Intervals};
use super::single::{Single, Standard};
use super::statistics::BatchStatistics;
#[cfg(feature = "parallel")]
use super::worker::run_parallel;
use super::worker::{Worker, default_threads};
use crate::error::{Argument, Error};
use crate::finite::check_model_input;
use crate::integrator::Integrator as Alone;
use crate::model::{Dae, VectorX, VectorZ};
use crate::options::{Newton, Options, Start};
use crate::result::{Adjoint, Forward, ForwardAdjoint, Hessian, Nominal};
use crate::shape::Matrix;
use crate::tableau::{Custom, Tableau};
use alloc::vec::Vec;
use bytemuck::Zeroable;

/// Start values `ẋ` and `z`.
type StartValues<I> =
    (VectorX<<I as Alone>::Model, <I as Alone>::Number>, VectorZ<<I as Alone>::Model, <I as Alone>::Number>);

/// Weights `λ` of the final states, and `ν` of the initial algebraic states.
pub(crate) type Weights<'a, I> = (
    Option<&'a [VectorX<<I as Alone>::Model, <I as Alone>::Number>]>,
    Option<&'a [VectorZ<<I as Alone>::Model, <I as Alone>::Number>]>,
);

/// Integrates many intervals of one model with the method of the integrator `I`; see
/// [`Batch`](super::Batch).
///
/// Every call writes one result for each interval to the caller's slice. A failed interval is
/// reported with the error of a single call; its element of the slice remains unchanged, and the
/// other intervals are not affected.
///
/// # Errors
/// Every call: [`BatchError::Length`], [`BatchError::OutOfMemory`] before anything is computed;
/// [`BatchError::Intervals`] if intervals failed.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// let mut batch = Batch::<Cart, Gauss<2>>::new(Options::default())?;
/// // Four intervals of 0.5 s, each with a start and an acceleration of its own.
/// let x0 = [0.0, 1.0, 2.0, 3.0].map(|speed| vector![0.0, speed]);
/// let u = [4.0, 2.0, 0.0, -2.0].map(|u| vector![u]);
/// let mut ends = vec![casados::result::Nominal::default(); 4];
/// batch.solve(&Intervals { x0: &x0, u: &u, h: &[0.5], ..Default::default() }, &mut ends)?;
/// for ((x0, u), end) in x0.iter().zip(&u).zip(&ends) {
///     assert!((end.x[1] - (x0[1] + 0.5 * u[0])).abs() < 1e-14);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Integrator<I: Single> {
    options: Options,
    tableau: I::Tableau,
    /// One worker for each thread.
    workers: Vec<Worker<I>>,
    threads: usize,
    start_values: Option<StartValues<I>>,
    status: Vec<Result<(), Error>>,
    /// The stages of every step of every interval; `has_stages` is whether they are valid.
    stages: Vec<I::Stages>,
    has_stages: Vec<bool>,
    /// Whether stages are also stored without a warm start; `reuses_solutions` is whether they are
    /// solutions.
    stores_stages: bool,
    reuses_solutions: bool,
    statistics: BatchStatistics,
}

impl<I: Standard> Integrator<I> {
    /// Returns a batch for any number of intervals.
    ///
    /// # Errors
    /// [`Error::InvalidOption`]
    pub fn new(options: Options) -> Result<Self, Error> {
        Self::build(options, I::TABLEAU)
    }
}

impl<I: Single<Method = Custom<S>, Tableau = Tableau<S>>, const S: usize> Integrator<I> {
    /// Returns a batch for a user-defined tableau.
    ///
    /// # Errors
    /// [`Error::InvalidOption`]; [`Error::NoInterpolation`] if the model has algebraic states and
    /// two nodes are equal; [`Error::NotExplicit`] for an implicit tableau of an explicit method.
    pub fn with_tableau(options: Options, tableau: Tableau<S>) -> Result<Self, Error> {
        Self::build(options, tableau)
    }
}

impl<I: Single> core::fmt::Debug for Integrator<I> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let model = I::Model::STRUCTURE.name;
        f.debug_struct("Batch").field("model", &model).field("options", &self.options).finish_non_exhaustive()
    }
}

/// Copies options and start values. The copy has its own memory, which is empty until its first
/// call.
impl<I: Single> Clone for Integrator<I> {
    fn clone(&self) -> Self {
        Self {
            options: self.options,
            tableau: self.tableau,
            workers: self.workers.iter().take(1).map(Worker::clone_settings).collect(),
            threads: self.threads,
            start_values: self.start_values,
            status: Vec::new(),
            stages: Vec::new(),
            has_stages: Vec::new(),
            stores_stages: false,
            reuses_solutions: false,
            statistics: BatchStatistics::default(),
        }
    }
}

impl<I: Single> Integrator<I> {
    fn build(options: Options, tableau: I::Tableau) -> Result<Self, Error> {
        let mut workers = Vec::new();
        workers.try_reserve(1).map_err(|_| Error::OutOfMemory { bytes: size_of::<Worker<I>>() })?;
        workers.push(Worker::new(&options, &tableau)?);
        Ok(Self {
            options,
            tableau,
            workers,
            threads: default_threads(),
            start_values: None,
            status: Vec::new(),
            stages: Vec::new(),
            has_stages: Vec::new(),
            stores_stages: false,
            reuses_solutions: false,
            statistics: BatchStatistics::default(),
        })
    }

    /// Sets start values `ẋ` and `z` of Newton's method, at all stages of all intervals; they
    /// replace the nominal values of the model. They are not read by explicit methods or with
    /// [`Start::Zero`], and with [`Start::Warm`] only without a warm start.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]; the last values remain valid.
    pub fn set_start(
        &mut self,
        xdot: &VectorX<I::Model, I::Number>,
        z: &VectorZ<I::Model, I::Number>,
    ) -> Result<(), Error> {
        check_model_input::<I::Model, I::Number>(Argument::StartXdot, xdot.as_slice())?;
        check_model_input::<I::Model, I::Number>(Argument::StartZ, z.as_slice())?;
        self.start_values = Some((*xdot, *z));
        Ok(())
    }

    /// Sets the number of threads; the default is that of rayon. Results do not depend on it, bit
    /// for bit.
    #[cfg(feature = "parallel")]
    pub fn set_threads(&mut self, threads: usize) {
        self.threads = threads.max(1);
    }

    /// Discards the warm start.
    pub fn reset(&mut self) {
        self.has_stages.fill(false);
    }

    /// Makes all following calls store their stages. With `reuse_as_solutions`, the inputs of the
    /// following calls equal those of the last one: stored stages of successful intervals are then
    /// solutions, which are only differentiated.
    pub(crate) fn store_stages(&mut self, reuse_as_solutions: bool) {
        (self.stores_stages, self.reuses_solutions) = (true, reuse_as_solutions);
    }

    /// Returns the options.
    #[must_use]
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// Returns the statistics of the last call.
    #[must_use]
    pub fn statistics(&self) -> &BatchStatistics {
        &self.statistics
    }

    /// Returns the outcome of an interval in the last call.
    ///
    /// # Errors
    /// Those of a single call; [`Error::NoResult`] if the interval does not exist.
    pub fn status(&self, interval: usize) -> Result<(), Error> {
        self.status.get(interval).copied().unwrap_or(Err(Error::NoResult))
    }

    /// Computes `x₊`, and `z` at both ends of every interval.
    ///
    /// # Errors
    /// See [`Integrator`].
    pub fn solve(
        &mut self,
        intervals: &Intervals<'_, I::Model, I::Number>,
        results: &mut [Nominal<I::Model, I::Number>],
    ) -> Result<(), BatchError> {
        self.run(&BatchInputs::new(intervals, None, None, results.len())?, results, None)
    }

    /// Computes the solutions, and their derivatives with respect to `x₀`, `u` and `p`.
    ///
    /// # Errors
    /// See [`Integrator`].
    pub fn forward(
        &mut self,
        intervals: &Intervals<'_, I::Model, I::Number>,
        results: &mut [Forward<I::Model, I::Number>],
    ) -> Result<(), BatchError> {
        self.run(&BatchInputs::new(intervals, None, None, results.len())?, results, None)
    }

    /// Computes the solutions, and the gradients of `λᵀx₊` with respect to `x₀`, `u` and `p`; one
    /// `λ` for each interval, or one for all.
    ///
    /// # Errors
    /// See [`Integrator`].
    pub fn adjoint(
        &mut self,
        intervals: &Intervals<'_, I::Model, I::Number>,
        lambda: &[VectorX<I::Model, I::Number>],
        results: &mut [Adjoint<I::Model, I::Number>],
    ) -> Result<(), BatchError> {
        self.run(&BatchInputs::new(intervals, Some(lambda), None, results.len())?, results, None)
    }

    /// Computes the solutions, their derivatives, and the gradients of `λᵀx₊`.
    ///
    /// # Errors
    /// See [`Integrator`].
    pub fn forward_adjoint(
        &mut self,
        intervals: &Intervals<'_, I::Model, I::Number>,
        lambda: &[VectorX<I::Model, I::Number>],
        results: &mut [ForwardAdjoint<I::Model, I::Number>],
    ) -> Result<(), BatchError> {
        self.run(&BatchInputs::new(intervals, Some(lambda), None, results.len())?, results, None)
    }

    /// Computes the solutions, their derivatives, and the gradients and Hessians of `λᵀx₊`.
    ///
    /// # Errors
    /// See [`Integrator`].
    pub fn hessian(
        &mut self,
        intervals: &Intervals<'_, I::Model, I::Number>,
        lambda: &[VectorX<I::Model, I::Number>],
        results: &mut [Hessian<I::Model, I::Number>],
    ) -> Result<(), BatchError> {
        self.run(&BatchInputs::new(intervals, Some(lambda), None, results.len())?, results, None)
    }

    /// Computes the solutions, their derivatives, and the gradients and Hessians of `λᵀx₊ + νᵀz₀`,
    /// with the algebraic states `z₀` at the starts of the intervals; one `ν` for each interval, or
    /// one for all.
    ///
    /// # Errors
    /// See [`Integrator`].
    ///
    /// ```
    /// # use casados_core::{Batch, BatchError, Gauss, Dae, Intervals, model::{VectorX, VectorZ}, result::Hessian};
    /// # fn example<Crane: Dae>(batch: &mut Batch<Crane, Gauss<2>>, intervals: &Intervals<Crane>, lambda: &[VectorX<Crane, f64>], nu: &[VectorZ<Crane, f64>]) -> Result<(), BatchError> {
    /// let mut results = vec![Hessian::default(); intervals.x0.len()];
    /// batch.hessian_with_z0(intervals, lambda, nu, &mut results)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn hessian_with_z0(
        &mut self,
        intervals: &Intervals<'_, I::Model, I::Number>,
        lambda: &[VectorX<I::Model, I::Number>],
        nu: &[VectorZ<I::Model, I::Number>],
        results: &mut [Hessian<I::Model, I::Number>],
    ) -> Result<(), BatchError> {
        self.run(&BatchInputs::new(intervals, Some(lambda), Some(nu), results.len())?, results, None)
    }

    /// Returns an integrator of single intervals that solves for the stages, even if stages of this
    /// batch are [lifted](Options::lifted).
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub(crate) fn single_integrator(&self) -> Result<I, Error> {
        let newton = Newton { fixed_iterations: None, ..self.options.newton };
        let mut single = I::of(&Options { newton, ..self.options }, &self.tableau)?;
        if let Some((xdot, z)) = &self.start_values {
            single.give([xdot.as_slice(), z.as_slice()])?;
        }
        Ok(single)
    }

    /// Sets the stages of an interval in the last call as warm start of such an integrator, if they
    /// are stored.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub(crate) fn warm_start_single(&self, interval: usize, single: &mut I) -> Result<(), Error> {
        let stages = self.stages.chunks_exact(self.options.steps).nth(interval);
        let warm = self.has_stages.get(interval) == Some(&true) && self.options.start == Start::Warm;
        single.start(stages.filter(|_| warm), false)
    }

    /// Computes the results of any mode, with weights `λ` and `ν` or empty ones, and passes them to
    /// `sink` in order, up to the first failed interval. With one thread `result_buffer` has the
    /// size of one group, so that it stays in the caches.
    ///
    /// # Errors
    /// See [`Integrator`].
    pub(crate) fn for_each_result<R: BatchOutput<I::Model, I::Number> + Zeroable>(
        &mut self,
        intervals: &Intervals<'_, I::Model, I::Number>,
        (lambda, nu): Weights<'_, I>,
        result_buffer: &mut Vec<R>,
        sink: Sink<'_, R>,
    ) -> Result<(), BatchError> {
        let inputs = &BatchInputs::new(intervals, lambda, nu, intervals.x0.len())?;
        let buffer_length = if self.threads == 1 { self.group_sizes::<R>()[0] } else { inputs.len() };
        try_resize(result_buffer, buffer_length.min(inputs.len()), Zeroable::zeroed())?;
        self.run(inputs, result_buffer, Some(sink))
    }

    /// Returns the number of intervals per group for an output, and the number of intervals that
    /// are simulated together before each is differentiated alone: models that are too large to be
    /// differentiated in SIMD lanes may still be simulated in them.
    fn group_sizes<R: BatchOutput<I::Model, I::Number>>(&self) -> [usize; 2] {
        let lacks_start_values =
            I::IS_ITERATIVE && self.options.start == Start::Given && self.start_values.is_none();
        match if lacks_start_values { 1 } else { lanes_per_group::<I, R>(&self.options) } {
            1 if I::IS_ITERATIVE && !lacks_start_values => {
                [1, lanes_per_group::<I, Nominal<I::Model, I::Number>>(&self.options)]
            }
            lanes => [lanes, 1],
        }
    }

    fn run<R: BatchOutput<I::Model, I::Number>>(
        &mut self,
        inputs: &BatchInputs<'_, I::Model, I::Number>,
        results: &mut [R],
        sink: Option<Sink<'_, R>>,
    ) -> Result<(), BatchError> {
        let (count, steps) = (inputs.len(), self.options.steps);
        self.status.clear();
        try_resize(&mut self.status, count, Ok(()))?;
        if I::IS_ITERATIVE && (self.options.start == Start::Warm || self.stores_stages) {
            try_resize(&mut self.has_stages, count, false)?;
            try_resize(&mut self.stages, count.saturating_mul(steps), Zeroable::zeroed())?;
        }
        let [lanes, simulated] = self.group_sizes::<R>();
        let (options, tableau) = (&self.options, &self.tableau);
        let start_values = self.start_values.as_ref().map(|(xdot, z)| [xdot.as_slice(), z.as_slice()]);
        let task = BatchTask {
            inputs,
            options,
            tableau,
            start_values,
            lanes,
            simulation_lanes: simulated,
            reuses_solutions: self.reuses_solutions,
        };
        let threads = self.threads;
        let chunk = IntervalChunk {
            first_interval: 0,
            results: &mut *results,
            status: &mut self.status,
            stages: &mut self.stages,
            has_stages: &mut self.has_stages,
        };
        match (sink, self.workers.first_mut()) {
            (Some(sink), Some(worker)) if threads == 1 => worker.for_each_result(&task, chunk, sink),
            (sink, _) => {
                #[cfg(feature = "parallel")]
                run_parallel(&task, &mut self.workers, threads, chunk)?;
                #[cfg(not(feature = "parallel"))]
                if let Some(worker) = self.workers.first_mut() {
                    worker.run(&task, chunk);
                }
                let good = results.iter().zip(&self.status).take_while(|(_, status)| status.is_ok());
                if let Some(sink) = sink {
                    good.enumerate().for_each(|(interval, (result, _))| sink(interval, result));
                }
            }
        }
        self.statistics = BatchStatistics::default();
        for worker in &mut self.workers {
            self.statistics.add(&core::mem::take(&mut worker.statistics));
        }
        let mut failures = self.status.iter().enumerate().filter_map(|(i, status)| Some((i, status.err()?)));
        match failures.next() {
            Some((first, error)) => {
                self.statistics.failed = 1 + failures.count();
                Err(BatchError::Intervals { failed: self.statistics.failed, first, error })
            }
            None => Ok(()),
        }
    }
}
