//! Statistics of the last call.

/// Statistics of the last call, successful or not.
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
    /// Completed steps.
    pub steps: usize,
    /// Iterations of Newton's method, summed over all steps.
    pub iterations: usize,
    /// Evaluations of the residual at all stages; for explicit methods, at one stage.
    pub residuals: usize,
    /// Evaluations of the residual and the Jacobian at all stages, or of the residual there and the
    /// Jacobian in their middle; for explicit methods, at one stage.
    pub jacobians: usize,
    /// Factorisations of the Newton matrix.
    pub factorizations: usize,
    /// Factorisations with the dense fallback, since the planned elimination lost too many digits.
    pub dense: usize,
}

impl Statistics {
    /// Adds the statistics of another call.
    pub(crate) fn add(&mut self, other: &Self) {
        self.steps += other.steps;
        self.iterations += other.iterations;
        self.residuals += other.residuals;
        self.jacobians += other.jacobians;
        self.factorizations += other.factorizations;
        self.dense += other.dense;
    }
}
