//! Nonlinear interior-point method with the structure of optimal control.
//!
//! ```text
//! min  f(v) − μ Σ log s        c(v) = 0,  σ (g(v) − bound) = s        μ → 0
//! ```
//!
//! | | |
//! | --- | --- |
//! | `run`, `iteration` | the loop, and one iteration |
//! | `kkt/initial_point`, `multipliers` | the initial point and its multipliers |
//! | `kkt/newton`, `direction` | Newton's equations (Riccati recursion), and their regularisation |
//! | `kkt/barrier_function`, `line_search` | barrier function, filter line search |
//! | `kkt/scaling` | the objective unit, and the scaling by multipliers |
//! | `barrier`, `predictor` | updates of `μ`, and the affine-scaling step that predicts `μ` |
//! | `restoration` | restoration phase, elastic mode, restart from a simulation, verdicts |
//! | `violations` | whether violations are stationary |
//! | `lifted_stages` | steps of stages that are variables |
//!
//! The algorithm is that of Wächter and Biegler, Math. Program. 106 (2006). The Riccati recursion
//! determines the inertia: the reduced Hessian is positive definite if `M_uu` of every stage has a
//! Cholesky factor.

mod barrier;
mod direction;
#[cfg(feature = "alloc")]
mod heap;
mod iteration;
mod kkt;
mod lifted_stages;
mod line_search;
mod memory;
mod multipliers;
mod options;
mod predictor;
mod restoration;
mod run;
mod run_state;
mod violations;

pub use barrier::Barrier;
#[cfg(feature = "alloc")]
pub use heap::HeapIpm;
pub use options::IpmOptions;

#[cfg(feature = "alloc")]
use crate::ocp::solution::log::Iteration;
use crate::qp::Solution;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;

/// A nonlinear interior-point method for an [`Ocp`](crate::ocp::Ocp), with exact Hessians.
///
/// ```text
/// min  f(v) − μ Σ log s        x_{k+1} = φ(x_k, u_k),  σ (g(v) − bound) = s,  x₀[i] = x_N[i] where asked
/// ```
///
/// It requires dynamics with second derivatives ([`SecondOrder`](crate::ocp::SecondOrder)). Equal
/// bounds are equations; soft bounds have penalties. An iteration costs one evaluation with
/// Hessians, one Riccati factorisation, and one simulation for each trial point of the line search.
///
/// If the line search fails, a restoration phase minimises the violations of bounds of states and
/// constraints. If they are stationary, the status is `Infeasible` and names the largest violation.
/// Before it gives up, the run restarts once from a simulation with the controls of the guess, if
/// that violates less. Afterwards the iterate of the problem is the best one, or the last one after
/// `Infeasible`.
///
/// [`HeapIpm`] allocates its memory. With [`Ipm::in_memory`] a run allocates only its log, with the
/// feature `alloc`.
///
/// A. Wächter, L. T. Biegler, Math. Program. 106 (2006); periodic states by parametric recursion,
/// inertia by J. R. Bunch, L. Kaufman, Math. Comp. 31 (1977).
///
/// # Example
/// ```
/// use casados::ocp::{GeneralCost, HeapIpm, Horizon, Problem};
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
/// ocp.fix_initial_state(&[0.0, 0.0])?.bound("x[0]", 10.., 1.0, 1.0)?;
/// ocp.bound("u", .., -3.0, 3.0)?.guess(&[0.0, 0.0], &[0.0])?;
/// let mut ipm = HeapIpm::new(&ocp)?;
/// assert!(ipm.solve(&mut ocp)?.is_converged());
/// // Without a bound the push would begin at about 3 / 1 s² · 1 m.
/// let push = ocp.solution()?.control("u")?.to_vec();
/// assert!(push.iter().all(|u| u.abs() <= 3.0 + 1e-6));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Ipm<T, D, M, I> {
    /// Options, which may be changed between runs.
    pub options: IpmOptions,
    /// The trial point of the line search.
    trial_point: Solution<T, D, M>,
    /// The best iterate.
    best_iterate: Solution<T, D, M>,
    /// The initial point.
    guess: Solution<T, D, M>,
    /// Memory of Newton's equations.
    kkt_numbers: M,
    kkt_indices: I,
    /// See [`Workspace`](kkt::workspace::Workspace).
    workspace: M,
    #[cfg(feature = "alloc")]
    log: Vec<Iteration>,
}
