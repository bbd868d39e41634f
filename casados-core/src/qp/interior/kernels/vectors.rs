//! Products with vectors, by SIMD.

use super::dots::symmetric;
use super::{MAX_LANES, lane_indices, splat};
use crate::scalar::{Packed, Real, Registers};

/// Computes `target + H v` as [`symmetric`], for callers outside a SIMD kernel.
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

/// Computes `target − factor · column`.
#[inline(always)]
pub fn subtract_column<T: Real, E: Packed<T>>(target: &mut [T], factor: T, column: &[T]) {
    let factor = splat::<T, E>(factor);
    for (target, cell) in E::cells_mut(target).iter_mut().zip(E::cells(column)) {
        E::load(target).minus_product(E::load(cell), factor).store(target);
    }
}

/// Computes `target · factor`.
#[inline(always)]
pub fn scale<T: Real, E: Packed<T>>(target: &mut [T], factor: T) {
    let factor = splat::<T, E>(factor);
    for target in E::cells_mut(target) {
        (E::load(target) * factor).store(target);
    }
}

/// Copies the lower triangle to the upper one.
#[cfg_attr(feature = "std", inline(always))]
#[cfg_attr(not(feature = "std"), inline(never))]
pub fn mirror<T: Real, E: Packed<T>>(matrix: &mut [T], ld: usize, n: usize) {
    if E::LANES > 1 {
        let blocks = n.div_ceil(E::LANES);
        for column in 0..blocks {
            for row in column..blocks {
                mirror_block::<T, E>(matrix, ld, n, [row * E::LANES, column * E::LANES]);
            }
        }
        return;
    }
    for column in 0..n {
        let (mut below, mut above) = (column * ld + column, column * ld + column);
        for _ in column + 1..n {
            (below, above) = (below + 1, above + ld);
            if let Some(&value) = matrix.get(below)
                && let Some(to) = matrix.get_mut(above)
            {
                *to = value;
            }
        }
    }
}

/// As [`mirror`], for a block of one register of rows and as many columns, from `row` and `column`
/// on.
#[inline(always)]
fn mirror_block<T: Real, E: Packed<T>>(matrix: &mut [T], ld: usize, n: usize, [row, column]: [usize; 2]) {
    let mut turned = [<E::Cell as bytemuck::Zeroable>::zeroed(); MAX_LANES];
    let from = matrix.get(column * ld + row..).unwrap_or_default();
    transpose_block::<T, E>(&mut turned, from, ld, n - column);
    let index = lane_indices::<T, E>();
    let mut columns = matrix.get_mut(row * ld + column..).unwrap_or_default();
    for (lane, turned) in turned.iter().enumerate().take((n - row).min(E::LANES)) {
        if let Some(cell) = E::cells_mut(columns).first_mut() {
            let mut value = E::load(turned);
            if row == column {
                value = E::select(E::lt(index, E::from_f64(lane as f64)), value, E::load(cell));
            }
            value.store(cell);
        }
        columns = columns.get_mut(ld..).unwrap_or_default();
    }
}

/// Transposes the first register of rows of a matrix; past the last column, elements are zero.
#[inline(always)]
fn transpose_block<T: Real, E: Packed<T>>(
    to: &mut [E::Cell; MAX_LANES],
    from: &[T],
    ld: usize,
    columns: usize,
) {
    let mut own = [E::from_f64(0.0); MAX_LANES];
    let (cells, ld) = (E::cells(from), ld / E::LANES);
    for (index, own) in own.iter_mut().enumerate().take(E::LANES) {
        if index < columns
            && let Some(cell) = cells.get(index * ld)
        {
            *own = E::load(cell);
        }
    }
    if let (Some(from), Some(to)) = (own.get(..E::LANES), to.get_mut(..E::LANES)) {
        E::transpose(from, to);
    }
}

/// Adds the transpose of `rows` rows of `columns` columns.
#[cfg_attr(feature = "std", inline(always))]
#[cfg_attr(not(feature = "std"), inline(never))]
pub fn add_rows<T: Real, E: Packed<T>>(target: &mut [T], from: &[T], ld: usize, [rows, columns]: [usize; 2]) {
    if E::LANES == 1 {
        for (i, column) in from.chunks(ld.max(1)).take(columns).enumerate() {
            for (target, &value) in target.iter_mut().skip(i).step_by(ld.max(1)).zip(column).take(rows) {
                *target = *target + value;
            }
        }
        return;
    }
    for column in (0..columns).step_by(E::LANES) {
        for row in (0..rows).step_by(E::LANES) {
            let mut turned = [<E::Cell as bytemuck::Zeroable>::zeroed(); MAX_LANES];
            let block = from.get(column * ld + row..).unwrap_or_default();
            transpose_block::<T, E>(&mut turned, block, ld, columns - column);
            let cells = E::cells_mut(target.get_mut(row * ld + column..).unwrap_or_default());
            for (lane, turned) in turned.iter().enumerate().take((rows - row).min(E::LANES)) {
                if let Some(cell) = cells.get_mut(lane * (ld / E::LANES)) {
                    (E::load(cell) + E::load(turned)).store(cell);
                }
            }
        }
    }
}

/// Copies whole registers.
#[inline(always)]
pub fn copy<T: Real, E: Packed<T>>(target: &mut [T], source: &[T]) {
    for (target, source) in E::cells_mut(target).iter_mut().zip(E::cells(source)) {
        *target = *source;
    }
}

/// Computes `source − target` in whole registers.
#[inline(always)]
pub fn subtract_from<T: Real, E: Packed<T>>(target: &mut [T], source: &[T]) {
    for (target, source) in E::cells_mut(target).iter_mut().zip(E::cells(source)) {
        (E::load(source) - E::load(target)).store(target);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{LEADING_DIMENSIONS, integers};
    use super::*;
    use alloc::vec::Vec;

    /// The products by their definition; elements above the diagonal, which must not be read, are
    /// NaN.
    #[test]
    fn symmetric_products_of_all_sizes() {
        for (n, padding) in (1..27).flat_map(|n| [(n, 0), (n, 1)]) {
            let ld = LEADING_DIMENSIONS[padding](n);
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

    struct Transposes<'a> {
        mirrored: &'a mut [f64],
        sums: &'a mut [f64],
        n: usize,
        ld: usize,
    }

    impl crate::scalar::Registers<f64> for Transposes<'_> {
        fn run<E: Packed<f64>>(self) {
            let Self { mirrored, sums, n, ld } = self;
            add_rows::<f64, E>(sums, mirrored, ld, [n / 2, n]);
            mirror::<f64, E>(mirrored, ld, n);
        }
    }

    /// The definition, for matrices of one register and of several.
    #[test]
    fn transposes_of_all_sizes() {
        for (n, padding) in (1..27).flat_map(|n| [(n, 0), (n, 1)]) {
            let ld = LEADING_DIMENSIONS[padding](n);
            let before = integers(n, n, ld, 1);
            let (mut mirrored, mut sums) = (before.clone(), integers(n, n, ld, 2));
            let own = sums.clone();
            let transposes = Transposes { mirrored: &mut mirrored, sums: &mut sums, n, ld };
            if padding == 0 {
                f64::registers(transposes)
            } else {
                crate::scalar::Registers::run::<f64>(transposes)
            }
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                assert_eq!(mirrored[j * ld + i], before[i.min(j) * ld + i.max(j)], "{n} {i} {j}");
                let sum = if j < n / 2 { own[j * ld + i] + before[i * ld + j] } else { own[j * ld + i] };
                assert_eq!(sums[j * ld + i], sum, "{n} {i} {j}");
            }
        }
    }
}
