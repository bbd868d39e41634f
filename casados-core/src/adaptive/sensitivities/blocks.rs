//! What is checked of derivatives, and where errors are.

use super::*;

/// # Errors
/// [`Error::Overflow`]
pub(super) fn finite<T: Real>(values: &[T]) -> Result<(), Error> {
    not_finite(values).map_or(Ok(()), |(index, _)| Err(Error::Overflow { step: 0, index }))
}

/// An error of a step is one of the run.
pub(super) fn in_step(mut error: Error, number: usize) -> Error {
    match &mut error {
        Error::NonFiniteModel { at, .. }
        | Error::NonFiniteFunction { at, .. }
        | Error::Singular { at, .. }
        | Error::NotConverged { at, .. } => at.step = number,
        Error::Overflow { step, .. } => *step = number,
        _ => {}
    }
    error
}
