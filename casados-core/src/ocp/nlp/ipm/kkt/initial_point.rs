//! The initial point: inside all bounds, with positive slacks and multipliers.

use crate::ocp::assembly::units::ScalingUnits;
use crate::ocp::nlp::ipm::IpmOptions;
use crate::qp::element::set;
use crate::qp::interior::{Iterate, at};
use crate::qp::{Bounds, QpView, SolutionView, StageOffsetsIter, part, part_mut};
use crate::scalar::Real;

/// Moves states and controls with hard bounds inside by `κ max(unit, |bound|)`, at most by `κ` of
/// the distance between two bounds (Wächter and Biegler, section 3.6).
pub(in crate::ocp::nlp::ipm) fn push_inside_bounds<T: Real>(
    qp: QpView<'_, T>,
    fixed: bool,
    push: f64,
    units: &[T],
    solution: &mut SolutionView<'_, T>,
) {
    let push = T::from_f64(push);
    for (place, stage) in StageOffsetsIter::<T>::new(qp.dims).zip(qp.stages()) {
        let v = part_mut(solution.v, place.v, place.n);
        let (x, u) = v.split_at_mut_checked(place.nx).unwrap_or_default();
        if !(fixed && place.stage == 0) {
            push_variables_inside(&stage.x_bounds(), push, part(units, place.row, place.nx), x);
        }
        push_variables_inside(&stage.u_bounds(), push, part(units, place.row + place.nx, place.nu), u);
    }
}

fn push_variables_inside<T: Real>(bounds: &Bounds<'_, T>, push: T, units: &[T], v: &mut [T]) {
    let penalties = bounds.lower_linear.iter().zip(bounds.upper_linear);
    for ((((v, &lower), &upper), (soft_below, soft_above)), &unit) in
        v.iter_mut().zip(bounds.lower).zip(bounds.upper).zip(penalties).zip(units)
    {
        let below = lower.is_finite() && !soft_below.is_finite();
        let above = upper.is_finite() && !soft_above.is_finite();
        if below && above && lower >= upper {
            *v = lower;
            continue;
        }
        let room = if below && above { push * (upper - lower) } else { T::from_f64(f64::INFINITY) };
        let distance = |bound: T| (push * bound.abs().max(unit)).min(room);
        if below {
            *v = (*v).max(lower + distance(lower));
        }
        if above {
            *v = (*v).min(upper - distance(upper));
        }
    }
}

/// Sets slacks to the distances from the bounds, at least to `push`; and multipliers to those of a
/// warm start, or to `objective_unit / unit`. `scratch` must contain the distances.
pub(in crate::ocp::nlp::ipm) fn initialise_inequalities<T: Real>(
    iterate: &mut Iterate<'_, T>,
    options: &IpmOptions,
    warm: bool,
    mu: f64,
    units: ScalingUnits<'_, T>,
    solution: &SolutionView<'_, T>,
) {
    let ([force, mu], units) = ([units.scaling.objective_unit, mu].map(T::from_f64), units.rows);
    let push = T::from_f64(if warm { options.warm_push } else { options.bound_push });
    let inequalities = &mut iterate.inequalities;
    let count = inequalities.counts.sides();
    // Variables are inside their hard bounds, and their slacks are exact. Other slacks are pushed.
    let general = super::newton::general_constraint_flags::<T>(iterate.qp, inequalities.rows);
    let rows = inequalities.rows.iter().map(|&row| at(units, row));
    for ((((slack, &distance), &bound), general), unit) in inequalities
        .slack
        .iter_mut()
        .zip(&*inequalities.scratch)
        .zip(&*inequalities.bound)
        .zip(general)
        .zip(rows)
    {
        let is_exact = !general && distance > T::ZERO;
        // The bounds of general constraints in the QP are shifted: their size has no meaning.
        let size = if general { unit } else { bound.abs().max(unit) };
        *slack = if is_exact { distance } else { distance.max(push * size) };
    }
    for (multiplier, &row) in inequalities.multiplier.iter_mut().zip(&*inequalities.rows) {
        *multiplier = force / at(units, row);
    }
    if warm {
        inequalities.load_multipliers(solution);
        for (multiplier, &slack) in inequalities.multiplier.iter_mut().zip(&*inequalities.slack).take(count) {
            *multiplier = (*multiplier).max(mu / slack);
        }
    }
    for (j, &side) in inequalities.soft.iter().enumerate() {
        let (linear, quadratic) = (at(inequalities.linear, j as u32), at(inequalities.quadratic, j as u32));
        // `λ + ν = linear + quadratic e` holds from the start.
        let unit = at(units, inequalities.rows.get(side as usize).copied().unwrap_or(u32::MAX));
        let violation = (at(inequalities.slack, side) - at(inequalities.scratch, side)).max(push * unit);
        let force = linear + quadratic * violation;
        let half = T::from_f64(0.5) * force;
        let multiplier = at(inequalities.multiplier, side).min(half);
        set(inequalities.multiplier, side as usize, multiplier);
        set(inequalities.slack, count + j, violation);
        set(inequalities.multiplier, count + j, force - multiplier);
    }
}
