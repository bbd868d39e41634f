//! What a user can choose.

/// Options of the interior point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InteriorPointOptions {
    /// Every one of the four [`Residuals`](crate::qp::Residuals) is to be below. Default 1e-8; of single precision 1e-4.
    pub tolerance: f64,
    /// Default 50.
    pub max_iterations: usize,
    /// Where the products of slacks and multipliers begin. Default 1.
    pub start_mu: f64,
    /// Slacks and multipliers of a warm start are at least this. Default 1e-3.
    pub warm_distance: f64,
    /// Whether a QP that was not solved is solved again with all bounds soft, to see which of them cannot be satisfied.
    /// Default true.
    pub locate: bool,
}

impl InteriorPointOptions {
    /// For numbers of some precision.
    #[must_use]
    pub fn new<T: crate::scalar::Real>() -> Self {
        let tolerance = if T::EPSILON < 1e-10 { 1e-8 } else { 1e-4 };
        Self { tolerance, max_iterations: 50, start_mu: 1.0, warm_distance: 1e-3, locate: true }
    }
}
