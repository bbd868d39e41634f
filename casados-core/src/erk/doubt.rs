//! Values that are not finite: among single numbers the first one is an error at once; of several
//! side by side each lane that has one is doubted, and the others go on.

use crate::error::Error;
use crate::linalg::{are_finite, kernels, run_plain};
use crate::scalar::Lanes;
use crate::scalar::lanes::REGISTERS;
use bytemuck::Zeroable;

/// Zero in every lane all of whose values were finite.
#[derive(Zeroable)]
pub(crate) struct Doubt<E>(E);

impl<E: Lanes> Doubt<E> {
    /// Before a call.
    pub fn forget(&mut self) {
        self.0 = E::zeroed();
    }

    /// The lanes that nobody doubts.
    #[inline(always)]
    pub fn none(&self) -> E::Mask {
        self.0.is_finite()
    }

    /// These are the lanes that nobody doubts.
    #[inline(always)]
    pub fn keep(&mut self, lanes: E::Mask) {
        self.0 = E::select(lanes, E::zeroed(), E::from_f64(f64::NAN));
    }

    /// Looks at values. An error is made of the place and the value of the first that is not
    /// finite.
    ///
    /// # Errors
    /// That one, of single numbers.
    #[inline(always)]
    pub fn check(&mut self, values: &[E], error: impl FnOnce(usize, f64) -> Error) -> Result<(), Error> {
        if const { E::LANES > 1 } {
            notice(values, self);
            return Ok(());
        }
        if !ONE_BY_ONE && are_finite(values) {
            return Ok(());
        }
        match values.iter().position(|value| !E::all(value.is_finite())) {
            None => Ok(()),
            Some(index) => {
                let value = values[index];
                let mut cell: E::Cell = Zeroable::zeroed();
                value.store(&mut cell);
                Err(error(index, E::lane(&cell, 0)))
            }
        }
    }
}

/// Whether single numbers are looked at one by one. Where registers take several of them all are,
/// without a branch for each.
pub(super) const ONE_BY_ONE: bool = !REGISTERS;

kernels! { by run_plain;
    /// Doubts lanes with a value that is not finite.
    fn notice [E: Lanes] [E] <A>(values: &'k [E], doubt: &'k mut Doubt<E>) {
        let mut finite = doubt.none();
        for value in values {
            finite = E::and(finite, value.is_finite());
        }
        doubt.keep(finite);
    }
}
