//! The restoration phase after a failed step: it minimises the violations of hard bounds. It ends
//! at a point with small violations, from which the run continues, or where the sum of violations
//! is stationary.
//!
//! ```text
//! min  Σ e / unit        x_{k+1} = φ(x_k, u_k),  σ (g(v) − bound) = s − e,  s, e ≥ 0
//! ```
//!
//! The gradient of the objective is omitted. Its curvature and the regularisation limit steps along
//! which violations do not change. J. Nocedal, S. J. Wright, "Numerical Optimization", sections
//! 18.6 and 19.5; A. Wächter, L. T. Biegler, Math. Program. 106 (2006), section 3.3.

use super::elastic_mode::{self, set_elastic_penalties};
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::nlp::advanced::RestorationOptions;
use crate::ocp::nlp::ipm::Ipm;
use crate::ocp::nlp::ipm::IpmOptions;
use crate::ocp::nlp::ipm::kkt::dimensions::KktDimensions;
use crate::ocp::nlp::ipm::kkt::workspace::Workspace;
use crate::ocp::nlp::ipm::run_state::RunState;
use crate::ocp::nlp::solver_loop::NextAction;
use crate::ocp::solution::outcome::Status;
use crate::qp::element::set;
use crate::qp::interior::{Inequalities, at};
use crate::qp::{StageDims, Store};
use crate::scalar::{Real, Scalar};

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// Recovers from a failed step: by a restoration phase, then a monotone barrier, then elastic
    /// mode. Returns a status if all have been tried.
    pub(in crate::ocp::nlp::ipm) fn recover_from_failed_step<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_>,
    ) -> Option<Status> {
        let workspace = Workspace::new(ocp.ends(), &state.max_dimensions, self.workspace.as_mut());
        let (penalties, units) = (&*workspace.saved_penalties, &*workspace.units);
        let options = self.options.advanced.restoration;
        if state.restoration.outer_objective_unit.is_some() {
            if state.adaptive_mu.allows_free_mode() {
                state.begin_monotone_mode(&self.options);
                return None;
            }
            state.restoration.phase_count = options.max_restoration_phases;
            exit_restoration(ocp, state, penalties, &self.options);
            ocp.restore_best_iterate(&self.best_iterate);
            set_elastic_penalties(
                ocp,
                state,
                (penalties, units),
                (self.options.elastic_penalty, options.elastic_mu),
            );
            return None;
        }
        // Near a feasible point the first failure is not caused by violations.
        let is_violated = state.violation
            > if state.adaptive_mu.allows_free_mode() {
                options.monotone_retry_violation
            } else {
                options.small_violation
            };
        if self.options.elastic
            && state.elastic_penalty.is_none()
            && is_violated
            && state.restoration.may_enter(&options)
        {
            if state.violation > state.best_violation {
                ocp.restore_best_iterate(&self.best_iterate);
            }
            enter_restoration(ocp, state, (penalties, units), &options);
            return None;
        }
        if state.adaptive_mu.allows_free_mode() {
            // Continue from the best iterate.
            ocp.restore_best_iterate(&self.best_iterate);
            state.begin_monotone_mode(&self.options);
            return None;
        }
        if state.elastic_penalty.is_some() || !self.options.elastic {
            return Some(Status::NoProgress);
        }
        // The last iterate is a poor start.
        ocp.restore_best_iterate(&self.best_iterate);
        set_elastic_penalties(
            ocp,
            state,
            (penalties, units),
            (self.options.elastic_penalty, options.elastic_mu),
        );
        None
    }
}

/// Enters the restoration phase.
fn enter_restoration<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    ocp: &mut Ocp<P, T, D, M>,
    state: &mut RunState<'_>,
    penalties_and_units: (&[T], &[T]),
    options: &RestorationOptions,
) {
    state.restoration.outer_objective_unit = Some(state.dimensions.scaling.objective_unit);
    state.restoration.phase_count += 1;
    state.dimensions.scaling.objective_unit *= options.resto_penalty_scaling;
    set_elastic_penalties(ocp, state, penalties_and_units, (1.0, options.elastic_mu));
    state.dimensions.in_restoration = true;
}

/// Ends the restoration phase: restores the hard bounds.
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

/// Returns the end of the run, a reevaluation after the end of the phase, or `None`.
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
    let restoration = &options.advanced.restoration;
    if violations.is_stationary(restoration)
        && let Some(worst) = elastic_mode::largest_elastic_violation(ocp, state, (penalties, units))
    {
        return Some(NextAction::Terminate(ocp.infeasible_status(&worst)));
    }
    if violations.are_small(restoration) || state.nlp_error <= options.tolerance {
        exit_restoration(ocp, state, penalties, options);
        return Some(NextAction::Reevaluate);
    }
    None
}

/// Puts slacks `s` and violations `e` on the central path: both products are `μ`, and the distances
/// `d` from the bounds are unchanged.
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
        // The larger of two numbers with a given difference is computed without cancellation.
        let larger = (2.0 * mu + push.abs() + root) / (2.0 * linear);
        let smaller = mu / (linear - mu / larger);
        let (slack, violation) = if distance >= 0.0 { (larger, smaller) } else { (smaller, larger) };
        set(inequalities.slack, side as usize, T::from_f64(slack));
        set(inequalities.multiplier, side as usize, T::from_f64(mu / slack));
        set(inequalities.slack, count + j, T::from_f64(violation));
        set(inequalities.multiplier, count + j, T::from_f64(linear - mu / slack));
    }
}
