//! Matrix products in micro-tiles of registers.
//!
//! Rows of a tile are registers of `X`, its columns are elements of `Y` in all lanes. Two registers
//! times six elements are twelve accumulators; with their operands they leave one of the sixteen
//! registers of AVX2 free. Three times four leave none: the compiler then spills accumulators to
//! memory, which takes twice as long.

use super::{Columns, splat};
use crate::scalar::{Packed, Piece, Real};
use core::marker::PhantomData;
use core::ops::Range;

/// Columns of tiles; they are even, so that a tile that starts at an even column does not exceed a
/// matrix with an even number of columns. AVX-512 has twice as many registers as AVX2.
const COLUMNS_AVX512: usize = 8;
const COLUMNS_AVX2: usize = 6;
const MIN_TILE_COLUMNS: usize = 4;
const TWO_COLUMNS: usize = 2;
/// The number of columns that a product may write beyond those requested.
pub const PADDING_COLUMNS: usize = 1;

/// The minuend of a product; zero beyond its end.
#[derive(Clone, Copy)]
pub enum Source<'a, T> {
    /// Zero.
    Zero,
    /// The target itself.
    Target,
    /// Another matrix.
    Matrix(Columns<'a, T>),
}

impl<T> Source<'_, T> {
    #[inline(always)]
    fn skip(self, columns: usize) -> Self {
        if let Source::Matrix(matrix) = self { Source::Matrix(matrix.skip(columns)) } else { self }
    }
    #[inline(always)]
    fn skip_rows(self, rows: usize) -> Self {
        if let Source::Matrix(matrix) = self { Source::Matrix(matrix.below(rows)) } else { self }
    }
}

/// Computes `sums − X Yᵀ` for `R` registers of rows of `X` and `C` rows of `Y`, over `depth`
/// columns.
#[inline(always)]
fn tile<T: Real, E: Packed<T>, const R: usize, const C: usize>(
    sums: &mut [[E; R]; C],
    mut x: &[E::Cell],
    x_ld: usize,
    mut y: &[T],
    y_ld: usize,
    depth: usize,
) {
    for _ in 0..depth {
        let (Some(column), Some(row)) = (x.first_chunk::<R>(), y.first_chunk::<C>()) else { return };
        let mut registers = [E::from_f64(0.0); R];
        for (register, cell) in registers.iter_mut().zip(column) {
            *register = E::load(cell);
        }
        for (sums, &factor) in sums.iter_mut().zip(row) {
            let factor = splat::<T, E>(factor);
            for (sum, &register) in sums.iter_mut().zip(&registers) {
                *sum = sum.minus_product(register, factor);
            }
        }
        x = x.get(x_ld..).unwrap_or_default();
        y = y.get(y_ld..).unwrap_or_default();
    }
}

/// Writes a tile of `target = source − X Yᵀ`.
#[inline(always)]
fn write_tile<T: Real, E: Packed<T>, const R: usize, const C: usize>(
    target: &mut [T],
    target_ld: usize,
    source: Source<'_, T>,
    x: Columns<'_, T>,
    y: Columns<'_, T>,
    depth: usize,
) {
    let mut sums = [[E::from_f64(0.0); R]; C];
    let (mut columns, ld) = match source {
        Source::Zero => (&[][..], 0),
        Source::Target => (&*target, target_ld),
        Source::Matrix(matrix) => (matrix.data, matrix.ld),
    };
    for sums in &mut sums {
        let Some(cells) = E::cells(columns).first_chunk::<R>() else { break };
        for (sum, cell) in sums.iter_mut().zip(cells) {
            *sum = E::load(cell);
        }
        columns = columns.get(ld..).unwrap_or_default();
    }
    tile::<T, E, R, C>(&mut sums, E::cells(x.data), x.ld / E::LANES, y.data, y.ld, depth);
    let mut columns = target;
    for sums in &sums {
        let Some(cells) = E::cells_mut(columns).first_chunk_mut::<R>() else { return };
        for (sum, cell) in sums.iter().zip(cells) {
            sum.store(cell);
        }
        columns = columns.get_mut(target_ld..).unwrap_or_default();
    }
}

/// Writes rows of `C` columns of `target = source − X Yᵀ`, from the first requested row on.
#[inline(always)]
fn strip<T: Real, E: Packed<T>, const C: usize>(
    target: &mut [T],
    target_ld: usize,
    source: Source<'_, T>,
    x: Columns<'_, T>,
    y: Columns<'_, T>,
    rows: usize,
    depth: usize,
) {
    let mut left = rows.div_ceil(E::LANES);
    let mut row = 0;
    while left > 0 {
        let target = target.get_mut(row..).unwrap_or_default();
        let (source, x) = (source.skip_rows(row), x.below(row));
        let done = left.min(2);
        if done == 2 {
            write_tile::<T, E, 2, C>(target, target_ld, source, x, y, depth);
        } else {
            write_tile::<T, E, 1, C>(target, target_ld, source, x, y, depth);
        }
        left -= done;
        row += done * E::LANES;
    }
}

/// The requested rows of a product.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// All rows.
    Full,
    /// The rows from the diagonal on; some rows above it may be written as well.
    Lower,
}

/// Computes `target = source − X Yᵀ` with `rows` × `columns` elements; the source is zero beyond
/// its end.
///
/// Columns are processed in tiles from the first one on, which must be even, as must be the first
/// row of `Y` in its columns. [`PADDING_COLUMNS`] more columns than requested are written if the
/// target has them, and rows up to whole registers.
#[inline(always)]
pub fn product<T: Real, E: Packed<T>>(
    target: &mut [T],
    target_ld: usize,
    source: Source<'_, T>,
    x: Columns<'_, T>,
    y: Columns<'_, T>,
    (rows, columns, depth): (usize, Range<usize>, usize),
    part: Part,
) {
    E::vectorize(Product::<T, E> {
        target,
        target_ld,
        source,
        x,
        y,
        rows,
        columns,
        depth,
        part,
        register: PhantomData,
    });
}

/// The arguments of a product, as a separate function: the tiles are large in code size.
struct Product<'a, T, E> {
    target: &'a mut [T],
    target_ld: usize,
    source: Source<'a, T>,
    x: Columns<'a, T>,
    y: Columns<'a, T>,
    rows: usize,
    columns: Range<usize>,
    depth: usize,
    part: Part,
    register: PhantomData<E>,
}

impl<T: Real, E: Packed<T>> Piece for Product<'_, T, E> {
    #[inline(always)]
    fn run(self) {
        let Self { target, target_ld, source, x, y, rows, columns, depth, part, .. } = self;
        tiles::<T, E>(target, target_ld, source, x, y, (rows, columns, depth), part);
    }
}

#[inline(always)]
fn tiles<T: Real, E: Packed<T>>(
    target: &mut [T],
    target_ld: usize,
    source: Source<'_, T>,
    x: Columns<'_, T>,
    y: Columns<'_, T>,
    (rows, columns, depth): (usize, Range<usize>, usize),
    part: Part,
) {
    let mut column = columns.start;
    while column < columns.end {
        let first = if part == Part::Lower { column / E::LANES * E::LANES } else { 0 };
        let target = target.get_mut(column * target_ld + first..).unwrap_or_default();
        let source = source.skip(column).skip_rows(first);
        let rows = rows.saturating_sub(first);
        let (x, y) = (x.below(first), y.below(column));
        column += match columns.end - column {
            0..=2 => {
                strip::<T, E, TWO_COLUMNS>(target, target_ld, source, x, y, rows, depth);
                TWO_COLUMNS
            }
            3..=4 => {
                strip::<T, E, MIN_TILE_COLUMNS>(target, target_ld, source, x, y, rows, depth);
                MIN_TILE_COLUMNS
            }
            7.. if size_of::<E>() == 64 => {
                strip::<T, E, COLUMNS_AVX512>(target, target_ld, source, x, y, rows, depth);
                COLUMNS_AVX512
            }
            _ => {
                strip::<T, E, COLUMNS_AVX2>(target, target_ld, source, x, y, rows, depth);
                COLUMNS_AVX2
            }
        };
    }
}

/// Computes `target − X y`, `rows` elements, over `depth` columns.
#[cfg_attr(feature = "std", inline(always))]
#[cfg_attr(not(feature = "std"), inline(never))]
pub fn subtract<T: Real, E: Packed<T>>(
    target: &mut [T],
    x: Columns<'_, T>,
    y: &[T],
    rows: usize,
    depth: usize,
) {
    let mut left = rows.div_ceil(E::LANES);
    let mut cells = E::cells_mut(target);
    let mut x = x;
    loop {
        match left {
            0 => return,
            1 => return subtract_rows::<T, E, 1>(cells, x, y, depth),
            2 => return subtract_rows::<T, E, 2>(cells, x, y, depth),
            3 => return subtract_rows::<T, E, 3>(cells, x, y, depth),
            _ => subtract_rows::<T, E, 4>(cells, x, y, depth),
        }
        left -= 4;
        cells = cells.get_mut(4..).unwrap_or_default();
        x = x.below(4 * E::LANES);
    }
}

#[inline(always)]
fn subtract_rows<T: Real, E: Packed<T>, const R: usize>(
    target: &mut [E::Cell],
    x: Columns<'_, T>,
    y: &[T],
    depth: usize,
) {
    let Some(target) = target.first_chunk_mut::<R>() else { return };
    let mut sums = [E::from_f64(0.0); R];
    for (sum, cell) in sums.iter_mut().zip(&*target) {
        *sum = E::load(cell);
    }
    let mut data = x.data;
    for &factor in y.get(..depth).unwrap_or_default() {
        let Some(column) = E::cells(data).first_chunk::<R>() else { break };
        let factor = splat::<T, E>(factor);
        for (sum, cell) in sums.iter_mut().zip(column) {
            *sum = sum.minus_product(E::load(cell), factor);
        }
        data = data.get(x.ld..).unwrap_or_default();
    }
    for (sum, cell) in sums.iter().zip(target) {
        sum.store(cell);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{LEADING_DIMENSIONS, integers};
    use super::*;
    use crate::scalar::Registers;

    struct Case<'a> {
        target: &'a mut [f64],
        x: Columns<'a, f64>,
        y: Columns<'a, f64>,
        size: (usize, usize, usize),
        part: Part,
    }

    impl Registers<f64> for Case<'_> {
        fn run<E: Packed<f64>>(self) {
            let (rows, columns, depth) = self.size;
            let source = if depth % 2 == 0 { Source::Zero } else { Source::Target };
            product::<f64, E>(
                self.target,
                self.x.ld,
                source,
                self.x,
                self.y,
                (rows, 0..columns, depth),
                self.part,
            );
        }
    }

    /// All sizes around the limits of tiles, with memory that ends at the last column.
    #[test]
    fn products_of_all_sizes() {
        for (padding, padded) in LEADING_DIMENSIONS.into_iter().enumerate() {
            for case in 0..13 * 13 * 5 * 2 {
                let (rows, columns, depth) = (1 + case % 13, 1 + case / 13 % 13, case / 169 % 5);
                let part = if case < 845 { Part::Full } else { Part::Lower };
                let size = (rows, columns, depth);
                let (ld, ld_y) = (padded(rows), padded(columns));
                let (x, y) = (integers(rows, depth, ld, 1), integers(columns, depth, ld_y, 2));
                let before = integers(rows, columns + PADDING_COLUMNS, ld, 3);
                let mut target = before.clone();
                let (x_columns, y_columns) =
                    (Columns { data: &x[..], ld }, Columns { data: &y[..], ld: ld_y });
                let product = Case { target: &mut target, x: x_columns, y: y_columns, size, part };
                if padding == 0 {
                    f64::registers(product)
                } else {
                    product.run::<f64>()
                }
                for column in 0..columns {
                    for row in if part == Part::Lower { column } else { 0 }..rows {
                        let sum = (0..depth).map(|k| x[k * ld + row] * y[k * ld_y + column]).sum::<f64>();
                        let source = if depth % 2 == 0 { 0.0 } else { before[column * ld + row] };
                        assert_eq!(target[column * ld + row], source - sum, "{size:?} {row} {column} {ld}");
                    }
                }
            }
        }
    }
}
