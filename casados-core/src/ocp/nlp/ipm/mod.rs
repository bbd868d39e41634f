//! A nonlinear interior point on the structure of optimal control.
//!
//! ```text
//! min  f(v) − μ Σ log s        c(v) = 0,  σ (g(v) − bound) = s        μ → 0
//! ```
//!
//! | | |
//! | --- | --- |
//! | `run`, `iteration` | the iterations, and one of them |
//! | `start`, `multipliers` | the first point and its multipliers |
//! | `newton`, `direction` | Newton's equations by the Riccati recursion, and what makes them convex |
//! | `measure`, `line_search` | how far a step goes, by the filter of `ocp::filter` |
//! | `scaling` | units of forces, and the sizes of multipliers |
//! | `barrier`, `predictor` | how `μ` shrinks, and the step that says how far |
//! | `restoration` | restoration phase, elastic mode, restart from a simulation, verdicts |
//! | `violations` | whether violations are stationary |
//! | `lifted` | stages that are variables go with the iterate |
//!
//! The algorithm is that of Wächter and Biegler, Math. Program. 106 (2006). Inertia is what the
//! Riccati recursion says: the reduced Hessian is positive definite where `M_uu` of every stage has
//! a factor of Cholesky.

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

/// A nonlinear interior point for an [`Ocp`](crate::ocp::Ocp), with exact Hessians.
///
/// ```text
/// min  f(v) − μ Σ log s        x_{k+1} = φ(x_k, u_k),  σ (g(v) − bound) = s,  x₀[i] = x_N[i] where asked
/// ```
///
/// It needs dynamics with second derivatives ([`SecondOrder`](crate::ocp::SecondOrder)). Bounds
/// that are equal are equations; soft ones have their penalties. An iteration costs one evaluation
/// with Hessians, one Riccati factorisation, and one simulation for each point that the line search
/// tries. Where no step makes progress, violations of bounds of states and constraints alone are
/// made small; where they stay, the bound that is violated most is named. Before it gives up it
/// begins again, once, at a simulation with the controls of its guess, if that violates less. The
/// iterate of the problem is the best one afterwards, whatever the status; where violations stay,
/// the one at which they do.
///
/// [`HeapIpm`] allocates its memory; [`Ipm::in_memory`] takes it, and then a run allocates nothing
/// but its log, with the feature `alloc`.
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
    /// Options, which may be changed between calls.
    pub options: IpmOptions,
    /// A point that is tried.
    trial_point: Solution<T, D, M>,
    /// The best iterate.
    best_iterate: Solution<T, D, M>,
    /// The first iterate.
    guess: Solution<T, D, M>,
    /// Of Newton's equations.
    kkt_numbers: M,
    kkt_indices: I,
    /// See [`Work`](work::Work).
    workspace: M,
    #[cfg(feature = "alloc")]
    log: Vec<Iteration>,
}
