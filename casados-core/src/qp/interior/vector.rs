//! Sums and extrema of long vectors, by SIMD.

use crate::qp::statistics;
use crate::scalar::{Packed, Real};

/// Splits slices into whole registers and the remainder.
macro_rules! split {
    ($slice:expr) => {
        (E::cells($slice), $slice.get($slice.len() / E::LANES * E::LANES..).unwrap_or_default())
    };
}

/// Returns `Σ a b`.
#[inline(always)]
pub fn dot<T: Real, E: Packed<T>>(a: &[T], b: &[T]) -> T {
    let ((a, a_rest), (b, b_rest)) = (split!(a), split!(b));
    let mut sums = [E::from_f64(0.0); 2];
    for (i, (a, b)) in a.iter().zip(b).enumerate() {
        let sum = &mut sums[i % 2];
        *sum = sum.minus_product(E::load(a), E::load(b));
    }
    let whole = -(sums[0] + sums[1]).total();
    a_rest.iter().zip(b_rest).fold(whole, |sum, (&a, &b)| sum + a * b)
}

/// Returns the largest `a b`, at least `least`. NaN is ignored.
#[inline(always)]
pub fn largest_product<T: Real, E: Packed<T>>(least: T, a: &[T], b: &[T]) -> T {
    let ((a, a_rest), (b, b_rest)) = (split!(a), split!(b));
    let mut largest = super::kernels::splat::<T, E>(least);
    for (a, b) in a.iter().zip(b) {
        largest = (E::load(a) * E::load(b)).max(largest);
    }
    let whole = largest.largest();
    a_rest.iter().zip(b_rest).fold(whole, |largest, (&a, &b)| (a * b).max(largest))
}

/// Returns the largest `−a / b`, at least `least`.
#[inline(always)]
pub fn largest_negative_ratio<T: Real, E: Packed<T>>(least: T, a: &[T], b: &[T]) -> T {
    let ((a, a_rest), (b, b_rest)) = (split!(a), split!(b));
    let mut largest = super::kernels::splat::<T, E>(least);
    for (a, b) in a.iter().zip(b) {
        largest = (-(E::load(a) / E::load(b))).max(largest);
    }
    let whole = largest.largest();
    a_rest.iter().zip(b_rest).fold(whole, |largest, (&a, &b)| (-(a / b)).max(largest))
}

/// Returns the largest `|a|`, at least `least`. NaN is ignored.
#[inline(always)]
pub fn largest_magnitude_ignoring_nan<T: Real, E: Packed<T>>(least: T, all: &[T]) -> T {
    let (a, rest) = split!(all);
    let mut largest = super::kernels::splat::<T, E>(least);
    for a in a {
        largest = E::load(a).abs().max(largest);
    }
    let whole = largest.largest();
    rest.iter().fold(whole, |largest, a| a.abs().max(largest))
}

/// Returns the largest `|a|` in units, at least `least`; NaN if one element is NaN.
#[inline(never)]
pub fn largest_scaled_magnitude<T: Real>(least: T, all: &[T], units: &[T], measure: fn(T, T) -> T) -> T {
    all.iter().zip(units).fold(least, |most, (a, &unit)| statistics::nan_max(most, measure(a.abs(), unit)))
}

/// Returns the largest `|a|`; NaN if one element is NaN, or if their squares overflow.
#[inline(always)]
pub fn largest_size<T: Real, E: Packed<T>>(all: &[T]) -> T {
    let largest = largest_magnitude_ignoring_nan::<T, E>(T::ZERO, all);
    // Comparisons ignore NaN; sums do not.
    if dot::<T, E>(all, all).is_finite() { largest } else { T::from_f64(f64::NAN) }
}

/// Computes `a + factor · b`.
#[inline(always)]
pub fn add_scaled<T: Real>(a: &mut [T], factor: T, b: &[T]) {
    for (a, &b) in a.iter_mut().zip(b) {
        *a = *a + factor * b;
    }
}

/// Computes `factor · a`.
#[inline(always)]
pub fn scale_vector<T: Real>(a: &mut [T], factor: T) {
    for a in a {
        *a = *a * factor;
    }
}
