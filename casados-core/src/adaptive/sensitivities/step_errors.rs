//! The places of errors.

use super::*;

/// Replaces the step number of an error of a single step by that of the run.
pub(super) fn with_step_number(mut error: Error, number: usize) -> Error {
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
