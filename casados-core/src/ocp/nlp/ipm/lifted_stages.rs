//! Lifted stages, which are variables: initialisation, steps, and the best iterate.

use super::Ipm;
use super::kkt::newton::kkt_view;
use super::run_state::RunState;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::dynamics::StageAction;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::qp::{Solution, StageDims, StageOffsetsIter, Store, copy_common, part, part_mut};
use crate::scalar::Real;

impl<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Initialises the stages from the guess; a `warm` start keeps the last ones.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub(super) fn initialise_stages(&mut self, warm: bool) -> Result<(), OcpError> {
        if !self.problem.is_lifted() {
            return Ok(());
        }
        self.step_length = Some(T::ZERO);
        if warm {
            return Ok(());
        }
        P::initialise_stages(self)
    }

    /// Restores the best iterate.
    pub(super) fn restore_best_iterate(&mut self, best: &Solution<T, D, M>) {
        self.iterate.copy_from(best);
        self.algebraic_is_current = false;
        self.problem.apply_stage_action(StageAction::RestoreBest);
    }
}

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// Computes the step of the stages that belongs to the search direction.
    ///
    /// # Errors
    /// [`OcpError::Integration`]
    pub(super) fn expand_stage_steps<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &RunState<'_>,
    ) -> Result<(), OcpError> {
        if !ocp.problem.is_lifted() {
            return Ok(());
        }
        let iterate =
            kkt_view(ocp.qp.view(), &state.dimensions, &mut self.kkt_numbers, &mut self.kkt_indices)?;
        let to = self.trial_point.view_mut();
        for place in StageOffsetsIter::<T>::new(iterate.qp.dims) {
            copy_common(part_mut(to.v, place.v, place.n), part(iterate.step, place.row, place.n));
        }
        P::expand_stage_steps(ocp, &self.trial_point)
    }
}
