//! Results: outcomes, logs, solutions by name, and their derivatives.

pub(in crate::ocp) mod convexity;
#[cfg(feature = "alloc")]
mod largest_violation;
pub(in crate::ocp) mod log;
pub(in crate::ocp) mod messages;
pub(in crate::ocp) mod outcome;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod sensitivities;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod trajectory;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod verification;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod warnings;
