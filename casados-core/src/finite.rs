//! Finite checks: of what is given, and of what is returned.

use crate::error::{Argument, Error};
use crate::linalg::{are_finite, kernels};
use crate::scalar::Real;

/// # Errors
/// [`Error::NonFiniteInput`]
pub(crate) fn check_input<T: Real>(argument: Argument, values: &[T]) -> Result<(), Error> {
    match not_finite(values) {
        Some((index, value)) => Err(Error::NonFiniteInput { argument, index, value }),
        None => Ok(()),
    }
}

/// # Errors
/// [`Error::Overflow`] of the first element that is not finite.
pub(crate) fn check_output<T: Real>(values: &[T], step: usize) -> Result<(), Error> {
    match not_finite(values) {
        Some((index, _)) => Err(Error::Overflow { step, index }),
        None => Ok(()),
    }
}

/// The first element that is infinite or NaN.
#[inline]
pub(crate) fn not_finite<T: Real>(values: &[T]) -> Option<(usize, f64)> {
    // A few are looked at before the function for many is entered.
    let finite = if values.len() < 16 { are_finite(values) } else { are_all_finite(values) };
    if finite {
        return None;
    }
    values.iter().position(|value| !value.is_finite()).map(|index| (index, values[index].to_f64()))
}

kernels! {
    /// See [`are_finite`].
    fn are_all_finite [E: Real] [E] <A>(values: &'k [E]) -> bool {
        are_finite(values)
    }
}
