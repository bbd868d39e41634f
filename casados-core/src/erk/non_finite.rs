//! Non-finite values: for scalars the first one is an error; for SIMD lanes it marks its lane, and
//! the other lanes continue.

use crate::error::Error;
use crate::linalg::{are_finite, kernels, run_plain};
use crate::scalar::Lanes;
use crate::scalar::lanes::REGISTERS;
use bytemuck::Zeroable;

/// Zero in every lane whose values were all finite, otherwise NaN.
#[derive(Zeroable)]
pub(crate) struct NonFiniteLanes<E>(E);

impl<E: Lanes> NonFiniteLanes<E> {
    /// Marks all lanes as finite.
    pub fn reset(&mut self) {
        self.0 = E::zeroed();
    }

    /// Returns the lanes whose values were all finite.
    #[inline(always)]
    pub fn finite_lanes(&self) -> E::Mask {
        self.0.is_finite()
    }

    /// Sets the finite lanes.
    #[inline(always)]
    pub fn set_finite_lanes(&mut self, lanes: E::Mask) {
        self.0 = E::select(lanes, E::zeroed(), E::from_f64(f64::NAN));
    }

    /// Checks values; calls `error` with the index and the value of the first non-finite one.
    ///
    /// # Errors
    /// That error, for scalars.
    #[inline(always)]
    pub fn check(&mut self, values: &[E], error: impl FnOnce(usize, f64) -> Error) -> Result<(), Error> {
        if const { E::LANES > 1 } {
            record(values, self);
            return Ok(());
        }
        if !CHECK_EACH_VALUE && are_finite(values) {
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

/// Whether scalars are checked one by one. With SIMD registers all values are checked without
/// branches.
pub(super) const CHECK_EACH_VALUE: bool = !REGISTERS;

kernels! { by run_plain;
    /// Unmarks lanes with a non-finite value.
    fn record [E: Lanes] [E] <A>(values: &'k [E], non_finite: &'k mut NonFiniteLanes<E>) {
        let mut finite = non_finite.finite_lanes();
        for value in values {
            finite = E::and(finite, value.is_finite());
        }
        non_finite.set_finite_lanes(finite);
    }
}
