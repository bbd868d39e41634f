//! The gradient that forward sensitivities have in them, and finite checks of these.

use crate::error::Error;
use crate::finite::check_output;
use crate::linalg::kernels;
use crate::model::Dae;
use crate::result::{Forward, ForwardAdjoint};
use crate::scalar::{Lanes, Real};
use crate::shape::Matrix;

/// # Errors
/// [`Error::Overflow`] of the first derivative that is not finite.
#[cfg_attr(feature = "std", inline(never))]
pub(crate) fn check_result<M: Dae, T: Real>(result: &Forward<M, T>, step: usize) -> Result<(), Error> {
    for values in [
        result.dx_dx0.as_slice(),
        result.dx_du.as_slice(),
        result.dx_dp.as_slice(),
        result.dz_dx0.as_slice(),
        result.dz_du.as_slice(),
        result.dz_dp.as_slice(),
        result.dz0_dx0.as_slice(),
        result.dz0_du.as_slice(),
        result.dz0_dp.as_slice(),
    ] {
        check_output(values, step)?;
    }
    Ok(())
}

/// `∇(λᵀx)` from the derivatives of `x`.
pub(crate) fn multiply<M: Dae, E: Lanes>(result: &mut ForwardAdjoint<M, E>, lambda: &[E]) {
    let ForwardAdjoint { forward, grad_x0, grad_u, grad_p } = result;
    for (matrix, gradient) in [
        (forward.dx_dx0.as_slice(), grad_x0.as_mut_slice()),
        (forward.dx_du.as_slice(), grad_u.as_mut_slice()),
        (forward.dx_dp.as_slice(), grad_p.as_mut_slice()),
    ] {
        product(lambda, matrix, gradient);
    }
}

/// `∇(λᵀx)` from the derivatives of `x`.
///
/// # Errors
/// [`Error::Overflow`]
pub(crate) fn gradient<M: Dae, T: Real>(
    result: &mut ForwardAdjoint<M, T>,
    lambda: &[T],
) -> Result<(), Error> {
    multiply(result, lambda);
    check_output(result.grad_x0.as_slice(), 0)?;
    check_output(result.grad_u.as_slice(), 0)?;
    check_output(result.grad_p.as_slice(), 0)
}

kernels! {
    /// `gradientᵀ = λᵀ S`, with `S` column after column.
    fn product [E: Lanes] [E] <A>(lambda: &'k [E], matrix: &'k [E], gradient: &'k mut [E]) {
        gradient.fill(E::from_f64(0.0));
        // A model without states has no columns to go through.
        let columns = matrix.chunks_exact(lambda.len().max(1));
        for (gradient, column) in gradient.iter_mut().zip(columns) {
            for (&lambda, &s) in lambda.iter().zip(column) {
                *gradient = *gradient + lambda * s;
            }
        }
    }
}
