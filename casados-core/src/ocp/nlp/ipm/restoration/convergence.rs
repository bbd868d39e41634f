//! How a run may end, from residuals of an iterate.

use super::elastic;
use super::phase;
use crate::ocp::assembly::units::{of_tolerance, unit_of_products};
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::nlp::ipm::Ipm;
use crate::ocp::nlp::ipm::kkt::work::Work;
use crate::ocp::nlp::ipm::state::State;
use crate::ocp::nlp::solver::Next;
use crate::ocp::solution::log::Iteration;
use crate::ocp::solution::outcome::Status;
use crate::qp::{StageDims, Store};
use crate::scalar::Real;

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// What follows the residuals of an iteration.
    pub(in crate::ocp::nlp::ipm) fn next<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_>,
        row: &Iteration,
    ) -> Next {
        let mut work = Work::new(ocp.ends(), &state.capacity, self.work.as_mut());
        if let Some(status) = state.contradiction {
            return Next::End(status);
        }
        if state.lengths.alone {
            let next = phase::check_convergence(ocp, state, (work.penalties, work.units), &self.options);
            if let Some(next) = next {
                return next;
            }
        } else if state.error <= self.options.tolerance {
            if state.tightens(ocp, &mut work, self.options.tolerance) {
                return Next::Evaluate;
            }
            let cost = row.objective - ocp.objective.to_f64();
            let end = elastic::verdict(ocp, state, (work.penalties, work.units), cost, &self.options);
            return end.map_or(Next::Evaluate, Next::End);
        }
        if state.acceptable >= self.options.acceptable_iterations.max(1) {
            return Next::End(Status::Acceptable);
        }
        if row.iteration >= self.options.max_iterations {
            return Next::End(Status::MaxIterations);
        }
        Next::Step
    }
}

impl State<'_> {
    /// Goes on with a smaller unit of forces, where that of the guess says little of the iterate,
    /// and with products of slacks and multipliers in units of the objective.
    fn tightens<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        &mut self,
        ocp: &Ocp<P, T, D, M>,
        work: &mut Work<'_, T>,
        tolerance: f64,
    ) -> bool {
        if self.has_tightened || self.elastic.is_some() {
            return false;
        }
        let force = self.lengths.sizes.force;
        let smaller = ocp.smaller_force(work.units, force, (tolerance, true), work.scratch);
        let products = unit_of_products(ocp.objective.to_f64(), force);
        if smaller.is_none() && of_tolerance(products) >= of_tolerance(force) {
            return false;
        }
        let smaller = smaller.unwrap_or(force);
        self.has_tightened = true;
        (self.lengths.sizes.force, self.capacity.sizes.force) = (smaller, smaller);
        self.filter.clear();
        self.best_residual = f64::INFINITY;
        true
    }
}
