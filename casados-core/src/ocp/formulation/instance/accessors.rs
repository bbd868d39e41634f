//! Access to the QP and the iterate of a problem.

use crate::ocp::formulation::error::{OcpError, Part};
use crate::ocp::formulation::instance::Ocp;
use crate::qp::{QpView, Solution, StageDims, marked_indices};
use crate::scalar::Real;

impl<P, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Checks that the memory of a run has the dimensions of the problem.
    ///
    /// # Errors
    /// [`OcpError::Length`]
    pub(in crate::ocp) fn check_dimensions(&self, dims: &[StageDims]) -> Result<(), OcpError> {
        let part = Part::Dimensions;
        let (expected, found) = (self.qp.dims().len(), dims.len());
        if expected != found {
            return Err(OcpError::Length { part, stage: 0, expected, found });
        }
        for (stage, (a, b)) in self.qp.dims().iter().zip(dims).enumerate() {
            for (expected, found) in [(a.nx, b.nx), (a.nu, b.nu), (a.ng, b.ng)] {
                if expected != found {
                    return Err(OcpError::Length { part, stage, expected, found });
                }
            }
        }
        Ok(())
    }

    /// Returns the number of intervals of the horizon.
    #[must_use]
    pub fn intervals(&self) -> usize {
        self.qp.dims().len().saturating_sub(1)
    }

    /// Returns the functions of the problem, to change weights of costs and options of integrators.
    pub fn problem(&mut self) -> &mut P {
        &mut self.problem
    }

    /// Returns the QP at the iterate of the last [`Ocp::linearise`].
    #[must_use]
    pub fn qp(&self) -> QpView<'_, T> {
        self.qp.view()
    }

    /// Returns the QP, and the iterate as the memory of its solution.
    pub fn qp_and_iterate(&mut self) -> (QpView<'_, T>, &mut Solution<T, D, M>) {
        (self.qp.view(), &mut self.iterate)
    }

    /// Returns states, controls and multipliers.
    #[must_use]
    pub fn iterate(&self) -> &Solution<T, D, M> {
        &self.iterate
    }

    /// Returns states, controls and multipliers, mutably.
    pub fn iterate_mut(&mut self) -> &mut Solution<T, D, M> {
        &mut self.iterate
    }

    /// Sets the shared controls of the iterate to their values at stage 0.
    pub(in crate::ocp) fn equalise_shared_controls(&mut self) {
        let intervals = self.intervals();
        for j in marked_indices(self.qp.view().shared()) {
            let Some(value) = self.iterate.stage(0).and_then(|stage| stage.u.get(j).copied()) else { return };
            for k in 1..=intervals {
                if let Some(u) = self.iterate.stage_mut(k).and_then(|stage| stage.u.get_mut(j)) {
                    *u = value;
                }
            }
        }
    }

    /// Sets the periodic states of the last stage of the iterate to their values at the first
    /// stage.
    pub(in crate::ocp) fn equalise_periodic_states(&mut self) {
        let last = self.intervals();
        for i in marked_indices(self.qp.view().periodic()) {
            let Some(value) = self.iterate.stage(0).and_then(|stage| stage.x.get(i).copied()) else { return };
            if let Some(x) = self.iterate.stage_mut(last).and_then(|stage| stage.x.get_mut(i)) {
                *x = value;
            }
        }
    }
}
