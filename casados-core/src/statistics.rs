//! What the last call did.

/// What the last call did, successful or not.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Steps that were completed.
    pub steps: usize,
    /// Iterations of Newton's method, all steps together.
    pub iterations: usize,
    /// Evaluations of the residual alone at all stages; of an explicit method, of one stage.
    pub residuals: usize,
    /// Evaluations of the residual and the Jacobian at all stages, or of the residual there and the
    /// Jacobian in their middle; of an explicit method, of one stage.
    pub jacobians: usize,
    /// Factorisations of the Newton matrix.
    pub factorizations: usize,
    /// Those of them in which the planned elimination was not good enough, so that the whole matrix
    /// was pivoted.
    pub dense: usize,
}
