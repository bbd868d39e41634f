//! What a feasibility phase makes small, and when it stays.

use crate::ocp::assembly::units::Units;
use crate::qp::interior::{Iterate, at};
use crate::qp::{Places, part};
use crate::scalar::Real;

/// Violations and gaps, in units, that are no more than this are none from which a run cannot go
/// on.
pub(super) const SMALL_VIOLATION: f64 = 1e-4;
/// Violations are there to stay where no step makes more than this part of them less, to first
/// order.
const STATIONARY_DECREASE: f64 = 1e-4;
/// What is left of the dynamics by then, as a part of the violations.
const CLOSED_GAPS: f64 = 1e-5;
/// So many phases there may be in a run.
pub(super) const MAX_RESTORATION_PHASES: usize = 4;

/// What there is at an iterate, in units.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::ocp::nlp) struct Violations {
    /// Of hard bounds, which are soft in the phase.
    sum: f64,
    /// By how much a point may be better that is no farther away than variables are large, to first
    /// order: products of slacks and multipliers, of residuals and multipliers, of the gradient and
    /// variables.
    better: f64,
    gaps: f64,
}

/// What is remembered of phases.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::ocp::nlp) struct Phase {
    /// The unit of forces of the problem, while there is a phase.
    pub force: Option<f64>,
    /// How many there were.
    pub count: usize,
    /// What there is in the phase.
    pub violations: Violations,
}

impl Phase {
    /// Whether another phase may help.
    pub fn may_enter(&self) -> bool {
        self.force.is_none() && self.count < MAX_RESTORATION_PHASES
    }

    /// Takes what there is at an iterate with multipliers `π` of the dynamics.
    pub fn take<T: Real>(&mut self, iterate: &Iterate<'_, T>, pi: &[T], gaps: f64, units: Units<'_, T>) {
        let sides = &iterate.sides;
        let product = |sum: f64, (&a, &b): (&T, &T)| sum + (a * b).abs().to_f64();
        let slacks = sides.slack.iter().zip(&*sides.multiplier).fold(0.0, product);
        let of_sides = sides.residual.iter().zip(&*sides.multiplier).fold(slacks, product);
        let of_rows = sides.equation_residual.iter().zip(&*sides.free).fold(of_sides, product);
        let mut better = Places::<T>::new(iterate.qp.dims).fold(of_rows, |sum, place| {
            let gaps = part(iterate.dynamics, place.dynamics, place.next);
            gaps.iter().zip(part(pi, place.dynamics, place.next)).fold(sum, product)
        });
        for ((&g, &v), &unit) in iterate.stationarity.iter().zip(&*iterate.v).zip(units.rows) {
            better += (g * (v.abs() + unit)).abs().to_f64();
        }
        let violations = sides.slack.get(sides.counts.sides()..).unwrap_or_default();
        let mut sum = 0.0;
        for ((&side, &violation), &linear) in sides.soft.iter().zip(violations).zip(&*sides.linear) {
            sum += (linear * (violation - at(sides.slack, side)).max(T::ZERO)).to_f64();
        }
        let force = units.sizes.force;
        self.violations = Violations { sum: sum / force, better: better / force, gaps };
    }
}

impl Violations {
    /// Whether a run may go on.
    pub fn are_small(&self) -> bool {
        self.sum <= SMALL_VIOLATION && self.gaps <= SMALL_VIOLATION
    }

    /// Whether they are stationary.
    pub fn is_stationary(&self) -> bool {
        let Self { sum, better, gaps } = *self;
        sum > SMALL_VIOLATION && better <= STATIONARY_DECREASE * sum && gaps <= CLOSED_GAPS * sum
    }
}
