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

use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::problem::Formulation;
use crate::ocp::nlp::ipm::Ipm;
use crate::ocp::nlp::ipm::IpmOptions;
use crate::ocp::nlp::ipm::kkt::lengths::Lengths;
use crate::ocp::nlp::ipm::kkt::regularisation::Regularisation;
use crate::ocp::nlp::ipm::kkt::work::Work;
use crate::ocp::nlp::ipm::state::State;
use crate::ocp::nlp::ipm::violations::SMALL_VIOLATION;
use crate::ocp::nlp::solver::Next;
use crate::ocp::solution::outcome::Status;
use crate::qp::element::set;
use crate::qp::interior::{Sides, at};
use crate::qp::{StageDims, Store};
use crate::scalar::{Real, Scalar};

/// The unit of forces of the phase, as a multiple of that of the problem: beside it the curvature
/// of the objective is small.
const PENALTY_SCALING: f64 = 1e3;
/// Where violations are no more than this, a monotone barrier parameter is tried first.
const MONOTONE_FIRST_BELOW: f64 = 1e-2;
/// The first barrier parameter of the phase, in its units of forces.
const RESTORATION_MU: f64 = 0.1;

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// Goes on where the line search fails: by a restoration phase, with a monotone barrier parameter
    /// from the best iterate; nothing if it has been tried. The status then.
    pub(in crate::ocp::nlp::ipm) fn recover<P: Formulation<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        capacity: &Lengths,
        state: &mut State<'_>,
    ) -> Option<Status> {
        let Work { penalties, units, .. } = Work::new(ocp.ends(), capacity, self.work.as_mut());
        if state.lengths.alone {
            if !state.progress.adapts() {
                return Some(Status::NoProgress);
            }
            state.begin_monotone(&self.options);
            return None;
        }
        // Near a feasible point it is not violations that hinder a first attempt.
        let small = if state.progress.adapts() { MONOTONE_FIRST_BELOW } else { SMALL_VIOLATION };
        let is_violated = state.violation > small;
        if self.options.elastic && is_violated && state.phase.may_enter() {
            if state.violation > state.best_violation {
                ocp.recall(&self.best);
            }
            enter(ocp, state, (penalties, units));
            return None;
        }
        if !state.progress.adapts() {
            return Some(Status::NoProgress);
        }
        // From the best point on, as carefully as may be.
        ocp.recall(&self.best);
        state.begin_monotone(&self.options);
        None
    }
}

/// Begins a phase.
fn enter<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    ocp: &mut Ocp<P, T, D, M>,
    state: &mut State<'_>,
    (given, units): (&[T], &[T]),
) {
    state.phase.force = Some(state.lengths.sizes.force);
    state.phase.count += 1;
    state.lengths.sizes.force *= PENALTY_SCALING;
    let sizes = state.lengths.sizes;
    ocp.set_penalties(given, Some(T::from_f64(sizes.force)), units);
    state.lengths = Lengths { sizes, alone: true, ..Lengths::of(ocp.qp()) };
    state.mu = RESTORATION_MU * sizes.force;
    state.regularisation = Regularisation::default();
    (state.has_slacks, state.has_filter) = (false, false);
}

/// Ends it: bounds are as hard as they were.
pub(in crate::ocp::nlp::ipm) fn exit<
    P: Formulation<T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
>(
    ocp: &mut Ocp<P, T, D, M>,
    state: &mut State<'_>,
    penalties: &[T],
    options: &IpmOptions,
) {
    ocp.set_penalties(penalties, None, &[]);
    let mut sizes = state.lengths.sizes;
    sizes.force = state.phase.force.take().unwrap_or(sizes.force);
    state.lengths = Lengths { sizes, ..Lengths::of(ocp.qp()) };
    state.begin_monotone(options);
}

/// What follows an iterate of a phase: the end of the run, the end of the phase, or nothing.
pub(in crate::ocp::nlp::ipm) fn check_convergence<
    P: Formulation<T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
>(
    ocp: &mut Ocp<P, T, D, M>,
    state: &mut State<'_>,
    (penalties, units): (&[T], &[T]),
    options: &IpmOptions,
) -> Option<Next> {
    let violations = state.phase.violations;
    if violations.is_stationary()
        && let Some(worst) = ocp.worst(penalties, units).0
    {
        return Some(Next::End(ocp.status_of_worst(&worst)));
    }
    if violations.are_small() || state.error <= options.tolerance {
        exit(ocp, state, penalties, options);
        return Some(Next::Evaluate);
    }
    None
}

/// Slacks and violations in the middle: both products are `μ`, and distances are as they are.
///
/// ```text
/// s − e = d,  μ / s + μ / e = linear
/// ```
pub(in crate::ocp::nlp::ipm) fn centre<T: Real>(sides: &mut Sides<'_, T>, mu: f64) {
    let count = sides.counts.sides();
    for (multiplier, &slack) in sides.multiplier.iter_mut().zip(&*sides.slack).take(count) {
        *multiplier = T::from_f64(mu / slack.to_f64());
    }
    for (j, &side) in sides.soft.iter().enumerate() {
        let distance = at(sides.scratch, side).to_f64();
        let linear = at(sides.linear, j as u32).to_f64();
        let push = linear * distance;
        let root = Scalar::sqrt(4.0 * mu * mu + push * push);
        // Of two numbers whose difference is the distance the larger one has no cancellation.
        let larger = (2.0 * mu + push.abs() + root) / (2.0 * linear);
        let other = mu / (linear - mu / larger);
        let (slack, violation) = if distance >= 0.0 { (larger, other) } else { (other, larger) };
        set(sides.slack, side as usize, T::from_f64(slack));
        set(sides.multiplier, side as usize, T::from_f64(mu / slack));
        set(sides.slack, count + j, T::from_f64(violation));
        set(sides.multiplier, count + j, T::from_f64(linear - mu / slack));
    }
}
