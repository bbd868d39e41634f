//! Products with vectors, in registers.

use super::{Columns, splat};
use crate::qp::layout::part;
use crate::scalar::{Packed, Real, Registers};

/// Columns whose products with a vector are summed side by side.
const SIDE: usize = 4;

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
    let (fours, rest) = target.get_mut(..columns).unwrap_or_default().as_chunks_mut::<SIDE>();
    let mut x = x;
    for target in fours {
        let dots = dots::<T, E, SIDE>(x, v);
        for (target, dot) in target.iter_mut().zip(dots) {
            *target = *target + dot;
        }
        x = x.skip(SIDE);
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
    use super::super::tests::{PADDINGS, integers};
    use super::*;
    use alloc::vec::Vec;

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
