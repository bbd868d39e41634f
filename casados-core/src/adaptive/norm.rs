//! Errors and increments relative to what is tolerated.

use crate::scalar::{Real, Scalar};

/// `√(Σ (v/scale)² / n)`, with the reciprocals of the scales.
#[inline(never)]
pub(super) fn norm<T: Real>(values: &[T], scale: &[T]) -> f64 {
    let mut sum = T::ZERO;
    for (value, scale) in values.iter().zip(scale) {
        let relative = *value * *scale;
        sum = sum + relative * relative;
    }
    mean(sum.to_f64(), values.len())
}

/// The root of a mean of squares.
pub(super) fn mean(sum: f64, count: usize) -> f64 {
    Scalar::sqrt(sum / count.max(1) as f64)
}
