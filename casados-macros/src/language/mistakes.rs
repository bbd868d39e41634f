//! Mistakes that do not follow from each other are reported together.

use syn::{Error, Result};

/// The mistakes found so far.
#[derive(Default)]
pub struct CollectedErrors(Option<Error>);

impl CollectedErrors {
    /// One more.
    pub fn note(&mut self, error: Error) {
        match &mut self.0 {
            Some(errors) => errors.combine(error),
            None => self.0 = Some(error),
        }
    }

    /// An error if there is any.
    pub fn into_result(self) -> Result<()> {
        self.0.map_or(Ok(()), Err)
    }
}
