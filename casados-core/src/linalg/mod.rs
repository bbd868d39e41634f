//! The linear systems of the stages.
//!
//! Unknowns are ordered by variable, stages innermost: `(k₀₁ … k₀ₛ, k₁₁ … k₁ₛ, …)`. The Newton
//! matrix then consists of `S × S` blocks with the sparsity pattern of the model. Right-hand sides
//! have one row per slot, with all columns adjacent; [`slot`] returns the row of an equation.
//!
//! [`Factors`] is the interface for the rest of the library: factor, solve, solve transposed
//! (`newton_matrix`). The factors are computed by the plan of the model (`sparse_lu`), or with
//! pivoting of the whole matrix (`dense_lu`) if those are too inaccurate.
//! [Kinematic](crate::model::Kinematic) states have slots, but neither pivots nor blocks: their
//! rows remain unchanged. Stages that share one Jacobian have smaller systems in the eigenbasis of
//! the tableau (`transformed`). `kernel` compiles kernels and unrolls loops, `block` is the
//! arithmetic of `S × S` blocks.
//!
//! Everything in a kernel is inlined, so that it is compiled for the machine's instructions.
//! Without optimisation, helpers that do not depend on a model are ordinary functions: inlined they
//! would be no faster, and compiled again for each kernel of each model.

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
