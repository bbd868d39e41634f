//! Violations in the restoration phase, and their stationarity.

use crate::ocp::assembly::units::ScalingUnits;
use crate::ocp::nlp::advanced::RestorationOptions;
use crate::qp::interior::{Iterate, at};
use crate::qp::{StageOffsetsIter, part};
use crate::scalar::Real;

/// Violations at an iterate, in units.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::ocp::nlp) struct Violations {
    /// The sum of violations of hard bounds, which are soft in the phase.
    violation_sum: f64,
    /// A bound, to first order, of the decrease within a distance of the size of the variables: the
    /// products of slacks and multipliers, of residuals and multipliers, and of gradient and
    /// variables.
    max_first_order_decrease: f64,
    largest_gap: f64,
}

/// State of the restoration phase.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::ocp::nlp) struct RestorationPhase {
    /// The objective unit of the problem during the phase.
    pub outer_objective_unit: Option<f64>,
    /// The number of restoration phases so far.
    pub phase_count: usize,
    /// The violations at the iterate of the phase.
    pub violations: Violations,
}

impl RestorationPhase {
    /// Whether another restoration phase may start.
    pub fn may_enter(&self, options: &RestorationOptions) -> bool {
        self.outer_objective_unit.is_none() && self.phase_count < options.max_restoration_phases
    }

    /// Computes the violations at an iterate with multipliers `π` of the dynamics.
    pub fn update_violations<T: Real>(
        &mut self,
        iterate: &Iterate<'_, T>,
        pi: &[T],
        gaps: f64,
        units: ScalingUnits<'_, T>,
    ) {
        let inequalities = &iterate.inequalities;
        let product = |sum: f64, (&a, &b): (&T, &T)| sum + (a * b).abs().to_f64();
        let slacks = inequalities.slack.iter().zip(&*inequalities.multiplier).fold(0.0, product);
        let of_sides = inequalities.residual.iter().zip(&*inequalities.multiplier).fold(slacks, product);
        let of_rows = inequalities
            .equation_residual
            .iter()
            .zip(&*inequalities.equation_multipliers)
            .fold(of_sides, product);
        let mut max_decrease = StageOffsetsIter::<T>::new(iterate.qp.dims).fold(of_rows, |sum, place| {
            let gaps = part(iterate.dynamics, place.dynamics, place.next);
            gaps.iter().zip(part(pi, place.dynamics, place.next)).fold(sum, product)
        });
        for ((&g, &v), &unit) in iterate.stationarity.iter().zip(&*iterate.v).zip(units.rows) {
            max_decrease += (g * (v.abs() + unit)).abs().to_f64();
        }
        let violations = inequalities.slack.get(inequalities.counts.sides()..).unwrap_or_default();
        let mut sum = 0.0;
        for ((&side, &violation), &linear) in
            inequalities.soft.iter().zip(violations).zip(&*inequalities.linear)
        {
            sum += (linear * (violation - at(inequalities.slack, side)).max(T::ZERO)).to_f64();
        }
        let objective_unit = units.scaling.objective_unit;
        self.violations = Violations {
            violation_sum: sum / objective_unit,
            max_first_order_decrease: max_decrease / objective_unit,
            largest_gap: gaps,
        };
    }
}

impl Violations {
    /// Whether the run may leave the restoration phase.
    pub fn are_small(&self, options: &RestorationOptions) -> bool {
        self.violation_sum <= options.small_violation && self.largest_gap <= options.small_violation
    }

    /// Whether the violations are stationary.
    pub fn is_stationary(&self, options: &RestorationOptions) -> bool {
        let Self { violation_sum: sum, max_first_order_decrease: better, largest_gap: gaps } = *self;
        sum > options.small_violation
            && better <= options.stationary_decrease_ratio * sum
            && gaps <= options.closed_gap_ratio * sum
    }
}
