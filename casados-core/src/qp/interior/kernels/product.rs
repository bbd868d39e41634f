//! Matrix products in micro-tiles of registers.
//!
//! Rows of a tile are registers of `X`, its columns are elements of `Y` in all lanes. Two registers
//! times six elements are twelve accumulators; with their operands they leave one of the sixteen
//! registers of AVX2 free. Three times four leave none: the compiler then spills accumulators to
//! memory, which takes twice as long.

use super::{Columns, chunk, splat};
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

/// Whole registers of columns, from an index on.
#[derive(Clone, Copy)]
struct Cells<'a, C> {
    data: &'a [C],
    begin: usize,
    ld: usize,
}

/// Computes `sums − X Yᵀ` for `R` registers of rows of `X` and `C` rows of `Y`, over `depth`
/// columns.
#[inline(always)]
#[allow(unsafe_code)]
fn tile<T: Real, E: Packed<T>, const R: usize, const C: usize>(
    sums: &mut [[E; R]; C],
    x: Cells<'_, E::Cell>,
    y: Cells<'_, T>,
    depth: usize,
) {
    let Some(last) = depth.checked_sub(1) else { return };
    if x.data.len() < x.begin + last * x.ld + R || y.data.len() < y.begin + last * y.ld + C {
        return;
    }
    for k in 0..depth {
        // SAFETY: `k ≤ last`, and the slices are as long as the last of these chunks needs.
        let (column, row) =
            unsafe { (chunk::<_, R>(x.data, x.begin + k * x.ld), chunk::<_, C>(y.data, y.begin + k * y.ld)) };
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
    }
}

/// The target of a product, the matrix from which it is subtracted, and its factors.
struct Operands<'a, T, E: Packed<T>> {
    target: &'a mut [E::Cell],
    ld: usize,
    /// `None` if the source is the target.
    source: Option<Cells<'a, E::Cell>>,
    x: Cells<'a, E::Cell>,
    y: Cells<'a, T>,
    depth: usize,
}

/// Writes a tile of `target = source − X Yᵀ`, from a register of rows and a column on. The source
/// is zero past its end; elements past the end of the target are not written.
#[inline(always)]
fn write_tile<T: Real, E: Packed<T>, const R: usize, const C: usize>(
    all: &mut Operands<'_, T, E>,
    row: usize,
    column: usize,
) {
    let mut sums = [[E::from_f64(0.0); R]; C];
    let begin = column * all.ld + row;
    let (from, index, ld) = match all.source {
        None => (&*all.target, begin, all.ld),
        Some(source) => (source.data, source.begin + column * source.ld + row, source.ld),
    };
    if from.len() >= index + R {
        for (c, sums) in sums.iter_mut().enumerate() {
            let Some(cells) = from.get(index + c * ld..).and_then(|cells| cells.first_chunk::<R>()) else {
                break;
            };
            for (sum, cell) in sums.iter_mut().zip(cells) {
                *sum = E::load(cell);
            }
        }
    }
    let x = Cells { begin: all.x.begin + row, ..all.x };
    let y = Cells { begin: all.y.begin + column, ..all.y };
    tile::<T, E, R, C>(&mut sums, x, y, all.depth);
    for (c, sums) in sums.iter().enumerate() {
        let cells = all.target.get_mut(begin + c * all.ld..).and_then(|cells| cells.first_chunk_mut::<R>());
        let Some(cells) = cells else { return };
        for (sum, cell) in sums.iter().zip(cells) {
            sum.store(cell);
        }
    }
}

/// Writes some registers of rows of `C` columns.
#[inline(always)]
fn strip<T: Real, E: Packed<T>, const C: usize>(
    all: &mut Operands<'_, T, E>,
    rows: Range<usize>,
    column: usize,
) {
    let mut row = rows.start;
    while row + 1 < rows.end {
        write_tile::<T, E, 2, C>(all, row, column);
        row += 2;
    }
    if row < rows.end {
        write_tile::<T, E, 1, C>(all, row, column);
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
        let mut all = Operands::<T, E> {
            target: E::cells_mut(target),
            ld: target_ld / E::LANES,
            source: match source {
                Source::Zero => Some(Cells { data: &[], begin: 0, ld: 0 }),
                Source::Target => None,
                Source::Matrix(matrix) => {
                    Some(Cells { data: E::cells(matrix.data), begin: 0, ld: matrix.ld / E::LANES })
                }
            },
            x: Cells { data: E::cells(x.data), begin: 0, ld: x.ld / E::LANES },
            y: Cells { data: y.data, begin: 0, ld: y.ld },
            depth,
        };
        tiles(&mut all, rows.div_ceil(E::LANES), columns, part);
    }
}

#[inline(always)]
fn tiles<T: Real, E: Packed<T>>(
    all: &mut Operands<'_, T, E>,
    rows: usize,
    columns: Range<usize>,
    part: Part,
) {
    let mut column = columns.start;
    while column < columns.end {
        let first = if part == Part::Lower { column / E::LANES } else { 0 };
        column += match columns.end - column {
            0..=2 => {
                strip::<T, E, TWO_COLUMNS>(all, first..rows, column);
                TWO_COLUMNS
            }
            3..=4 => {
                strip::<T, E, MIN_TILE_COLUMNS>(all, first..rows, column);
                MIN_TILE_COLUMNS
            }
            7.. if size_of::<E>() == 64 => {
                strip::<T, E, COLUMNS_AVX512>(all, first..rows, column);
                COLUMNS_AVX512
            }
            _ => {
                strip::<T, E, COLUMNS_AVX2>(all, first..rows, column);
                COLUMNS_AVX2
            }
        };
    }
}

/// Computes `target − X y`, `rows` elements, over `depth` columns.
#[inline(always)]
pub fn subtract<T: Real, E: Packed<T>>(
    target: &mut [T],
    x: Columns<'_, T>,
    y: &[T],
    rows: usize,
    depth: usize,
) {
    difference::<T, E>(target, Source::Target, x, y, (rows, depth));
}

/// Computes `target = source − X y`, `rows` elements, over `depth` columns.
#[cfg_attr(feature = "std", inline(always))]
#[cfg_attr(not(feature = "std"), inline(never))]
pub fn difference<T: Real, E: Packed<T>>(
    target: &mut [T],
    mut source: Source<'_, T>,
    mut x: Columns<'_, T>,
    y: &[T],
    (rows, depth): (usize, usize),
) {
    let mut left = rows.div_ceil(E::LANES);
    let mut cells = E::cells_mut(target);
    loop {
        match left {
            0 => return,
            1 => return subtract_rows::<T, E, 1>(cells, source, x, y, depth),
            2 => return subtract_rows::<T, E, 2>(cells, source, x, y, depth),
            3 => return subtract_rows::<T, E, 3>(cells, source, x, y, depth),
            _ => subtract_rows::<T, E, 4>(cells, source, x, y, depth),
        }
        left -= 4;
        cells = cells.get_mut(4..).unwrap_or_default();
        x = x.below(4 * E::LANES);
        if let Source::Matrix(matrix) = source {
            source = Source::Matrix(matrix.below(4 * E::LANES));
        }
    }
}

#[inline(always)]
#[allow(unsafe_code)]
fn subtract_rows<T: Real, E: Packed<T>, const R: usize>(
    target: &mut [E::Cell],
    source: Source<'_, T>,
    x: Columns<'_, T>,
    y: &[T],
    depth: usize,
) {
    let Some(target) = target.first_chunk_mut::<R>() else { return };
    let (columns, ld, last) = (E::cells(x.data), x.ld / E::LANES, depth.saturating_sub(1));
    let Some(factors) = y.get(..depth) else { return };
    if depth > 0 && columns.len() < last * ld + R {
        return;
    }
    // Two sums of each register halve the chain of dependent products.
    let mut sums = [[E::from_f64(0.0); R]; 2];
    let from = match source {
        Source::Zero => None,
        Source::Target => Some(&*target),
        Source::Matrix(matrix) => E::cells(matrix.data).first_chunk::<R>(),
    };
    if let Some(from) = from {
        for (sum, cell) in sums[0].iter_mut().zip(from) {
            *sum = E::load(cell);
        }
    }
    let (pairs, rest) = factors.as_chunks::<2>();
    for (k, pair) in pairs.iter().enumerate() {
        for (i, (&factor, sums)) in pair.iter().zip(&mut sums).enumerate() {
            // SAFETY: `2 k + i ≤ last`, and there are so many columns.
            let column = unsafe { chunk::<_, R>(columns, (2 * k + i) * ld) };
            let factor = splat::<T, E>(factor);
            for (sum, cell) in sums.iter_mut().zip(column) {
                *sum = sum.minus_product(E::load(cell), factor);
            }
        }
    }
    for &factor in rest {
        // SAFETY: this is the last column.
        let column = unsafe { chunk::<_, R>(columns, last * ld) };
        let factor = splat::<T, E>(factor);
        for (sum, cell) in sums[1].iter_mut().zip(column) {
            *sum = sum.minus_product(E::load(cell), factor);
        }
    }
    for ((first, second), cell) in sums[0].iter().zip(&sums[1]).zip(target) {
        (*first + *second).store(cell);
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
