//! The linear systems of the stages.
//!
//! Unknowns are ordered by variable, stages innermost: `(k₀₁ … k₀ₛ, k₁₁ … k₁ₛ, …)`. The Newton
//! matrix then is a matrix of `S × S` blocks with the pattern of the model. Right-hand sides have
//! one row per slot, all columns side by side; [`slot`] tells where the row of an equation is.
//!
//! [`Factors`] is everything that the rest of the library knows: factor, solve, solve transposed
//! (`newton_matrix`). They are found by the plan of the model (`sparse_lu`), and by pivoting the
//! whole matrix (`dense_lu`) where that one is not good enough.
//! [Kinematic](crate::model::Kinematic) states have slots, but neither pivots nor blocks: what is
//! there stays there. Stages that share one Jacobian have smaller systems in the eigenbasis of the
//! tableau (`transformed`). `kernel` is what all of this is compiled with, `block` arithmetic of
//! `S × S` blocks.
//!
//! What a kernel consists of is inlined, so that it is compiled for the machine's instructions.
//! Without optimisation helpers that know nothing of a model are functions like others: inlined
//! they would be no faster, and compiled once more for each kernel of each model.

mod block;
mod dense_lu;
mod kernel;
mod newton_matrix;
mod sparse_lu;
mod transformed;

pub(crate) use block::{PanelRow, minus_ha, subtract_diagonal, subtract_product, subtract_transposed};
pub(crate) use kernel::{
    arithmetic::{Arithmetic, Block},
    dispatch::{Kernel, dispatch, kernels, run_plain},
    double_double::{axpy_compensated, dot_compensated, two_product},
    prefetch::Prefetch,
    unroll::{RowVisitor, for_each_row, is_large_plan, is_unrolled},
    vector::{are_finite, axpy, dot},
};
pub use newton_matrix::{Factors, kinematic, slot};
pub(crate) use sparse_lu::{
    factor::PlannedFactors,
    solve::{
        BackSubstitution, ForwardSubstitution, TransposedBackSubstitution, TransposedForwardSubstitution,
        Visitor, solve_triangular_pair,
    },
};
pub(crate) use transformed::{basis::Eigenbasis, shared_factor::SharedFactors};
#[cfg(feature = "alloc")]
pub(crate) use transformed::{
    checked_factor::{COMPLEX_PARTS, EigenFactors, EigenRows},
    complex::Complex,
};
