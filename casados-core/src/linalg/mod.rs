//! The linear systems of the stages.
//!
//! Unknowns are ordered by variable, stages innermost: `(k₀₁ … k₀ₛ, k₁₁ … k₁ₛ, …)`. The Newton
//! matrix then is a matrix of `S × S` blocks with the pattern of the model. Right-hand sides have
//! one row per slot, all columns side by side; [`slot`] tells where the row of an equation is.
//!
//! [`Factors`] is everything that the rest of the library knows: factor, solve, solve transposed.
//! They are found by the plan of the model (`sparse`, `substitution`, `transposed`), and by
//! pivoting the whole matrix (`dense`) where that one is not good enough.
//! [Kinematic](crate::model::Kinematic) states have slots, but neither pivots nor blocks: what is
//! there stays there. Stages that share one Jacobian have smaller systems in the eigenbasis of the
//! tableau (`eigen`): `MeanFactors` for iterations that need not be exact (`mean`, solved supernode
//! by supernode in `mean_solve`), `EigenFactors` for steps of variable size.
//!
//! What a kernel consists of is inlined, so that it is compiled for the machine's instructions.
//! Without optimisation helpers that know nothing of a model are functions like others: inlined
//! they would be no faster, and compiled once more for each kernel of each model.

mod block;
mod complex;
mod dense;
mod eigen;
#[cfg(feature = "alloc")]
mod eigen_factors;
mod factors;
mod fused;
mod kernels;
mod mean;
mod mean_solve;
mod packets;
mod prefetch;
mod sparse;
mod straight;
mod substitution;
mod transposed;
mod twice;

pub(crate) use block::{Block, Packet, coupling, subtract, subtract_diagonal, subtract_transposed};
#[cfg(feature = "alloc")]
pub(crate) use complex::Complex;
pub(crate) use eigen::Eigenbasis;
#[cfg(feature = "alloc")]
pub(crate) use eigen_factors::{EigenFactors, PARTS, Rows};
pub use factors::{Factors, kinematic, slot};
pub(crate) use fused::{Arithmetic, Kernel, dispatch};
pub(crate) use kernels::{are_finite, axpy};
pub(crate) use mean::MeanFactors;
pub(crate) use prefetch::Ahead;
pub(crate) use sparse::Planned;
pub(crate) use straight::{AtRow, each_row, is_long, is_short};
pub(crate) use substitution::{Down, TransposedDown, TransposedUp, Up, Viewer, sweeps};
pub(crate) use twice::{dot_compensated, moved, two_product};
