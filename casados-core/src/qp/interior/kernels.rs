//! Products of small dense matrices, in tiles of registers.
//!
//! All matrices lie column after column, and columns are whole registers apart. Rows of a tile are
//! registers of `X`, its columns are elements of `Y` in all lanes: two registers times six elements
//! are twelve sums, and with what they are computed from they leave one of the sixteen registers of
//! AVX2 free. Three times four leave none, and the compiler then keeps sums in memory, which takes
//! twice as long. Everything is inlined into the function that was compiled for `E`.

use crate::qp::layout::part;
use crate::scalar::{Packed, Piece, Real, Registers};
use core::marker::PhantomData;
use core::ops::Range;

/// Columns of tiles, which are even: what begins at an even column and is no longer than columns,
/// whose length is even, does not end behind them.
const WIDE: usize = 6;
const NARROW: usize = 4;
const PAIR: usize = 2;
/// A product writes up to one column more than it is asked for.
pub const MORE: usize = 1;

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

/// What a product is subtracted from; zero where it ends.
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
    fn below(self, rows: usize) -> Self {
        if let Source::Matrix(matrix) = self { Source::Matrix(matrix.below(rows)) } else { self }
    }
}

/// A number in every lane.
#[inline(always)]
pub fn splat<T: Real, E: Packed<T>>(value: T) -> E {
    E::from_f64(value.to_f64())
}

/// `sums − X Yᵀ` for `R` registers of rows of `X` and `C` rows of `Y`, over `depth` columns.
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

/// A tile of `target = source − X Yᵀ`.
#[inline(always)]
fn update<T: Real, E: Packed<T>, const R: usize, const C: usize>(
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

/// Some rows of `C` columns of `target = source − X Yᵀ`; all begin at the first row that is wanted.
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
        let (source, x) = (source.below(row), x.below(row));
        let done = left.min(2);
        if done == 2 {
            update::<T, E, 2, C>(target, target_ld, source, x, y, depth);
        } else {
            update::<T, E, 1, C>(target, target_ld, source, x, y, depth);
        }
        left -= done;
        row += done * E::LANES;
    }
}

/// Which rows of a product are wanted.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// All.
    Full,
    /// Those from the diagonal on; above it some may be written as well.
    Lower,
}

/// `target = source − X Yᵀ` with `rows` × `columns` elements; the source is zero where it ends.
///
/// Columns are taken in tiles from the first one on, which is even, and so is where `Y` begins in
/// its columns. [`MORE`] columns than asked for are written if the target has them, and rows up to
/// whole registers.
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

/// A product as a function of its own: the tiles are many instructions.
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
        let source = source.skip(column).below(first);
        let rows = rows.saturating_sub(first);
        let (x, y) = (x.below(first), y.below(column));
        column += match columns.end - column {
            0..=2 => {
                strip::<T, E, PAIR>(target, target_ld, source, x, y, rows, depth);
                PAIR
            }
            3..=4 => {
                strip::<T, E, NARROW>(target, target_ld, source, x, y, rows, depth);
                NARROW
            }
            _ => {
                strip::<T, E, WIDE>(target, target_ld, source, x, y, rows, depth);
                WIDE
            }
        };
    }
}

/// `target − X y`, `rows` elements, over `depth` columns.
#[inline(always)]
pub fn subtract<T: Real, E: Packed<T>>(
    target: &mut [T],
    x: Columns<'_, T>,
    y: &[T],
    rows: usize,
    depth: usize,
) {
    let mut left = rows.div_ceil(E::LANES);
    let mut cells = E::cells_mut(target);
    let mut x_cells = E::cells(x.data);
    let ld = x.ld / E::LANES;
    while left > 0 {
        let done = if left >= 6 {
            subtract_rows::<T, E, 6>(cells, x_cells, ld, y, depth);
            6
        } else if left >= 3 {
            subtract_rows::<T, E, 3>(cells, x_cells, ld, y, depth);
            3
        } else {
            subtract_rows::<T, E, 1>(cells, x_cells, ld, y, depth);
            1
        };
        left -= done;
        cells = cells.get_mut(done..).unwrap_or_default();
        x_cells = x_cells.get(done..).unwrap_or_default();
    }
}

#[inline(always)]
fn subtract_rows<T: Real, E: Packed<T>, const R: usize>(
    target: &mut [E::Cell],
    x: &[E::Cell],
    ld: usize,
    y: &[T],
    depth: usize,
) {
    let Some(target) = target.first_chunk_mut::<R>() else { return };
    let mut sums = [[E::from_f64(0.0); R]];
    for sums in &mut sums {
        for (sum, cell) in sums.iter_mut().zip(&*target) {
            *sum = E::load(cell);
        }
    }
    tile::<T, E, R, 1>(&mut sums, x, ld, y, 1, depth);
    for sums in &sums {
        for (sum, cell) in sums.iter().zip(&mut *target) {
            sum.store(cell);
        }
    }
}

/// `target + Xᵀ v`: `columns` products of columns of `X` with `v`, of `rows` elements. Padding must
/// be zero in one of them.
#[inline(always)]
pub fn add_transposed<T: Real, E: Packed<T>>(
    target: &mut [T],
    x: Columns<'_, T>,
    v: &[T],
    rows: usize,
    columns: usize,
) {
    let registers = rows.div_ceil(E::LANES);
    let v = E::cells(v).get(..registers).unwrap_or_default();
    let (fours, rest) = target.get_mut(..columns).unwrap_or_default().as_chunks_mut::<NARROW>();
    let mut x = x;
    for target in fours {
        let dots = dots::<T, E, NARROW>(x, v);
        for (target, dot) in target.iter_mut().zip(dots) {
            *target = *target + dot;
        }
        x = x.skip(NARROW);
    }
    for target in rest {
        let [dot] = dots::<T, E, 1>(x, v);
        *target = *target + dot;
        x = x.skip(1);
    }
}

/// `target + H v` with a symmetric matrix whose lower triangle is there; above it may be anything.
/// Target and `v` are padded, `v` with zeros.
#[inline(always)]
pub fn symmetric<T: Real, E: Packed<T>>(target: &mut [T], h: &[T], ld: usize, v: &[T], n: usize) {
    let mut index = <E::Cell as bytemuck::Zeroable>::zeroed();
    for lane in 0..E::LANES {
        E::set_lane(&mut index, lane, lane as f64);
    }
    let index = E::load(&index);
    let below = |column: usize| splat::<T, E>(T::from_f64((column % E::LANES) as f64));
    let strict = |cell: &E::Cell, column: usize| {
        E::select(below(column).is_smaller(index), E::load(cell), E::from_f64(0.0))
    };
    // What is below the diagonal, row by row of registers.
    for (i, target) in E::cells_mut(target).iter_mut().take(n.div_ceil(E::LANES)).enumerate() {
        let mut sum = E::load(target);
        let columns = h.chunks_exact(ld.max(1)).zip(v);
        for (column, &v) in columns.clone().take(i * E::LANES) {
            if let Some(cell) = E::cells(column).get(i) {
                sum = sum.minus_product(E::load(cell), splat::<T, E>(-v));
            }
        }
        for (j, (column, &v)) in columns.enumerate().take(n).skip(i * E::LANES).take(E::LANES) {
            if let Some(cell) = E::cells(column).get(i) {
                sum = sum.minus_product(strict(cell, j), splat::<T, E>(-v));
            }
        }
        sum.store(target);
    }
    // And its transpose, with the diagonal.
    let v_cells = E::cells(v).get(..n.div_ceil(E::LANES)).unwrap_or_default();
    for (j, (column, target)) in h.chunks_exact(ld.max(1)).zip(target).take(n).enumerate() {
        let first = j / E::LANES;
        let (cells, factors) = (E::cells(column).get(first..), v_cells.get(first..));
        let mut products = cells.unwrap_or_default().iter().zip(factors.unwrap_or_default());
        let Some((cell, factor)) = products.next() else { return };
        let mut sum = E::from_f64(0.0).minus_product(strict(cell, j), E::load(factor));
        for (cell, factor) in products {
            sum = sum.minus_product(E::load(cell), E::load(factor));
        }
        let diagonal = column.get(j).zip(v.get(j)).map_or(T::ZERO, |(&h, &v)| h * v);
        *target = *target + (diagonal - sum.total());
    }
}

/// `target + H v` as [`symmetric`], for whoever is not in registers yet.
pub fn add_symmetric<T: Real>(target: &mut [T], h: &[T], ld: usize, v: &[T], n: usize) {
    T::registers(AddSymmetric { target, h, ld, v, n });
}

struct AddSymmetric<'a, T> {
    target: &'a mut [T],
    h: &'a [T],
    ld: usize,
    v: &'a [T],
    n: usize,
}

impl<T: Real> Registers<T> for AddSymmetric<'_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        symmetric::<T, E>(self.target, self.h, self.ld, self.v, self.n);
    }
}

/// Products of the first `C` columns with `v`.
#[inline(always)]
fn dots<T: Real, E: Packed<T>, const C: usize>(x: Columns<'_, T>, v: &[E::Cell]) -> [T; C] {
    let mut columns = [&[][..]; C];
    let mut rest = x.data;
    for column in &mut columns {
        *column = E::cells(rest).get(..v.len()).unwrap_or_default();
        rest = rest.get(x.ld..).unwrap_or_default();
    }
    let mut sums = [E::from_f64(0.0); C];
    for (i, v) in v.iter().enumerate() {
        let v = E::load(v);
        for (sum, column) in sums.iter_mut().zip(&columns) {
            if let Some(cell) = column.get(i) {
                *sum = sum.minus_product(E::load(cell), v);
            }
        }
    }
    let mut dots = [T::ZERO; C];
    for (dot, sum) in dots.iter_mut().zip(sums) {
        *dot = -sum.total();
    }
    dots
}

/// `target − factor · column`
#[inline(always)]
pub fn subtract_column<T: Real, E: Packed<T>>(target: &mut [T], factor: T, column: &[T]) {
    let factor = splat::<T, E>(factor);
    for (target, cell) in E::cells_mut(target).iter_mut().zip(E::cells(column)) {
        E::load(target).minus_product(E::load(cell), factor).store(target);
    }
}

/// `target · factor`
#[inline(always)]
pub fn scale<T: Real, E: Packed<T>>(target: &mut [T], factor: T) {
    let factor = splat::<T, E>(factor);
    for target in E::cells_mut(target) {
        (E::load(target) * factor).store(target);
    }
}

/// The upper triangle from the lower one.
#[inline(always)]
pub fn mirror<T: Real>(matrix: &mut [T], ld: usize, n: usize) {
    for column in 0..n {
        for row in column + 1..n {
            let below = part(matrix, column * ld + row, 1).first().copied().unwrap_or(T::ZERO);
            if let Some(above) = matrix.get_mut(row * ld + column) {
                *above = below;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::qp::layout::pad;
    use crate::scalar::Registers;
    use alloc::vec::Vec;

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

    /// What columns are padded to: registers, and an even number, which is enough without them.
    const PADDINGS: [fn(usize) -> usize; 2] = [pad::<f64>, |n| n.next_multiple_of(2)];

    /// Small integers, of which sums are exact, in columns of `rows` that are `ld` apart.
    fn integers(rows: usize, columns: usize, ld: usize, seed: usize) -> Vec<f64> {
        (0..ld * columns)
            .map(|i| if i % ld < rows { ((i * 7 + seed * 13) % 11) as f64 - 5.0 } else { 0.0 })
            .collect()
    }

    /// Every size around the edges of tiles, with memory that ends with the last column.
    #[test]
    fn products_of_all_sizes() {
        for (padding, padded) in PADDINGS.into_iter().enumerate() {
            for case in 0..13 * 13 * 5 * 2 {
                let (rows, columns, depth) = (1 + case % 13, 1 + case / 13 % 13, case / 169 % 5);
                let part = if case < 845 { Part::Full } else { Part::Lower };
                let size = (rows, columns, depth);
                let (ld, ld_y) = (padded(rows), padded(columns));
                let (x, y) = (integers(rows, depth, ld, 1), integers(columns, depth, ld_y, 2));
                let before = integers(rows, columns + MORE, ld, 3);
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

    /// The definition, with what must not be read above the diagonal.
    #[test]
    fn symmetric_products_of_all_sizes() {
        for (n, padding) in (1..27).flat_map(|n| [(n, 0), (n, 1)]) {
            let ld = PADDINGS[padding](n);
            let mut h = integers(n, n, ld, 1);
            let v = integers(n, 1, ld, 2);
            let before = integers(n, 1, ld, 3);
            let expected: Vec<f64> = (0..n)
                .map(|i| before[i] + (0..n).map(|j| h[i.min(j) * ld + i.max(j)] * v[j]).sum::<f64>())
                .collect();
            (0..n).for_each(|j| h[j * ld..j * ld + j].fill(f64::NAN));
            let mut target = before.clone();
            if padding == 0 {
                add_symmetric(&mut target, &h, ld, &v, n);
            } else {
                symmetric::<f64, f64>(&mut target, &h, ld, &v, n);
            }
            assert_eq!(target[..n], expected, "{n}");
        }
    }
}
