//! Errors and increments relative to what is tolerated.

use crate::scalar::{Real, Scalar};

/// Loops over more elements are functions of their own, and not unrolled.
pub(super) const FEW: usize = 6;

/// `√(Σ (v/scale)² / n)`, with the reciprocals of the scales.
#[inline(always)]
pub(super) fn norm<T: Real>(values: &[T], scale: &[T]) -> f64 {
    let sum = if values.len() <= FEW { squares(values, scale) } else { many_squares(values, scale) };
    mean(sum.to_f64(), values.len())
}

#[inline(always)]
fn squares<T: Real>(values: &[T], scale: &[T]) -> T {
    let mut sum = T::ZERO;
    for (value, scale) in values.iter().zip(scale) {
        let relative = *value * *scale;
        sum = sum + relative * relative;
    }
    sum
}

#[inline(never)]
fn many_squares<T: Real>(values: &[T], scale: &[T]) -> T {
    squares(values, scale)
}

/// The root of a mean of squares.
pub(super) fn mean(sum: f64, count: usize) -> f64 {
    Scalar::sqrt(sum / count.max(1) as f64)
}
