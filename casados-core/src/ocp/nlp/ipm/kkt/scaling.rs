//! Residuals in units, relative to the mean of the multipliers.
//!
//! A. Wächter, L. T. Biegler, Math. Program. 106 (2006), equations (5) and (6).

use crate::ocp::assembly::units::{NEAR_ONE_RATIO, ScalingUnits, tolerance_factor};
use crate::ocp::nlp::advanced::NewtonOptions;
use crate::qp::interior::{Inequalities, Iterate, at};
use crate::qp::{Residuals, StageDims, StageOffsetsIter, nan_max, part};
use crate::scalar::Real;

/// Returns the gaps of the dynamics, each with the unit of its state.
pub(in crate::ocp::nlp::ipm) fn gaps_with_units<'a, T: Real>(
    dims: &'a [StageDims],
    gaps: &'a [T],
    units: &'a [T],
) -> impl Iterator<Item = (T, T)> + 'a {
    StageOffsetsIter::<T>::new(dims).flat_map(move |place| {
        let gaps = part(gaps, place.dynamics, place.next);
        gaps.iter().copied().zip(part(units, place.row + place.rows, place.next).iter().copied())
    })
}

/// Returns values of inequalities, each with the unit of its row.
pub(in crate::ocp::nlp::ipm) fn row_values_with_units<'a, T: Real>(
    rows: &'a [u32],
    values: &'a [T],
    units: &'a [T],
) -> impl Iterator<Item = (T, T)> + 'a {
    values.iter().copied().zip(rows.iter().map(|&row| at(units, row)))
}

/// Returns the sum of the absolute values in their units.
pub(in crate::ocp::nlp::ipm) fn sum_in_units<T: Real>(values: impl Iterator<Item = (T, T)>) -> f64 {
    values.fold(0.0, |sum, (value, unit)| sum + (value / unit).abs().to_f64())
}

/// Residuals relative to units.
pub(in crate::ocp::nlp::ipm) struct ScaledResiduals {
    /// Residuals of the barrier problem, and the divisor of its complementarity.
    pub barrier_residuals: (Residuals, f64),
    /// The largest residual that is compared with tolerances.
    pub nlp_error: f64,
    /// The same, without complementarity.
    pub error_without_complementarity: f64,
}

/// Scales residuals by units, and by the means of large multipliers: `s_d` for all multipliers,
/// `s_c` for those of inequalities. Complementarity is compared with tolerances in units of
/// `product_unit`.
pub(in crate::ocp::nlp::ipm) fn scaled_residuals<T: Real>(
    residuals: &Residuals,
    iterate: &Iterate<'_, T>,
    pi: &[T],
    (units, product_unit): (ScalingUnits<'_, T>, f64),
    stage_residual: f64,
    options: &NewtonOptions,
) -> ScaledResiduals {
    let (force, units) = (units.scaling.objective_unit, units.rows);
    let (inequalities, dims) = (&iterate.inequalities, iterate.qp.dims);
    let size = |sum: f64, (value, unit): (T, T)| sum + (value * unit).abs().to_f64();
    let bound_multiplier_sum =
        row_values_with_units(inequalities.rows, inequalities.multiplier, units).fold(0.0, size);
    let violation_multipliers =
        part(inequalities.multiplier, inequalities.counts.sides(), inequalities.counts.soft);
    let inequality_multiplier_sum = violation_multipliers.iter().zip(&*inequalities.soft).fold(
        bound_multiplier_sum,
        |sum, (&value, &side)| {
            size(sum, (value, at(units, inequalities.rows.get(side as usize).copied().unwrap_or(0))))
        },
    );
    let equation_multiplier_sum =
        row_values_with_units(inequalities.equations, inequalities.equation_multipliers, units)
            .fold(0.0, size);
    let (all, count) = gaps_with_units(dims, pi, units)
        .fold((inequality_multiplier_sum + equation_multiplier_sum, 0), |(sum, count), pair| {
            (size(sum, pair), count + 1)
        });
    let mean =
        |sum: f64, count: usize, unit: f64| (sum / unit / count.max(1) as f64 / options.s_max).max(1.0);
    let pairs = inequalities.counts.pair_count();
    let s_d = mean(all, count + pairs + inequalities.counts.equations, force);
    let [s_c, tolerance_s_c] = [force, product_unit].map(|unit| mean(inequality_multiplier_sum, pairs, unit));
    let (mut barrier_stationarity, mut tolerance_stationarity, wide) =
        (T::ZERO, T::ZERO, T::from_f64(NEAR_ONE_RATIO));
    for (&g, &unit) in iterate.stationarity.iter().zip(units) {
        barrier_stationarity = nan_max(barrier_stationarity, (g * unit).abs());
        let unit = T::ONE.min(wide * unit).max(unit / wide);
        tolerance_stationarity = nan_max(tolerance_stationarity, (g * unit).abs());
    }
    let barrier = Residuals {
        stationarity: barrier_stationarity.to_f64() / (force * s_d),
        dynamics: nan_max(largest_scaled_gap(iterate, units, options.min_relative_gap_unit), stage_residual),
        inequalities: largest_scaled_inequality(inequalities, units, |unit| unit),
        complementarity: residuals.complementarity / (force * s_c),
    };
    let objective_tolerance_unit = tolerance_factor(force);
    let tolerance_residuals = Residuals {
        stationarity: tolerance_stationarity.to_f64() / (objective_tolerance_unit * s_d),
        inequalities: largest_scaled_inequality(inequalities, units, tolerance_factor),
        complementarity: residuals.complementarity / (tolerance_factor(product_unit) * tolerance_s_c),
        ..barrier
    };
    let others = Residuals { complementarity: 0.0, ..tolerance_residuals }.largest();
    ScaledResiduals {
        barrier_residuals: (barrier, force * s_c),
        nlp_error: tolerance_residuals.largest(),
        error_without_complementarity: others,
    }
}

/// Returns the largest gap in units of the states, which are at most one and at least
/// `min_relative_unit` of the state.
fn largest_scaled_gap<T: Real>(iterate: &Iterate<'_, T>, units: &[T], min_relative_unit: f64) -> f64 {
    let rounding = T::from_f64(min_relative_unit);
    let coupling = iterate
        .coupling
        .as_ref()
        .map_or(T::ZERO, |coupling| coupling.residual.iter().fold(T::ZERO, |m, gap| nan_max(m, gap.abs())));
    let mut largest = coupling;
    for place in StageOffsetsIter::<T>::new(iterate.qp.dims) {
        let begin = place.row + place.rows;
        let next = part(iterate.v, begin, place.next).iter().zip(part(units, begin, place.next));
        for (&gap, (&x, &unit)) in part(iterate.dynamics, place.dynamics, place.next).iter().zip(next) {
            largest = nan_max(largest, gap.abs() / unit.min(T::ONE).max(rounding * x.abs()));
        }
    }
    largest.to_f64()
}

/// Returns the largest residual of inequalities and equations in the units of their rows.
fn largest_scaled_inequality<T: Real>(
    inequalities: &Inequalities<'_, T>,
    units: &[T],
    tolerance_unit: impl Fn(f64) -> f64,
) -> f64 {
    let equations = row_values_with_units(inequalities.equations, inequalities.equation_residual, units);
    let distances = inequalities.rows.iter().zip(&*inequalities.scratch);
    distances
        .map(|(&row, &distance)| ((-distance).max(T::ZERO), at(units, row)))
        .chain(equations)
        .fold(0.0, |m, (value, unit)| nan_max(m, value.abs().to_f64() / tolerance_unit(unit.to_f64())))
}
