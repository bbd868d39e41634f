//! Memory on the heap that may be refused.

use super::error::QpError;
use alloc::vec::Vec;

/// Bytes of a cache line, which are those of the widest register.
pub const CACHE_LINE: usize = 64;

/// As many defaults.
pub fn zeros<T: Copy + Default>(length: usize) -> Result<Vec<T>, QpError> {
    let mut memory = Vec::new();
    try_resize(&mut memory, length)?;
    Ok(memory)
}

/// A copy.
pub fn copy<T: Copy>(slice: &[T]) -> Result<Vec<T>, QpError> {
    let mut memory = Vec::new();
    try_reserve(&mut memory, slice.len())?;
    memory.extend_from_slice(slice);
    Ok(memory)
}

/// Room for more elements.
pub fn try_reserve<T>(list: &mut Vec<T>, more: usize) -> Result<(), QpError> {
    list.try_reserve(more).map_err(|_| QpError::OutOfMemory { bytes: more.saturating_mul(size_of::<T>()) })
}

/// At least as many elements; what is new is a default.
pub fn try_resize<T: Copy + Default>(memory: &mut Vec<T>, length: usize) -> Result<(), QpError> {
    if memory.len() < length {
        try_reserve(memory, length - memory.len())?;
        memory.resize(length, T::default());
    }
    Ok(())
}
