//! Newton's method on the stages of a step.
//!
//! The [`iteration`] finds [increments](increment), whose [`norm`] the test of [`convergence`]
//! takes; the [policy](jacobian_policy) says which Jacobian they are found with, and increments by
//! an old one that grow are [rejected](rejection). Where it does not arrive, the
//! [dense fallback](dense_fallback) pivots the whole matrix; linear equations are asked whether
//! they are [nearly singular](near_singular), and errors say where the iteration
//! [started](start_errors), and whether a fold is between.

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
