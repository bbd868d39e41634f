//! Closed loops of a controller and a plant.

use crate::integrator::Integrator;
use crate::model::VectorP;
pub use crate::ocp::feedback::closed_record::ClosedLoop;
use crate::ocp::feedback::closed_record::Recorder;
use crate::ocp::feedback::real_time::HeapRealTime;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::dynamics::vector;
use crate::ocp::formulation::instance::HeapOcp;
use crate::ocp::formulation::problem::Formulation;
use crate::ocp::formulation::program::curvature::Curvature;
use crate::ocp::nlp::ocp_solver::OcpSolver;
use crate::ocp::nlp::stopwatch::Stopwatch;
use crate::qp::{QpSolver, copy_common, each, threads, try_reserve, zeros};
use crate::scalar::Real;
use crate::shape::{Matrix as _, Shape};
use alloc::vec::Vec;

/// A sample of a closed loop.
///
/// ```
/// use casados::ocp::Sample;
///
/// /// A push of the plant, in the twentieth sample.
/// fn push(sample: Sample<f64>, x: &mut [f64]) {
///     if sample.index == 20 {
///         x[1] += 1.0;
///     }
/// }
/// # let _: fn(Sample<f64>, &mut [f64]) = push;
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Sample<T> {
    /// The index of the sample, from zero.
    pub index: usize,
    /// The time of its start; the first one is zero.
    pub time: T,
    /// Its length: the first interval of the controller's horizon.
    pub length: T,
}

/// A controller, which computes a control for each state: [`HeapRealTime`], by one iteration in
/// each sample; or a problem with a solver, `(ocp, sqp)`, by its solution. A user's own controller
/// may filter measurements, or change references and parameters before it calls another one.
///
/// ```
/// use casados::ocp::{Controller, Formulation, HeapOcp, OcpError};
///
/// /// A controller that sees the state as a broken sensor shows it.
/// struct Stuck<K>(K);
///
/// impl<P: Formulation<f64>, K: Controller<P, f64>> Controller<P, f64> for Stuck<K> {
///     fn control(&mut self, x: &[f64], u: &mut [f64]) -> Result<(), OcpError> {
///         let mut seen = x.to_vec();
///         seen[0] = seen[0].clamp(-0.5, 0.5);
///         self.0.control(&seen, u)
///     }
///     fn problem(&mut self) -> &mut HeapOcp<P> {
///         self.0.problem()
///     }
/// }
/// ```
pub trait Controller<P, T: Real> {
    /// Writes the control for a state, and prepares the next sample.
    ///
    /// # Errors
    /// The errors of the solver; the loop then holds the last control.
    fn control(&mut self, x: &[T], u: &mut [T]) -> Result<(), OcpError>;

    /// The problem; the costs and constraints of its first stage are recorded.
    fn problem(&mut self) -> &mut HeapOcp<P, T>;
}

impl<P: Formulation<T>, S: QpSolver<T>, C: Curvature<P::Dynamics, T>, T: Real> Controller<P, T>
    for HeapRealTime<P, S, C, T>
{
    fn control(&mut self, x: &[T], u: &mut [T]) -> Result<(), OcpError> {
        copy_common(u, self.prepare()?.feedback(x)?.u);
        self.shift();
        Ok(())
    }
    fn problem(&mut self) -> &mut HeapOcp<P, T> {
        self.ocp_mut()
    }
}

impl<P: Formulation<T>, S: OcpSolver<P, T>, T: Real> Controller<P, T> for (HeapOcp<P, T>, S) {
    fn control(&mut self, x: &[T], u: &mut [T]) -> Result<(), OcpError> {
        let (ocp, solver) = self;
        ocp.fix_initial_state(x)?;
        if !solver.solve(ocp)?.is_solved() {
            return Err(OcpError::NoSolution);
        }
        copy_common(u, ocp.stage(0)?.u);
        ocp.shift();
        Ok(())
    }
    fn problem(&mut self) -> &mut HeapOcp<P, T> {
        &mut self.0
    }
}

/// A plant for [`closed_loop`]: an integrator with its own parameters.
///
/// ```
/// # use casados::ocp::{HeapRealTime, Horizon, LeastSquaresCost, Problem, closed_loop, plant};
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// /// A mass on a spring; the controller and the plant do not agree about its stiffness.
/// #[ode]
/// fn spring(x: [f64; 2], u: f64, p: f64) -> [f64; 2] { [x[1], u - p * x[0]] }
/// #[function]
/// fn all(x: [f64; 2], u: f64, _p: f64) -> [f64; 3] { [x[0], x[1], u] }
///
/// let mut ocp = Problem::new(Erk::<Spring, Rk4>::new(Options::default())?)
///     .running_cost(LeastSquaresCost::<All>::diagonal(&[1.0, 0.1, 0.1]))
///     .on(Horizon::uniform(20, 0.1))?;
/// ocp.fix_initial_state(&[1.0, 0.0])?.set_parameters(.., &[1.0])?.guess(&[0.0; 2], &[0.0])?;
/// let mut controller = HeapRealTime::new(ocp)?;
/// let mut erk = Erk::<Spring, Rk4>::new(Options { steps: 2, ..Default::default() })?;
/// let run = closed_loop(&mut controller, plant(&mut erk, &vector![1.3]), |_, _| {}, &[1.0, 0.0], 60)?;
/// assert!(run.trajectory.state("x[0]")?[60].abs() < 0.02);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
// A closure has no name, and an alias cannot name its trait.
#[allow(clippy::type_complexity)]
pub fn plant<I: Integrator>(
    integrator: &mut I,
    p: &VectorP<I::Model, I::Number>,
) -> impl FnMut(Sample<I::Number>, &[I::Number], &mut [I::Number]) -> Result<(), OcpError> {
    let p = *p;
    move |sample, u, x| {
        integrator.set_parameters(&p)?;
        integrator.set_time(sample.time)?;
        let end = integrator.solve(&vector(x), &vector(u), sample.length)?;
        copy_common(x, end.x.as_slice());
        Ok(())
    }
}

/// Simulates a closed loop: in each sample the controller computes a control for the state, the
/// plant is integrated with it, and the disturbance changes the end state.
///
/// `plant(sample, u, x)` replaces the state at the start of the sample by that at its end;
/// [`plant`] creates one from an integrator. `disturbance(sample, x)` then changes it; `|_, _| {}`
/// does nothing. If the controller fails, the last control is held, zero at first;
/// [`ClosedLoop::failures`] has the errors.
///
/// Costs, bounds and path constraints are those of the first stage of the controller's problem, at
/// the actual states and controls.
///
/// # Errors
/// [`OcpError::Length`] if the state has another dimension; [`OcpError::Unsupported`] if costs or
/// constraints depend on algebraic states; errors of the plant; [`OcpError::NonFiniteFunction`] if
/// a cost is not finite; [`OcpError::OutOfMemory`].
///
/// # Example
/// ```
/// use casados::ocp::{HeapRealTime, Horizon, LeastSquaresCost, Problem, closed_loop, plant};
/// use casados::prelude::*;
/// use nalgebra::SVector;
///
/// /// A pendulum that stands at zero: angle, rate.
/// #[ode]
/// fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u + 9.81 * x[0].sin()] }
/// #[function]
/// fn deviation(x: [f64; 2], u: f64) -> [f64; 3] { [x[0], x[1], u] }
///
/// let mut ocp = Problem::new(Erk::<Pendulum, Rk4>::new(Options::default())?)
///     .running_cost(LeastSquaresCost::<Deviation>::diagonal(&[10.0, 0.1, 0.01]))
///     .on(Horizon::uniform(20, 0.05))?;
/// ocp.fix_initial_state(&[0.3, 0.0])?.bound("u", .., -6.0, 6.0)?.guess(&[0.0; 2], &[0.0])?;
/// let mut controller = HeapRealTime::new(ocp)?;
/// let mut erk = Erk::<Pendulum, Rk4>::new(Options { steps: 4, ..Default::default() })?;
/// let push = |sample: casados::ocp::Sample<f64>, x: &mut [f64]| {
///     if sample.index == 20 {
///         x[1] += 0.5;
///     }
/// };
/// let run = closed_loop(&mut controller, plant(&mut erk, &SVector::zeros()), push, &[0.3, 0.0], 80)?;
/// assert!(run.failures.is_empty() && run.trajectory.state("x[0]")?[80].abs() < 1e-3);
/// assert!(run.trajectory.violations(1e-6).is_empty());
/// println!("{} in all\n{}", run.cost(), run.trajectory.csv());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn closed_loop<P: Formulation<T>, T: Real>(
    controller: &mut impl Controller<P, T>,
    mut plant: impl FnMut(Sample<T>, &[T], &mut [T]) -> Result<(), OcpError>,
    mut disturbance: impl FnMut(Sample<T>, &mut [T]),
    x0: &[T],
    samples: usize,
) -> Result<ClosedLoop<T>, OcpError> {
    let (mut x, mut u) = (zeros(P::Shape::NX)?, zeros(P::Shape::NU)?);
    let mut recorder = Recorder::new(controller.problem(), x0, samples)?;
    copy_common(&mut x, x0);
    let length = recorder.sample_length;
    for index in 0..samples {
        let sample = Sample { index, time: T::from_whole(index) * length, length };
        let mut watch = Stopwatch::start();
        let result = controller.control(&x, &mut u);
        let duration = watch.lap();
        recorder.record(controller.problem(), [&x, &u], (result, duration))?;
        plant(sample, &u, &mut x)?;
        disturbance(sample, &mut x);
    }
    recorder.finish(controller.problem(), &x)
}

/// Runs many closed loops, or other simulations. `make` creates the data of a thread, and `run`
/// uses them with the index of the run. With the feature `parallel` the threads of rayon share the
/// runs. Results are in the order of the runs; they are independent of the number of threads if
/// each run initialises its data.
///
/// # Errors
/// The errors of `make`, and [`OcpError::OutOfMemory`].
///
/// # Example
/// ```
/// use casados::ocp::{HeapRealTime, Horizon, LeastSquaresCost, Map, Problem, closed_loop, closed_loops};
/// use casados::prelude::*;
///
/// #[function]
/// fn push(x: f64, u: f64) -> f64 { x + u }
/// #[function]
/// fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
///
/// let make = || {
///     let mut ocp = Problem::new(Map::<Push, f64>::new())
///         .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
///         .on(Horizon::uniform(10, 1.0))?;
///     ocp.fix_initial_state(&[1.0])?.guess(&[0.0], &[0.0])?;
///     HeapRealTime::new(ocp)
/// };
/// // Plants that are pushed by less or more than the controller believes.
/// let runs = closed_loops(100, make, |controller, run| {
///     controller.reset();
///     controller.ocp_mut().guess(&[0.0], &[0.0])?;
///     let gain = 0.5 + 0.01 * run as f64;
///     let plant = |_, u: &[f64], x: &mut [f64]| {
///         x[0] += gain * u[0];
///         Ok(())
///     };
///     closed_loop(controller, plant, |_, _| {}, &[1.0], 40)
/// })?;
/// let worst = runs.iter().flatten().map(|run| run.cost()).fold(0.0, f64::max);
/// // With half of the push x₊ = 0.691 x, at a cost of ½ · 1.382 x² in each sample: 1.32 in all.
/// assert!(runs.len() == 100 && runs.iter().all(Result::is_ok) && (worst - 1.32).abs() < 0.01);
/// # Ok::<(), casados::ocp::OcpError>(())
/// ```
pub fn closed_loops<W: Send, R: Send>(
    count: usize,
    make: impl Fn() -> Result<W, OcpError>,
    run: impl Fn(&mut W, usize) -> R + Sync,
) -> Result<Vec<R>, OcpError> {
    let (mut workers, mut results): (Vec<W>, Vec<Option<R>>) = (Vec::new(), Vec::new());
    let threads = threads(count);
    try_reserve(&mut workers, threads)?;
    for _ in 0..threads.min(count) {
        workers.push(make()?);
    }
    try_reserve(&mut results, count)?;
    results.resize_with(count, || None);
    each(&mut workers, results.iter_mut().enumerate(), |worker, (index, result)| {
        *result = Some(run(worker, index));
    });
    Ok(results.into_iter().flatten().collect())
}
