//! Memory of a solver: fixed, or growing on the heap.

use crate::qp::error::{QpError, QpField};

/// Memory that a solver works in: an array or slice, or, with the feature `alloc`, a `Vec` that
/// grows when a larger problem comes and never shrinks.
pub trait Store<T>: AsRef<[T]> + AsMut<[T]> {
    /// At least so many elements.
    ///
    /// # Errors
    /// [`QpError::Dimension`] or [`QpError::OutOfMemory`] if there are less.
    #[doc(hidden)]
    fn at_least(&mut self, length: usize, field: QpField) -> Result<&mut [T], QpError>;
}

fn fixed<T>(slice: &mut [T], expected: usize, field: QpField) -> Result<&mut [T], QpError> {
    let found = slice.len();
    slice.get_mut(..expected).ok_or(QpError::Dimension { field, stage: 0, expected, found })
}

impl<T, const N: usize> Store<T> for [T; N] {
    fn at_least(&mut self, length: usize, field: QpField) -> Result<&mut [T], QpError> {
        fixed(self, length, field)
    }
}

impl<T> Store<T> for &mut [T] {
    fn at_least(&mut self, length: usize, field: QpField) -> Result<&mut [T], QpError> {
        fixed(self, length, field)
    }
}

#[cfg(feature = "alloc")]
impl<T: Copy + Default> Store<T> for alloc::vec::Vec<T> {
    fn at_least(&mut self, length: usize, field: QpField) -> Result<&mut [T], QpError> {
        crate::qp::memory::reserve(self, length)?;
        fixed(self, length, field)
    }
}
