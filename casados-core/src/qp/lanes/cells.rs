//! Products of small dense matrices whose elements are registers, with a problem in each lane.
//!
//! Matrices are stored column after column. Everything is inlined into the function compiled for
//! `E`.

use crate::qp::layout::copy_common;
use crate::scalar::{Lanes, Scalar};

/// An element in memory.
pub type Cell<E> = <E as Scalar>::Cell;

/// A read-only matrix, and the stride of its columns.
pub struct Matrix<'a, C> {
    pub data: &'a [C],
    pub ld: usize,
}

impl<C> Clone for Matrix<'_, C> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<C> Copy for Matrix<'_, C> {}

/// The minuend of a product.
#[derive(Clone, Copy)]
pub enum Start<'a, C> {
    Zero,
    /// The target itself.
    Itself,
    Matrix(Matrix<'a, C>),
}

/// Returns the number of columns of a tile: sixteen accumulators with thirty-two registers,
/// otherwise eight.
const fn tile_columns<E>() -> usize {
    if cfg!(target_arch = "x86_64") && size_of::<E>() < 64 { 2 } else { 4 }
}

#[inline(always)]
fn tile<E: Lanes, const R: usize, const C: usize>(
    (to, ld): (&mut [Cell<E>], usize),
    start: Start<'_, Cell<E>>,
    (x, y): (Matrix<'_, Cell<E>>, Matrix<'_, Cell<E>>),
    depth: usize,
) {
    let mut sums = [[E::from_f64(0.0); R]; C];
    let from = match start {
        Start::Zero => None,
        Start::Itself => Some((&*to, ld)),
        Start::Matrix(Matrix { data, ld }) => Some((data, ld)),
    };
    if let Some((from, ld)) = from {
        for (c, sums) in sums.iter_mut().enumerate() {
            let Some(from) = from.get(c * ld..).and_then(|column| column.first_chunk::<R>()) else { return };
            for (sum, from) in sums.iter_mut().zip(from) {
                *sum = E::load(from);
            }
        }
    }
    for k in 0..depth {
        let x = x.data.get(k * x.ld..).and_then(|column| column.first_chunk::<R>());
        let y = y.data.get(k * y.ld..).and_then(|column| column.first_chunk::<C>());
        let (Some(x), Some(y)) = (x, y) else { return };
        let mut factors = [E::from_f64(0.0); R];
        for (factor, x) in factors.iter_mut().zip(x) {
            *factor = E::load(x);
        }
        for (sums, y) in sums.iter_mut().zip(y) {
            let y = E::load(y);
            for (sum, &x) in sums.iter_mut().zip(&factors) {
                *sum = sum.subtract_product(x, y);
            }
        }
    }
    for (c, sums) in sums.iter().enumerate() {
        let Some(to) = to.get_mut(c * ld..).and_then(|column| column.first_chunk_mut::<R>()) else { return };
        for (to, sum) in to.iter_mut().zip(sums) {
            sum.store(to);
        }
    }
}

/// Computes `to (rows × columns) = start − X (rows × depth) Y (columns × depth)ᵀ`; with `lower`
/// elements above the diagonal are undefined.
#[inline(always)]
pub fn product<E: Lanes>(
    (to, ld): (&mut [Cell<E>], usize),
    start: Start<'_, Cell<E>>,
    (x, y): (Matrix<'_, Cell<E>>, Matrix<'_, Cell<E>>),
    [rows, columns, depth]: [usize; 3],
    lower: bool,
) {
    let mut j = 0;
    while j < columns {
        let width = match columns - j {
            4.. if tile_columns::<E>() == 4 => 4,
            2.. => 2,
            _ => 1,
        };
        let mut i = if lower { j } else { 0 };
        while i < rows {
            let height = match rows - i {
                4.. => 4,
                2.. => 2,
                _ => 1,
            };
            let to = (to.get_mut(j * ld + i..).unwrap_or_default(), ld);
            let start = match start {
                Start::Matrix(from) => Start::Matrix(Matrix {
                    data: from.data.get(j * from.ld + i..).unwrap_or_default(),
                    ld: from.ld,
                }),
                other => other,
            };
            let x = Matrix { data: x.data.get(i..).unwrap_or_default(), ld: x.ld };
            let y = Matrix { data: y.data.get(j..).unwrap_or_default(), ld: y.ld };
            match (height, width) {
                (4, 4) => tile::<E, 4, 4>(to, start, (x, y), depth),
                (4, 2) => tile::<E, 4, 2>(to, start, (x, y), depth),
                (4, _) => tile::<E, 4, 1>(to, start, (x, y), depth),
                (2, 4) => tile::<E, 2, 4>(to, start, (x, y), depth),
                (2, 2) => tile::<E, 2, 2>(to, start, (x, y), depth),
                (2, _) => tile::<E, 2, 1>(to, start, (x, y), depth),
                (_, 4) => tile::<E, 1, 4>(to, start, (x, y), depth),
                (_, 2) => tile::<E, 1, 2>(to, start, (x, y), depth),
                _ => tile::<E, 1, 1>(to, start, (x, y), depth),
            }
            i += height;
        }
        j += width;
    }
}

/// Computes `to −= X v`.
#[inline(always)]
pub fn subtract<E: Lanes>(
    to: &mut [Cell<E>],
    x: Matrix<'_, Cell<E>>,
    v: &[Cell<E>],
    [rows, depth]: [usize; 2],
) {
    product::<E>((to, rows), Start::Itself, (x, Matrix { data: v, ld: 1 }), [rows, 1, depth], false);
}

/// Computes `to −= Xᵀ v`, an element for each column, with four accumulators.
#[inline(always)]
pub fn subtract_transposed<E: Lanes>(to: &mut [Cell<E>], x: Matrix<'_, Cell<E>>, v: &[Cell<E>]) {
    let mut columns = x.data.chunks_exact(x.ld.max(1));
    let (fours, rest) = to.as_chunks_mut::<4>();
    for to in fours {
        let mut next = || columns.next().unwrap_or_default();
        let all = [next(), next(), next(), next()];
        let mut sums = [E::from_f64(0.0); 4];
        for (sum, to) in sums.iter_mut().zip(&*to) {
            *sum = E::load(to);
        }
        let [a, b, c, d] = all;
        for ((((a, b), c), d), v) in a.iter().zip(b).zip(c).zip(d).zip(v) {
            let v = E::load(v);
            sums = [
                sums[0].subtract_product(E::load(a), v),
                sums[1].subtract_product(E::load(b), v),
                sums[2].subtract_product(E::load(c), v),
                sums[3].subtract_product(E::load(d), v),
            ];
        }
        for (to, sum) in to.iter_mut().zip(sums) {
            sum.store(to);
        }
    }
    for (to, column) in rest.iter_mut().zip(columns) {
        let mut sum = E::load(to);
        for (x, v) in column.iter().zip(v) {
            sum = sum.subtract_product(E::load(x), E::load(v));
        }
        sum.store(to);
    }
}

/// Computes `to −= a x`.
#[inline(always)]
pub fn subtract_scaled<E: Lanes>(to: &mut [Cell<E>], a: E, x: &[Cell<E>]) {
    for (to, x) in to.iter_mut().zip(x) {
        E::load(to).subtract_product(E::load(x), a).store(to);
    }
}

/// Computes `x *= a`.
#[inline(always)]
pub fn scale<E: Lanes>(x: &mut [Cell<E>], a: E) {
    for x in x {
        (E::load(x) * a).store(x);
    }
}

/// Computes `to = −x`.
#[inline(always)]
pub fn assign_negated<E: Lanes>(to: &mut [Cell<E>], x: &[Cell<E>]) {
    for (to, x) in to.iter_mut().zip(x) {
        (-E::load(x)).store(to);
    }
}

/// Copies the lower triangle of a square matrix to the upper one.
#[inline(always)]
pub fn mirror<C: Copy>(matrix: &mut [C], n: usize) {
    for j in 0..n {
        for i in j + 1..n {
            let Some(&below) = matrix.get(j * n + i) else { return };
            copy_common(matrix.get_mut(i * n + j..).unwrap_or_default(), &[below]);
        }
    }
}
