//! Numbers that are looked up.

use super::Real;

/// `C` numbers that `K` others lead to, as constants of a table that depend on the interval in
/// which a number is.
#[doc(hidden)]
pub trait Rows<const K: usize, const C: usize>: Copy {
    /// The numbers. To be `#[inline]`.
    fn row<T: Real>(self, at: [T; K]) -> [T; C];
}
