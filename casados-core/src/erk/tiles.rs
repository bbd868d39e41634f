//! Sums of rows, in micro-tiles of columns that stay in registers during the summation.
//!
//! Storing a SIMD register takes as long as several products. For groups of intervals a micro-tile
//! is therefore summed over all terms of a row. For scalars whole rows are summed term by term: the
//! compiler vectorises over their columns.

use crate::linalg::Arithmetic;
use crate::scalar::Lanes;
use crate::shape::InBounds;

/// An operation on `W` columns at a time; `#[inline(always)]`.
pub(super) trait ColumnKernel {
    fn process_columns<A: Arithmetic, const W: usize>(&mut self, first: usize);
}

/// Processes all columns from `first` on, in micro-tiles of at most eight or four columns: each
/// column has a register for its sum, and there are enough independent products to hide their
/// latency.
#[inline(always)]
pub(super) fn for_each_tile<A: Arithmetic, V: ColumnKernel, const MAX_WIDTH: usize>(
    mut first: usize,
    end: usize,
    visit: &mut V,
) {
    while const { MAX_WIDTH >= 8 } && first + 8 <= end {
        visit.process_columns::<A, 8>(first);
        first += 8;
    }
    while first + 4 <= end {
        visit.process_columns::<A, 4>(first);
        first += 4;
    }
    if first + 2 <= end {
        visit.process_columns::<A, 2>(first);
        first += 2;
    }
    if first < end {
        visit.process_columns::<A, 1>(first);
    }
}

/// Loads columns of a row.
#[inline(always)]
pub(super) fn load<E: Lanes, const W: usize>(row: &[E], first: usize) -> [E; W] {
    let mut tile = [E::zeroed(); W];
    if let Some(row) = row.get(first..first + W).in_bounds() {
        tile.copy_from_slice(row);
    }
    tile
}

/// Stores columns of a row.
#[inline(always)]
pub(super) fn store<E: Lanes, const W: usize>(tile: &[E; W], row: &mut [E], first: usize) {
    if let Some(row) = row.get_mut(first..first + W).in_bounds() {
        row.copy_from_slice(tile);
    }
}

/// `sum + a y`
#[inline(always)]
pub(super) fn add<A: Arithmetic, E: Lanes, const W: usize>(sum: &mut [E; W], a: E, y: &[E], first: usize) {
    if let Some(y) = y.get(first..first + W).in_bounds() {
        for (sum, &y) in sum.iter_mut().zip(y) {
            *sum = A::add(*sum, a, y);
        }
    }
}

/// Adds `a` to `column` if it is in this micro-tile. All columns are compared: an index at run time
/// would move the sums out of registers.
#[inline(always)]
pub(super) fn add_to_column<E: Lanes, const W: usize>(sum: &mut [E; W], a: E, first: usize, column: usize) {
    for (i, sum) in sum.iter_mut().enumerate() {
        if first + i == column {
            *sum = *sum + a;
        }
    }
}
