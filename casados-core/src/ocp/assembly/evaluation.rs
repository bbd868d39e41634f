//! Linearisation, evaluation and residuals of a problem.

use crate::ocp::assembly::kkt;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::curvature::Curvature;
use crate::ocp::formulation::program::{Program, ProgramParts, ends};
use crate::qp::{Residuals, Solution, StageDims, nan_max};
use crate::scalar::Real;

impl<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Writes the QP at the iterate. Its solution is the full step of sequential quadratic
    /// programming.
    ///
    /// # Errors
    /// [`OcpError::Missing`], [`OcpError::NonFiniteFunction`], [`OcpError::Integration`]
    pub fn linearise<C: Curvature<P::Dynamics, T>>(&mut self, curvature: C) -> Result<(), OcpError> {
        P::linearise(self, curvature)
    }

    /// Returns the objective at a point, without penalties. Writes `φ` of every interval, then `g`
    /// of every stage, to `ends_and_constraints`.
    ///
    /// # Errors
    /// [`OcpError::NonFiniteFunction`], [`OcpError::Integration`]
    pub(crate) fn evaluate(
        &mut self,
        trial_point: &Solution<T, D, M>,
        ends_and_constraints: &mut [T],
    ) -> Result<T, OcpError> {
        P::evaluate(self, trial_point, ends_and_constraints)
    }

    /// The number of values of `φ` of all intervals and `g` of all stages.
    pub(crate) fn ends(&self) -> usize {
        ends(self.qp.dims())
    }

    /// Returns the residuals of the optimality conditions at the iterate, and the objective with
    /// penalties of soft bounds. [`Ocp::linearise`] must have been called.
    #[must_use]
    pub fn residuals(&mut self) -> (Residuals, f64) {
        let ProgramParts { qp, iterate, scratch, .. } = P::split(self);
        let (mut residuals, penalties) = kkt::residuals(qp.view(), iterate, scratch);
        if self.problem.is_lifted() {
            let [_, largest_stage_residual] = self.stage_residuals;
            residuals.dynamics = nan_max(residuals.dynamics, largest_stage_residual.to_f64());
        }
        (residuals, self.objective.to_f64() + penalties)
    }
}
