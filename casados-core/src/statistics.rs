//! Statistics of calls.

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
    /// Number of completed steps.
    pub steps: usize,
    /// Number of Newton iterations in all steps.
    pub iterations: usize,
    /// Number of evaluations of the residual alone at all stages; for explicit methods at one
    /// stage.
    pub residuals: usize,
    /// Number of evaluations of the residual and the Jacobian at all stages, or of the residual at
    /// all stages and the Jacobian at their midpoint; for explicit methods at one stage.
    pub jacobians: usize,
    /// Number of factorisations of the Newton matrix.
    pub factorizations: usize,
    /// Number of these factorisations with pivoting of the whole matrix, since the planned
    /// elimination was too inaccurate.
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
