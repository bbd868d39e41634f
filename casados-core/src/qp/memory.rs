//! Memory on the heap that may be refused.

use super::error::QpError;
use alloc::vec::Vec;

/// As many defaults.
pub fn zeros<T: Copy + Default>(length: usize) -> Result<Vec<T>, QpError> {
    let mut memory = Vec::new();
    reserve(&mut memory, length)?;
    Ok(memory)
}

/// A copy.
pub fn copy<T: Copy>(slice: &[T]) -> Result<Vec<T>, QpError> {
    let mut memory = Vec::new();
    memory.try_reserve_exact(slice.len()).map_err(|_| QpError::OutOfMemory { bytes: size_of_val(slice) })?;
    memory.extend_from_slice(slice);
    Ok(memory)
}

/// At least as many elements; what is new is a default.
pub fn reserve<T: Copy + Default>(memory: &mut Vec<T>, length: usize) -> Result<(), QpError> {
    if memory.len() < length {
        let bytes = length.saturating_mul(size_of::<T>());
        memory.try_reserve_exact(length - memory.len()).map_err(|_| QpError::OutOfMemory { bytes })?;
        memory.resize(length, T::default());
    }
    Ok(())
}
