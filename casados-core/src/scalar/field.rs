//! The arithmetic of kernels.

use super::Known;
use core::fmt::Debug;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// Numbers with addition, multiplication, division and comparison of magnitudes: the arithmetic of
/// eliminations.
pub trait Field:
    Copy
    + Debug
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The result of a comparison: `bool`, or one for each lane.
    type Mask: Copy;

    /// A constant.
    fn from_f64(value: f64) -> Self;

    /// An integer known at run time only; without double precision for types that lack it.
    #[inline(always)]
    fn from_whole(value: usize) -> Self {
        Self::from_f64(value as f64)
    }

    /// `1/self`
    #[inline(always)]
    fn reciprocal(self) -> Self {
        Self::from_f64(1.0) / self
    }

    /// `self − a b`, rounded once if the number type supports it. Only for code that has detected
    /// the instruction: elsewhere it is slow.
    #[inline(always)]
    fn subtract_product(self, a: Self, b: Self) -> Self {
        self - a * b
    }

    /// `target − left · right` of s×s blocks in column-major order, fused. For kernels, as
    /// everything that requires [`Known`] instructions.
    #[inline(always)]
    fn subtract_blocks<const S: usize, const WIDE: bool>(
        target: &mut [[Self; S]; S],
        left: &[[Self; S]; S],
        right: &[[Self; S]; S],
        known: Known<WIDE>,
    ) {
        for (target, right) in target.iter_mut().zip(right) {
            Self::subtract_columns(target, left, right, known);
        }
    }

    /// `target − block · x` of an s×s block in column-major order, fused.
    #[inline(always)]
    fn subtract_columns<const S: usize, const WIDE: bool>(
        target: &mut [Self; S],
        block: &[[Self; S]; S],
        x: &[Self; S],
        _: Known<WIDE>,
    ) {
        for (column, &x) in block.iter().zip(x) {
            for (target, &element) in target.iter_mut().zip(column) {
                *target = target.subtract_product(element, x);
            }
        }
    }

    /// `target − a b`, element by element, fused.
    #[inline(always)]
    fn subtract_products<const W: usize, const WIDE: bool>(
        target: &mut [Self; W],
        a: &[Self; W],
        b: &[Self; W],
        _: Known<WIDE>,
    ) {
        for ((target, &a), &b) in target.iter_mut().zip(a).zip(b) {
            *target = target.subtract_product(a, b);
        }
    }

    /// `target = block`, one register at a time.
    #[inline(always)]
    fn write_block<const S: usize, const WIDE: bool>(
        target: &mut [[Self; S]; S],
        block: &[[Self; S]; S],
        _: Known<WIDE>,
    ) {
        *target = *block;
    }

    /// The transposed matrix.
    #[inline(always)]
    fn transposed<const N: usize, const WIDE: bool>(rows: &[[Self; N]; N], _: Known<WIDE>) -> [[Self; N]; N] {
        transposed(rows)
    }

    /// `target − factor · row`, fused.
    #[inline(always)]
    fn subtract_row<const W: usize, const WIDE: bool>(
        target: &mut [Self; W],
        factor: Self,
        row: &[Self; W],
        _: Known<WIDE>,
    ) {
        for (target, &element) in target.iter_mut().zip(row) {
            *target = target.subtract_product(factor, element);
        }
    }

    /// `target − a b` of `⌊N/2⌋` complex numbers (their real parts, then their imaginary ones) and
    /// a real number if `N` is odd, fused.
    #[inline(always)]
    fn subtract_complex<const N: usize, const WIDE: bool>(
        target: &mut [Self; N],
        a: &[Self; N],
        b: &[Self; N],
        _: Known<WIDE>,
    ) {
        let mut sum = *target;
        for l in 0..const { N / 2 } {
            let m = const { N / 2 } + l;
            sum[l] = sum[l].subtract_product(a[l], b[l]).subtract_product(-a[m], b[m]);
            sum[m] = sum[m].subtract_product(a[l], b[m]).subtract_product(a[m], b[l]);
        }
        if const { N % 2 == 1 } {
            sum[N - 1] = sum[N - 1].subtract_product(a[N - 1], b[N - 1]);
        }
        *target = sum;
    }

    /// `|a| < |b|`
    fn is_smaller(self, other: Self) -> Self::Mask;

    /// `if mask { a } else { b }`, lane by lane
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self;
    /// Whether any lane is set.
    fn any(mask: Self::Mask) -> bool;
}

/// `baseⁿ` by square and multiply; the reciprocal for a negative exponent.
#[inline(always)]
#[allow(dead_code)] // Single numbers with `std` have a method of their own.
pub(crate) fn power<F: Field>(base: F, n: i32) -> F {
    let (mut square, mut left) = (base, n.unsigned_abs());
    let mut power = if left & 1 == 1 { base } else { F::from_f64(1.0) };
    left >>= 1;
    while left > 0 {
        square = square * square;
        if left & 1 == 1 {
            power = power * square;
        }
        left >>= 1;
    }
    if n < 0 { power.reciprocal() } else { power }
}

/// `a + b`, rounded, and its rounding error: their sum is exact (D. Knuth).
#[inline(always)]
pub(crate) fn two_sum<E: Copy + Add<Output = E> + Sub<Output = E>>(a: E, b: E) -> [E; 2] {
    let sum = a + b;
    let second = sum - a;
    let first = sum - second;
    [sum, (a - first) + (b - second)]
}

/// As [`two_sum`] for `a = 0` or `|a| ≥ |b|`, with half of the operations (T. J. Dekker).
#[inline(always)]
pub(crate) fn fast_two_sum<E: Copy + Add<Output = E> + Sub<Output = E>>(a: E, b: E) -> [E; 2] {
    let sum = a + b;
    [sum, b - (sum - a)]
}

/// The transposed matrix.
#[inline(always)]
pub(crate) fn transposed<T: Copy, const N: usize>(rows: &[[T; N]; N]) -> [[T; N]; N] {
    let mut columns = *rows;
    for (r, row) in rows.iter().enumerate() {
        for (column, &number) in columns.iter_mut().zip(row) {
            column[r] = number;
        }
    }
    columns
}
