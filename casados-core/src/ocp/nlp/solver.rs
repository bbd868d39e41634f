//! The loop of both solvers: evaluate, test, step, restart, log.
//!
//! [`Method`] is what a solver does in each of them: [`Sqp`](crate::ocp::Sqp) steps towards the
//! solution of a quadratic program, [`Ipm`](crate::ocp::Ipm) along Newton's direction of a barrier
//! problem.

use super::watch::Watch;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::solution::log::Iteration;
use crate::ocp::solution::outcome::{Outcome, Status};
#[cfg(feature = "alloc")]
use crate::qp::try_reserve;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;
use core::ops::ControlFlow;

/// What follows the test of an iterate.
pub(super) enum Next {
    /// A step.
    Step,
    /// Another evaluation: what is minimised has changed.
    Evaluate,
    /// The end of the run.
    End(Status),
}

/// The parts of an iteration.
pub(super) trait Method<P, T, D, M> {
    /// What a run remembers from one iteration to the next.
    type State<'c>;

    /// Evaluates functions and derivatives at the iterate, and residuals.
    ///
    /// # Errors
    /// Those of functions and integrators.
    fn evaluate(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut Self::State<'_>,
        row: &mut Iteration,
    ) -> Result<(), OcpError>;

    /// Whether the run ends at the iterate.
    fn test(&mut self, ocp: &mut Ocp<P, T, D, M>, state: &mut Self::State<'_>, row: &Iteration) -> Next;

    /// A direction, and a step along it; a status if the run ends without.
    ///
    /// # Errors
    /// Those of functions and integrators.
    fn step(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut Self::State<'_>,
        row: &mut Iteration,
        watch: &mut Watch,
    ) -> Result<Option<Status>, OcpError>;

    /// Whether the run begins again, at another start, where it would end otherwise, or stalls.
    fn restart(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut Self::State<'_>,
        end: Option<Status>,
        row: &Iteration,
    ) -> bool;

    /// The log of the run.
    #[cfg(feature = "alloc")]
    fn log(&mut self) -> &mut Vec<Iteration>;
}

/// Iterates until a test, a step or the observer ends the run; counts in `outcome` what it took.
///
/// # Errors
/// Those of the method.
pub(super) fn iterate<P, T, D, M, S: Method<P, T, D, M>>(
    method: &mut S,
    ocp: &mut Ocp<P, T, D, M>,
    state: &mut S::State<'_>,
    observer: &mut dyn FnMut(&Iteration) -> ControlFlow<()>,
    outcome: &mut Outcome,
) -> Result<(), OcpError> {
    loop {
        let mut row = Iteration { iteration: outcome.iterations, ..Iteration::default() };
        let mut watch = Watch::start();
        method.evaluate(ocp, state, &mut row)?;
        row.times.linearise += watch.lap();
        let end = match method.test(ocp, state, &row) {
            Next::Step => method.step(ocp, state, &mut row, &mut watch)?,
            Next::Evaluate => None,
            Next::End(status) => Some(status),
        };
        outcome.count(&row);
        #[cfg(feature = "alloc")]
        {
            try_reserve(method.log(), 1)?;
            method.log().push(row);
        }
        if !method.restart(ocp, state, end, &row)
            && let Some(status) = end
        {
            outcome.status = status;
            return Ok(());
        }
        if observer(&row).is_break() {
            outcome.status = Status::Stopped;
            return Ok(());
        }
        outcome.iterations += 1;
    }
}
