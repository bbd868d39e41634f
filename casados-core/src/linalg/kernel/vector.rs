//! The inner loops.

use crate::scalar::{Field, Lanes};

/// `y += a x`
#[cfg_attr(not(debug_assertions), inline(always))]
pub(crate) fn axpy<T: Field>(a: T, x: &[T], y: &mut [T]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y = *y + a * *x;
    }
}

/// `x /= a`
#[cfg_attr(not(debug_assertions), inline(always))]
pub(crate) fn divide<T: Field>(x: &mut [T], a: T) {
    for x in x {
        *x = *x / a;
    }
}

/// Whether all elements are neither infinite nor NaN. Without an early exit, so that it is a SIMD
/// loop.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(crate) fn are_finite<E: Lanes>(values: &[E]) -> bool {
    let mut finite = E::le(E::zeroed(), E::zeroed());
    for value in values {
        finite = E::and(finite, value.is_finite());
    }
    E::all(finite)
}
