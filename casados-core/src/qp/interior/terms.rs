//! What residuals are sums of: what rounding leaves of them is a part of it.

/// What residuals are sums of.
#[derive(Clone, Copy)]
pub struct Terms<T> {
    /// In gradients: `H v`, `h`, forces of constraints, `π`.
    pub forces: T,
    /// In conditions: `v`, `C x + D u`, `b`.
    pub values: T,
}
