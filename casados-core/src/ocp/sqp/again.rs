//! A second attempt, from a simulation with the controls of the guess.

use super::Sqp;
use super::state::State;
use crate::ocp::convexify::Convexification;
use crate::ocp::curvature::Curvature;
use crate::ocp::dynamics::Dynamics;
use crate::ocp::instance::Ocp;
use crate::ocp::log::Iteration;
use crate::ocp::outcome::Status;
use crate::ocp::problem::Formulation;
use crate::qp::{QpSolver, StageDims};
use crate::scalar::Real;

/// The regularisation of the first direction.
const DAMPING: f64 = 1.0;
/// A simulation is a better place where it violates less than this part.
const BETTER: f64 = 0.5;

impl<S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Sqp<S, C, T, D, M> {
    /// Whether a run that failed begins again: once, with steps that are damped as those of Gauss
    /// and Newton are. It was long steps at first that led astray, or gaps that were to be closed
    /// over unstable dynamics.
    pub(super) fn begin_again<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        status: Status,
        iterations: usize,
    ) -> bool
    where
        C: Curvature<P::Dynamics, T>,
    {
        let failed = matches!(status, Status::Infeasible { .. } | Status::NoProgress | Status::QpFailed(_));
        let can = C::EXACT && !state.again && iterations < self.options.max_iterations;
        if !(failed && can && self.curvature.convexification() == Convexification::Reduced) {
            return false;
        }
        self.leave_elastic(ocp, state);
        self.weights.multipliers_mut().fill(T::ZERO);
        ocp.iterate.copy_from(&self.weights);
        self.simulate_guess(ocp);
        self.forget(ocp, state);
        true
    }

    /// Begins again, too, where steps with penalties go on and on, and a simulation violates less
    /// than their iterate.
    pub(super) fn ask_simulation<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
        row: &Iteration,
    ) where
        C: Curvature<P::Dynamics, T>,
    {
        state.asked = true;
        if !C::EXACT || state.again || self.curvature.convexification() != Convexification::Reduced {
            return;
        }
        self.leave_elastic(ocp, state);
        let here = row.residuals.dynamics.max(row.residuals.inequalities);
        if self.simulate_guess(ocp) {
            let there = ocp.residuals().0;
            if there.dynamics.max(there.inequalities) < BETTER * here {
                self.forget(ocp, state);
                return;
            }
            ocp.iterate.copy_from(&self.trial);
        }
        state.search.linearised = None;
    }

    /// Makes a simulation with the controls of the guess the iterate and linearises there, if that
    /// has values; what was the iterate is a trial then.
    fn simulate_guess<P: Formulation<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>) -> bool
    where
        C: Curvature<P::Dynamics, T>,
    {
        self.trial.copy_from(&self.weights);
        self.trial.multipliers_mut().fill(T::ZERO);
        let ends = self.work.as_mut().get_mut(..ocp.ends()).unwrap_or_default();
        if P::Dynamics::LIFTED || !ocp.simulate_guess(&mut self.trial, ends) {
            return false;
        }
        let is_linearised = ocp.linearise(self.curvature).is_ok();
        if !is_linearised {
            core::mem::swap(&mut ocp.iterate, &mut self.trial);
        }
        is_linearised
    }

    /// Nothing is remembered of the first attempt.
    fn forget<P: Formulation<T>>(&mut self, ocp: &Ocp<P, T, D, M>, state: &mut State<'_, T>) {
        let (over, sizes) = (state.over.take(), state.sizes);
        *state = State { over, again: true, asked: true, damping: DAMPING, sizes, ..State::new() };
        self.forget_weights(ocp, state);
    }
}
