//! Second-order sensitivities, in the [backward pass](backward_pass) of the adjoint.
//!
//! ```text
//! d²(λᵀ x_N)/dw² = − Σ_n Σ_i D_iᵀ [∇²(μ_iᵀ f)_i] D_i
//! ```
//!
//! The sum is computed by [products of panels](products), which begin with
//! [`G = −H D`](sparse_product), or for large models by a [matrix adjoint](matrix_adjoint) with its
//! [steps](matrix_adjoint_step). [Diagonal](diagonal) terms need neither. The [output](output)
//! copies the lower triangle to the matrices of results.

pub(super) mod backward_pass;
mod diagonal;
mod matrix_adjoint;
mod matrix_adjoint_step;
mod output;
pub(super) mod products;
mod sparse_product;
