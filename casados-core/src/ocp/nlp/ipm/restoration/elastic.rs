//! Penalties where no step makes progress, and what they tell of a problem without a solution.

use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::nlp::elastic::Worst;
use crate::ocp::nlp::ipm::IpmOptions;
use crate::ocp::nlp::ipm::kkt::lengths::Lengths;
use crate::ocp::nlp::ipm::kkt::regularisation::Regularisation;
use crate::ocp::nlp::ipm::state::State;
use crate::ocp::solution::outcome::Status;
use crate::qp::StageDims;
use crate::scalar::Real;

/// Penalties grow to this multiple of the first.
const MAX_PENALTY_FACTOR: f64 = 1e4;
/// A violation that larger penalties do not make smaller than this part of it is there to stay.
const STATIONARY_UNDER_PENALTIES: f64 = 0.9;
/// The barrier parameter of new penalties, in units of forces.
const ELASTIC_MU: f64 = 0.1;

/// The hard bound that is violated most, in units, while penalties stand for it.
pub(in crate::ocp::nlp::ipm) fn worst<
    P: Program<T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
>(
    ocp: &Ocp<P, T, D, M>,
    state: &State<'_>,
    (given, units): (&[T], &[T]),
) -> Option<Worst> {
    state.elastic.and_then(|_| ocp.worst(given, units).0)
}

/// The end of a run at a stationary point, where violations cost so much; nothing where penalties
/// stand for bounds and larger ones may help. Near a minimum `v̄` of `f + ρ θ` a point without
/// violation has an objective of `f(v̄) + ρ θ(v̄)` at least: a violation that costs less than the
/// objective has changed by on the way may be there because it pays.
pub(in crate::ocp::nlp::ipm) fn verdict<
    P: Program<T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
>(
    ocp: &mut Ocp<P, T, D, M>,
    state: &mut State<'_>,
    (given, units): (&[T], &[T]),
    cost: f64,
    options: &IpmOptions,
) -> Option<Status> {
    let worst = worst(ocp, state, (given, units)).filter(|worst| worst.violation > options.tolerance);
    let (Some(penalty), Some(worst)) = (state.elastic, worst) else { return Some(Status::Converged) };
    let stays = worst.violation > STATIONARY_UNDER_PENALTIES * state.stationary_violation
        && cost >= (ocp.objective.to_f64() - state.first_objective).abs();
    if stays || penalty >= MAX_PENALTY_FACTOR * options.elastic_penalty {
        return Some(ocp.status_of_worst(&worst));
    }
    state.stationary_violation = worst.violation;
    soften(ocp, state, (given, units), 10.0 * penalty);
    None
}

/// Penalties, in units, in place of hard bounds; slacks begin anew.
pub(in crate::ocp::nlp::ipm) fn soften<
    P: Program<T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
>(
    ocp: &mut Ocp<P, T, D, M>,
    state: &mut State<'_>,
    (given, units): (&[T], &[T]),
    penalty: f64,
) {
    let sizes = state.lengths.sizes;
    ocp.set_penalties(given, Some(T::from_f64(penalty * sizes.force)), units);
    state.lengths = Lengths { sizes, ..Lengths::of(ocp.qp()) };
    state.elastic = Some(penalty);
    state.has_slacks = false;
    state.mu = ELASTIC_MU * sizes.force;
    state.regularisation = Regularisation::default();
    state.has_filter = false;
}
