//! Solvers: sequential quadratic programming (`sqp/`), a nonlinear interior point (`ipm/`), their
//! loop (`solver`), and what both of them use.

pub(in crate::ocp) mod consistency;
mod degenerate;
pub(in crate::ocp) mod elastic;
pub(in crate::ocp) mod filter;
pub(in crate::ocp) mod guess;
pub(in crate::ocp) mod inertia;
pub(in crate::ocp) mod ipm;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod multi_start;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod ocp_solver;
pub(in crate::ocp) mod simulation;
mod solver;
pub(in crate::ocp) mod sqp;
pub(in crate::ocp) mod watch;
