//! Problems of optimal control, discretised by direct multiple shooting or direct collocation.
//!
//! ```text
//! min   Σ_k l(x_k, z_k, u_k, p_k, t_k) + e(x_N)
//! s.t.  x_{k+1} = φ(x_k, u_k, p_k),  z_k = ζ(x_k, u_k, p_k)
//!       lb ≤ (x_k, u_k) ≤ ub,  lg ≤ g(x_k, z_k, u_k, p_k, t_k) ≤ ug
//! ```
//!
//! Each bound is optional, and hard or soft.
//!
//! | term | types |
//! | --- | --- |
//! | `φ` | [`Dynamics`]: an integrator of single intervals (`Irk`, `Erk`), `Shooting` over a `Batch`, `Collocation`, [`Map`] |
//! | `l`, `e` | [`LeastSquaresCost`] `½ ‖y − r‖²_W`, [`ConvexCost`] `φ(y − r)`, [`GeneralCost`], pairs of costs; integrals with [`WithIntegral`] |
//! | `g` | [`Constraint`], pairs of constraints |
//!
//! All of these are `#[function]`s of the arguments of the model, with exact derivatives by the
//! macro. [`Problem`] combines them, `problem.on(horizon)` allocates their memory: an [`Ocp`] has
//! bounds by the names of the model (`ocp.bound("u", .., -1.0, 1.0)?`), references and parameters
//! of every stage, an iterate, and the QP at this iterate. [`Sqp`] solves it:
//!
//! ```text
//! B_k ≈ ∇²_(x,u) [l + πᵀφ + (λ_u − λ_l)ᵀ g]
//! QP at (x̄, ū): variables (x, u), data φ − A x̄ − B ū, …, solution the next iterate
//! ```
//!
//! `Exact`, the default, is the whole Hessian, regularised where a QP is not convex; `GaussNewton`
//! is `JᵀWJ` of least squares.
//!
//! It uses a line search (merit function, filter, second-order correction) or full steps, and
//! elastic mode where a QP is infeasible. Its [`Outcome`] has the status, and the constraint that
//! prevents a solution, if there is one. [`RealTime`] takes one step in each sample, in two phases.
//! `Sensitivities` are derivatives of solutions by initial states and parameters, and feedback
//! gains; `SolutionFactors` has adjoint derivatives, and gradient and Hessian of the optimal value.
//! `BatchOcp` solves and differentiates many problems at once; `closed_loop` runs a controller and
//! a plant.
//!
//! ```
//! use casados::ocp::{GeneralCost, HeapSqp, Horizon, Problem};
//! use casados::prelude::*;
//!
//! /// A cart on a rail that is pushed: position m, velocity m/s; acceleration m/s².
//! #[ode]
//! fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
//! #[function]
//! fn effort(_x: [f64; 2], u: f64) -> f64 { 0.5 * u * u }
//!
//! let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
//!     .running_cost(GeneralCost::<Effort>::new())
//!     .on(Horizon::uniform(20, 0.05))?;
//! ocp.fix_initial_state(&[0.0, 0.0])?.guess(&[0.0, 0.0], &[0.0])?;
//! ocp.bound("x[0]", 20.., 1.0, 1.0)?.bound("x[1]", 20.., 0.0, 0.0)?.bound("u", .., -8.0, 8.0)?;
//! let outcome = HeapSqp::new(&ocp)?.solve(&mut ocp)?;
//! assert!(outcome.is_converged());
//! println!("{ocp}\n{}", ocp.solution()?.csv());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Algebraic states `z_k` are those at the start of interval `k`, extrapolated there from the
//! stages by the integrator (`z0` of its results), with exact first derivatives. Their second
//! derivatives, `Σ_j ν_j ∇²ζ_j` with `ν = ∂(l + (λ_u − λ_l)ᵀg)/∂z`, are in exact Hessians. The end
//! of the horizon has no algebraic states.
//!
//! `Ocp::solution` returns a `Trajectory` with states, controls and multipliers by the names of the
//! model, `Ocp::dense_solution` one with points between the nodes too. It can be read, written as
//! CSV, and loaded again.
//!
//! With [`Options::lifted`](crate::Options::lifted) an integrator takes one Newton iteration in
//! each call, from the stages of the last call. The stages converge with the iterates, to the same
//! solution.
//!
//! [`Ipm`] solves the same problems by a nonlinear interior point with exact Hessians. With
//! `Collocation` it has the stages as variables: the discrete solution is the same, and guesses
//! need not be integrable.
//!
//! States may be periodic, `x₀ = x_N` (`ocp.periodic("x")?`), and controls the same at all stages
//! (`ocp.shared("u.duration")?`). Parameters of the model may be free
//! (`ocp.free("p.mass", 0.1..=5.0, 1.0)?`), end times too ([`Horizon::free`]), and [`Boundary`]
//! constrains any function `r(x₀, x_N, p)`. `Ocp::verify` estimates the error of a solution between
//! its nodes.
//!
//! No heap is required: `problem.on_horizon(horizon, &DIMS, &mut memory)` uses memory whose length
//! is a constant of the types ([`Problem::memory`]), and integrators with `Inline` memory are
//! dynamics too.

mod assembly;
#[cfg(feature = "alloc")]
mod batch;
mod dynamics;
mod feedback;
mod formulation;
mod nlp;
#[cfg(feature = "alloc")]
mod phases;
mod program;
mod solution;

#[cfg(feature = "alloc")]
pub use batch::{BatchOcp, BatchPrepared, BatchRealTime, Gradient, Gradients};
#[cfg(feature = "alloc")]
pub use dynamics::collocation::Collocation;
pub use dynamics::map::Map;
#[cfg(feature = "alloc")]
pub use dynamics::return_map::ReturnMap;
#[cfg(feature = "alloc")]
pub use dynamics::shooting::Shooting;
pub use dynamics::single_interval::{IntegralCost, WithIntegral};
#[cfg(feature = "alloc")]
pub use feedback::closed_loop::{ClosedLoop, Controller, Sample, closed_loop, closed_loops, plant};
pub use feedback::contraction::{Contraction, ContractionTest, Convergence};
pub use feedback::phases::{Fallback, Feedback, Prepared};
#[cfg(feature = "alloc")]
pub use feedback::real_time::HeapRealTime;
pub use feedback::real_time::RealTime;
pub use formulation::error::{ConstraintName, OcpError, Part, Text};
#[doc(hidden)]
pub use formulation::functions::argument_checks::{
    ConstraintsOf, CostOf, HasArgumentsOf, IsConstraint, IsCost,
};
pub use formulation::functions::boundary::Boundary;
pub use formulation::functions::constraint::{Constraint, Constraints};
pub use formulation::functions::convex::{Convex, ConvexCost, Huber, InvalidConstant, PseudoHuber};
pub use formulation::functions::cost::{Cost, GeneralCost};
pub use formulation::functions::dynamics::{Dynamics, SecondOrder};
#[doc(hidden)]
pub use formulation::functions::dynamics::{
    IntegralTerms, Interval, IntervalResult, Nodes, Sink, StageAction,
};
pub use formulation::functions::least_squares::LeastSquaresCost;
#[cfg(feature = "casadi")]
pub(crate) use formulation::functions::sparsity::{DerivativeEntry, DynamicsStructure};
pub use formulation::horizon::Horizon;
#[cfg(feature = "alloc")]
pub use formulation::instance::HeapOcp;
pub use formulation::instance::Ocp;
pub use formulation::names::Names;
pub use formulation::problem::{ExactFormulation, Formulation, Problem};
pub use formulation::program::Program;
pub use formulation::program::curvature::{Convexification, Curvature, Exact, GaussNewton};
pub use nlp::advanced;
#[cfg(feature = "alloc")]
pub use nlp::ipm::HeapIpm;
pub use nlp::ipm::{Barrier, Ipm, IpmOptions};
#[cfg(feature = "alloc")]
pub use nlp::multi_start::{MultiStart, StartOutcome};
#[cfg(feature = "alloc")]
pub use nlp::ocp_solver::OcpSolver;
#[cfg(feature = "alloc")]
pub use nlp::sqp::HeapSqp;
pub use nlp::sqp::{Globalisation, Sqp, SqpOptions};
#[cfg(feature = "alloc")]
pub use phases::{Continuous, Jump, Link, PhaseAdjoint, PhaseDirection, PhaseDynamics, PhaseFactors, Phases};
#[cfg(feature = "alloc")]
#[doc(hidden)]
pub use phases::{PhaseDims, PhaseEnd};
pub use solution::log::{Iteration, Log, Times};
pub use solution::outcome::{Outcome, Status};
#[cfg(feature = "alloc")]
pub use solution::sensitivities::{
    Covariance, Sensitivities, SolutionAdjoint, SolutionFactors, Unidentifiable, ValueHessian,
};
#[cfg(feature = "alloc")]
pub use solution::trajectory::{Csv, Kind, Series, Trajectory, TrajectoryError, Violation};
#[cfg(feature = "alloc")]
pub use solution::verification::{Defect, InnerViolation, Verification};
#[cfg(feature = "alloc")]
pub use solution::warnings::Warning;
