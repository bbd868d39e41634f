//! Stages of intervals that are variables: they begin, go and stay with the iterate.

use super::Ipm;
use super::kkt::newton::kkt_view;
use super::state::State;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::dynamics::{Dynamics, Nodes, StageAction};
use crate::ocp::formulation::instance::data::split;
use crate::ocp::formulation::instance::{Ocp, nodes};
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::qp::{Places, Solution, StageDims, Store, assign, part, part_mut};
use crate::scalar::Real;

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Stages are those of the guess, or, after a `warm` start, what they were.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub(super) fn begin_stages(&mut self, warm: bool) -> Result<(), OcpError> {
        if !P::Dynamics::LIFTED {
            return Ok(());
        }
        self.step_length = Some(T::ZERO);
        if warm {
            return Ok(());
        }
        let layout = self.layout();
        let data = split::<P, T>(self.data.as_mut(), layout);
        let Problem { dynamics, .. } = self.problem.parts();
        let (v, multipliers) = self.iterate.vectors();
        let p = (&*data.p, self.free.view());
        dynamics.begin_stages(&nodes::<P::Shape, T>(v, multipliers, &[], p, data.times))
    }

    /// The iterate is the best one again.
    pub(super) fn recall(&mut self, best: &Solution<T, D, M>) {
        self.iterate.copy_from(best);
        self.has_algebraic = false;
        self.problem.parts().dynamics.move_stages(StageAction::Recall);
    }
}

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// The step of stages that belongs to the search direction.
    ///
    /// # Errors
    /// [`OcpError::Integration`]
    pub(super) fn expand<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &State<'_>,
    ) -> Result<(), OcpError> {
        if !P::Dynamics::LIFTED {
            return Ok(());
        }
        let iterate = kkt_view(ocp.qp.view(), &state.lengths, &mut self.numbers, &mut self.indices)?;
        let to = self.trial.view_mut();
        for place in Places::<T>::new(iterate.qp.dims) {
            assign(part_mut(to.v, place.v, place.n), part(iterate.step, place.row, place.n));
        }
        let layout = ocp.layout();
        let data = split::<P, T>(ocp.data.as_mut(), layout);
        let Problem { dynamics, .. } = ocp.problem.parts();
        let (v, multipliers) = ocp.iterate.vectors();
        let nodes = nodes::<P::Shape, T>(v, multipliers, &[], (data.p, ocp.free.view()), data.times);
        let (step, _) = self.trial.vectors();
        dynamics.expand_stages(&nodes, &Nodes { v: step, ..nodes })
    }
}
