//! Collection of independent errors, which are reported together.

use syn::{Error, Result};

/// The errors so far.
#[derive(Default)]
pub struct CollectedErrors(Option<Error>);

impl CollectedErrors {
    /// Adds an error.
    pub fn note(&mut self, error: Error) {
        match &mut self.0 {
            Some(errors) => errors.combine(error),
            None => self.0 = Some(error),
        }
    }

    /// The errors, if there are any.
    pub fn into_result(self) -> Result<()> {
        self.0.map_or(Ok(()), Err)
    }
}
