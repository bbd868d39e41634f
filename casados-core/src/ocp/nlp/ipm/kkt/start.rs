//! The first point: inside of all bounds, with slacks and multipliers away from zero.

use crate::ocp::assembly::units::Units;
use crate::ocp::nlp::ipm::IpmOptions;
use crate::qp::element::set;
use crate::qp::interior::{Iterate, at};
use crate::qp::{Bounds, Places, QpView, SolutionView, part, part_mut};
use crate::scalar::Real;

/// Moves states and controls that have hard bounds away from these by `κ max(unit, |bound|)`,
/// and by no more than `κ` of the room between two bounds (Wächter and Biegler, section 3.6).
pub(in crate::ocp::nlp::ipm) fn push_inside<T: Real>(
    qp: QpView<'_, T>,
    fixed: bool,
    push: T,
    units: &[T],
    solution: &mut SolutionView<'_, T>,
) {
    for (place, stage) in Places::<T>::new(qp.dims).zip(qp.stages()) {
        let v = part_mut(solution.v, place.v, place.n);
        let (x, u) = v.split_at_mut_checked(place.nx).unwrap_or_default();
        if !(fixed && place.stage == 0) {
            push_part(&stage.x_bounds(), push, part(units, place.row, place.nx), x);
        }
        push_part(&stage.u_bounds(), push, part(units, place.row + place.nx, place.nu), u);
    }
}

fn push_part<T: Real>(bounds: &Bounds<'_, T>, push: T, units: &[T], v: &mut [T]) {
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

/// Slacks at the distances from the bounds, and no less than `push`; multipliers of a warm start,
/// or the unit of forces. Values are evaluated already, so that distances are in `scratch`.
pub(in crate::ocp::nlp::ipm) fn begin_sides<T: Real>(
    iterate: &mut Iterate<'_, T>,
    options: &IpmOptions,
    warm: bool,
    mu: f64,
    units: Units<'_, T>,
    solution: &SolutionView<'_, T>,
) {
    let ([force, mu], units) = ([units.sizes.force, mu].map(T::from_f64), units.rows);
    let push = options.push::<T>(warm);
    let sides = &mut iterate.sides;
    let count = sides.counts.sides();
    // Variables are inside of their hard bounds; their slacks are exact and stay so. Others are
    // pushed.
    let general = super::newton::is_general::<T>(iterate.qp, sides.rows);
    let rows = sides.rows.iter().map(|&row| at(units, row));
    for ((((slack, &distance), &bound), general), unit) in
        sides.slack.iter_mut().zip(&*sides.scratch).zip(&*sides.bound).zip(general).zip(rows)
    {
        let exact = !general && distance > T::ZERO;
        // Bounds of general constraints are those of the QP, whose size says nothing.
        let size = if general { unit } else { bound.abs().max(unit) };
        *slack = if exact { distance } else { distance.max(push * size) };
    }
    for (multiplier, &row) in sides.multiplier.iter_mut().zip(&*sides.rows) {
        *multiplier = force / at(units, row);
    }
    if warm {
        sides.load_multipliers(solution);
        for (multiplier, &slack) in sides.multiplier.iter_mut().zip(&*sides.slack).take(count) {
            *multiplier = (*multiplier).max(mu / slack);
        }
    }
    for (j, &side) in sides.soft.iter().enumerate() {
        let (linear, quadratic) = (at(sides.linear, j as u32), at(sides.quadratic, j as u32));
        // `λ + ν = linear + quadratic e`, from the start on.
        let unit = at(units, sides.rows.get(side as usize).copied().unwrap_or(u32::MAX));
        let violation = (at(sides.slack, side) - at(sides.scratch, side)).max(push * unit);
        let force = linear + quadratic * violation;
        let half = T::from_f64(0.5) * force;
        let multiplier = at(sides.multiplier, side).min(half);
        set(sides.multiplier, side as usize, multiplier);
        set(sides.slack, count + j, violation);
        set(sides.multiplier, count + j, force - multiplier);
    }
}
