//! Solvers: sequential quadratic programming (`sqp/`), a nonlinear interior point (`ipm/`), their
//! loop (`solver_loop`), and shared parts.

pub mod advanced;
pub(in crate::ocp) mod bound_consistency;
mod degenerate_start;
pub(in crate::ocp) mod elastic_mode;
pub(in crate::ocp) mod filter;
pub(in crate::ocp) mod guess;
pub(in crate::ocp) mod inertia_correction;
pub(in crate::ocp) mod ipm;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod multi_start;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod ocp_solver;
pub(in crate::ocp) mod simulation;
mod solver_loop;
pub(in crate::ocp) mod sqp;
pub(in crate::ocp) mod stopwatch;
