//! What a user can choose.

/// Options of the interior point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InteriorPointOptions {
    /// Every one of the four [`Residuals`](crate::qp::Residuals) is to be below this, or below `relative_tolerance`. Default
    /// 1e-8; of single precision 1e-4.
    pub tolerance: f64,
    /// Residuals may be this part of the largest of the terms whose sums they are: stationarity and complementarity of
    /// `H v`, `h`, forces of constraints and multipliers `π`; dynamics and inequalities of `v`, values of general constraints
    /// and `b`. What is asked for is the larger one of this and `tolerance`. Default 0, absolute; of single precision, where
    /// terms have no more than seven digits, 1e-5.
    pub relative_tolerance: f64,
    /// Default 50.
    pub max_iterations: usize,
    /// Where the products of slacks and multipliers begin. Default 1.
    pub start_mu: f64,
    /// How many sets of active bounds a warm start tries before slacks and multipliers are moved away from zero and the
    /// interior point begins. Each costs less than one of its iterations, and counts as one. Default 4.
    pub active_sets: usize,
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
        let (tolerance, relative_tolerance) = if T::EPSILON < 1e-10 { (1e-8, 0.0) } else { (1e-4, 1e-5) };
        Self {
            tolerance,
            relative_tolerance,
            max_iterations: 50,
            start_mu: 1.0,
            active_sets: 4,
            warm_distance: 1e-3,
            locate: true,
        }
    }
}
