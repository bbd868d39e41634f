//! The real-time iteration: of sequential quadratic programming one full step in each sample, cut
//! in two where the state becomes known (M. Diehl, H. G. Bock, J. P. Schlöder, "A real-time
//! iteration scheme for nonlinear optimization in optimal feedback control", SIAM J. Control Optim.
//! 43, 2005).
//!
//! ```text
//! prepare      linearise at the plan (x̄, ū): all integrations and derivatives; nothing of it depends on the state
//! feedback(x)  solve the QP with x_0 = x: its first control is applied, its solution is the next plan
//! ```

use crate::ocp::assembly::curvature::{Curvature, GaussNewton};
use crate::ocp::formulation::error::OcpError;
#[cfg(feature = "alloc")]
use crate::ocp::formulation::instance::HeapOcp;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::problem::Formulation;
#[cfg(feature = "alloc")]
use crate::qp::{HeapInteriorPoint, HeapSolution};
use crate::qp::{QpSolver, QpStart, QpStatistics, Solution, StageDims};
use crate::scalar::Real;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;

/// A controller that takes one step of sequential quadratic programming in each sample.
///
/// Its order is that of its types: [`RealTime::prepare`] gives what alone has `feedback`, which
/// takes it away.
///
/// ```
/// # use casados_core::ocp::{Curvature, Formulation, OcpError, RealTime};
/// # use casados_core::qp::{QpSolver, StageDims};
/// # fn f<P: Formulation<f64>, S: QpSolver<f64>, C: Curvature<P::Dynamics, f64>, D: AsRef<[StageDims]>, M: AsRef<[f64]> + AsMut<[f64]>>(
/// #     mut controller: RealTime<P, S, C, f64, D, M>, measure: fn() -> [f64; 4], apply: fn(&[f64]),
/// # ) -> Result<(), OcpError> {
/// loop {
///     let prepared = controller.prepare()?; // while the last control acts
///     let feedback = prepared.feedback(&measure())?;
///     apply(feedback.u);
///     controller.shift();
/// }
/// # }
/// ```
///
/// Feedback without a preparation of its own does not compile:
///
/// ```compile_fail,E0382
/// # use casados_core::ocp::{Curvature, Formulation, OcpError, RealTime};
/// # use casados_core::qp::{QpSolver, StageDims};
/// # fn f<P: Formulation<f64>, S: QpSolver<f64>, C: Curvature<P::Dynamics, f64>, D: AsRef<[StageDims]>, M: AsRef<[f64]> + AsMut<[f64]>>(
/// #     mut controller: RealTime<P, S, C, f64, D, M>, measure: fn() -> [f64; 4],
/// # ) -> Result<(), OcpError> {
/// let prepared = controller.prepare()?;
/// prepared.feedback(&measure())?;
/// prepared.feedback(&measure())?; // of a linearisation that is not there any more
/// # Ok(())
/// # }
/// ```
///
/// ```compile_fail,E0599
/// # use casados_core::ocp::{Curvature, Formulation, OcpError, RealTime};
/// # use casados_core::qp::{QpSolver, StageDims};
/// # fn f<P: Formulation<f64>, S: QpSolver<f64>, C: Curvature<P::Dynamics, f64>, D: AsRef<[StageDims]>, M: AsRef<[f64]> + AsMut<[f64]>>(
/// #     mut controller: RealTime<P, S, C, f64, D, M>, measure: fn() -> [f64; 4],
/// # ) -> Result<(), OcpError> {
/// controller.feedback(&measure())?;
/// # Ok(())
/// # }
/// ```
///
/// Between two samples the plan may be followed with the gains of its QP, `gains` (feature `alloc`)
/// of [`RealTime::ocp`]: `u_k + K_k (x − x_k)`.
///
/// Shared controls are found anew in each sample, and periodic states end where the state of the
/// sample is.
///
/// What a sample takes is bounded by the options of the solver of QPs: `max_iterations`, and
/// `locate` switched off. After any error the plan is as it was before the call.
pub struct RealTime<P, S, C, T, D, M> {
    /// The Hessian.
    pub curvature: C,
    /// The solver of QPs.
    pub qp_solver: S,
    ocp: Ocp<P, T, D, M>,
    solution: Solution<T, D, M>,
    /// Whether the plan has the multipliers of a QP before.
    warm: bool,
}

/// A controller with its memory on the heap.
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
/// let mut x = 1.0;
/// for _ in 0..20 {
///     x += controller.prepare()?.feedback(&[x])?.u[0];
///     controller.shift();
/// }
/// assert!(x.abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[cfg(feature = "alloc")]
pub type HeapRealTime<P, S = HeapInteriorPoint, C = GaussNewton, T = f64> =
    RealTime<P, S, C, T, Vec<StageDims>, Vec<T>>;

/// A QP that waits for the state; see [`RealTime`].
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
pub struct Prepared<'a, P, S, T, D, M> {
    qp_solver: &'a mut S,
    ocp: &'a mut Ocp<P, T, D, M>,
    solution: &'a mut Solution<T, D, M>,
    warm: &'a mut bool,
}

/// What is to be done now.
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
    /// The control to be applied: the first of the plan.
    pub u: &'a [T],
    /// What the QP took.
    pub statistics: QpStatistics,
}

#[cfg(feature = "alloc")]
impl<P: Formulation<T>, T: Real> HeapRealTime<P, HeapInteriorPoint<T>, GaussNewton, T> {
    /// A controller for a problem whose iterate is the first plan, with the library's own solver of
    /// QPs and the Hessian of Gauss and Newton.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn new(ocp: HeapOcp<P, T>) -> Result<Self, OcpError> {
        let solution = HeapSolution::new(ocp.qp().dims())?;
        Ok(Self::with(ocp, HeapInteriorPoint::new(), solution))
    }
}

impl<'a, P: Formulation<T>, S: QpSolver<T>, T: Real>
    RealTime<P, S, GaussNewton, T, &'a [StageDims], &'a mut [T]>
{
    /// How many numbers a controller takes beside its problem and its solver of QPs.
    #[must_use]
    pub const fn memory(dims: &[StageDims]) -> usize {
        Solution::<T, (), ()>::memory(dims)
    }

    /// A controller for a problem of these dimensions whose iterate is the first plan, in given
    /// memory of [`RealTime::memory`] numbers.
    ///
    /// # Errors
    /// [`OcpError::Qp`] if memory or dimensions do not fit.
    pub fn in_memory(
        ocp: Ocp<P, T, &'a [StageDims], &'a mut [T]>,
        qp_solver: S,
        dims: &'a [StageDims],
        memory: &'a mut [T],
    ) -> Result<Self, OcpError> {
        Ok(Self::with(ocp, qp_solver, Solution::in_memory(dims, memory)?))
    }
}

impl<P: Formulation<T>, S: QpSolver<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>
    RealTime<P, S, GaussNewton, T, D, M>
{
    fn with(ocp: Ocp<P, T, D, M>, qp_solver: S, solution: Solution<T, D, M>) -> Self {
        Self { curvature: GaussNewton::default(), qp_solver, ocp, solution, warm: false }
    }
}

impl<P: Formulation<T>, S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>
    RealTime<P, S, C, T, D, M>
where
    C: Curvature<P::Dynamics, T>,
{
    /// Linearises at the plan: everything that can be done before the state is known.
    ///
    /// # Errors
    /// [`OcpError::Missing`], [`OcpError::NonFiniteFunction`], [`OcpError::Integration`]
    pub fn prepare(&mut self) -> Result<Prepared<'_, P, S, T, D, M>, OcpError> {
        self.ocp.join_controls();
        self.ocp.join_states();
        self.ocp.linearise(self.curvature)?;
        let Self { qp_solver, ocp, solution, warm, .. } = self;
        Ok(Prepared { qp_solver, ocp, solution, warm })
    }

    /// The plan one interval earlier, for the next sample.
    pub fn shift(&mut self) {
        self.ocp.shift();
    }

    /// The problem, with the plan as its iterate.
    #[must_use]
    pub fn ocp(&self) -> &Ocp<P, T, D, M> {
        &self.ocp
    }

    /// The problem, with the plan as its iterate, to be changed: references, bounds, the plan
    /// itself.
    pub fn ocp_mut(&mut self) -> &mut Ocp<P, T, D, M> {
        &mut self.ocp
    }

    /// The next QP starts cold.
    pub fn reset(&mut self) {
        self.warm = false;
    }
}

impl<'a, P: Formulation<T>, S: QpSolver<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>
    Prepared<'a, P, S, T, D, M>
{
    /// Solves the QP with this state at its start.
    ///
    /// # Errors
    /// [`OcpError::Length`], [`OcpError::InvalidValue`], [`OcpError::NonFiniteDerivative`],
    /// [`OcpError::Qp`]
    pub fn feedback(self, x0: &[T]) -> Result<Feedback<'a, T>, OcpError> {
        self.feedback_until(x0, &mut || false)
    }

    /// As [`Prepared::feedback`], until the time is over; see [`QpSolver::solve_until`].
    ///
    /// # Errors
    /// As [`Prepared::feedback`], and [`OcpError::Qp`] with
    /// [`QpError::OutOfTime`](crate::qp::QpError::OutOfTime): then the first control of the plan,
    /// which is as it was, is what is left to apply.
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
        over: &mut dyn FnMut() -> bool,
    ) -> Result<Feedback<'a, T>, OcpError> {
        let Self { qp_solver, ocp, solution, warm } = self;
        ocp.fix_initial_state(x0)?;
        solution.copy_from(&ocp.iterate);
        let start = if *warm { QpStart::Warm } else { QpStart::Cold };
        let statistics = qp_solver
            .solve_until(ocp.qp(), start, solution.view_mut(), over)
            .map_err(|error| ocp.derivative(&error).unwrap_or_else(|| error.into()))?;
        *warm = true;
        core::mem::swap(&mut ocp.iterate, solution);
        Ok(Feedback { u: ocp.stage(0)?.u, statistics })
    }
}
