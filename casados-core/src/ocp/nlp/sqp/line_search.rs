//! Line search.

use super::Sqp;
use super::acceptance::MeritModel;
use super::options::Globalisation;
use super::run_state::{AcceptedStep, RunState};
use super::scaling::ScalingDirection;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::Curvature;
use crate::ocp::nlp::filter::FilterPair;
use crate::ocp::nlp::stopwatch::Stopwatch;
use crate::ocp::solution::log::Iteration;
use crate::qp::{QpSolver, QpStart, Solution, StageDims};
use crate::scalar::Real;

/// The smallest ratio of a weight to the largest multiplier. Constraints with zero multipliers, as
/// of states without costs, would have arbitrary violations otherwise.
const MIN_RELATIVE_WEIGHT: f64 = 1e-2;
/// `ρ`: to first order the merit function decreases by at least this fraction of the weighted
/// violations, also with negative curvature along the step (J. Nocedal, S. J. Wright, "Numerical
/// Optimization", equation (18.36)).
const RHO: f64 = 0.1;
/// Gauss-Newton steps up to this length are rejected in favour of damping, if weighted violations
/// exceed the slope of the objective. A short step reduces all linear gaps by the same fraction; a
/// damped direction reduces mainly the changes of the variables with the largest steps.
const SHORTEST_UNDAMPED_STEP: f64 = 0.25;

impl<S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Sqp<S, C, T, D, M> {
    /// Searches along the line from the iterate to the solution of its QP. Returns `None` if no
    /// step above the shortest one is acceptable.
    ///
    /// # Errors
    /// [`OcpError`] of a repeated linearisation at the iterate.
    pub(super) fn line_search<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        log_row: &mut Iteration,
    ) -> Result<Option<AcceptedStep>, OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        let globalisation = state.globalisation(&self.options);
        let uses_merit_function = globalisation == Globalisation::Merit;
        let model = self.merit_model(ocp, state);
        let mut qp_is_current = true;
        if state.line_search.last_step_was_full {
            if self.try_full_step(ocp, state, &model) {
                return Ok(Some(AcceptedStep { length: 1.0, corrected: false }));
            }
            qp_is_current = false;
        }
        state.line_search.last_step_was_full = false;
        let rejects_short_steps = state.may_reject_short_steps
            && uses_merit_function
            && model.current.violation > model.slope.abs();
        let shortest =
            if rejects_short_steps { 2.0 * SHORTEST_UNDAMPED_STEP } else { self.options.shortest_step };
        let mut length = 1.0;
        while length >= shortest {
            // A point with a non-finite function is rejected.
            let trial_pair = self.evaluate_trial(ocp, state, length);
            if let Some(trial_pair) = trial_pair
                && state.line_search.accepts(globalisation, length, &model, &trial_pair)
            {
                let length = self.backtrack_to_minimiser(ocp, state, &model, length, trial_pair);
                return Ok(Some(AcceptedStep { length, corrected: false }));
            }
            if length == 1.0 && trial_pair.is_some_and(|there| there.is_finite()) {
                if !qp_is_current {
                    ocp.linearise(self.curvature)?;
                    self.scale_qp_and_points(ocp, state, ScalingDirection::Scale);
                    ocp.regularise(T::from_f64(log_row.regularisation));
                    self.scale_qp_and_points(ocp, state, ScalingDirection::Unscale);
                }
                if self.try_second_order_correction(ocp, state, &model, log_row) {
                    return Ok(Some(AcceptedStep { length, corrected: true }));
                }
            }
            length *= 0.5;
        }
        Ok(None)
    }

    /// Initialises the weights of violations before the first line search. The weights of a filter
    /// are the inverses of units, and constant.
    pub(super) fn reset_weights<P: Program<T>>(&mut self, ocp: &Ocp<P, T, D, M>, state: &RunState<'_, T>) {
        let uses_merit_function = state.globalisation(&self.options) == Globalisation::Merit;
        self.violation_weights.multipliers_mut().fill(if uses_merit_function { T::ZERO } else { T::ONE });
        if !uses_merit_function {
            // The QP solution is written before it is read.
            self.scale_weights(ocp, state, ScalingDirection::Unscale);
        }
    }

    /// Returns objective and weighted violation at a step length, if they are finite.
    fn evaluate_trial<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &RunState<'_, T>,
        length: f64,
    ) -> Option<FilterPair> {
        let Self {
            qp_solution: solution,
            trial_point: trial,
            workspace: work,
            violation_weights: weights,
            ..
        } = self;
        let ends = work.as_mut().get_mut(..ocp.ends()).unwrap_or_default();
        interpolate_points(&ocp.iterate, solution, length, trial);
        ocp.objective_and_violation_at(trial, weights, ends)
            .ok()
            .map(|there| there.divided_by(state.objective_unit()))
    }

    /// Whether a shorter step may decrease the merit function further.
    fn should_shorten(
        &self,
        state: &RunState<'_, T>,
        model: &MeritModel,
        length: f64,
        trial_pair: &FilterPair,
    ) -> bool {
        let uses_merit_function = state.globalisation(&self.options) == Globalisation::Merit;
        uses_merit_function && model.overshoots(length, trial_pair)
    }

    /// Takes an accepted step, or half, a quarter, … of it: while its model has a shorter
    /// minimiser, and the merit function decreases. Returns the step length.
    fn backtrack_to_minimiser<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        model: &MeritModel,
        mut length: f64,
        mut trial_pair: FilterPair,
    ) -> f64
    where
        C: Curvature<P::Dynamics, T>,
    {
        while self.should_shorten(state, model, length, &trial_pair)
            && 0.5 * length >= self.options.shortest_step
        {
            let half = self.evaluate_trial(ocp, state, 0.5 * length);
            let Some(half) = half.filter(|half| half.is_finite() && half.merit() < trial_pair.merit()) else {
                interpolate_points(&ocp.iterate, &self.qp_solution, length, &mut self.trial_point);
                break;
            };
            (length, trial_pair) = (0.5 * length, half);
        }
        core::mem::swap(&mut ocp.iterate, &mut self.trial_point);
        state.line_search.last_step_was_full = length == 1.0;
        length
    }

    /// Updates the weights of violations, and returns the merit model.
    fn merit_model<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &RunState<'_, T>,
    ) -> MeritModel {
        let (current_pair, slope) = self.update_weights(ocp, state);
        MeritModel {
            current: current_pair.divided_by(state.objective_unit()),
            slope: slope / state.objective_unit(),
        }
    }

    /// Updates the weights. Returns objective and weighted violations at the iterate, and the slope
    /// of the objective.
    fn update_weights<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &RunState<'_, T>,
    ) -> (FilterPair, f64) {
        if state.globalisation(&self.options) != Globalisation::Merit {
            let current_pair = ocp.objective_and_violation(&self.violation_weights);
            let slope =
                ocp.objective_slope(&self.qp_solution, current_pair.objective - ocp.objective.to_f64());
            return (current_pair, slope);
        }
        self.scale_weights(ocp, state, ScalingDirection::Scale);
        let multipliers = self.qp_solution.multipliers_mut();
        let largest = multipliers.iter().fold(T::ZERO, |largest, m| m.abs().max(largest));
        let (half, least) = (T::from_f64(0.5), T::from_f64(MIN_RELATIVE_WEIGHT) * largest);
        // Weights are at least the multipliers of this step.
        self.violation_weights.update_multipliers(&self.qp_solution, |w, multiplier| {
            let size = multiplier.abs();
            size.max(half * (w + size)).max(least)
        });
        self.scale_weights(ocp, state, ScalingDirection::Unscale);
        let current_pair = ocp.objective_and_violation(&self.violation_weights);
        let slope = ocp.objective_slope(&self.qp_solution, current_pair.objective - ocp.objective.to_f64());
        let factor = slope / ((1.0 - RHO) * current_pair.violation);
        if !(factor > 1.0 && factor.is_finite()) {
            return (current_pair, slope);
        }
        let factor = T::from_f64(factor);
        self.violation_weights.multipliers_mut().iter_mut().for_each(|w| *w = factor * *w);
        (ocp.objective_and_violation(&self.violation_weights), slope)
    }

    /// Tries the full step by linearising at its end.
    fn try_full_step<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        model: &MeritModel,
    ) -> bool
    where
        C: Curvature<P::Dynamics, T>,
    {
        let mut watch = Stopwatch::start();
        let globalisation = state.globalisation(&self.options);
        core::mem::swap(&mut ocp.iterate, &mut self.qp_solution);
        let trial_pair = ocp.linearise(self.curvature);
        let trial_pair = trial_pair.map(|()| {
            ocp.objective_and_violation(&self.violation_weights).divided_by(state.objective_unit())
        });
        let seconds = watch.lap();
        let is_accepted = trial_pair.is_ok_and(|there| {
            !self.should_shorten(state, model, 1.0, &there)
                && state.line_search.accepts(globalisation, 1.0, model, &there)
        });
        if is_accepted {
            state.line_search.linearisation_seconds = Some(seconds);
            return true;
        }
        core::mem::swap(&mut ocp.iterate, &mut self.qp_solution);
        false
    }

    /// Tries a full step with second-order correction: with the constraint values at the end of the
    /// full step.
    fn try_second_order_correction<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
        model: &MeritModel,
        log_row: &mut Iteration,
    ) -> bool {
        let remaining_iterations = self.options.max_qp_iterations.saturating_sub(log_row.qp_iterations);
        if remaining_iterations == 0 {
            return false;
        }
        let ends = self.workspace.as_mut().get_mut(..ocp.ends()).unwrap_or_default();
        ocp.set_second_order_correction(&self.trial_point, ends);
        self.trial_point.copy_from(&self.qp_solution);
        // The trial point takes the solution, and is scaled back.
        core::mem::swap(&mut self.qp_solution, &mut self.trial_point);
        self.scale_qp_and_points(ocp, state, ScalingDirection::Scale);
        self.qp_solver.limit(Some(remaining_iterations));
        let solved =
            self.qp_solver.solve_until(ocp.qp(), QpStart::Warm, self.qp_solution.view_mut(), &mut || {
                state.is_out_of_time()
            });
        self.scale_qp_and_points(ocp, state, ScalingDirection::Unscale);
        core::mem::swap(&mut self.qp_solution, &mut self.trial_point);
        self.qp_solver.limit(None);
        let Ok(statistics) = solved else { return false };
        let globalisation = state.globalisation(&self.options);
        log_row.qp_iterations += statistics.iterations;
        let ends = self.workspace.as_mut().get_mut(..ocp.ends()).unwrap_or_default();
        let trial_pair = ocp
            .objective_and_violation_at(&self.trial_point, &self.violation_weights, ends)
            .ok()
            .map(|there| there.divided_by(state.objective_unit()));
        let is_accepted =
            trial_pair.is_some_and(|there| state.line_search.accepts(globalisation, 1.0, model, &there));
        if is_accepted {
            core::mem::swap(&mut ocp.iterate, &mut self.trial_point);
        }
        is_accepted
    }
}

/// Computes `a + length (b − a)` of all variables and multipliers.
fn interpolate_points<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    a: &Solution<T, D, M>,
    b: &Solution<T, D, M>,
    length: f64,
    target: &mut Solution<T, D, M>,
) {
    let length = T::from_f64(length);
    target.combine(a, b, |a, b| if length == T::ONE { b } else { a + length * (b - a) });
}
