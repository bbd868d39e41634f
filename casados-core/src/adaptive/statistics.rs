//! What the last call did.

/// What the last call of an adaptive integrator did, successful or not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct AdaptiveStatistics {
    /// Steps that were accepted.
    pub steps: usize,
    /// Steps whose error was too large.
    pub rejected: usize,
    /// Steps whose stages were not found: Newton's method was slow or failed.
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
