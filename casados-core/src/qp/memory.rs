//! Fallible allocation of memory on the heap.

use super::error::QpError;
use alloc::vec::Vec;

/// The size of a cache line in bytes, which is that of the widest register.
pub const CACHE_LINE: usize = 64;

/// Returns a list of this many default elements.
pub fn zeros<T: Copy + Default>(length: usize) -> Result<Vec<T>, QpError> {
    let mut memory = Vec::new();
    try_resize(&mut memory, length)?;
    Ok(memory)
}

/// Returns a copy of a slice.
pub fn copy<T: Copy>(slice: &[T]) -> Result<Vec<T>, QpError> {
    let mut memory = Vec::new();
    try_reserve(&mut memory, slice.len())?;
    memory.extend_from_slice(slice);
    Ok(memory)
}

/// Reserves memory for `more` elements.
pub fn try_reserve<T>(list: &mut Vec<T>, more: usize) -> Result<(), QpError> {
    list.try_reserve(more).map_err(|_| QpError::OutOfMemory { bytes: more.saturating_mul(size_of::<T>()) })
}

/// Resizes a list to at least this length; new elements are defaults.
pub fn try_resize<T: Copy + Default>(memory: &mut Vec<T>, length: usize) -> Result<(), QpError> {
    if memory.len() < length {
        try_reserve(memory, length - memory.len())?;
        memory.resize(length, T::default());
    }
    Ok(())
}
