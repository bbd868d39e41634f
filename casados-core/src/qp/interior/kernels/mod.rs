//! Products of small dense matrices and vectors, by SIMD.
//!
//! All matrices are stored column after column, with strides of whole registers. Everything is
//! inlined into the function compiled for `E`. Firmware is compiled for its own processor, and has
//! one copy of each kernel: code size matters more than calls.

mod product;
mod vectors;

pub use product::{PADDING_COLUMNS, Part, Source, product, subtract};
pub use vectors::{
    add, add_symmetric_product, add_transposed, copy, copy_negative, mirror, scale, subtract_column,
    symmetric,
};

use crate::scalar::{Packed, Real};

/// A read-only matrix, and the stride of its columns.
#[derive(Clone, Copy)]
pub struct Columns<'a, T> {
    /// The elements from the first one on.
    pub data: &'a [T],
    /// The stride of columns.
    pub ld: usize,
}

impl<'a, T> Columns<'a, T> {
    /// Returns the matrix without its first columns.
    #[inline(always)]
    pub fn skip(self, columns: usize) -> Self {
        Self { data: self.data.get(columns * self.ld..).unwrap_or_default(), ld: self.ld }
    }
    /// Returns the matrix without its first rows. Its last column is shorter.
    #[inline(always)]
    pub fn below(self, rows: usize) -> Self {
        Self { data: self.data.get(rows..).unwrap_or_default(), ld: self.ld }
    }
}

/// Returns a register with a number in every lane.
#[inline(always)]
pub fn splat<T: Real, E: Packed<T>>(value: T) -> E {
    E::from_f64(value.to_f64())
}

/// Helpers of the tests of products.
#[cfg(test)]
mod tests {
    use crate::qp::layout::padded_len;
    use alloc::vec::Vec;

    /// Strides to test: padding to registers, and to an even number, which suffices without SIMD.
    pub const LEADING_DIMENSIONS: [fn(usize) -> usize; 2] = [padded_len::<f64>, |n| n.next_multiple_of(2)];

    /// Returns small integers, whose sums are exact, in columns of `rows` elements with the stride
    /// `ld`.
    pub fn integers(rows: usize, columns: usize, ld: usize, seed: usize) -> Vec<f64> {
        (0..ld * columns)
            .map(|i| if i % ld < rows { ((i * 7 + seed * 13) % 11) as f64 - 5.0 } else { 0.0 })
            .collect()
    }
}
