//! Newton's method on the stages of a step.
//!
//! The [`iteration`] computes [increments](increment), whose [`norm`] is the input of the
//! [`convergence`] test. The [policy](jacobian_policy) decides about updates of the Jacobian;
//! increments that grow with an old Jacobian are [rejected](rejection). If the iteration does not
//! converge, the [dense fallback](dense_fallback) pivots the whole matrix. Linear equations are
//! checked for being [nearly singular](near_singular). Errors report [start values](start_errors),
//! and a [`fold`] between start and solution.

mod convergence;
pub(super) mod dense_fallback;
#[cfg(feature = "alloc")]
pub(super) mod fold;
mod increment;
pub(super) mod iteration;
mod jacobian_policy;
mod near_singular;
mod norm;
mod rejection;
mod start_errors;
