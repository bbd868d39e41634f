//! What the last call did.

/// What the last call of an adaptive integrator did to choose its steps, successful or not.
///
/// Steps that are there are taken again for derivatives and integrals, and by all calls while they
/// are frozen: what that takes is not counted. So all is zero of calls with frozen steps.
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
    /// Steps that were accepted.
    pub steps: usize,
    /// Steps whose error was too large.
    pub rejected: usize,
    /// Steps without an estimate of their error: Newton's method was slow or failed, the matrix was
    /// singular, or a value was not finite.
    pub failed: usize,
    /// Evaluations of the residual at one point.
    pub residuals: usize,
    /// Evaluations of the Jacobian.
    pub jacobians: usize,
    /// Factorisations of the Newton matrix, all eigenvalues together.
    pub factorizations: usize,
    /// Those of them in which the planned elimination was not good enough.
    pub dense: usize,
    /// Iterations of Newton's method, all steps together.
    pub iterations: usize,
}

impl AdaptiveStatistics {
    /// What another interval took.
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
