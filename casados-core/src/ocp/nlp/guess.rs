//! Linearisation at the guess.

use super::advanced::StartOptions;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::qp::{Bounds, Solution, StageDims};
use crate::scalar::Real;

impl<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Linearises at the guess. If a function is not finite there, projects the guess onto the
    /// bounds of states and controls; `copy` holds the guess meanwhile.
    ///
    /// With options of the `perturbation`, perturbs a guess at which the gradient of a violated
    /// constraint vanishes. Returns whether it has been perturbed.
    ///
    /// # Errors
    /// The error at the guess, if the projected guess fails too.
    pub(in crate::ocp) fn linearise_guess(
        &mut self,
        mut linearise: impl FnMut(&mut Self) -> Result<(), OcpError>,
        copy: &mut Solution<T, D, M>,
        perturbation: Option<StartOptions>,
    ) -> Result<bool, OcpError> {
        let Err(error) = linearise(self) else {
            let Some(options) = perturbation else { return Ok(false) };
            return self.leave_degenerate_start(copy, linearise, &options);
        };
        if !matches!(error, OcpError::Integration { .. } | OcpError::NonFiniteFunction { .. }) {
            return Err(error);
        }
        copy.copy_from(&self.iterate);
        self.clip_to_bounds();
        let result = linearise(self);
        if result.is_err() {
            self.iterate.copy_from(copy);
        }
        result.map(|()| false).map_err(|_| error)
    }

    /// Projects states and controls of the iterate onto their bounds.
    pub(in crate::ocp) fn clip_to_bounds(&mut self) {
        let Self { qp, iterate, .. } = self;
        for (k, stage) in qp.view().stages().enumerate() {
            let Some(point) = iterate.stage_mut(k) else { return };
            for (values, bounds) in [(point.x, stage.x_bounds()), (point.u, stage.u_bounds())] {
                let Bounds { lower, upper, .. } = bounds;
                for ((value, &lower), &upper) in values.iter_mut().zip(lower).zip(upper) {
                    *value = if *value < lower {
                        lower
                    } else if *value > upper {
                        upper
                    } else {
                        *value
                    };
                }
            }
        }
    }
}
