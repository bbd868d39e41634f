//! What there is at the iterate of a problem, whatever it is.

use crate::ocp::assembly::kkt;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::curvature::Curvature;
use crate::ocp::formulation::program::{Program, ProgramParts, ends};
use crate::qp::{Residuals, Solution, StageDims, nan_max};
use crate::scalar::Real;

impl<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Writes the QP at the iterate: its solution is the full step of sequential quadratic
    /// programming.
    ///
    /// # Errors
    /// [`OcpError::Missing`], [`OcpError::NonFiniteFunction`], [`OcpError::Integration`]
    pub fn linearise<C: Curvature<P::Dynamics, T>>(&mut self, curvature: C) -> Result<(), OcpError> {
        P::linearise(self, curvature)
    }

    /// The objective at some point, without penalties; and what is left of its dynamics and
    /// constraints in `ends`: `φ` of every interval, then `g` of every stage.
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

    /// How many numbers `φ` of every interval and `g` of every stage are.
    pub(crate) fn ends(&self) -> usize {
        ends(self.qp.dims())
    }

    /// How well the iterate satisfies the conditions of optimality of the problem, and the
    /// objective with penalties of soft bounds; after [`Ocp::linearise`].
    #[must_use]
    pub fn residuals(&mut self) -> (Residuals, f64) {
        let ProgramParts { qp, iterate, scratch, .. } = P::split(self);
        let (mut residuals, penalties) = kkt::residuals(qp.view(), iterate, scratch);
        if P::LIFTED {
            let [_, largest_stage_residual] = self.stage_residuals;
            residuals.dynamics = nan_max(residuals.dynamics, largest_stage_residual.to_f64());
        }
        (residuals, self.objective.to_f64() + penalties)
    }
}
