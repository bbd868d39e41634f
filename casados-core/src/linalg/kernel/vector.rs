//! Inner loops over vectors.

use crate::scalar::{Field, Lanes, Real};
use crate::shape::InBounds;

/// `y += a x`
#[cfg_attr(not(debug_assertions), inline(always))]
pub(crate) fn axpy<T: Field>(a: T, x: &[T], y: &mut [T]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y = *y + a * *x;
    }
}

/// `aᵀ b`
#[inline(always)]
pub(crate) fn dot<T: Real>(a: &[T], b: &[T]) -> T {
    // Four accumulators, so that the compiler can vectorise.
    let mut sums = [T::ZERO; 4];
    let (a, b) = (a.get(..b.len()).in_bounds().unwrap_or(a), b);
    let (chunks, rest) = a.as_chunks::<4>();
    let (others, more) = b.as_chunks::<4>();
    for (a, b) in chunks.iter().zip(others) {
        for ((sum, &a), &b) in sums.iter_mut().zip(a).zip(b) {
            *sum = *sum + a * b;
        }
    }
    let [a0, a1, a2, a3] = sums;
    let sum = (a0 + a1) + (a2 + a3);
    rest.iter().zip(more).fold(sum, |sum, (&a, &b)| sum + a * b)
}

/// `x /= a`
#[cfg_attr(not(debug_assertions), inline(always))]
pub(crate) fn divide<T: Field>(x: &mut [T], a: T) {
    for x in x {
        *x = *x / a;
    }
}

/// Whether all elements are finite. Without an early exit, so that it is a SIMD loop.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(crate) fn are_finite<E: Lanes>(values: &[E]) -> bool {
    let mut finite = E::le(E::zeroed(), E::zeroed());
    for value in values {
        finite = E::and(finite, value.is_finite());
    }
    E::all(finite)
}
