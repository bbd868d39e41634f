//! Products of columns with a vector. Their sums lie in the lanes of one register: a vector that is
//! stored by whole registers is loaded again without a stall.

use super::{Columns, MAX_LANES, Source, chunk, lane_indices};
use crate::scalar::lanes::REGISTERS;
use crate::scalar::{Packed, Piece, Real};
use core::marker::PhantomData;

/// Computes `target + Xᵀ v`: `columns` dot products of columns of `X` with `v`, of `rows` elements.
/// The padding of one factor must be zero. Elements of the target past its last whole register are
/// computed one by one.
#[cfg_attr(feature = "std", inline(always))]
#[cfg_attr(not(feature = "std"), inline(never))]
pub fn add_transposed<T: Real, E: Packed<T>>(
    target: &mut [T],
    x: Columns<'_, T>,
    v: &[T],
    rows: usize,
    columns: usize,
) {
    if const { !REGISTERS } {
        return add_dots::<T>(target, x, v, (rows, columns));
    }
    sum_transposed::<T, E>(target, Source::Target, x, v, (rows, columns));
}

/// Computes `target = source + Xᵀ v` for a target of whole registers. Past the columns it is the
/// source.
#[inline(always)]
pub fn sum_transposed<T: Real, E: Packed<T>>(
    target: &mut [T],
    source: Source<'_, T>,
    x: Columns<'_, T>,
    v: &[T],
    (rows, columns): (usize, usize),
) {
    if columns > 0 {
        E::vectorize(AddTransposed::<T, E> { target, source, x, v, rows, columns, register: PhantomData });
    }
}

/// As [`add_transposed`], one number at a time.
#[inline(always)]
fn add_dots<T: Real>(target: &mut [T], x: Columns<'_, T>, v: &[T], (rows, columns): (usize, usize)) {
    let v = v.get(..rows).unwrap_or_default();
    let mut data = x.data;
    for target in target.iter_mut().take(columns) {
        *target = data.iter().zip(v).fold(*target, |sum, (&x, &v)| sum + x * v);
        data = data.get(x.ld..).unwrap_or_default();
    }
}

/// A product as a separate function.
struct AddTransposed<'a, T, E> {
    target: &'a mut [T],
    source: Source<'a, T>,
    x: Columns<'a, T>,
    v: &'a [T],
    rows: usize,
    columns: usize,
    register: PhantomData<E>,
}

impl<T: Real, E: Packed<T>> Piece for AddTransposed<'_, T, E> {
    #[inline(always)]
    fn run(self) {
        let Self { target, source, mut x, v, rows, mut columns, .. } = self;
        let (own, from) = match source {
            Source::Zero => (false, &[][..]),
            Source::Target => (true, &[][..]),
            Source::Matrix(matrix) => (false, E::cells(matrix.data)),
        };
        let cells = E::cells(v).get(..rows.div_ceil(E::LANES)).unwrap_or_default();
        let mut done = 0;
        for (index, cell) in E::cells_mut(target).iter_mut().enumerate() {
            let here = columns.min(E::LANES);
            let dots = negative_dots::<T, E>(x, (0, here), cells);
            let source = if own { Some(&*cell) } else { from.get(index) };
            let before = source.map_or(E::from_f64(0.0), E::load);
            (before - dots).store(cell);
            columns -= here;
            if columns == 0 {
                return;
            }
            (x, done) = (x.skip(here), done + here);
        }
        add_dots(target.get_mut(done..).unwrap_or_default(), x, v, (rows, columns));
    }
}

/// Computes the controls `u − Kᵀ x` of `v = (x, u)`, whose `u` is zero, from `u` in `feedforward`.
/// Rows of `K` past the states are zero.
#[inline(always)]
pub fn add_feedback<T: Real, E: Packed<T>>(
    v: &mut [T],
    gains: Columns<'_, T>,
    feedforward: &[T],
    [nx, nu]: [usize; 2],
) {
    let of_states = nx.div_ceil(E::LANES);
    for register in nx / E::LANES..(nx + nu).div_ceil(E::LANES) {
        let begin = register * E::LANES;
        let (lane, first) = (nx.saturating_sub(begin), begin.saturating_sub(nx));
        let here = (nu - first).min(E::LANES - lane);
        let cells = E::cells_mut(v);
        let states = cells.get(..of_states).unwrap_or_default();
        let dots = negative_dots::<T, E>(gains.skip(first), (lane, here), states);
        let (Some(cell), Some(own)) = (cells.get_mut(register), E::cells(feedforward).get(register)) else {
            return;
        };
        let value = E::load(own) + dots;
        let value = E::select(lanes::<T, E>(lane, here), value, E::load(cell));
        value.store(cell);
    }
}

/// Returns the mask of `count` lanes from `first` on.
#[inline(always)]
pub fn lanes<T: Real, E: Packed<T>>(first: usize, count: usize) -> E::Mask {
    let (index, half) = (lane_indices::<T, E>(), 0.5);
    let (begin, end) = (first as f64 - half, (first + count) as f64 - half);
    E::and(E::lt(E::from_f64(begin), index), E::lt(index, E::from_f64(end)))
}

/// Computes `−Xᵀ v` of `columns` columns, in the lanes from `lane` on; other lanes are zero.
#[inline(always)]
fn negative_dots<T: Real, E: Packed<T>>(
    x: Columns<'_, T>,
    (lane, columns): (usize, usize),
    v: &[E::Cell],
) -> E {
    if lane == 0 && columns == MAX_LANES {
        return sums_of_columns::<T, E, MAX_LANES>(x, (0, MAX_LANES), v);
    }
    let sums = match lane + columns {
        0..=2 => sums_of_columns::<T, E, 2>(x, (lane, columns), v),
        3..=4 => sums_of_columns::<T, E, 4>(x, (lane, columns), v),
        _ => sums_of_columns::<T, E, MAX_LANES>(x, (lane, columns), v),
    };
    if columns == E::LANES { sums } else { E::select(lanes::<T, E>(lane, columns), sums, E::from_f64(0.0)) }
}

/// As [`negative_dots`], in `C` lanes; other lanes are unspecified. Lanes before and after the
/// columns have the sums of the first and of the last column.
#[inline(always)]
#[allow(unsafe_code)]
fn sums_of_columns<T: Real, E: Packed<T>, const C: usize>(
    x: Columns<'_, T>,
    (lane, columns): (usize, usize),
    v: &[E::Cell],
) -> E {
    let zero = E::from_f64(0.0);
    let (cells, ld, last) = (E::cells(x.data), x.ld / E::LANES, columns.saturating_sub(1));
    if cells.len() < last * ld + v.len() {
        return zero;
    }
    let mut begins = [0; C];
    for (index, begin) in begins.iter_mut().enumerate() {
        *begin = index.saturating_sub(lane).min(last) * ld;
    }
    let mut sums = [zero; MAX_LANES];
    for (row, cell) in v.iter().enumerate() {
        let factor = E::load(cell);
        for (sum, &begin) in sums.iter_mut().zip(&begins) {
            // SAFETY: no column is after the last one, which has as many rows as `v`.
            let [cell] = unsafe { chunk::<_, 1>(cells, begin + row) };
            *sum = sum.minus_product(E::load(cell), factor);
        }
    }
    E::totals(sums.get(..E::LANES).unwrap_or_default())
}

/// Computes `target + H v` with a symmetric matrix stored by its lower triangle; elements above the
/// diagonal are ignored. Target and `v` are padded, `v` with zeros.
#[cfg_attr(feature = "std", inline(always))]
#[cfg_attr(not(feature = "std"), inline(never))]
pub fn symmetric<T: Real, E: Packed<T>>(target: &mut [T], h: &[T], ld: usize, v: &[T], n: usize) {
    let factors = E::cells(v).get(..n.div_ceil(E::LANES)).unwrap_or_default();
    let mut targets = E::cells_mut(target);
    let mut h = Columns { data: h, ld };
    let mut left = n;
    for register in 0..factors.len() {
        let own = factors.get(register..).unwrap_or_default();
        symmetric_columns::<T, E>(targets, h, left, own);
        targets = targets.get_mut(1..).unwrap_or_default();
        left = left.saturating_sub(E::LANES);
        h = h.skip(E::LANES).below(E::LANES);
    }
}

/// Adds the products of the columns of one register of variables, from the diagonal on, and of
/// their transpose. The slices start at the diagonal.
#[inline(always)]
#[allow(unsafe_code)]
fn symmetric_columns<T: Real, E: Packed<T>>(
    targets: &mut [E::Cell],
    h: Columns<'_, T>,
    left: usize,
    factors: &[E::Cell],
) {
    let zero = E::from_f64(0.0);
    let Some(own) = factors.first() else { return };
    let (cells, ld, last) = (E::cells(h.data), h.ld / E::LANES, left.saturating_sub(1).min(E::LANES - 1));
    if cells.len() < last * ld + factors.len() {
        return;
    }
    let mut begins = [0; MAX_LANES];
    for (index, begin) in begins.iter_mut().enumerate() {
        // Past the last column, the padding of the last one is read, which is zero.
        *begin = index.min(last) * ld;
    }
    let index = lane_indices::<T, E>();
    let (mut dots, mut diagonal) = ([zero; MAX_LANES], zero);
    for (column, (dot, &begin)) in dots.iter_mut().zip(&begins).enumerate().take(E::LANES) {
        // SAFETY: no column is after the last one, which has as many rows as `factors`, of which
        // there is one at least.
        let [cell] = unsafe { chunk::<_, 1>(cells, begin) };
        let (value, lane) = (E::load(cell), E::from_f64(column as f64));
        let below = E::select(E::lt(lane, index), value, zero);
        let lower = E::select(E::lt(index, lane), zero, value);
        diagonal = diagonal.minus_product(lower, E::from_f64(E::lane(own, column)));
        *dot = dot.minus_product(below, E::load(own));
    }
    for (row, (target, factor)) in targets.iter_mut().zip(factors).enumerate().skip(1) {
        let (factor, mut sum) = (E::load(factor), zero);
        for (column, (dot, &begin)) in dots.iter_mut().zip(&begins).enumerate().take(E::LANES) {
            // SAFETY: as above; `row` is one of `factors`.
            let [cell] = unsafe { chunk::<_, 1>(cells, begin + row) };
            let value = E::load(cell);
            sum = sum.minus_product(value, E::from_f64(E::lane(own, column)));
            *dot = dot.minus_product(value, factor);
        }
        (E::load(target) - sum).store(target);
    }
    if let Some(target) = targets.first_mut() {
        let sums = E::totals(dots.get(..E::LANES).unwrap_or_default()) + diagonal;
        (E::load(target) - sums).store(target);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{LEADING_DIMENSIONS, integers};
    use super::*;
    use crate::scalar::Registers;
    use alloc::vec::Vec;

    struct Case<'a> {
        target: &'a mut [f64],
        x: Columns<'a, f64>,
        v: &'a [f64],
        size: (usize, usize),
    }

    impl Registers<f64> for Case<'_> {
        fn run<E: Packed<f64>>(self) {
            add_transposed::<f64, E>(self.target, self.x, self.v, self.size.0, self.size.1);
        }
    }

    /// The products by their definition, in targets with and without padding: sums of small
    /// integers are exact.
    #[test]
    fn transposed_products_of_all_sizes() {
        for case in 0..19 * 19 * 4 {
            let (rows, columns) = (1 + case % 19, case / 19 % 19);
            let padded = LEADING_DIMENSIONS[case / 361 % 2];
            let (ld, whole) = (padded(rows), case / 722 == 0);
            let (x, v) = (integers(rows, columns, ld, 1), integers(rows, 1, ld, 2));
            let before = integers(columns, 1, if whole { padded(columns) } else { columns.max(1) }, 3);
            let mut target = before.clone();
            let x = Columns { data: &x[..], ld };
            let own = if whole { &mut target[..] } else { &mut target[..columns] };
            let product = Case { target: own, x, v: &v, size: (rows, columns) };
            if ld % 8 == 0 {
                f64::registers(product)
            } else {
                product.run::<f64>()
            }
            for (column, &before) in before.iter().enumerate() {
                let dot = (0..rows).map(|i| x.data.get(column * ld + i).unwrap_or(&0.0) * v[i]).sum::<f64>();
                let dot = if column < columns { dot } else { 0.0 };
                assert_eq!(target[column], before + dot, "{rows} {columns} {column} {ld}");
            }
        }
    }

    struct Feedback<'a> {
        v: &'a mut [f64],
        gains: Columns<'a, f64>,
        feedforward: &'a [f64],
        size: [usize; 2],
    }

    impl Registers<f64> for Feedback<'_> {
        fn run<E: Packed<f64>>(self) {
            add_feedback::<f64, E>(self.v, self.gains, self.feedforward, self.size);
        }
    }

    /// The feedback by its definition, for all positions of controls in registers; states are
    /// unchanged.
    #[test]
    fn feedback_of_all_sizes() {
        for (nx, nu) in (1..20).flat_map(|nx| (0..12).map(move |nu| (nx, nu))) {
            let ld = LEADING_DIMENSIONS[0](nx + nu);
            let (gains, feedforward) = (integers(nx, nu, ld, 1), integers(nx + nu, 1, ld, 2));
            let mut v = integers(nx, 1, ld, 3);
            let expected: Vec<f64> = (0..nx + nu)
                .map(|i| match i.checked_sub(nx) {
                    None => v[i],
                    Some(j) => feedforward[i] - (0..nx).map(|i| gains[j * ld + i] * v[i]).sum::<f64>(),
                })
                .collect();
            let gains = Columns { data: &gains[..], ld };
            f64::registers(Feedback { v: &mut v, gains, feedforward: &feedforward, size: [nx, nu] });
            assert_eq!(v[..nx + nu], expected, "{nx} {nu}");
        }
    }
}
