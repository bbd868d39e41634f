//! Penalties where no step makes progress, and what they tell of a problem without a solution.

use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::nlp::elastic_mode::Worst;
use crate::ocp::nlp::ipm::IpmOptions;
use crate::ocp::nlp::ipm::kkt::dimensions::KktDimensions;
use crate::ocp::nlp::ipm::kkt::regularisation::Regularisation;
use crate::ocp::nlp::ipm::run_state::RunState;
use crate::ocp::solution::outcome::Status;
use crate::qp::StageDims;
use crate::scalar::Real;

/// Penalties grow to this multiple of the first.
const MAX_PENALTY_FACTOR: f64 = 1e4;
/// A violation that larger penalties do not make smaller than this part of it is there to stay.
const STATIONARY_ELASTIC_RATIO: f64 = 0.9;
/// The barrier parameter of new penalties, in units of forces.
const ELASTIC_MU: f64 = 0.1;

/// The hard bound that is violated most, in units, while penalties stand for it.
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

/// The end of a run at a stationary point, where violations cost so much; nothing where penalties
/// stand for bounds and larger ones may help. Near a minimum `v̄` of `f + ρ θ` a point without
/// violation has an objective of `f(v̄) + ρ θ(v̄)` at least: a violation that costs less than the
/// objective has changed by on the way may be there because it pays.
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
    let is_stationary = worst.violation > STATIONARY_ELASTIC_RATIO * state.last_elastic_violation
        && penalty_cost >= (ocp.objective.to_f64() - state.initial_objective).abs();
    if is_stationary || penalty >= MAX_PENALTY_FACTOR * options.elastic_penalty {
        return Some(ocp.infeasible_status(&worst));
    }
    state.last_elastic_violation = worst.violation;
    set_elastic_penalties(ocp, state, (saved_penalties, units), 10.0 * penalty);
    None
}

/// Penalties, in units, in place of hard bounds; slacks begin anew.
pub(in crate::ocp::nlp::ipm) fn set_elastic_penalties<
    P: Program<T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
>(
    ocp: &mut Ocp<P, T, D, M>,
    state: &mut RunState<'_>,
    (saved_penalties, units): (&[T], &[T]),
    penalty: f64,
) {
    let sizes = state.dimensions.scaling;
    ocp.set_penalties(saved_penalties, Some(T::from_f64(penalty * sizes.objective_unit)), units);
    state.dimensions = KktDimensions { scaling: sizes, ..KktDimensions::from_qp(ocp.qp()) };
    state.elastic_penalty = Some(penalty);
    state.slacks_are_current = false;
    state.mu = ELASTIC_MU * sizes.objective_unit;
    state.regularisation = Regularisation::default();
    state.filter_is_initialised = false;
}
