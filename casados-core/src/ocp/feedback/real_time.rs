//! The real-time iteration: one full step of sequential quadratic programming in each sample,
//! divided into a preparation phase before the state is known and a feedback phase (M. Diehl, H. G.
//! Bock, J. P. Schlöder, "A real-time iteration scheme for nonlinear optimization in optimal
//! feedback control", SIAM J. Control Optim. 43, 2005).
//!
//! ```text
//! prepare      linearise at the plan (x̄, ū): all integrations and derivatives; nothing of it depends on the state
//! feedback(x)  solve the QP with x_0 = x: its first control is applied, its solution is the next plan
//! ```

use crate::ocp::feedback::contraction::{self, ContractionMonitor, ContractionTest, Convergence};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::error::Part;
#[cfg(feature = "alloc")]
use crate::ocp::formulation::functions::dynamics::SecondOrder;
#[cfg(feature = "alloc")]
use crate::ocp::formulation::instance::HeapOcp;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::problem::Formulation;
use crate::ocp::formulation::program::curvature::Convexification;
#[cfg(feature = "alloc")]
use crate::ocp::formulation::program::curvature::Exact;
use crate::ocp::formulation::program::curvature::{Curvature, GaussNewton};
use crate::ocp::nlp::advanced::InertiaOptions;
use crate::ocp::nlp::inertia_correction::InertiaCorrection;
#[cfg(feature = "alloc")]
use crate::qp::{HeapInteriorPoint, HeapSolution};
use crate::qp::{QpError, QpSolver, QpStart, QpStatistics, Residuals, Solution, StageDims};
use crate::scalar::Real;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;

/// A controller that takes one step of sequential quadratic programming in each sample.
///
/// Types enforce the order of the phases: only the result of [`RealTime::prepare`] has the method
/// `feedback`, which consumes it.
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
/// Feedback without its own preparation does not compile:
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
/// Between two samples the plan may be tracked with the gains of its QP, `u_k + K_k (x − x_k)`:
/// `gains` (feature `alloc`) of [`RealTime::ocp`].
///
/// Shared controls are optimised in each sample. Periodic states end at the state of the sample.
///
/// The Hessian is the Gauss-Newton Hessian ([`HeapRealTime::new`]) or the exact one
/// ([`HeapRealTime::exact`], [`RealTime::with_curvature`]). Nonconvex QPs with exact Hessians have
/// an inertia correction as in [`Sqp`](crate::ocp::Sqp), which may take several QPs; with another
/// [`Convexification`] than [`Convexification::Reduced`] each feedback solves one QP.
///
/// To bound the computation time of a sample, set the options of the QP solver: limit
/// `max_iterations`, and switch `locate` off. After an error the plan is unchanged.
pub struct RealTime<P, S, C, T, D, M> {
    /// The Hessian.
    pub curvature: C,
    /// The QP solver.
    pub qp_solver: S,
    /// The test for divergence.
    pub contraction_test: ContractionTest,
    inertia: InertiaCorrection,
    monitor: Option<ContractionMonitor<P, T, D, M>>,
    pub(super) ocp: Ocp<P, T, D, M>,
    solution: Solution<T, D, M>,
    /// Whether the plan has the multipliers of an earlier QP.
    has_multipliers: bool,
}

/// A controller with memory on the heap.
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

#[cfg(feature = "alloc")]
impl<P: Formulation<T>, T: Real> HeapRealTime<P, HeapInteriorPoint<T>, GaussNewton, T> {
    /// Creates a controller for a problem whose iterate is the first plan, with the library's QP
    /// solver and the Gauss-Newton Hessian.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn new(ocp: HeapOcp<P, T>) -> Result<Self, OcpError> {
        Self::with_heap_memory(ocp, GaussNewton::default())
    }
}

#[cfg(feature = "alloc")]
impl<P: Formulation<T, Dynamics: SecondOrder<T>>, T: Real> HeapRealTime<P, HeapInteriorPoint<T>, Exact, T> {
    /// [`HeapRealTime::new`] with exact Hessians, for plans with large residuals, where
    /// Gauss-Newton iterations may diverge.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    ///
    /// # Example
    /// ```
    /// use casados::ocp::{GeneralCost, HeapRealTime, Horizon, Problem};
    /// use casados::prelude::*;
    ///
    /// /// A wheel: angle and rate, a torque.
    /// #[ode]
    /// fn wheel(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
    /// #[function]
    /// fn price(x: [f64; 2], u: f64) -> f64 { 1.0 - x[0].cos() + 0.1 * x[1] * x[1] + 0.1 * u * u }
    ///
    /// let mut ocp = Problem::new(Irk::<Wheel, Gauss<2>>::new(Options::default())?)
    ///     .running_cost(GeneralCost::<Price>::new())
    ///     .on(Horizon::uniform(20, 0.1))?;
    /// ocp.fix_initial_state(&[1.0, 0.0])?.guess(&[1.0, 0.0], &[0.0])?;
    /// let mut controller = HeapRealTime::exact(ocp)?.monitored()?;
    /// for _ in 0..8 {
    ///     controller.prepare()?.feedback(&[1.0, 0.0])?;
    /// }
    /// let feedback = controller.prepare()?.feedback(&[1.0, 0.0])?;
    /// assert!(feedback.convergence.ok_or("monitored")?.residuals.largest() < 1e-6);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn exact(ocp: HeapOcp<P, T>) -> Result<Self, OcpError> {
        Self::with_heap_memory(ocp, Exact::default())
    }
}

#[cfg(feature = "alloc")]
impl<P: Formulation<T>, C, T: Real> HeapRealTime<P, HeapInteriorPoint<T>, C, T> {
    fn with_heap_memory(ocp: HeapOcp<P, T>, curvature: C) -> Result<Self, OcpError> {
        let dims = ocp.qp().dims();
        let solution = HeapSolution::new(dims)?;
        Ok(Self::from_parts(ocp, HeapInteriorPoint::new(), curvature, solution))
    }
}

#[cfg(feature = "alloc")]
impl<P: Formulation<T>, S, C, T: Real> HeapRealTime<P, S, C, T> {
    /// Adds a monitor of the convergence:
    /// [`Feedback::convergence`](crate::ocp::Feedback::convergence) then has residuals, the step
    /// size and the contraction. It costs one simulation of the horizon in each sample, between two
    /// feedbacks.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn monitored(self) -> Result<Self, OcpError> {
        let dims = self.ocp.qp().dims();
        let [_, ends_len] = contraction::memory_lens::<T>(dims);
        let monitor = ContractionMonitor::new(HeapSolution::new(dims)?, crate::qp::zeros(ends_len)?);
        Ok(Self { monitor: Some(monitor), ..self })
    }
}

impl<'a, P: Formulation<T>, S: QpSolver<T>, T: Real>
    RealTime<P, S, GaussNewton, T, &'a [StageDims], &'a mut [T]>
{
    /// The length of the memory of a controller, without its problem and its QP solver.
    #[must_use]
    pub const fn memory(dims: &[StageDims]) -> usize {
        Solution::<T, (), ()>::memory(dims)
    }

    /// Creates a controller for a problem of these dimensions whose iterate is the first plan, in
    /// given memory of [`RealTime::memory`] numbers.
    ///
    /// # Errors
    /// [`OcpError::Qp`] if memory or dimensions do not fit.
    pub fn in_memory(
        ocp: Ocp<P, T, &'a [StageDims], &'a mut [T]>,
        qp_solver: S,
        dims: &'a [StageDims],
        memory: &'a mut [T],
    ) -> Result<Self, OcpError> {
        let solution = Solution::in_memory(dims, memory)?;
        Ok(Self::from_parts(ocp, qp_solver, GaussNewton::default(), solution))
    }
}

impl<'a, P: Formulation<T>, S, C, T: Real> RealTime<P, S, C, T, &'a [StageDims], &'a mut [T]> {
    /// The length of the memory for [`RealTime::monitored_in`].
    #[must_use]
    pub const fn memory_of_monitor(dims: &[StageDims]) -> usize {
        let [weights_len, ends_len] = contraction::memory_lens::<T>(dims);
        weights_len.saturating_add(ends_len)
    }

    /// [`HeapRealTime::monitored`] in given memory of [`RealTime::memory_of_monitor`] numbers for
    /// the dimensions of the problem.
    ///
    /// # Errors
    /// [`OcpError::Length`], [`OcpError::Qp`] if memory or dimensions do not fit.
    pub fn monitored_in(self, dims: &'a [StageDims], memory: &'a mut [T]) -> Result<Self, OcpError> {
        self.ocp.check_dimensions(dims)?;
        let (expected, found) = (Self::memory_of_monitor(dims), memory.len());
        if found < expected {
            return Err(OcpError::Length { part: Part::Memory, stage: 0, expected, found });
        }
        let [weights, _] = contraction::memory_lens::<T>(dims);
        let (weights, ends) = memory.split_at_mut_checked(weights).unwrap_or_default();
        let monitor = ContractionMonitor::new(Solution::in_memory(dims, weights)?, ends);
        Ok(Self { monitor: Some(monitor), ..self })
    }
}

impl<P: Formulation<T>, S, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>
    RealTime<P, S, C, T, D, M>
{
    fn from_parts(ocp: Ocp<P, T, D, M>, qp_solver: S, curvature: C, solution: Solution<T, D, M>) -> Self {
        Self {
            curvature,
            qp_solver,
            contraction_test: ContractionTest::new::<T>(),
            inertia: InertiaCorrection::new(InertiaOptions::QUADRATIC_PROGRAM),
            monitor: None,
            ocp,
            solution,
            has_multipliers: false,
        }
    }

    /// Replaces the Hessian.
    #[must_use]
    pub fn with_curvature<N>(self, curvature: N) -> RealTime<P, S, N, T, D, M> {
        RealTime {
            curvature,
            qp_solver: self.qp_solver,
            contraction_test: self.contraction_test,
            inertia: self.inertia,
            monitor: self.monitor,
            ocp: self.ocp,
            solution: self.solution,
            has_multipliers: self.has_multipliers,
        }
    }
}

impl<P: Formulation<T>, S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>
    RealTime<P, S, C, T, D, M>
where
    C: Curvature<P::Dynamics, T>,
{
    pub(in crate::ocp) fn linearise(&mut self) -> Result<(), OcpError> {
        self.update_contraction();
        let Self { curvature, monitor, ocp, .. } = self;
        ocp.equalise_shared_controls();
        ocp.equalise_periodic_states();
        ocp.linearise(*curvature)?;
        if let Some(monitor) = monitor {
            monitor.update_residuals(ocp);
        }
        Ok(())
    }

    /// Solves the QP with this initial state, and makes its solution the plan.
    pub(in crate::ocp) fn iterate(
        &mut self,
        x0: &[T],
        deadline_passed: &mut dyn FnMut() -> bool,
    ) -> Result<IterationResult, OcpError> {
        let Self {
            curvature,
            qp_solver,
            contraction_test,
            inertia,
            monitor,
            ocp,
            solution,
            has_multipliers: warm,
        } = self;
        ocp.fix_initial_state(x0)?;
        let start = if *warm { QpStart::Warm } else { QpStart::Cold };
        let mut solve = |ocp: &Ocp<P, T, D, M>| {
            solution.copy_from(&ocp.iterate);
            qp_solver.solve_until(ocp.qp(), start, solution.view_mut(), deadline_passed)
        };
        let mut regularisation = 0.0;
        // Other Hessians are convex, or are used as they are.
        let result = if C::EXACT && curvature.convexification() == Convexification::Reduced {
            let mut statistics = Err(QpError::Stalled { iterations: 0, residuals: Residuals::default() });
            let solve = |ocp: &Ocp<P, T, D, M>| {
                statistics = solve(ocp);
                statistics.map(|_| ())
            };
            ocp.correct_inertia(inertia, &mut regularisation, solve).and(statistics)
        } else {
            solve(ocp)
        };
        let statistics =
            result.map_err(|error| ocp.non_finite_derivative(&error).unwrap_or_else(|| error.into()))?;
        let convergence =
            monitor.as_mut().map(|monitor| monitor.convergence_at_solution(ocp, solution, contraction_test));
        *warm = true;
        core::mem::swap(&mut ocp.iterate, solution);
        Ok(IterationResult { statistics, regularisation, convergence })
    }

    /// Shifts the plan by one interval, for the next sample.
    pub fn shift(&mut self) {
        self.update_contraction();
        self.ocp.shift();
    }

    /// Evaluates the last iteration, before its problem is changed.
    fn update_contraction(&mut self) {
        let Self { contraction_test, monitor, ocp, solution, .. } = self;
        if let Some(monitor) = monitor {
            monitor.update_reductions(ocp, solution, contraction_test);
        }
    }

    /// The problem, with the plan as its iterate.
    #[must_use]
    pub fn ocp(&self) -> &Ocp<P, T, D, M> {
        &self.ocp
    }

    /// The problem, with the plan as its iterate, for changes of references, bounds or the plan.
    pub fn ocp_mut(&mut self) -> &mut Ocp<P, T, D, M> {
        self.update_contraction();
        &mut self.ocp
    }

    /// Resets the controller: the next QP starts cold, and the contraction is unknown.
    pub fn reset(&mut self) {
        self.has_multipliers = false;
        if let Some(monitor) = &mut self.monitor {
            monitor.reset();
        }
    }
}

/// The result of an iteration.
pub(in crate::ocp) struct IterationResult {
    pub statistics: QpStatistics,
    pub regularisation: f64,
    pub convergence: Option<Convergence>,
}
