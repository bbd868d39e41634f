//! The QP at an iterate: derivatives of intervals and functions, convexification, units, and
//! residuals of the optimality conditions.

pub(in crate::ocp) mod algebraic;
pub(in crate::ocp) mod convexify;
mod evaluation;
pub(in crate::ocp) mod initial_state_copies;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod inner_points;
pub(in crate::ocp) mod kkt;
pub(in crate::ocp) mod linearise;
pub(in crate::ocp) mod linearised_interval;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod piecewise_integration;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod separate_linearisation;
pub(in crate::ocp) mod trial;
pub(in crate::ocp) mod units;
