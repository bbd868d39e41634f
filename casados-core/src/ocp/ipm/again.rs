//! A second attempt, from a simulation with the controls of the guess.

use super::Ipm;
use super::feasibility::leave;
use super::lengths::Lengths;
use super::state::State;
use super::violations::Phase;
use super::work::Work;
use crate::ocp::curvature::Slopes;
use crate::ocp::dynamics::{Dynamics, SecondOrder};
use crate::ocp::instance::Ocp;
use crate::ocp::outcome::Status;
use crate::ocp::problem::Formulation;
use crate::qp::{StageDims, Store};
use crate::scalar::Real;

/// A simulation is a better place where it violates bounds by less than this part of what the first
/// attempt leaves.
const BETTER: f64 = 0.5;

impl<T, D, M, I> Ipm<T, D, M, I>
where
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]> + Store<T>,
    I: Store<u32>,
{
    /// Whether a run that failed begins again: once, where a simulation with the controls of the
    /// guess violates bounds by less than the point where it failed. Over unstable dynamics gaps
    /// may be what leads astray, and violations that stay there say nothing of the problem.
    pub(super) fn begin_again<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        capacity: &Lengths,
        state: &mut State<'_>,
        status: Status,
    ) -> bool
    where
        P::Dynamics: SecondOrder<T>,
    {
        let failed = matches!(status, Status::Infeasible { .. } | Status::NoProgress);
        if !failed || state.again || P::Dynamics::LIFTED {
            return false;
        }
        state.again = true;
        let work = Work::new(ocp.ends(), capacity, self.work.as_mut());
        let here = ocp.worst(work.penalties, work.units).0.map_or(0.0, |worst| worst.violation);
        let left = if status == Status::NoProgress { state.best_violation } else { here };
        self.trial.copy_from(&self.guess);
        if !ocp.simulate_guess(&mut self.trial, work.ends) {
            return false;
        }
        let is_linearised = ocp.linearise(Slopes).is_ok();
        let work = Work::new(ocp.ends(), capacity, self.work.as_mut());
        let found = ocp.worst(work.penalties, work.units).0.map_or(0.0, |worst| worst.violation);
        if !(is_linearised && found < BETTER * left) {
            core::mem::swap(&mut ocp.iterate, &mut self.trial);
            return false;
        }
        leave(ocp, state, work.penalties, &self.options);
        (state.phase, state.is_linearised) = (Phase::default(), true);
        true
    }
}
