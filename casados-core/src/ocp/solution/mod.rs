//! Results: how a run ended, its log, solutions by name, and their derivatives.

pub(in crate::ocp) mod log;
pub(in crate::ocp) mod messages;
pub(in crate::ocp) mod outcome;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod sensitivities;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod trajectory;
pub(in crate::ocp) mod verdict;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod verification;
#[cfg(feature = "alloc")]
mod violated;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod warnings;
