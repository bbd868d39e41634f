//! Products of small dense matrices and vectors, by SIMD.
//!
//! All matrices are stored column after column, with strides of whole registers. Everything is
//! inlined into the function compiled for `E`. Firmware is compiled for its own processor, and has
//! one copy of each kernel: code size matters more than calls.

mod dots;
mod product;
mod vectors;

pub use dots::{add_feedback, add_transposed, lanes, sum_transposed, symmetric};
pub use product::{PADDING_COLUMNS, Part, Source, difference, product, subtract};
pub use vectors::{add_rows, add_symmetric, copy, mirror, scale, subtract_column, subtract_from};

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

/// Returns `N` adjacent elements of a slice without a check. Checks of all accesses would be a
/// third of the instructions of a small tile.
///
/// # Safety
/// The slice has `N` elements from the index on.
#[inline(always)]
#[allow(unsafe_code)]
pub unsafe fn chunk<T, const N: usize>(slice: &[T], index: usize) -> &[T; N] {
    debug_assert!(index + N <= slice.len());
    // SAFETY: the elements of an array are contiguous, and the caller guarantees that they exist.
    unsafe { &*slice.as_ptr().add(index).cast() }
}

/// Returns a register with a number in every lane.
#[inline(always)]
pub fn splat<T: Real, E: Packed<T>>(value: T) -> E {
    E::from_f64(value.to_f64())
}

/// The maximum number of lanes of computations on slices.
const MAX_LANES: usize = 8;

/// Returns `0, 1, 2, …` in the lanes of a register.
#[inline(always)]
fn lane_indices<T: Real, E: Packed<T>>() -> E {
    let mut index = <E::Cell as bytemuck::Zeroable>::zeroed();
    for lane in 0..E::LANES {
        E::set_lane(&mut index, lane, lane as f64);
    }
    E::load(&index)
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
