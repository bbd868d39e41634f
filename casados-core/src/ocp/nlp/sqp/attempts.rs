//! Attempts at an iterate until a step is accepted.

use super::Sqp;
use super::direction::DirectionOutcome;
use super::options::Globalisation;
use super::run_state::{AcceptedStep, Attempt, RunState};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::{Convexification, Curvature};
use crate::ocp::nlp::stopwatch::Stopwatch;
use crate::ocp::solution::log::Iteration;
use crate::ocp::solution::outcome::Status;
use crate::qp::{QpError, QpSolver, StageDims};
use crate::scalar::Real;
use core::ops::ControlFlow;

const ATTEMPTS: [Attempt; 5] = [
    Attempt::First,
    Attempt::FullAccuracy,
    Attempt::Damped(1e-2),
    Attempt::Damped(1e0),
    Attempt::Damped(MAX_ATTEMPT_DAMPING),
];
const MAX_ATTEMPT_DAMPING: f64 = 1e2;
impl<S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Sqp<S, C, T, D, M> {
    /// Takes the full step, or a step of the line search.
    fn take_step<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        log_row: &mut Iteration,
    ) -> Result<Option<AcceptedStep>, OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        if self.options.globalisation != Globalisation::FullStep {
            return self.line_search(ocp, state, log_row);
        }
        core::mem::swap(&mut ocp.iterate, &mut self.qp_solution);
        Ok(Some(AcceptedStep { length: 1.0, corrected: false }))
    }

    /// Attempts a step in the direction of the QP. Continues with `None` if the line search fails
    /// or the QP is not solved.
    pub(super) fn attempt_step<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        log_row: &mut Iteration,
        watch: &mut Stopwatch,
    ) -> Result<ControlFlow<Status, Option<AcceptedStep>>, OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        let attempt = state.attempt;
        let damping = if let Attempt::Damped(damping) = attempt { damping } else { 0.0 };
        state.full_qp_accuracy = state.second_attempt || attempt != Attempt::First;
        state.may_reject_short_steps =
            state.uses_levenberg_marquardt(C::EXACT) && damping.max(state.damping) < MAX_ATTEMPT_DAMPING;
        if damping > 0.0 {
            state.damping = damping;
        }
        let direction = self.compute_direction(ocp, state, log_row)?;
        log_row.times.qp += watch.lap();
        state.qp_failure = direction.as_ref().err().copied();
        if state.out_of_time {
            return Ok(ControlFlow::Break(Status::OutOfTime));
        }
        match direction {
            Ok(DirectionOutcome::Step) => {
                let accepted_step = self.take_step(ocp, state, log_row)?;
                log_row.times.search += watch.lap() - state.line_search.linearisation_seconds.unwrap_or(0.0);
                return Ok(ControlFlow::Continue(accepted_step));
            }
            Ok(DirectionOutcome::LocallyInfeasible(worst)) => {
                return Ok(ControlFlow::Break(ocp.infeasible_status(&worst)));
            }
            Err(QpError::Infeasible { .. }) if self.options.elastic => {}
            Err(QpError::NotConvex { .. } | QpError::MaxIterations { .. } | QpError::Stalled { .. })
                if self.curvature.convexification() == Convexification::Reduced => {}
            Err(error) => return ocp.qp_failure_status(error).map(ControlFlow::Break),
        }
        Ok(ControlFlow::Continue(None))
    }

    /// Selects the next attempt at the same iterate. Returns a status if there is none.
    pub(super) fn select_next_attempt<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        log_row: &mut Iteration,
    ) -> Result<Option<Status>, OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        log_row.step = 0.0;
        let failure = state.qp_failure;
        let next = ATTEMPTS.iter().skip_while(|attempt| **attempt != state.attempt).skip(1);
        let next = next.copied().find(|attempt| match attempt {
            Attempt::First => false,
            Attempt::FullAccuracy => !(failure.is_some() || log_row.elastic || state.may_reject_short_steps),
            Attempt::Damped(damping) => {
                !(state.uses_levenberg_marquardt(C::EXACT) && *damping <= state.damping)
            }
        });
        let Some(next) = next else {
            return Ok(Some(match failure {
                // An infeasible QP at one iterate does not prove that the problem is infeasible.
                None | Some(QpError::Infeasible { .. }) => Status::NoProgress,
                Some(error) => ocp.qp_failure_status(error)?,
            }));
        };
        state.attempt = next;
        state.line_search.linearisation_seconds = None;
        if failure.is_some() {
            // The curvature due to multipliers may have caused the failure.
            ocp.iterate.multipliers_mut().fill(T::ZERO);
        }
        Ok(None)
    }
}
