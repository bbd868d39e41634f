//! Barrier function `φ` and violation `θ` at a point, and the slope of the barrier function.

use super::scaling::{gaps_with_units, row_values_with_units, sum_in_units};
use crate::ocp::assembly::units::ScalingUnits;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::{Program, ProgramParts, intervals_end};
use crate::ocp::nlp::filter::FilterPair;
use crate::qp::interior::{Inequalities, Iterate};
use crate::qp::{Solution, StageDims, StageOffsetsIter, add_symmetric_product, copy_common, part, part_mut};
use crate::scalar::{Real, Scalar};

/// Returns `Σ λ_e e + ½ q e²` over violations of soft bounds, and `−Σ log` over slacks and
/// violations.
pub(in crate::ocp::nlp::ipm) fn penalties_and_barrier<T: Real>(
    inequalities: &Inequalities<'_, T>,
    slacks: &[T],
) -> (f64, f64) {
    let violations = slacks.get(inequalities.counts.sides()..).unwrap_or_default();
    let costs = inequalities.linear.iter().zip(&*inequalities.quadratic).zip(violations);
    let penalties = costs.fold(0.0, |sum, ((&l, &q), &e)| {
        let (l, q, e) = (l.to_f64(), q.to_f64(), e.to_f64());
        sum + e * (l + 0.5 * q * e)
    });
    let barrier = slacks.iter().fold(0.0, |sum, &s| sum - Scalar::ln(s.to_f64()));
    (penalties, barrier)
}

/// Returns barrier function (in units of the objective) and violation at the iterate, whose
/// residuals must be up to date.
pub(in crate::ocp::nlp::ipm) fn barrier_and_violation<T: Real>(
    iterate: &Iterate<'_, T>,
    objective: f64,
    mu: f64,
    units: ScalingUnits<'_, T>,
) -> FilterPair {
    let (force, units) = (units.scaling.objective_unit, units.rows);
    let inequalities = &iterate.inequalities;
    let gaps = gaps_with_units(iterate.qp.dims, iterate.dynamics, units);
    let equations = row_values_with_units(inequalities.equations, inequalities.equation_residual, units);
    let coupling = iterate.coupling.as_ref().map_or(0.0, |coupling| coupling.residual_sum());
    let violation = sum_in_units(gaps)
        + sum_in_units(row_values_with_units(inequalities.rows, inequalities.residual, units))
        + sum_in_units(equations)
        + coupling;
    let (penalties, barrier) = penalties_and_barrier(inequalities, inequalities.slack);
    FilterPair { objective: (objective + penalties + mu * barrier) / force, violation }
}

/// Returns the slope `∇φᵀ d`, and `Σ |∂f/∂v_i| |v_i|`, the scale of the rounding errors of
/// the point.
pub(in crate::ocp::nlp::ipm) fn barrier_slope<T: Real>(
    iterate: &Iterate<'_, T>,
    mu: f64,
    scratch: &mut [T],
) -> (f64, f64) {
    let (mut slope, mut terms) = (T::ZERO, T::ZERO);
    for (place, stage) in StageOffsetsIter::<T>::new(iterate.qp.dims).zip(iterate.qp.stages()) {
        let view = stage.arrays();
        let gradient = part_mut(scratch, 0, place.ld);
        copy_common(gradient, part(view.gradient, 0, place.ld));
        add_symmetric_product(
            gradient,
            view.hessian,
            place.ld,
            part(iterate.v, place.row, place.ld),
            place.n,
        );
        let (step, v) = (part(iterate.step, place.row, place.n), part(iterate.v, place.row, place.n));
        for ((&g, &d), &v) in gradient.iter().zip(step).zip(v) {
            (slope, terms) = (slope + g * d, terms + (g * v).abs());
        }
    }
    let inequalities = &iterate.inequalities;
    let mut slope = slope.to_f64();
    for (&s, &d) in inequalities.slack.iter().zip(&*inequalities.slack_step) {
        slope -= mu * d.to_f64() / s.to_f64();
    }
    let violations = inequalities.slack.get(inequalities.counts.sides()..).unwrap_or_default();
    let steps = inequalities.slack_step.get(inequalities.counts.sides()..).unwrap_or_default();
    for (((&l, &q), &e), &d) in
        inequalities.linear.iter().zip(&*inequalities.quadratic).zip(violations).zip(steps)
    {
        slope += (l.to_f64() + q.to_f64() * e.to_f64()) * d.to_f64();
    }
    (slope, terms.to_f64())
}

impl<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Returns the objective, and writes the values of all rows at a point, in the units of the
    /// QP's bounds, to `rows`; ends of intervals and constraints to `ends`.
    ///
    /// # Errors
    /// The errors of functions and integrators.
    pub(in crate::ocp::nlp::ipm) fn row_values_at(
        &mut self,
        point: &Solution<T, D, M>,
        ends: &mut [T],
        rows: &mut [T],
    ) -> Result<f64, OcpError> {
        let objective = self.evaluate(point, ends)?.to_f64();
        let ProgramParts { qp, given, .. } = P::split(self);
        let qp = qp.view();
        let mut values = ends.get(intervals_end(qp.dims)..).unwrap_or_default();
        let ((v, _), [mut given_lower, mut given_upper]) = (point.variables_and_costates(), given);
        for (place, stage) in StageOffsetsIter::<T>::new(qp.dims).zip(qp.stages()) {
            let rows = part_mut(rows, place.row, place.rows);
            copy_common(rows, part(v, place.v, place.n));
            let bounds = stage.g_bounds();
            let [of_lower, of_upper, of_stage] =
                [&mut given_lower, &mut given_upper, &mut values].map(|list| {
                    let (own, behind) = list.split_at_checked(place.ng).unwrap_or_default();
                    *list = behind;
                    own
                });
            let rows = rows.get_mut(place.ld..).unwrap_or_default();
            let limits = bounds.lower.iter().zip(bounds.upper).zip(of_lower.iter().zip(of_upper));
            for ((row, &value), ((&lower, &upper), (&given_lower, &given_upper))) in
                rows.iter_mut().zip(of_stage).zip(limits)
            {
                // Bounds of the QP are the given bounds minus the constant part of the
                // linearisation.
                let shift = if lower.is_finite() { lower - given_lower } else { upper - given_upper };
                *row = if shift.is_finite() { value + shift } else { value };
            }
        }
        Ok(objective)
    }

    /// Returns the sum of the continuity gaps, in units.
    pub(in crate::ocp::nlp::ipm) fn gap_sum_at(
        &self,
        point: &Solution<T, D, M>,
        ends: &[T],
        units: &[T],
    ) -> f64 {
        let (mut sum, mut ends) = (0.0, ends);
        for (next, place) in point.stages().zip(StageOffsetsIter::<T>::new(point.dims())).skip(1) {
            let (phi, behind) = ends.split_at_checked(place.nx).unwrap_or_default();
            ends = behind;
            for ((&phi, &x), &unit) in phi.iter().zip(next.x).zip(part(units, place.row, place.nx)) {
                sum += ((phi - x) / unit).abs().to_f64();
            }
        }
        sum
    }
}

/// Returns the sum of the violations of inequalities and equations for given row values and slacks.
pub(in crate::ocp::nlp::ipm) fn violation_sum<T: Real>(
    inequalities: &mut Inequalities<'_, T>,
    rows: &[T],
    slacks: &[T],
    units: &[T],
) -> f64 {
    let at = |row: u32| rows.get(row as usize).copied().unwrap_or(T::ZERO);
    let lower = inequalities.counts.lower;
    let listed = inequalities.rows.iter().zip(&*inequalities.bound).zip(slacks);
    for (i, (residual, ((&row, &bound), &slack))) in inequalities.scratch.iter_mut().zip(listed).enumerate() {
        let distance = at(row) - bound;
        *residual = if i < lower { distance - slack } else { -distance - slack };
    }
    let violations = slacks.get(inequalities.counts.sides()..).unwrap_or_default();
    for (&side, &violation) in inequalities.soft.iter().zip(violations) {
        if let Some(residual) = inequalities.scratch.get_mut(side as usize) {
            *residual = *residual + violation;
        }
    }
    let inequality_violation =
        sum_in_units(row_values_with_units(inequalities.rows, inequalities.scratch, units));
    let unit = |row: u32| units.get(row as usize).copied().unwrap_or(T::ONE);
    let equations = inequalities.equations.iter().zip(&*inequalities.equation_bound);
    equations.fold(inequality_violation, |sum, (&row, &bound)| {
        sum + ((at(row) - bound) / unit(row)).abs().to_f64()
    })
}
