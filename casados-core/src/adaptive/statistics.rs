//! Statistics of the last call.

/// Statistics of the step selection of the last call of an adaptive integrator, successful or not.
///
/// The replay of steps for derivatives and integrals, and of frozen steps, is not counted: all
/// counts are zero for calls with frozen steps.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
///
/// #[ode]
/// fn pendulum(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0] - 9.81 * x[0].sin()]
/// }
///
/// let mut adaptive = Adaptive::<Pendulum, DormandPrince5>::new(AdaptiveOptions::default())?;
/// adaptive.solve(&vector![1.0, 0.0], &vector![0.0], 2.0)?;
/// let statistics = adaptive.statistics();
/// assert_eq!(statistics.steps, adaptive.times().count() - 1);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct AdaptiveStatistics {
    /// Accepted steps.
    pub steps: usize,
    /// Steps rejected because of their error.
    pub rejected: usize,
    /// Steps without an error estimate: Newton's method was slow or failed, the matrix was
    /// singular, or a value was not finite.
    pub failed: usize,
    /// Evaluations of the residual at one point (not at all stages).
    pub residuals: usize,
    /// Evaluations of the Jacobian.
    pub jacobians: usize,
    /// Factorisations of the Newton matrix; those for all eigenvalues count as one.
    pub factorizations: usize,
    /// Factorisations with the dense fallback, since planned pivots were too small.
    pub dense: usize,
    /// Iterations of Newton's method, summed over all steps.
    pub iterations: usize,
}

impl AdaptiveStatistics {
    /// Adds the statistics of another interval.
    pub(super) fn add(&mut self, other: &Self) {
        self.steps += other.steps;
        self.rejected += other.rejected;
        self.failed += other.failed;
        self.residuals += other.residuals;
        self.jacobians += other.jacobians;
        self.factorizations += other.factorizations;
        self.dense += other.dense;
        self.iterations += other.iterations;
    }
}
