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

use super::elastic::{self, soften};
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::nlp::ipm::Ipm;
use crate::ocp::nlp::ipm::IpmOptions;
use crate::ocp::nlp::ipm::kkt::lengths::Lengths;
use crate::ocp::nlp::ipm::kkt::work::Work;
use crate::ocp::nlp::ipm::state::State;
use crate::ocp::nlp::ipm::violations::{MAX_RESTORATION_PHASES, SMALL_VIOLATION};
use crate::ocp::nlp::solver::Next;
use crate::ocp::solution::outcome::Status;
use crate::qp::element::set;
use crate::qp::interior::{Inequalities, at};
use crate::qp::{StageDims, Store};
use crate::scalar::{Real, Scalar};

/// The unit of forces of the phase, as a multiple of that of the problem: beside it the curvature
/// of the objective is small.
const PENALTY_SCALING: f64 = 1e3;
/// Where violations are no more than this, a run begins with a monotone barrier parameter first.
const MONOTONE_FIRST_BELOW: f64 = 1e-2;

impl<T: Real, D: AsRef<[StageDims]>, M: Store<T>, I: Store<u32>> Ipm<T, D, M, I> {
    /// Goes on where no step makes progress: violations alone, then with a monotone barrier
    /// parameter, then with penalties. The status if all of that has been tried.
    pub(in crate::ocp::nlp::ipm) fn recover<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut State<'_>,
    ) -> Option<Status> {
        let given = Work::new(ocp.ends(), &state.capacity, self.work.as_mut());
        let (penalties, units) = (&*given.penalties, &*given.units);
        if state.phase.force.is_some() {
            if state.progress.adapts() {
                state.begin_monotone(&self.options);
                return None;
            }
            state.phase.count = MAX_RESTORATION_PHASES;
            exit(ocp, state, penalties, &self.options);
            ocp.recall(&self.best);
            soften(ocp, state, (penalties, units), self.options.elastic_penalty);
            return None;
        }
        // Near a feasible point it is not violations that hinder a first attempt.
        let is_violated =
            state.violation > if state.progress.adapts() { MONOTONE_FIRST_BELOW } else { SMALL_VIOLATION };
        if self.options.elastic && state.elastic.is_none() && is_violated && state.phase.may_enter() {
            if state.violation > state.best_violation {
                ocp.recall(&self.best);
            }
            enter(ocp, state, (penalties, units));
            return None;
        }
        if state.progress.adapts() {
            // From the best point on, as carefully as may be.
            ocp.recall(&self.best);
            state.begin_monotone(&self.options);
            return None;
        }
        if state.elastic.is_some() || !self.options.elastic {
            return Some(Status::NoProgress);
        }
        // Where no step made progress is no place to begin.
        ocp.recall(&self.best);
        soften(ocp, state, (penalties, units), self.options.elastic_penalty);
        None
    }
}

/// Begins a phase.
fn enter<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    ocp: &mut Ocp<P, T, D, M>,
    state: &mut State<'_>,
    given: (&[T], &[T]),
) {
    state.phase.force = Some(state.lengths.sizes.force);
    state.phase.count += 1;
    state.lengths.sizes.force *= PENALTY_SCALING;
    soften(ocp, state, given, 1.0);
    state.lengths.alone = true;
}

/// Ends it: bounds are as hard as they were.
pub(in crate::ocp::nlp::ipm) fn exit<
    P: Program<T>,
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
    state.elastic = None;
    state.begin_monotone(options);
}

/// What follows an iterate of a phase: the end of the run, the end of the phase, or nothing.
pub(in crate::ocp::nlp::ipm) fn check_convergence<
    P: Program<T>,
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
        && let Some(worst) = elastic::worst(ocp, state, (penalties, units))
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
pub(in crate::ocp::nlp::ipm) fn centre<T: Real>(sides: &mut Inequalities<'_, T>, mu: f64) {
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
