//! Constants looked up by numbers.

use super::Real;

/// `C` constants of a table, looked up by the intervals that contain `K` numbers.
#[doc(hidden)]
pub trait Rows<const K: usize, const C: usize>: Copy {
    /// The constants. Implementations are `#[inline]`.
    fn row<T: Real>(self, at: [T; K]) -> [T; C];
}
