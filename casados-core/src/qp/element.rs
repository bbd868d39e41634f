//! Bounds-checked access to elements of slices: out of range, reads return zero and writes do
//! nothing.

use crate::scalar::Real;

/// Returns an element, or zero.
#[inline(always)]
pub fn get<T: Real>(values: &[T], index: usize) -> T {
    values.get(index).copied().unwrap_or(T::ZERO)
}

/// Writes an element.
#[inline(always)]
pub fn set<T>(values: &mut [T], index: usize, value: T) {
    if let Some(element) = values.get_mut(index) {
        *element = value;
    }
}

/// Adds to an element.
#[inline(always)]
pub fn add<T: Real>(values: &mut [T], index: usize, value: T) {
    if let Some(element) = values.get_mut(index) {
        *element = *element + value;
    }
}
