//! Where a run begins.

use super::Sqp;
use crate::ocp::error::OcpError;
use crate::ocp::instance::Ocp;
use crate::ocp::linearise::Curvature;
use crate::ocp::problem::Formulation;
use crate::qp::{Bounds, QpSolver, StageDims};
use crate::scalar::Real;

impl<S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Sqp<S, C, T, D, M> {
    /// Linearises at the guess; where something has no value there, at the point nearest to it that
    /// satisfies the bounds of states and controls.
    ///
    /// # Errors
    /// That at the guess, if there is none at that point either.
    pub(super) fn begin<P: Formulation<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>) -> Result<(), OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        let Err(error) = ocp.linearise(self.curvature) else { return Ok(()) };
        if !matches!(error, OcpError::Integration { .. } | OcpError::NonFiniteFunction { .. }) {
            return Err(error);
        }
        self.trial.copy_from(&ocp.iterate);
        ocp.clip();
        let result = ocp.linearise(self.curvature);
        if result.is_err() {
            ocp.iterate.copy_from(&self.trial);
        }
        result.map_err(|_| error)
    }
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Moves states and controls of the iterate into their bounds.
    fn clip(&mut self) {
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
