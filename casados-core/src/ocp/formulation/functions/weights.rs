//! Checks of least-squares weights.

use crate::function::{Function, MatrixYY};
use crate::ocp::formulation::error::OcpError;
use crate::scalar::Real;
use crate::shape::Matrix;

/// Checks that the weights of a function's outputs are symmetric and positive semidefinite.
///
/// # Errors
/// [`OcpError::InvalidWeight`]
pub(in crate::ocp) fn check<F: Function, T: Real>(
    weights: &MatrixYY<F, T>,
    coupled: bool,
) -> Result<(), OcpError> {
    check_semidefinite::<T, _>(weights, coupled).map_err(
        |WeightError { indices: outputs, value, allowed }| OcpError::InvalidWeight {
            function: F::STRUCTURE.name,
            outputs,
            value,
            allowed,
        },
    )
}

/// An invalid weight and the requirement.
pub(in crate::ocp) struct WeightError {
    /// Its row and column.
    pub indices: [usize; 2],
    pub value: f64,
    pub allowed: &'static str,
}

/// Checks that weights are a symmetric, positive semidefinite matrix, up to `δ = √ε` in the units
/// of its diagonal: the pivots of `W + δ diag(W)` must be positive, except in rows without weights.
/// If the weights are not `coupled`, only the diagonal is used.
pub(in crate::ocp) fn check_semidefinite<T: Real, V: Matrix<T>>(
    weights: &V,
    coupled: bool,
) -> Result<(), WeightError> {
    let ny = V::ROWS;
    let weight = |i: usize, j: usize| entry(weights.as_slice(), j * ny + i);
    let weight_error = |i: usize, j: usize, allowed| {
        Err(WeightError { indices: [i, j], value: weight(i, j).to_f64(), allowed })
    };
    for i in 0..ny {
        if !(weight(i, i) >= T::ZERO && weight(i, i).is_finite()) {
            return weight_error(i, i, "finite and at least 0");
        }
    }
    if !coupled {
        return Ok(());
    }
    let tolerance = T::from_f64(T::EPSILON).sqrt();
    for i in 0..ny {
        for j in 0..i {
            let difference = weight(i, j) - weight(j, i);
            // The square of the allowed asymmetry.
            let allowed = tolerance * tolerance * weight(i, i) * weight(j, j);
            let is_symmetric = difference * difference <= allowed;
            if !is_symmetric {
                let (i, j) =
                    if weight(i, j).is_finite() && !weight(j, i).is_finite() { (j, i) } else { (i, j) };
                return weight_error(i, j, "finite and the same as its mirror image");
            }
        }
    }
    let mut rest = *weights;
    let rest = rest.as_mut_slice();
    for k in 0..ny {
        let pivot = entry(rest, k * ny + k) + tolerance * weight(k, k);
        if pivot < T::ZERO {
            return weight_error(k, k, "larger: the weights are not positive semidefinite");
        }
        for i in k + 1..ny {
            let column_element = entry(rest, k * ny + i);
            if pivot == T::ZERO && column_element != T::ZERO {
                return weight_error(i, k, "zero where one of the two has no weight of its own");
            }
            for j in k + 1..i + 1 {
                let product =
                    if pivot > T::ZERO { column_element * entry(rest, k * ny + j) / pivot } else { T::ZERO };
                if let Some(element) = rest.get_mut(j * ny + i) {
                    *element = *element - product;
                }
            }
        }
    }
    Ok(())
}

fn entry<T: Real>(matrix: &[T], index: usize) -> T {
    matrix.get(index).copied().unwrap_or(T::ZERO)
}
