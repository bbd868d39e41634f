//! Products of small dense matrices and vectors, in registers.
//!
//! All matrices lie column after column, and columns are whole registers apart. Everything is
//! inlined into the function that was compiled for `E`. Firmware has the machine that it was
//! compiled for, and one copy of each kernel: flash is dearer than calls.

mod dots;
mod product;
mod vectors;

pub use dots::{add_feedback, add_transposed, lanes, sum_transposed, symmetric};
pub use product::{PADDING_COLUMNS, Part, Source, difference, product, subtract};
pub use vectors::{add_rows, add_symmetric, copy, mirror, scale, subtract_column, subtract_from};

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

/// Neighbours in a slice. Checks of each would take as long as the product of a small tile: a third
/// of its instructions.
///
/// # Safety
/// There are `N` elements from the index on.
#[inline(always)]
#[allow(unsafe_code)]
pub unsafe fn chunk<T, const N: usize>(slice: &[T], index: usize) -> &[T; N] {
    debug_assert!(index + N <= slice.len());
    // SAFETY: an array is its elements one behind the other, and the caller says that they exist.
    unsafe { &*slice.as_ptr().add(index).cast() }
}

/// A number in every lane.
#[inline(always)]
pub fn splat<T: Real, E: Packed<T>>(value: T) -> E {
    E::from_f64(value.to_f64())
}

/// The most lanes of registers that computations on slices are made in.
const MAX_LANES: usize = 8;

/// `0, 1, 2, …` in the lanes of a register.
#[inline(always)]
fn lane_indices<T: Real, E: Packed<T>>() -> E {
    let mut index = <E::Cell as bytemuck::Zeroable>::zeroed();
    for lane in 0..E::LANES {
        E::set_lane(&mut index, lane, lane as f64);
    }
    E::load(&index)
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
