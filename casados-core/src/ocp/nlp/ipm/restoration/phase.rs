//! The restoration phase: violations of hard bounds alone are made small, from where no step made
//! progress. Either a point without violations is found, and the run goes on from there, or one
//! where the sum of violations is stationary.
//!
//! ```text
//! min  Σ e / unit        x_{k+1} = φ(x_k, u_k),  σ (g(v) − bound) = s − e,  s, e ≥ 0
//! ```
//!
//! The objective has no gradient; its curvature, and what the regularisation adds, keep steps short
//! where violations do not say how far to go. J. Nocedal, S. J. Wright, "Numerical Optimization",
//! sections 18.6 and 19.5; A. Wächter, L. T. Biegler, Math. Program. 106 (2006), section 3.3.

use super::elastic_mode::{self, set_elastic_penalties};
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::nlp::ipm::Ipm;
use crate::ocp::nlp::ipm::IpmOptions;
use crate::ocp::nlp::ipm::kkt::dimensions::KktDimensions;
use crate::ocp::nlp::ipm::kkt::workspace::Workspace;
use crate::ocp::nlp::ipm::run_state::RunState;
use crate::ocp::nlp::ipm::violations::{MAX_RESTORATION_PHASES, SMALL_VIOLATION};
use crate::ocp::nlp::solver_loop::NextAction;
use crate::ocp::solution::outcome::Status;
use crate::qp::element::set;
use crate::qp::interior::{Inequalities, at};
use crate::qp::{StageDims, Store};
use crate::scalar::{Real, Scalar};

/// The unit of forces of the phase, as a multiple of that of the problem: beside it the curvature
/// of the objective is small.
const RESTORATION_PENALTY_SCALING: f64 = 1e3;
/// Where violations are no more than this, a run begins with a monotone barrier parameter first.
const MONOTONE_RETRY_VIOLATION: f64 = 1e-2;

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// Goes on where no step makes progress: violations alone, then with a monotone barrier
    /// parameter, then with penalties. The status if all of that has been tried.
    pub(in crate::ocp::nlp::ipm) fn recover_from_failed_step<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_>,
    ) -> Option<Status> {
        let workspace = Workspace::new(ocp.ends(), &state.max_dimensions, self.workspace.as_mut());
        let (penalties, units) = (&*workspace.saved_penalties, &*workspace.units);
        if state.restoration.outer_objective_unit.is_some() {
            if state.adaptive_mu.allows_free_mode() {
                state.begin_monotone_mode(&self.options);
                return None;
            }
            state.restoration.phase_count = MAX_RESTORATION_PHASES;
            exit_restoration(ocp, state, penalties, &self.options);
            ocp.restore_best_iterate(&self.best_iterate);
            set_elastic_penalties(ocp, state, (penalties, units), self.options.elastic_penalty);
            return None;
        }
        // Near a feasible point it is not violations that hinder a first attempt.
        let is_violated = state.violation
            > if state.adaptive_mu.allows_free_mode() { MONOTONE_RETRY_VIOLATION } else { SMALL_VIOLATION };
        if self.options.elastic
            && state.elastic_penalty.is_none()
            && is_violated
            && state.restoration.may_enter()
        {
            if state.violation > state.best_violation {
                ocp.restore_best_iterate(&self.best_iterate);
            }
            enter_restoration(ocp, state, (penalties, units));
            return None;
        }
        if state.adaptive_mu.allows_free_mode() {
            // From the best point on, as carefully as may be.
            ocp.restore_best_iterate(&self.best_iterate);
            state.begin_monotone_mode(&self.options);
            return None;
        }
        if state.elastic_penalty.is_some() || !self.options.elastic {
            return Some(Status::NoProgress);
        }
        // Where no step made progress is no place to begin.
        ocp.restore_best_iterate(&self.best_iterate);
        set_elastic_penalties(ocp, state, (penalties, units), self.options.elastic_penalty);
        None
    }
}

/// Begins a phase.
fn enter_restoration<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    ocp: &mut Ocp<P, T, D, M>,
    state: &mut RunState<'_>,
    penalties_and_units: (&[T], &[T]),
) {
    state.restoration.outer_objective_unit = Some(state.dimensions.scaling.objective_unit);
    state.restoration.phase_count += 1;
    state.dimensions.scaling.objective_unit *= RESTORATION_PENALTY_SCALING;
    set_elastic_penalties(ocp, state, penalties_and_units, 1.0);
    state.dimensions.in_restoration = true;
}

/// Ends it: bounds are as hard as they were.
pub(in crate::ocp::nlp::ipm) fn exit_restoration<
    P: Program<T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
>(
    ocp: &mut Ocp<P, T, D, M>,
    state: &mut RunState<'_>,
    penalties: &[T],
    options: &IpmOptions,
) {
    ocp.set_penalties(penalties, None, &[]);
    let mut sizes = state.dimensions.scaling;
    sizes.objective_unit = state.restoration.outer_objective_unit.take().unwrap_or(sizes.objective_unit);
    state.dimensions = KktDimensions { scaling: sizes, ..KktDimensions::from_qp(ocp.qp()) };
    state.elastic_penalty = None;
    state.begin_monotone_mode(options);
}

/// What follows an iterate of a phase: the end of the run, the end of the phase, or nothing.
pub(in crate::ocp::nlp::ipm) fn check_restoration<
    P: Program<T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
>(
    ocp: &mut Ocp<P, T, D, M>,
    state: &mut RunState<'_>,
    (penalties, units): (&[T], &[T]),
    options: &IpmOptions,
) -> Option<NextAction> {
    let violations = state.restoration.violations;
    if violations.is_stationary()
        && let Some(worst) = elastic_mode::largest_elastic_violation(ocp, state, (penalties, units))
    {
        return Some(NextAction::Terminate(ocp.infeasible_status(&worst)));
    }
    if violations.are_small() || state.nlp_error <= options.tolerance {
        exit_restoration(ocp, state, penalties, options);
        return Some(NextAction::Reevaluate);
    }
    None
}

/// Slacks and violations in the middle: both products are `μ`, and distances are as they are.
///
/// ```text
/// s − e = d,  μ / s + μ / e = linear
/// ```
pub(in crate::ocp::nlp::ipm) fn start_on_central_path<T: Real>(
    inequalities: &mut Inequalities<'_, T>,
    mu: f64,
) {
    let count = inequalities.counts.sides();
    for (multiplier, &slack) in inequalities.multiplier.iter_mut().zip(&*inequalities.slack).take(count) {
        *multiplier = T::from_f64(mu / slack.to_f64());
    }
    for (j, &side) in inequalities.soft.iter().enumerate() {
        let distance = at(inequalities.scratch, side).to_f64();
        let linear = at(inequalities.linear, j as u32).to_f64();
        let push = linear * distance;
        let root = Scalar::sqrt(4.0 * mu * mu + push * push);
        // Of two numbers whose difference is the distance the larger one has no cancellation.
        let larger = (2.0 * mu + push.abs() + root) / (2.0 * linear);
        let smaller = mu / (linear - mu / larger);
        let (slack, violation) = if distance >= 0.0 { (larger, smaller) } else { (smaller, larger) };
        set(inequalities.slack, side as usize, T::from_f64(slack));
        set(inequalities.multiplier, side as usize, T::from_f64(mu / slack));
        set(inequalities.slack, count + j, T::from_f64(violation));
        set(inequalities.multiplier, count + j, T::from_f64(linear - mu / slack));
    }
}
