//! Debug builds assert that indices are in bounds.

/// Asserts in debug builds that an index is in bounds. Release builds read nothing there, so that
/// no panic is in the code of a microcontroller.
pub(crate) trait InBounds {
    /// Returns the same; an element or a range that a slice does not have is a programming error.
    fn in_bounds(self) -> Self;
}

impl<T> InBounds for Option<T> {
    #[inline(always)]
    #[cfg_attr(debug_assertions, track_caller)]
    fn in_bounds(self) -> Self {
        debug_assert!(self.is_some(), "index out of bounds");
        self
    }
}
