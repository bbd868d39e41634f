//! The linear systems of the stages.
//!
//! Unknowns are ordered by variable, stages innermost: `(k₀₁ … k₀ₛ, k₁₁ … k₁ₛ, …)`. The Newton matrix
//! then is a matrix of `S × S` blocks with the pattern of the model. Right-hand sides have one row per
//! unknown, all columns side by side.
//!
//! [`Factors`] is everything that the rest of the library knows: clear, add, factor, solve, solve transposed.

mod dense;
mod kernels;

pub use dense::Factors;
pub(crate) use kernels::axpy;
