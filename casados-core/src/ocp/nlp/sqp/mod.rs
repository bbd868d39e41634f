//! Sequential quadratic programming.
//!
//! ```text
//! linearise at (x̄, ū)  →  QP with the exact Hessian, or that of Gauss and Newton  →  step
//! ```
//!
//! | | |
//! | --- | --- |
//! | `bound_multipliers` | multipliers of active bounds, where distances are rounded |
//! | `multipliers` | least-squares multipliers, where costs have no curvature |
//! | `attempts` | the attempts at an iterate |
//! | `direction` | the QP: inertia correction, elastic mode |
//! | `line_search` | the step length, by the `merit_function` or a filter (`acceptance`) |
//! | `scaling` | the QP in units |
//! | `run` | the iterations, and the end of a run |
//! | `restart` | the second attempt, from a simulation |

mod acceptance;
mod attempts;
mod bound_multipliers;
mod direction;
mod line_search;
mod merit_function;
mod multipliers;
mod options;
mod restart;
mod run;
mod run_state;
mod scaling;

pub use options::{Globalisation, SqpOptions};

use crate::ocp::formulation::error::{OcpError, Part};
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::{Exact, GaussNewton};
use crate::ocp::nlp::elastic_mode;
#[cfg(feature = "alloc")]
use crate::ocp::solution::log::{Iteration, Log};
#[cfg(feature = "alloc")]
use crate::qp::HeapInteriorPoint;
use crate::qp::{Solution, StageDims};
use crate::scalar::Real;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;

/// Sequential quadratic programming with the QP solver `S` and the Hessian `C`: [`Exact`], or
/// [`GaussNewton`] by [`Sqp::gauss_newton`].
///
/// Exact Hessians converge for all costs. Gauss-Newton Hessians are cheaper and need no second
/// derivatives of the dynamics. They converge about as fast if costs are least squares with small
/// residuals at the solution, as in tracking; otherwise they may diverge.
///
/// The memory is that of one problem; other problems must have the same dimensions.
///
/// # Errors
/// [`OcpError`] if a run cannot start: invalid data, or dynamics that cannot be integrated at the
/// first iterate. Otherwise the end of the run is the `status` of its
/// [`Outcome`](crate::ocp::Outcome).
///
/// # Example
/// ```
/// use casados::ocp::{GeneralCost, HeapSqp, Horizon, Problem};
/// use casados::prelude::*;
///
/// /// A cart on a rail that is pushed: position m, velocity m/s; acceleration m/s².
/// #[ode]
/// fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// #[function]
/// fn effort(_x: [f64; 2], u: f64) -> f64 { 0.5 * u * u }
///
/// let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
///     .running_cost(GeneralCost::<Effort>::new())
///     .on(Horizon::uniform(10, 0.1))?;
/// ocp.fix_initial_state(&[0.0, 0.0])?.bound("x[0]", 10.., 1.0, 1.0)?.guess(&[0.0, 0.0], &[0.0])?;
/// let mut sqp = HeapSqp::new(&ocp)?;
/// sqp.options.tolerance = 1e-9;
/// let outcome = sqp.solve(&mut ocp)?;
/// // A linear-quadratic problem: one step, and one that finds nothing to do.
/// assert!(outcome.is_converged() && outcome.iterations <= 2);
/// println!("{}{outcome}", sqp.log());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Sqp<S, C, T, D, M> {
    /// Options, which may be changed between runs.
    pub options: SqpOptions,
    /// The Hessian.
    pub curvature: C,
    /// The QP solver.
    pub qp_solver: S,
    /// The solution of a QP.
    qp_solution: Solution<T, D, M>,
    /// The trial point of the line search.
    trial_point: Solution<T, D, M>,
    /// The best iterate.
    best_iterate: Solution<T, D, M>,
    /// The weights of constraints in the merit function, in place of their multipliers. Its
    /// variables store the guess.
    violation_weights: Solution<T, D, M>,
    /// Ends of intervals and constraints at trial points, then the saved penalties, then the units
    /// of rows.
    workspace: M,
    #[cfg(feature = "alloc")]
    log: Vec<Iteration>,
}

/// Sequential quadratic programming with memory on the heap.
///
/// Created by `HeapSqp::new(&ocp)?`; [`Sqp`] has the methods, and an example.
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # #[function]
/// # fn effort(_x: [f64; 2], u: f64) -> f64 { u }
/// # let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
/// #     .running_cost(LeastSquaresCost::<Effort>::diagonal(&[1.0]))
/// #     .on(Horizon::uniform(10, 0.1))?;
/// # ocp.fix_initial_state(&[0.0, 0.0])?.bound("x[0]", 10.., 1.0, 1.0)?;
/// # ocp.guess(&[0.0, 0.0], &[0.0])?;
/// let mut sqp = HeapSqp::new(&ocp)?; // exact Hessians; `.gauss_newton()` after it takes others
/// assert!(sqp.solve(&mut ocp)?.is_converged());
/// // The velocity at the end is free: the push falls along a line, from 20/7 in the first
/// // interval.
/// assert!((ocp.stage(0)?.u[0] - 20.0 / 7.0).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[cfg(feature = "alloc")]
pub type HeapSqp<S = HeapInteriorPoint, C = Exact, T = f64> = Sqp<S, C, T, Vec<StageDims>, Vec<T>>;

#[cfg(feature = "alloc")]
impl<T: Real> HeapSqp<HeapInteriorPoint<T>, Exact, T> {
    /// Creates a solver for a problem, with the library's QP solver and exact Hessians.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn new<P: Program<T>>(
        ocp: &crate::ocp::formulation::instance::HeapOcp<P, T>,
    ) -> Result<Self, OcpError> {
        let mut solver = HeapInteriorPoint::new();
        // QPs are scaled already.
        solver.options.scaling = false;
        Self::with_solver(ocp, solver)
    }
}

#[cfg(feature = "alloc")]
impl<S, T: Real> HeapSqp<S, Exact, T> {
    /// Creates a solver for a problem, with exact Hessians and a given QP solver, such as
    /// [`Condensing`](crate::qp::Condensing).
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn with_solver<P: Program<T>>(
        ocp: &crate::ocp::formulation::instance::HeapOcp<P, T>,
        qp_solver: S,
    ) -> Result<Self, OcpError> {
        let dims = ocp.qp().dims();
        let length =
            ocp.ends() + elastic_mode::penalty_memory_len(dims) + scaling::unit_memory_len::<T>(dims);
        Ok(Self {
            options: SqpOptions::new::<T>(),
            curvature: Exact::default(),
            qp_solver,
            qp_solution: Solution::new(dims)?,
            trial_point: Solution::new(dims)?,
            best_iterate: Solution::new(dims)?,
            violation_weights: Solution::new(dims)?,
            workspace: crate::qp::zeros(length)?,
            log: Vec::new(),
        })
    }
}

#[cfg(feature = "alloc")]
impl<S, C, T: Real> HeapSqp<S, C, T> {
    /// The iterations of the last run, for printing.
    #[must_use]
    pub fn log(&self) -> Log<'_> {
        Log(&self.log)
    }
}

impl<S, C, T: Real, D, M> Sqp<S, C, T, D, M> {
    /// Replaces the Hessian by that of the Lagrangian with the given convexification.
    #[must_use]
    pub fn exact(self, curvature: Exact) -> Sqp<S, Exact, T, D, M> {
        self.with_curvature(curvature)
    }

    /// Replaces the Hessian by the Gauss-Newton Hessian.
    #[must_use]
    pub fn gauss_newton(self) -> Sqp<S, GaussNewton, T, D, M> {
        self.with_curvature(GaussNewton::default())
    }

    fn with_curvature<N>(self, curvature: N) -> Sqp<S, N, T, D, M> {
        Sqp {
            options: self.options,
            curvature,
            qp_solver: self.qp_solver,
            qp_solution: self.qp_solution,
            trial_point: self.trial_point,
            best_iterate: self.best_iterate,
            violation_weights: self.violation_weights,
            workspace: self.workspace,
            #[cfg(feature = "alloc")]
            log: self.log,
        }
    }
}

impl<'a, S, T: Real> Sqp<S, Exact, T, &'a [StageDims], &'a mut [T]> {
    /// Returns the length of the memory for a problem; `usize::MAX` on overflow.
    #[must_use]
    pub const fn memory<P: Program<T>>(dims: &[StageDims]) -> usize {
        Solution::<T, (), ()>::memory(dims)
            .saturating_mul(4)
            .saturating_add(crate::ocp::formulation::program::ends(dims))
            .saturating_add(elastic_mode::penalty_memory_len(dims))
            .saturating_add(scaling::unit_memory_len::<T>(dims))
    }

    /// Creates a solver for problems of these dimensions, in given memory of [`Sqp::memory`]
    /// numbers.
    ///
    /// # Errors
    /// [`OcpError::Length`]
    pub fn in_memory<P: Program<T>>(
        qp_solver: S,
        dims: &'a [StageDims],
        memory: &'a mut [T],
    ) -> Result<Self, OcpError> {
        let (expected, found) = (Self::memory::<P>(dims), memory.len());
        if found < expected {
            return Err(OcpError::Length { part: Part::Memory, stage: 0, expected, found });
        }
        let length = Solution::<T, (), ()>::memory(dims);
        let (solution, rest) = memory.split_at_mut_checked(length).unwrap_or_default();
        let (trial, rest) = rest.split_at_mut_checked(length).unwrap_or_default();
        let (best, rest) = rest.split_at_mut_checked(length).unwrap_or_default();
        let (weights, rest) = rest.split_at_mut_checked(length).unwrap_or_default();
        let (work, _) = rest.split_at_mut_checked(expected - 4 * length).unwrap_or_default();
        Ok(Self {
            options: SqpOptions::new::<T>(),
            curvature: Exact::default(),
            qp_solver,
            qp_solution: Solution::in_memory(dims, solution)?,
            trial_point: Solution::in_memory(dims, trial)?,
            best_iterate: Solution::in_memory(dims, best)?,
            violation_weights: Solution::in_memory(dims, weights)?,
            workspace: work,
            #[cfg(feature = "alloc")]
            log: Vec::new(),
        })
    }
}
