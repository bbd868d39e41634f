//! Single elements of slices. An index that is outside is an error of this crate: a debug build
//! panics there, a release build reads zero and writes nothing.

use crate::scalar::Real;

/// `values[index]`
#[inline(always)]
#[cfg_attr(debug_assertions, track_caller)]
pub fn get<T: Real>(values: &[T], index: usize) -> T {
    debug_assert!(index < values.len(), "element {index} of {}", values.len());
    values.get(index).copied().unwrap_or(T::ZERO)
}

/// `values[index] = value`
#[inline(always)]
#[cfg_attr(debug_assertions, track_caller)]
pub fn set<T>(values: &mut [T], index: usize, value: T) {
    debug_assert!(index < values.len(), "element {index} of {}", values.len());
    if let Some(element) = values.get_mut(index) {
        *element = value;
    }
}

/// `values[index] += value`
#[inline(always)]
#[cfg_attr(debug_assertions, track_caller)]
pub fn add<T: Real>(values: &mut [T], index: usize, value: T) {
    debug_assert!(index < values.len(), "element {index} of {}", values.len());
    if let Some(element) = values.get_mut(index) {
        *element = *element + value;
    }
}
