//! The loop of both solvers: evaluate, test, step, restart, log.
//!
//! [`IterativeMethod`] has the parts that differ: [`Sqp`](crate::ocp::Sqp) steps towards the
//! solution of a quadratic program, [`Ipm`](crate::ocp::Ipm) along the Newton direction of a
//! barrier problem.

use super::stopwatch::Stopwatch;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::solution::log::Iteration;
use crate::ocp::solution::outcome::{Outcome, Status};
#[cfg(feature = "alloc")]
use crate::qp::try_reserve;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;
use core::ops::ControlFlow;

/// The next action after the convergence test of an iterate.
pub(super) enum NextAction {
    /// Take a step.
    Step,
    /// Evaluate again: the objective or the bounds have changed.
    Reevaluate,
    /// End the run.
    Terminate(Status),
}

/// The parts of an iteration.
pub(super) trait IterativeMethod<P, T, D, M> {
    /// State of a run, kept between iterations.
    type RunState<'c>;

    /// Evaluates functions, derivatives and residuals at the iterate.
    ///
    /// # Errors
    /// The errors of functions and integrators.
    fn evaluate(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut Self::RunState<'_>,
        log_row: &mut Iteration,
    ) -> Result<(), OcpError>;

    /// Tests whether the run ends at the iterate.
    fn check_termination(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut Self::RunState<'_>,
        log_row: &Iteration,
    ) -> NextAction;

    /// Computes a direction and takes a step along it. Returns a status if the run ends instead.
    ///
    /// # Errors
    /// The errors of functions and integrators.
    fn step(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut Self::RunState<'_>,
        log_row: &mut Iteration,
        watch: &mut Stopwatch,
    ) -> Result<Option<Status>, OcpError>;

    /// Restarts a run that would end, or stalls, from another point. Returns whether it restarts.
    fn restart(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut Self::RunState<'_>,
        final_status: Option<Status>,
        log_row: &Iteration,
    ) -> bool;

    /// The log of the run.
    #[cfg(feature = "alloc")]
    fn log(&mut self) -> &mut Vec<Iteration>;
}

/// Iterates until a test, a step or the observer ends the run. Counts iterations and times in
/// `outcome`.
///
/// # Errors
/// The errors of the method.
pub(super) fn iterate<P, T, D, M, S: IterativeMethod<P, T, D, M>>(
    method: &mut S,
    ocp: &mut Ocp<P, T, D, M>,
    state: &mut S::RunState<'_>,
    observer: &mut dyn FnMut(&Iteration) -> ControlFlow<()>,
    outcome: &mut Outcome,
) -> Result<(), OcpError> {
    loop {
        let mut log_row = Iteration { iteration: outcome.iterations, ..Iteration::default() };
        let mut watch = Stopwatch::start();
        method.evaluate(ocp, state, &mut log_row)?;
        log_row.times.linearise += watch.lap();
        let final_status = match method.check_termination(ocp, state, &log_row) {
            NextAction::Step => method.step(ocp, state, &mut log_row, &mut watch)?,
            NextAction::Reevaluate => None,
            NextAction::Terminate(status) => Some(status),
        };
        outcome.add_iteration(&log_row);
        #[cfg(feature = "alloc")]
        {
            try_reserve(method.log(), 1)?;
            method.log().push(log_row);
        }
        if !method.restart(ocp, state, final_status, &log_row)
            && let Some(status) = final_status
        {
            outcome.status = status;
            return Ok(());
        }
        if observer(&log_row).is_break() {
            outcome.status = Status::Stopped;
            return Ok(());
        }
        outcome.iterations += 1;
    }
}
