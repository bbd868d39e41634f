//! The linear systems of the stages.
//!
//! Unknowns are ordered by variable, stages innermost: `(k₀₁ … k₀ₛ, k₁₁ … k₁ₛ, …)`. The Newton matrix
//! then is a matrix of `S × S` blocks with the pattern of the model. Right-hand sides have one row per
//! slot, all columns side by side; [`slot`] tells where the row of an equation is.
//!
//! [`Factors`] is everything that the rest of the library knows: factor, solve, solve transposed. They are found
//! by the plan of the model (`sparse`), and by pivoting the whole matrix (`dense`) where that one is not good enough.
//! [`EigenFactors`] is the same for stages that share one Jacobian, in the eigenbasis of the tableau.

mod block;
#[cfg(feature = "alloc")]
mod complex;
mod dense;
#[cfg(feature = "alloc")]
mod eigen;
mod factors;
mod fused;
mod kernels;
mod sparse;

#[cfg(feature = "alloc")]
pub(crate) use complex::Complex;
#[cfg(feature = "alloc")]
pub(crate) use eigen::{EigenFactors, Rows};
pub(crate) use eigen::{Eigenbasis, MeanFactors};
pub use factors::{Factors, slot};
pub(crate) use fused::{Arithmetic, Kernel, dispatch};
pub(crate) use kernels::axpy;
