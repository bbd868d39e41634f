//! The QP at an iterate: derivatives of intervals and functions, curvature, units, and the
//! conditions of optimality.

pub(in crate::ocp) mod algebraic;
mod ask;
pub(in crate::ocp) mod convexify;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod inside;
pub(in crate::ocp) mod kkt;
pub(in crate::ocp) mod linearise;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod pieces;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod program;
pub(in crate::ocp) mod start;
pub(in crate::ocp) mod transfer;
pub(in crate::ocp) mod trial;
pub(in crate::ocp) mod units;
