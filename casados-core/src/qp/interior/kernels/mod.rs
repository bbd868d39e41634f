//! Products of small dense matrices and vectors, in registers.
//!
//! All matrices lie column after column, and columns are whole registers apart. Everything is
//! inlined into the function that was compiled for `E`. Firmware has the machine that it was
//! compiled for, and one copy of each kernel: flash is dearer than calls.

mod product;
mod vectors;

pub use product::{PADDING_COLUMNS, Part, Source, product, subtract};
pub use vectors::{
    add, add_symmetric, add_transposed, copy, copy_negative, mirror, scale, subtract_column, symmetric,
};

use crate::scalar::{Packed, Real};

/// A matrix to be read, and the distance of its columns.
#[derive(Clone, Copy)]
pub struct Columns<'a, T> {
    /// From the first element on.
    pub data: &'a [T],
    /// The distance.
    pub ld: usize,
}

impl<'a, T> Columns<'a, T> {
    /// The matrix without some columns.
    #[inline(always)]
    pub fn skip(self, columns: usize) -> Self {
        Self { data: self.data.get(columns * self.ld..).unwrap_or_default(), ld: self.ld }
    }
    /// The matrix without some rows. Its last column is shorter.
    #[inline(always)]
    pub fn below(self, rows: usize) -> Self {
        Self { data: self.data.get(rows..).unwrap_or_default(), ld: self.ld }
    }
}

/// A number in every lane.
#[inline(always)]
pub fn splat<T: Real, E: Packed<T>>(value: T) -> E {
    E::from_f64(value.to_f64())
}

/// What tests of products share.
#[cfg(test)]
mod tests {
    use crate::qp::layout::padded_len;
    use alloc::vec::Vec;

    /// What columns are padded to: registers, and an even number, which is enough without them.
    pub const LEADING_DIMENSIONS: [fn(usize) -> usize; 2] = [padded_len::<f64>, |n| n.next_multiple_of(2)];

    /// Small integers, of which sums are exact, in columns of `rows` that are `ld` apart.
    pub fn integers(rows: usize, columns: usize, ld: usize, seed: usize) -> Vec<f64> {
        (0..ld * columns)
            .map(|i| if i % ld < rows { ((i * 7 + seed * 13) % 11) as f64 - 5.0 } else { 0.0 })
            .collect()
    }
}
