//! Sums of rows whose columns stay in registers while they are added up.
//!
//! A register of several numbers is written to memory in as much time as several products take. So
//! of groups a few columns are summed up at a time, over all terms of a row. Single numbers go
//! through whole rows, term by term: the compiler makes registers of their columns.

use crate::linalg::Arithmetic;
use crate::scalar::Lanes;

/// What is done with `W` columns at a time. To be `#[inline(always)]`.
pub(super) trait ColumnKernel {
    fn process_columns<A: Arithmetic, const W: usize>(&mut self, first: usize);
}

/// All columns from `first` on, eight or four at most at a time: as many have a register each for
/// their sums, and as many products under way as the processor can have.
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

/// Columns of a row.
#[inline(always)]
pub(super) fn load<E: Lanes, const W: usize>(row: &[E], first: usize) -> [E; W] {
    let mut tile = [E::zeroed(); W];
    if let Some(row) = row.get(first..first + W) {
        tile.copy_from_slice(row);
    }
    tile
}

/// Columns to a row.
#[inline(always)]
pub(super) fn store<E: Lanes, const W: usize>(tile: &[E; W], row: &mut [E], first: usize) {
    if let Some(row) = row.get_mut(first..first + W) {
        row.copy_from_slice(tile);
    }
}

/// `sum + a y`
#[inline(always)]
pub(super) fn add<A: Arithmetic, E: Lanes, const W: usize>(sum: &mut [E; W], a: E, y: &[E], first: usize) {
    if let Some(y) = y.get(first..first + W) {
        for (sum, &y) in sum.iter_mut().zip(y) {
            *sum = A::add(*sum, a, y);
        }
    }
}

/// `a` more in one column, if it is among these. Each is looked at: a place that is found out when
/// it runs would keep sums out of registers.
#[inline(always)]
pub(super) fn add_to_column<E: Lanes, const W: usize>(sum: &mut [E; W], a: E, first: usize, column: usize) {
    for (i, sum) in sum.iter_mut().enumerate() {
        if first + i == column {
            *sum = *sum + a;
        }
    }
}
