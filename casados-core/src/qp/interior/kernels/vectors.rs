//! Products with vectors, by SIMD.

use super::{Columns, splat};
use crate::qp::element::get;
use crate::scalar::{Packed, Real, Registers};

/// The number of registers of a vector that are held at a time.
const ACCUMULATORS: usize = 4;

/// Computes `target + Xᵀ v`: `columns` dot products of columns of `X` with `v`, of `rows` elements.
/// The padding of one factor must be zero.
#[cfg_attr(feature = "std", inline(always))]
#[cfg_attr(not(feature = "std"), inline(never))]
pub fn add_transposed<T: Real, E: Packed<T>>(
    target: &mut [T],
    x: Columns<'_, T>,
    v: &[T],
    rows: usize,
    columns: usize,
) {
    let target = target.get_mut(..columns).unwrap_or_default();
    let (mut left, mut x, mut v) = (rows.div_ceil(E::LANES), x, E::cells(v));
    loop {
        match left {
            0 => return,
            1 => return add_dots::<T, E, 1>(target, x, v),
            2 => return add_dots::<T, E, 2>(target, x, v),
            3 => return add_dots::<T, E, 3>(target, x, v),
            _ => add_dots::<T, E, ACCUMULATORS>(target, x, v),
        }
        left -= ACCUMULATORS;
        x = x.below(ACCUMULATORS * E::LANES);
        v = v.get(ACCUMULATORS..).unwrap_or_default();
    }
}

/// As [`add_transposed`], over `R` registers.
#[inline(always)]
fn add_dots<T: Real, E: Packed<T>, const R: usize>(target: &mut [T], x: Columns<'_, T>, v: &[E::Cell]) {
    let Some(cells) = v.first_chunk::<R>() else { return };
    let mut negative = [E::from_f64(0.0); R];
    for (negative, cell) in negative.iter_mut().zip(cells) {
        *negative = -E::load(cell);
    }
    let mut data = x.data;
    for target in target {
        let Some(column) = E::cells(data).first_chunk::<R>() else { return };
        let mut sum = E::from_f64(0.0);
        for (&negative, cell) in negative.iter().zip(column) {
            sum = sum.minus_product(E::load(cell), negative);
        }
        *target = *target + sum.total();
        data = data.get(x.ld..).unwrap_or_default();
    }
}

/// Computes `target + H v` with a symmetric matrix stored by its lower triangle; elements above the
/// diagonal are ignored. Target and `v` are padded, `v` with zeros.
#[cfg_attr(feature = "std", inline(always))]
#[cfg_attr(not(feature = "std"), inline(never))]
pub fn symmetric<T: Real, E: Packed<T>>(target: &mut [T], h: &[T], ld: usize, v: &[T], n: usize) {
    let (last, mut begin) = (n.div_ceil(E::LANES), 0);
    while begin < last {
        let rows = (begin, n);
        match last - begin {
            1 => symmetric_rows::<T, E, 1>(target, h, ld, v, rows),
            2 => symmetric_rows::<T, E, 2>(target, h, ld, v, rows),
            3 => symmetric_rows::<T, E, 3>(target, h, ld, v, rows),
            _ => symmetric_rows::<T, E, ACCUMULATORS>(target, h, ld, v, rows),
        }
        begin += ACCUMULATORS;
    }
}

/// Adds the products of `R` registers of rows below the diagonal, of their transpose and of the
/// diagonal.
#[inline(always)]
fn symmetric_rows<T: Real, E: Packed<T>, const R: usize>(
    target: &mut [T],
    h: &[T],
    ld: usize,
    v: &[T],
    (begin, n): (usize, usize),
) {
    let Some(cells) = E::cells(v).get(begin..).and_then(|v| v.first_chunk::<R>()) else { return };
    let mut factors = [E::from_f64(0.0); R];
    for (factor, cell) in factors.iter_mut().zip(cells) {
        *factor = E::load(cell);
    }
    let (index, zero) = (lane_indices::<T, E>(), E::from_f64(0.0));
    let mut sums = [zero; R];
    let mut data = h.get(begin * E::LANES..).unwrap_or_default();
    let columns = n.min((begin + R) * E::LANES);
    for (j, (&factor, target)) in v.iter().zip(&mut *target).enumerate().take(columns) {
        let Some(column) = E::cells(data).first_chunk::<R>() else { break };
        let (first, lane) = (j / E::LANES, splat::<T, E>(T::from_f64((j % E::LANES) as f64)));
        let negative = splat::<T, E>(-factor);
        let mut dot = zero;
        for (r, ((sum, cell), &v)) in sums.iter_mut().zip(column).zip(&factors).enumerate() {
            if begin + r < first {
                continue;
            }
            let own = E::load(cell);
            let value = if begin + r == first { E::select(lane.is_smaller(index), own, zero) } else { own };
            *sum = sum.minus_product(value, negative);
            dot = dot.minus_product(value, v);
        }
        let diagonal = if j < begin * E::LANES { T::ZERO } else { get(data, j - begin * E::LANES) };
        *target = *target + (diagonal * factor - dot.total());
        data = data.get(ld..).unwrap_or_default();
    }
    let rows = E::cells_mut(target).get_mut(begin..).unwrap_or_default();
    for (cell, &sum) in rows.iter_mut().zip(&sums) {
        (E::load(cell) + sum).store(cell);
    }
}

/// Computes `target + H v` as [`symmetric`], for callers outside a SIMD kernel.
pub fn add_symmetric_product<T: Real>(target: &mut [T], h: &[T], ld: usize, v: &[T], n: usize) {
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

/// The maximum number of lanes.
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

/// Copies the lower triangle to the upper one.
#[cfg_attr(feature = "std", inline(always))]
#[cfg_attr(not(feature = "std"), inline(never))]
pub fn mirror<T: Real, E: Packed<T>>(matrix: &mut [T], ld: usize, n: usize) {
    if E::LANES > 1 && n <= E::LANES {
        return mirror_register::<T, E>(matrix, ld, n);
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

/// As [`mirror`], for a matrix whose columns are one register each.
#[inline(always)]
fn mirror_register<T: Real, E: Packed<T>>(matrix: &mut [T], ld: usize, n: usize) {
    let mut own = [E::from_f64(0.0); MAX_LANES];
    let mut columns = &*matrix;
    for own in own.iter_mut().take(n) {
        if let Some(cell) = E::cells(columns).first() {
            *own = E::load(cell);
        }
        columns = columns.get(ld..).unwrap_or_default();
    }
    let mut turned = [<E::Cell as bytemuck::Zeroable>::zeroed(); MAX_LANES];
    let (Some(from), Some(to)) = (own.get(..E::LANES), turned.get_mut(..E::LANES)) else { return };
    E::transpose(from, to);
    let (index, one) = (lane_indices::<T, E>(), E::from_f64(1.0));
    let (mut columns, mut column) = (matrix, E::from_f64(0.0));
    for (own, turned) in own.iter().zip(&turned).take(n) {
        let value = E::select(index.is_smaller(column), E::load(turned), *own);
        if let Some(cell) = E::cells_mut(columns).first_mut() {
            value.store(cell);
        }
        columns = columns.get_mut(ld..).unwrap_or_default();
        column = column + one;
    }
}

/// Copies whole registers.
#[inline(always)]
pub fn copy<T: Real, E: Packed<T>>(target: &mut [T], source: &[T]) {
    for (target, source) in E::cells_mut(target).iter_mut().zip(E::cells(source)) {
        *target = *source;
    }
}

/// Copies whole registers of `−source`.
#[inline(always)]
pub fn copy_negative<T: Real, E: Packed<T>>(target: &mut [T], source: &[T]) {
    for (target, source) in E::cells_mut(target).iter_mut().zip(E::cells(source)) {
        (-E::load(source)).store(target);
    }
}

/// Adds whole registers.
#[inline(always)]
pub fn add<T: Real, E: Packed<T>>(target: &mut [T], source: &[T]) {
    for (target, source) in E::cells_mut(target).iter_mut().zip(E::cells(source)) {
        (E::load(target) + E::load(source)).store(target);
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
                add_symmetric_product(&mut target, &h, ld, &v, n);
            } else {
                symmetric::<f64, f64>(&mut target, &h, ld, &v, n);
            }
            assert_eq!(target[..n], expected, "{n}");
        }
    }
}
