//! The preparation and the feedback phase of a real-time iteration.

use super::contraction::{Contraction, Convergence};
use super::real_time::{IterationResult, RealTime};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::problem::Formulation;
use crate::ocp::formulation::program::curvature::Curvature;
use crate::qp::{QpSolver, QpStatistics, StageDims};
use crate::scalar::Real;

/// A prepared QP, which lacks only the state; see [`RealTime`].
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(20, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// let mut controller = HeapRealTime::new(ocp)?;
/// // Integrations and derivatives are done here, before the state is known.
/// let prepared = controller.prepare()?;
/// // One QP is left.
/// let feedback = prepared.feedback(&[0.8])?;
/// assert!(feedback.statistics.iterations > 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Prepared<'a, P, S, C, T, D, M> {
    pub(super) controller: &'a mut RealTime<P, S, C, T, D, M>,
}

/// The control to apply if the feedback fails; see [`Prepared::feedback_or`].
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(20, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// let mut controller = HeapRealTime::new(ocp)?;
/// let last = [0.3];
/// // The measurement is broken: the control before is held.
/// let prepared = controller.prepare()?;
/// let (u, feedback) = prepared.feedback_or(&[f64::NAN], &mut || false, Fallback::Control(&last));
/// assert!(u == [0.3] && feedback.is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fallback<'u, T> {
    /// The first control of the plan: the shifted plan of the last sample.
    Plan,
    /// This control: that of another controller or of an emergency stop, or the last one, which is
    /// held.
    Control(&'u [T]),
}

/// The result of the feedback phase.
///
/// ```
/// # use casados::ocp::{HeapRealTime, HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(10, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// let mut controller = HeapRealTime::new(ocp)?;
/// let feedback = controller.prepare()?.feedback(&[0.8])?;
/// // The law of the linear-quadratic regulator: nearly -0.618 x.
/// assert!((feedback.u[0] + 0.618 * 0.8).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Feedback<'a, T> {
    /// The control to apply: the first one of the plan.
    pub u: &'a [T],
    /// Statistics of the QP, or of the last one if there were several.
    pub statistics: QpStatistics,
    /// Iterations of sequential quadratic programming in this sample.
    pub iterations: usize,
    /// The inertia correction of the Hessian; see
    /// [`Convexification::Reduced`](crate::ocp::Convexification::Reduced).
    pub regularisation: f64,
    /// Residuals, the step size and the contraction; `None` for a controller without a monitor
    /// ([`HeapRealTime::monitored`](crate::ocp::HeapRealTime::monitored)).
    pub convergence: Option<Convergence>,
}

impl<T> Feedback<'_, T> {
    /// Whether iterations diverge: the plan does not approach a solution; see
    /// [`ContractionTest`](crate::ocp::ContractionTest).
    #[must_use]
    pub fn is_diverging(&self) -> bool {
        self.convergence.is_some_and(|convergence| convergence.contraction == Contraction::Diverging)
    }
}

impl<P: Formulation<T>, S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>
    RealTime<P, S, C, T, D, M>
where
    C: Curvature<P::Dynamics, T>,
{
    /// The preparation phase: linearises at the plan, before the state is known.
    ///
    /// # Errors
    /// [`OcpError::Missing`], [`OcpError::NonFiniteFunction`], [`OcpError::Integration`]
    pub fn prepare(&mut self) -> Result<Prepared<'_, P, S, C, T, D, M>, OcpError> {
        self.linearise()?;
        Ok(Prepared { controller: self })
    }
}

impl<'a, P: Formulation<T>, S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>
    Prepared<'a, P, S, C, T, D, M>
where
    C: Curvature<P::Dynamics, T>,
{
    /// The feedback phase: solves the QP with this initial state.
    ///
    /// # Errors
    /// [`OcpError::Length`], [`OcpError::InvalidValue`], [`OcpError::NonFiniteDerivative`],
    /// [`OcpError::Qp`]
    pub fn feedback(self, x0: &[T]) -> Result<Feedback<'a, T>, OcpError> {
        self.feedback_until(x0, &mut || false)
    }

    /// [`Prepared::feedback`] with a deadline; see [`QpSolver::solve_until`].
    ///
    /// # Errors
    /// The errors of [`Prepared::feedback`], and [`OcpError::Qp`] with
    /// [`QpError::OutOfTime`](crate::qp::QpError::OutOfTime): the plan is unchanged then, and its
    /// first control may be applied.
    ///
    /// # Example
    /// ```
    /// # use casados::ocp::*;
    /// # use casados::prelude::*;
    /// use casados::qp::QpError;
    /// # #[function]
    /// # fn push(x: f64, u: f64) -> f64 { x + u }
    /// # #[function]
    /// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
    /// # let mut ocp = Problem::new(Map::<Push, f64>::new())
    /// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
    /// #     .on(Horizon::uniform(20, 0.1))?;
    /// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
    /// let mut controller = HeapRealTime::new(ocp)?;
    /// let late = controller.prepare()?.feedback_until(&[0.8], &mut || true);
    /// assert!(matches!(late, Err(OcpError::Qp(QpError::OutOfTime { .. }))));
    /// assert_eq!(controller.ocp().stage(0)?.u, [0.0]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn feedback_until(
        self,
        x0: &[T],
        deadline_passed: &mut dyn FnMut() -> bool,
    ) -> Result<Feedback<'a, T>, OcpError> {
        let step = self.controller.iterate(x0, deadline_passed)?;
        self.feedback_from(step, 1)
    }

    /// [`Prepared::feedback_until`], which always returns a control: that of the feedback, or the
    /// fallback after an error.
    pub fn feedback_or(
        self,
        x0: &[T],
        deadline_passed: &mut dyn FnMut() -> bool,
        fallback: Fallback<'a, T>,
    ) -> (&'a [T], Result<Feedback<'a, T>, OcpError>) {
        let result = self.controller.iterate(x0, deadline_passed);
        let controller = &*self.controller;
        let plan = controller.ocp.stage(0).map_or(&[][..], |first| first.u);
        match (result, fallback) {
            (Ok(step), _) => (plan, Ok(step.into_feedback(plan, 1))),
            (Err(error), Fallback::Plan) => (plan, Err(error)),
            (Err(error), Fallback::Control(u)) => (u, Err(error)),
        }
    }

    /// [`Prepared::feedback_until`] with several iterations of sequential quadratic programming for
    /// the same state: until residuals are within the tolerance of the
    /// [`ContractionTest`](crate::ocp::ContractionTest), the number of iterations is
    /// `max_iterations`, or the deadline has passed. The plan is that of the last complete
    /// iteration.
    ///
    /// # Errors
    /// The errors of [`Prepared::feedback_until`] in the first iteration.
    ///
    /// # Example
    /// ```
    /// # use casados::ocp::*;
    /// # use casados::prelude::*;
    /// # #[ode]
    /// # fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], x[0].sin() + u] }
    /// # #[function]
    /// # fn all(x: [f64; 2], u: f64) -> [f64; 3] { [x[0], x[1], u] }
    /// # let mut ocp = Problem::new(Irk::<Pendulum, Gauss<2>>::new(Options::default())?)
    /// #     .stage_cost(LeastSquaresCost::<All>::diagonal(&[1.0; 3]))
    /// #     .on(Horizon::uniform(20, 0.1))?;
    /// # ocp.fix_initial_state(&[1.0, 0.0])?.guess(&[1.0, 0.0], &[0.0])?;
    /// let mut controller = HeapRealTime::new(ocp)?;
    /// // A clock is a closure: `|| Instant::now() > deadline`, or a counter of cycles.
    /// let feedback = controller.prepare()?.feedback_iterated(&[1.0, 0.0], 50, &mut || false)?;
    /// assert!(feedback.iterations > 1 && feedback.iterations < 50);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn feedback_iterated(
        self,
        x0: &[T],
        max_iterations: usize,
        deadline_passed: &mut dyn FnMut() -> bool,
    ) -> Result<Feedback<'a, T>, OcpError> {
        let mut step = self.controller.iterate(x0, deadline_passed)?;
        let mut iterations = 1;
        while iterations < max_iterations && !deadline_passed() {
            let controller = &mut *self.controller;
            if controller.linearise().is_err() {
                break;
            }
            controller.ocp.fix_initial_state(x0)?;
            let (residuals, _) = controller.ocp.residuals();
            if residuals.largest() <= controller.contraction_test.tolerance {
                break;
            }
            let Ok(next) = controller.iterate(x0, deadline_passed) else { break };
            (step, iterations) = (next, iterations + 1);
        }
        self.feedback_from(step, iterations)
    }

    fn feedback_from(self, step: IterationResult, iterations: usize) -> Result<Feedback<'a, T>, OcpError> {
        let controller = self.controller;
        Ok(step.into_feedback(controller.ocp.stage(0)?.u, iterations))
    }
}

impl IterationResult {
    fn into_feedback<T>(self, u: &[T], iterations: usize) -> Feedback<'_, T> {
        let Self { statistics, regularisation, convergence } = self;
        Feedback { u, statistics, iterations, regularisation, convergence }
    }
}
