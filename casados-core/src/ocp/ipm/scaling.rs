//! Units in which sizes are near one: of forces by the objective, of variables by guess and bounds,
//! of constraints by their gradients; and tolerances relative to multipliers.
//!
//! Iterates stay in the units of the problem. A constant of the algorithm is one in these units.
//!
//! A. Wächter, L. T. Biegler, Math. Program. 106 (2006), equations (5) and (6), and section 3.8.

use super::lengths::Lengths;
use super::work::Work;
use crate::ocp::instance::Ocp;
use crate::ocp::problem::Formulation;
use crate::qp::interior::{Iterate, Sides, at, set};
use crate::qp::{
    Bounds, Places, QpView, Residuals, StageDims, add_symmetric, assign, larger, part, part_mut,
};
use crate::scalar::Real;

/// No unit is larger, or smaller than its inverse: squares of units are numbers.
const FARTHEST: f64 = 1e12;
/// Tolerances are those of the problem where units are up to this or its inverse.
const WIDE: f64 = 100.0;
/// Gaps of a state need not be less than this part of it times the tolerance.
const ROUNDING: f64 = 1e-5;
/// `s_max`: a mean multiplier that is larger relaxes tolerances.
const MEAN: f64 = 100.0;

/// The least and the largest of the sizes that something may have.
#[derive(Clone, Copy)]
struct Range {
    least: f64,
    most: f64,
}

impl Range {
    const EMPTY: Self = Self { least: f64::INFINITY, most: 0.0 };

    /// Zeros and infinite bounds say nothing.
    fn add<T: Real>(&mut self, size: T) {
        let size = size.abs().to_f64();
        if size > 0.0 && size.is_finite() {
            (self.least, self.most) = (self.least.min(size), self.most.max(size));
        }
    }

    /// The number between least and most that is nearest to one; one where nothing is known.
    fn unit<T: Real>(&self) -> T {
        let Self { least, most } = *self;
        let unit = if most == 0.0 { 1.0 } else { least.max(most.min(1.0)) };
        T::from_f64(unit.clamp(1.0 / FARTHEST, FARTHEST))
    }

    /// The same; one where that is between a hundredth and a hundred.
    fn unit_far_from_one<T: Real>(&self) -> T {
        let unit = self.unit::<T>();
        let wide = T::from_f64(WIDE);
        if unit <= wide && unit * wide >= T::ONE { T::ONE } else { unit }
    }
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// All units at the iterate, where the QP was written without second derivatives of
    /// constraints.
    pub(super) fn find_units(&self, lengths: &mut Lengths, work: &mut Work<'_, T>) {
        let (qp, (v, _)) = (self.qp.view(), self.iterate.vectors());
        let last = qp.dims.len().saturating_sub(1);
        let variables = qp.dims.first().map_or(0, |dims| dims.nx + dims.nu);
        for i in 0..variables {
            units_of_variable(qp, v, i, work.units);
        }
        let (path, terminal) = (0..last, last..last + 1);
        for stages in [path, terminal] {
            for i in 0..qp.dims.get(stages.start).map_or(0, |dims| dims.ng) {
                units_of_row(qp, v, (stages.clone(), i), work.units);
            }
        }
        lengths.force = unit_of_forces(qp, lengths.fixed, v, work);
        let least = work.units.iter().filter(|&&unit| unit > T::ZERO).fold(T::ONE, |m, &unit| m.min(unit));
        lengths.least = least.to_f64();
    }
}

/// The unit of a variable at all stages, by its guess and bounds; one where they are not far from
/// one.
fn units_of_variable<T: Real>(qp: QpView<'_, T>, v: &[T], i: usize, units: &mut [T]) {
    let mut range = Range::EMPTY;
    let mut guess = T::ZERO;
    for (place, stage) in Places::<T>::new(qp.dims).zip(qp.stages()).filter(|(place, _)| i < place.n) {
        guess = guess.max(at(v, (place.v + i) as u32).abs());
        let (bounds, i) = if i < place.nx { (stage.x_bounds(), i) } else { (stage.u_bounds(), i - place.nx) };
        let Bounds { lower, upper, .. } = bounds;
        lower.get(i).into_iter().chain(upper.get(i)).for_each(|&bound| range.add(bound));
    }
    // Small guesses are as good as zero.
    if range.most > 0.0 || guess > T::ONE {
        range.add(guess);
    }
    let unit = range.unit_far_from_one();
    for place in Places::<T>::new(qp.dims).filter(|place| i < place.n) {
        set(units, place.row + i, unit);
    }
}

/// The unit of a constraint at some stages, by its gradients and how far it is from its bounds.
fn units_of_row<T: Real>(
    qp: QpView<'_, T>,
    v: &[T],
    (stages, i): (core::ops::Range<usize>, usize),
    units: &mut [T],
) {
    let mut range = Range::EMPTY;
    let (mut slope, mut distance) = (T::ZERO, T::ZERO);
    for (place, stage) in
        Places::<T>::new(qp.dims).zip(qp.stages()).filter(|(p, _)| stages.contains(&p.stage))
    {
        let view = stage.arrays();
        let column = part(view.matrix, (place.next + i) * place.ld, place.ld);
        let v = part(v, place.v, place.ld);
        let mut value = T::ZERO;
        for ((&g, &v), &unit) in column.iter().zip(v).zip(part(units, place.row, place.n)) {
            value = value + g * v;
            slope = slope.max((g * unit).abs());
        }
        let Bounds { lower, upper, .. } = stage.g_bounds();
        let mut nearest = T::from_f64(f64::INFINITY);
        for &bound in lower.get(i).into_iter().chain(upper.get(i)) {
            nearest = nearest.min((value - bound).abs());
        }
        if nearest.is_finite() {
            distance = distance.max(nearest);
        }
    }
    range.add(slope);
    range.add(distance);
    let unit = range.unit_far_from_one();
    for place in Places::<T>::new(qp.dims).filter(|place| stages.contains(&place.stage)) {
        set(units, place.row + place.ld + i, unit);
    }
}

/// The unit of forces: of the largest derivative of the objective by a variable, or what that
/// changes by where the variable changes by a unit or by its size. At many guesses gradients
/// vanish.
fn unit_of_forces<T: Real>(qp: QpView<'_, T>, fixed: bool, v: &[T], work: &mut Work<'_, T>) -> f64 {
    let mut largest = T::ZERO;
    for (place, stage) in Places::<T>::new(qp.dims).zip(qp.stages()) {
        let view = stage.arrays();
        let (v, gradient) = (part(v, place.v, place.ld), part_mut(work.scratch, 0, place.ld));
        assign(gradient, part(view.gradient, 0, place.ld));
        add_symmetric(gradient, view.hessian, place.ld, v, place.n);
        let curvatures = view.hessian.iter().step_by(place.ld + 1);
        let given = if fixed && place.stage == 0 { place.nx } else { 0 };
        let units = part(work.units, place.row, place.n);
        for (((&slope, &curvature), &v), &unit) in
            gradient.iter().zip(curvatures).zip(v).zip(units).skip(given)
        {
            let change = curvature * v.abs().max(unit);
            largest = largest.max(slope.abs() * unit).max(change.abs() * unit);
        }
    }
    let mut range = Range::EMPTY;
    range.add(largest);
    range.unit::<T>().to_f64()
}

/// Gaps of dynamics, each with the unit of its state.
pub(super) fn of_gaps<'a, T: Real>(
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
pub(super) fn of_sides<'a, T: Real>(
    rows: &'a [u32],
    values: &'a [T],
    units: &'a [T],
) -> impl Iterator<Item = (T, T)> + 'a {
    values.iter().copied().zip(rows.iter().map(|&row| at(units, row)))
}

/// The sum of sizes in their units.
pub(super) fn sum<T: Real>(values: impl Iterator<Item = (T, T)>) -> f64 {
    values.fold(0.0, |sum, (value, unit)| sum + (value / unit).abs().to_f64())
}

/// What a tolerance is multiplied by: the unit, but one from there to a hundredth of it.
pub(super) fn of_tolerance(unit: f64) -> f64 {
    unit.min(1.0).max(unit / WIDE)
}

/// Residuals relative to units.
pub(super) struct Relative {
    /// Of the barrier problem: all of them, and what products are divided by.
    pub barrier: (Residuals, f64),
    /// The largest of those that are compared with tolerances.
    pub error: f64,
}

/// Residuals in their units, relative to the mean sizes of multipliers where these are large: `s_d`
/// is that of all of them, `s_c` that of sides.
pub(super) fn relative<T: Real>(
    residuals: &Residuals,
    iterate: &Iterate<'_, T>,
    pi: &[T],
    units: &[T],
    [force, of_stages]: [f64; 2],
) -> Relative {
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
    let mean = |sum: f64, count: usize| (sum / force / count.max(1) as f64 / MEAN).max(1.0);
    let pairs = sides.counts.pairs();
    let (s_d, s_c) = (mean(all, count + pairs + sides.counts.equations), mean(in_sides, pairs));
    let (mut in_units, mut judged, wide) = (T::ZERO, T::ZERO, T::from_f64(WIDE));
    for (&g, &unit) in iterate.stationarity.iter().zip(units) {
        in_units = larger(in_units, (g * unit).abs());
        let unit = T::ONE.min(wide * unit).max(unit / wide);
        judged = larger(judged, (g * unit).abs());
    }
    let barrier = Residuals {
        stationarity: in_units.to_f64() / (force * s_d),
        dynamics: larger(gaps(iterate, units), of_stages),
        inequalities: inequalities(sides, units, |unit| unit),
        complementarity: residuals.complementarity / (force * s_c),
    };
    let of_force = of_tolerance(force);
    let judged = Residuals {
        stationarity: judged.to_f64() / (of_force * s_d),
        inequalities: inequalities(sides, units, of_tolerance),
        complementarity: residuals.complementarity / (of_force * s_c),
        ..barrier
    };
    Relative { barrier: (barrier, force * s_c), error: judged.largest() }
}

/// The largest gap in units of states that are not above one, nor below what rounding leaves of
/// states.
fn gaps<T: Real>(iterate: &Iterate<'_, T>, units: &[T]) -> f64 {
    let rounding = T::from_f64(ROUNDING);
    let coupling = iterate
        .coupling
        .as_ref()
        .map_or(T::ZERO, |coupling| coupling.residual.iter().fold(T::ZERO, |m, gap| larger(m, gap.abs())));
    let mut largest = coupling;
    for place in Places::<T>::new(iterate.qp.dims) {
        let begin = place.row + place.rows;
        let next = part(iterate.v, begin, place.next).iter().zip(part(units, begin, place.next));
        for (&gap, (&x, &unit)) in part(iterate.dynamics, place.dynamics, place.next).iter().zip(next) {
            largest = larger(largest, gap.abs() / unit.min(T::ONE).max(rounding * x.abs()));
        }
    }
    largest.to_f64()
}

/// The largest residual of sides and equations in the units of their rows.
fn inequalities<T: Real>(sides: &Sides<'_, T>, units: &[T], of: impl Fn(f64) -> f64) -> f64 {
    let equations = of_sides(sides.equations, sides.equation_residual, units);
    let sides = sides.rows.iter().zip(&*sides.scratch);
    sides
        .map(|(&row, &distance)| ((-distance).max(T::ZERO), at(units, row)))
        .chain(equations)
        .fold(0.0, |m, (value, unit)| larger(m, value.abs().to_f64() / of(unit.to_f64())))
}
