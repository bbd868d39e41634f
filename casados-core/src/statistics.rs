//! What the last call did.

/// What the last call did, successful or not.
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
/// let mut irk = Irk::<Pendulum, Gauss<2>>::new(Options { steps: 3, ..Default::default() })?;
/// irk.solve(&vector![0.3, 0.0], &vector![0.0], 0.1)?;
/// assert_eq!(irk.statistics().steps, 3);
/// assert!(irk.statistics().iterations >= 3);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
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

impl Statistics {
    /// What another call did.
    pub(crate) fn add(&mut self, other: &Self) {
        self.steps += other.steps;
        self.iterations += other.iterations;
        self.residuals += other.residuals;
        self.jacobians += other.jacobians;
        self.factorizations += other.factorizations;
        self.dense += other.dense;
    }
}
