//! Stages that share one Jacobian: smaller systems in the [eigenbasis](basis) of the tableau, its
//! [decomposition], and [complex](complex) numbers. [Shared factors](shared_factor) for Newton
//! increments are [solved](shared_solve) supernode by supernode; adaptive integrators have
//! [factors that are checked](checked_factor).

pub mod basis;
#[cfg(feature = "alloc")]
pub mod checked_factor;
pub mod complex;
mod decomposition;
mod demoted;
pub mod shared_factor;
mod shared_solve;
