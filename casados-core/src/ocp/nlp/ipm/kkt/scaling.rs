//! Residuals in units, relative to multipliers.
//!
//! A. Wächter, L. T. Biegler, Math. Program. 106 (2006), equations (5) and (6).

use crate::ocp::assembly::units::{Units, WIDE, of_tolerance};
use crate::qp::interior::{Inequalities, Iterate, at};
use crate::qp::{Places, Residuals, StageDims, nan_max, part};
use crate::scalar::Real;

/// Gaps of a state need not be less than this part of it times the tolerance.
const ROUNDING: f64 = 1e-5;
/// `s_max`: a mean multiplier that is larger relaxes tolerances.
const S_MAX: f64 = 100.0;

/// Gaps of dynamics, each with the unit of its state.
pub(in crate::ocp::nlp::ipm) fn of_gaps<'a, T: Real>(
    dims: &'a [StageDims],
    gaps: &'a [T],
    units: &'a [T],
) -> impl Iterator<Item = (T, T)> + 'a {
    Places::<T>::new(dims).flat_map(move |place| {
        let gaps = part(gaps, place.dynamics, place.next);
        gaps.iter().copied().zip(part(units, place.row + place.rows, place.next).iter().copied())
    })
}

/// Numbers of sides, each with the unit of its row.
pub(in crate::ocp::nlp::ipm) fn of_sides<'a, T: Real>(
    rows: &'a [u32],
    values: &'a [T],
    units: &'a [T],
) -> impl Iterator<Item = (T, T)> + 'a {
    values.iter().copied().zip(rows.iter().map(|&row| at(units, row)))
}

/// The sum of sizes in their units.
pub(in crate::ocp::nlp::ipm) fn sum<T: Real>(values: impl Iterator<Item = (T, T)>) -> f64 {
    values.fold(0.0, |sum, (value, unit)| sum + (value / unit).abs().to_f64())
}

/// Residuals relative to units.
pub(in crate::ocp::nlp::ipm) struct Relative {
    /// Of the barrier problem: all of them, and what products are divided by.
    pub barrier: (Residuals, f64),
    /// The largest of those that are compared with tolerances.
    pub error: f64,
    /// The largest of them but complementarity.
    pub others: f64,
}

/// Residuals in their units, relative to the mean sizes of multipliers where these are large: `s_d`
/// is that of all of them, `s_c` that of sides. What is judged has its own unit of products.
pub(in crate::ocp::nlp::ipm) fn relative<T: Real>(
    residuals: &Residuals,
    iterate: &Iterate<'_, T>,
    pi: &[T],
    (units, objective): (Units<'_, T>, f64),
    of_stages: f64,
) -> Relative {
    let (force, units) = (units.sizes.force, units.rows);
    let (sides, dims) = (&iterate.sides, iterate.qp.dims);
    let size = |sum: f64, (value, unit): (T, T)| sum + (value * unit).abs().to_f64();
    let in_rows = of_sides(sides.rows, sides.multiplier, units).fold(0.0, size);
    let others = part(sides.multiplier, sides.counts.sides(), sides.counts.soft);
    let in_sides = others.iter().zip(&*sides.soft).fold(in_rows, |sum, (&value, &side)| {
        size(sum, (value, at(units, sides.rows.get(side as usize).copied().unwrap_or(0))))
    });
    let in_equations = of_sides(sides.equations, sides.free, units).fold(0.0, size);
    let (all, count) = of_gaps(dims, pi, units)
        .fold((in_sides + in_equations, 0), |(sum, count), pair| (size(sum, pair), count + 1));
    let mean = |sum: f64, count: usize, unit: f64| (sum / unit / count.max(1) as f64 / S_MAX).max(1.0);
    let pairs = sides.counts.pair_count();
    let s_d = mean(all, count + pairs + sides.counts.equations, force);
    let [s_c, s_c_judged] = [force, objective].map(|unit| mean(in_sides, pairs, unit));
    let (mut in_units, mut judged, wide) = (T::ZERO, T::ZERO, T::from_f64(WIDE));
    for (&g, &unit) in iterate.stationarity.iter().zip(units) {
        in_units = nan_max(in_units, (g * unit).abs());
        let unit = T::ONE.min(wide * unit).max(unit / wide);
        judged = nan_max(judged, (g * unit).abs());
    }
    let barrier = Residuals {
        stationarity: in_units.to_f64() / (force * s_d),
        dynamics: nan_max(gaps(iterate, units), of_stages),
        inequalities: inequalities(sides, units, |unit| unit),
        complementarity: residuals.complementarity / (force * s_c),
    };
    let of_force = of_tolerance(force);
    let judged = Residuals {
        stationarity: judged.to_f64() / (of_force * s_d),
        inequalities: inequalities(sides, units, of_tolerance),
        complementarity: residuals.complementarity / (of_tolerance(objective) * s_c_judged),
        ..barrier
    };
    let others = Residuals { complementarity: 0.0, ..judged }.largest();
    Relative { barrier: (barrier, force * s_c), error: judged.largest(), others }
}

/// The largest gap in units of states that are not above one, nor below what rounding leaves of
/// states.
fn gaps<T: Real>(iterate: &Iterate<'_, T>, units: &[T]) -> f64 {
    let rounding = T::from_f64(ROUNDING);
    let coupling = iterate
        .coupling
        .as_ref()
        .map_or(T::ZERO, |coupling| coupling.residual.iter().fold(T::ZERO, |m, gap| nan_max(m, gap.abs())));
    let mut largest = coupling;
    for place in Places::<T>::new(iterate.qp.dims) {
        let begin = place.row + place.rows;
        let next = part(iterate.v, begin, place.next).iter().zip(part(units, begin, place.next));
        for (&gap, (&x, &unit)) in part(iterate.dynamics, place.dynamics, place.next).iter().zip(next) {
            largest = nan_max(largest, gap.abs() / unit.min(T::ONE).max(rounding * x.abs()));
        }
    }
    largest.to_f64()
}

/// The largest residual of sides and equations in the units of their rows.
fn inequalities<T: Real>(sides: &Inequalities<'_, T>, units: &[T], of: impl Fn(f64) -> f64) -> f64 {
    let equations = of_sides(sides.equations, sides.equation_residual, units);
    let sides = sides.rows.iter().zip(&*sides.scratch);
    sides
        .map(|(&row, &distance)| ((-distance).max(T::ZERO), at(units, row)))
        .chain(equations)
        .fold(0.0, |m, (value, unit)| nan_max(m, value.abs().to_f64() / of(unit.to_f64())))
}
