//! Convergence tests.

use super::elastic_mode;
use super::phase;
use crate::ocp::assembly::units::{product_unit, tolerance_factor};
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::nlp::ipm::Ipm;
use crate::ocp::nlp::ipm::kkt::workspace::Workspace;
use crate::ocp::nlp::ipm::run_state::RunState;
use crate::ocp::nlp::solver_loop::NextAction;
use crate::ocp::solution::log::Iteration;
use crate::ocp::solution::outcome::Status;
use crate::qp::{StageDims, Store};
use crate::scalar::Real;

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// Determines the next action from the residuals of an iterate.
    pub(in crate::ocp::nlp::ipm) fn check_convergence<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_>,
        log_row: &Iteration,
    ) -> NextAction {
        let mut work = Workspace::new(ocp.ends(), &state.max_dimensions, self.workspace.as_mut());
        if let Some(status) = state.contradictory_bounds {
            return NextAction::Terminate(status);
        }
        if state.dimensions.in_restoration {
            let next =
                phase::check_restoration(ocp, state, (work.saved_penalties, work.units), &self.options);
            if let Some(next) = next {
                return next;
            }
        } else if state.nlp_error <= self.options.tolerance {
            if state.rescale_objective(ocp, &mut work, self.options.tolerance) {
                return NextAction::Reevaluate;
            }
            let cost = log_row.objective - ocp.objective.to_f64();
            let end = elastic_mode::status_at_stationary_point(
                ocp,
                state,
                (work.saved_penalties, work.units),
                cost,
                &self.options,
            );
            return end.map_or(NextAction::Reevaluate, NextAction::Terminate);
        }
        if state.acceptable_iterations >= self.options.acceptable_iterations.max(1) {
            return NextAction::Terminate(Status::Acceptable);
        }
        if log_row.iteration >= self.options.max_iterations {
            return NextAction::Terminate(Status::MaxIterations);
        }
        NextAction::Step
    }
}

impl RunState<'_> {
    /// Replaces the objective unit by a smaller one, computed at the iterate, if that of the guess
    /// is far too large; from then on products of slacks and multipliers have their own unit.
    /// Returns whether a unit has been replaced.
    fn rescale_objective<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
        &mut self,
        ocp: &Ocp<P, T, D, M>,
        work: &mut Workspace<'_, T>,
        tolerance: f64,
    ) -> bool {
        if self.has_rescaled_objective || self.elastic_penalty.is_some() {
            return false;
        }
        let force = self.dimensions.scaling.objective_unit;
        let smaller = ocp.reduced_objective_unit(work.units, force, (tolerance, true), work.scratch);
        let products = product_unit(ocp.objective.to_f64(), force);
        if smaller.is_none() && tolerance_factor(products) >= tolerance_factor(force) {
            return false;
        }
        let smaller = smaller.unwrap_or(force);
        self.has_rescaled_objective = true;
        (self.dimensions.scaling.objective_unit, self.max_dimensions.scaling.objective_unit) =
            (smaller, smaller);
        self.filter.clear();
        self.best_residual = f64::INFINITY;
        true
    }
}
