//! The inner loops.

use crate::scalar::Field;

/// `y += a x`
#[inline(always)]
pub(crate) fn axpy<T: Field>(a: T, x: &[T], y: &mut [T]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y = *y + a * *x;
    }
}

/// `x /= a`
#[inline(always)]
pub(crate) fn divide<T: Field>(x: &mut [T], a: T) {
    for x in x {
        *x = *x / a;
    }
}
