//! How a run may end, from residuals of an iterate.

use super::elastic;
use super::phase;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::problem::Formulation;
use crate::ocp::nlp::ipm::Ipm;
use crate::ocp::nlp::ipm::kkt::work::Work;
use crate::ocp::nlp::ipm::state::State;
use crate::ocp::nlp::solver::Next;
use crate::ocp::solution::log::Iteration;
use crate::ocp::solution::outcome::Status;
use crate::qp::{StageDims, Store, larger};
use crate::scalar::Real;

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// What follows the residuals of an iteration.
    pub(in crate::ocp::nlp::ipm) fn next<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_>,
        row: &Iteration,
    ) -> Next {
        let work = Work::new(ocp.ends(), &state.capacity, self.work.as_mut());
        if let Some(status) = state.contradiction {
            return Next::End(status);
        }
        if state.lengths.alone {
            let next = phase::check_convergence(ocp, state, (work.penalties, work.units), &self.options);
            if let Some(next) = next {
                return next;
            }
        } else if state.error <= self.options.tolerance {
            let cost = row.objective - ocp.objective.to_f64();
            let end = elastic::verdict(ocp, state, (work.penalties, work.units), cost, &self.options);
            return end.map_or(Next::Evaluate, Next::End);
        }
        if state.acceptable >= self.options.acceptable_iterations.max(1) {
            return Next::End(Status::Acceptable);
        }
        let violation = larger(row.residuals.dynamics, row.residuals.inequalities);
        let is_feasible = violation <= self.options.tolerance;
        let (v, _) = ocp.iterate.vectors();
        if is_feasible
            && state.elastic.is_none()
            && v.iter().any(|v| v.abs().to_f64() > state.diverging_iterates)
        {
            return Next::End(Status::Unbounded);
        }
        if row.iteration >= self.options.max_iterations {
            return Next::End(Status::MaxIterations);
        }
        Next::Step
    }
}
