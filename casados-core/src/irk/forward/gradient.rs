//! Gradients computed from forward sensitivities.

use crate::error::Error;
use crate::finite::check_gradient;
use crate::linalg::kernels;
use crate::model::Dae;
use crate::result::ForwardAdjoint;
use crate::scalar::{Lanes, Real};
use crate::shape::Matrix;

/// Computes `∇(λᵀx)` from the derivatives of `x`.
pub(crate) fn gradient_product<M: Dae, E: Lanes>(result: &mut ForwardAdjoint<M, E>, lambda: &[E]) {
    let ForwardAdjoint { forward, grad_x0, grad_u, grad_p } = result;
    for (matrix, gradient) in [
        (forward.dx_dx0.as_slice(), grad_x0.as_mut_slice()),
        (forward.dx_du.as_slice(), grad_u.as_mut_slice()),
        (forward.dx_dp.as_slice(), grad_p.as_mut_slice()),
    ] {
        product(lambda, matrix, gradient);
    }
}

/// Computes `∇(λᵀx)` from the derivatives of `x`.
///
/// # Errors
/// [`Error::Overflow`]
pub(crate) fn checked_gradient<M: Dae, T: Real>(
    result: &mut ForwardAdjoint<M, T>,
    lambda: &[T],
) -> Result<(), Error> {
    gradient_product(result, lambda);
    check_gradient(result.grad_x0.as_slice(), result.grad_u.as_slice(), result.grad_p.as_slice())
}

kernels! {
    /// `gradientᵀ = λᵀ S`, with `S` in column-major order.
    fn product [E: Lanes] [E] <A>(lambda: &'k [E], matrix: &'k [E], gradient: &'k mut [E]) {
        gradient.fill(E::from_f64(0.0));
        // `max(1)`: the chunk length is positive for a model without states too.
        let columns = matrix.chunks_exact(lambda.len().max(1));
        for (gradient, column) in gradient.iter_mut().zip(columns) {
            for (&lambda, &s) in lambda.iter().zip(column) {
                *gradient = *gradient + lambda * s;
            }
        }
    }
}
