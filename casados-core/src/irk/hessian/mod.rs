//! Second-order sensitivities, in the [pass](pass) backwards over the steps that the adjoint takes.
//!
//! ```text
//! d²(λᵀ x_N)/dw² = − Σ_n Σ_i D_iᵀ [∇²(μ_iᵀ f)_i] D_i
//! ```
//!
//! The sum is one of [products of panels](products), which begin with
//! [`G = −H D`](sparse_product), or a [matrix adjoint](matrix_adjoint) with its
//! [steps](matrix_adjoint_step) where a model is large. Terms [on the diagonal](diagonal) need
//! neither. The lower triangle is [written](output) to the matrices of results.

pub(super) mod backward_pass;
mod diagonal;
mod matrix_adjoint;
mod matrix_adjoint_step;
mod output;
pub(super) mod products;
mod sparse_product;
