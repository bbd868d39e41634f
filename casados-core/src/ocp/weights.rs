//! Whether the weights of least squares are those of a norm.

use super::error::OcpError;
use crate::function::{Function, MatrixYY};
use crate::scalar::Real;
use crate::shape::Outputs;

/// Whether weights are a symmetric, positive semidefinite matrix, up to `δ = √ε` in the units of
/// its diagonal: then the pivots of `W + δ diag(W)` are positive, but for outputs without weights.
/// If none are `coupled`, there is the diagonal alone.
///
/// # Errors
/// [`OcpError::InvalidWeight`]
pub(super) fn check<F: Function, T: Real>(weights: &MatrixYY<F, T>, coupled: bool) -> Result<(), OcpError> {
    let ny = F::Outputs::NY;
    let fault = |i: usize, j: usize, value: T, allowed| {
        let (function, value) = (F::STRUCTURE.name, value.to_f64());
        Err(OcpError::InvalidWeight { function, outputs: [i, j], value, allowed })
    };
    for i in 0..ny {
        let weight = weights[(i, i)];
        if !(weight >= T::ZERO && weight.is_finite()) {
            return fault(i, i, weight, "finite and not negative");
        }
    }
    if !coupled {
        return Ok(());
    }
    let small = T::from_f64(T::EPSILON).sqrt();
    for i in 0..ny {
        for j in 0..i {
            let [weight, mirrored] = [weights[(i, j)], weights[(j, i)]];
            let difference = weight - mirrored;
            // The square of what the matrix may be off by there.
            let allowed = small * small * weights[(i, i)] * weights[(j, j)];
            let is_symmetric = difference * difference <= allowed;
            if !is_symmetric {
                return fault(i, j, weight, "finite and the same as that of the same outputs in reverse");
            }
        }
    }
    let mut rest = *weights;
    for k in 0..ny {
        let pivot = rest[(k, k)] + small * weights[(k, k)];
        if pivot < T::ZERO {
            return fault(k, k, weights[(k, k)], "larger: the weights are not positive semidefinite");
        }
        for i in k + 1..ny {
            let below = rest[(i, k)];
            if pivot > T::ZERO {
                for j in k + 1..=i {
                    rest[(i, j)] = rest[(i, j)] - below * rest[(j, k)] / pivot;
                }
            } else if below != T::ZERO {
                return fault(i, k, below, "zero where one of the two outputs has no weight of its own");
            }
        }
    }
    Ok(())
}
