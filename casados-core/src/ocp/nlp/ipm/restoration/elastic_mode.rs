//! Elastic mode after failed steps, and its verdict of infeasibility.

use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::nlp::elastic_mode::Worst;
use crate::ocp::nlp::ipm::IpmOptions;
use crate::ocp::nlp::ipm::kkt::dimensions::KktDimensions;
use crate::ocp::nlp::ipm::run_state::RunState;
use crate::ocp::solution::outcome::Status;
use crate::qp::StageDims;
use crate::scalar::Real;

/// The largest violation of a hard bound in elastic mode, in units.
pub(in crate::ocp::nlp::ipm) fn largest_elastic_violation<
    P: Program<T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
>(
    ocp: &Ocp<P, T, D, M>,
    state: &RunState<'_>,
    (saved_penalties, units): (&[T], &[T]),
) -> Option<Worst> {
    state.elastic_penalty.and_then(|_| ocp.largest_hard_violation(saved_penalties, units).0)
}

/// Returns the status at a stationary point whose violations have the penalty `penalty_cost`;
/// `None` if penalties are increased instead.
///
/// Near a minimum `v̄` of `f + ρ θ` a feasible point has at least the objective `f(v̄) + ρ θ(v̄)`.
/// If the penalty is less than the change of the objective since the start, the violation may still
/// pay off.
pub(in crate::ocp::nlp::ipm) fn status_at_stationary_point<
    P: Program<T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
>(
    ocp: &mut Ocp<P, T, D, M>,
    state: &mut RunState<'_>,
    (saved_penalties, units): (&[T], &[T]),
    penalty_cost: f64,
    options: &IpmOptions,
) -> Option<Status> {
    let worst = largest_elastic_violation(ocp, state, (saved_penalties, units))
        .filter(|worst| worst.violation > options.tolerance);
    let (Some(penalty), Some(worst)) = (state.elastic_penalty, worst) else { return Some(Status::Converged) };
    let restoration = &options.advanced.restoration;
    let is_stationary = worst.violation > restoration.stationary_elastic_ratio * state.last_elastic_violation
        && penalty_cost >= (ocp.objective.to_f64() - state.initial_objective).abs();
    if is_stationary || penalty >= restoration.max_penalty_factor * options.elastic_penalty {
        return Some(ocp.infeasible_status(&worst));
    }
    state.last_elastic_violation = worst.violation;
    let penalty = restoration.penalty_inc_fact * penalty;
    set_elastic_penalties(ocp, state, (saved_penalties, units), (penalty, restoration.elastic_mu));
    None
}

/// Replaces hard bounds by penalties, in units, and starts with `elastic_mu`; initialises slacks
/// again.
pub(in crate::ocp::nlp::ipm) fn set_elastic_penalties<
    P: Program<T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
>(
    ocp: &mut Ocp<P, T, D, M>,
    state: &mut RunState<'_>,
    (saved_penalties, units): (&[T], &[T]),
    (penalty, elastic_mu): (f64, f64),
) {
    let sizes = state.dimensions.scaling;
    ocp.set_penalties(saved_penalties, Some(T::from_f64(penalty * sizes.objective_unit)), units);
    state.dimensions = KktDimensions { scaling: sizes, ..KktDimensions::from_qp(ocp.qp()) };
    state.elastic_penalty = Some(penalty);
    state.slacks_are_current = false;
    state.mu = elastic_mu * sizes.objective_unit;
    state.regularisation = state.regularisation.restarted();
    state.filter_is_initialised = false;
}
