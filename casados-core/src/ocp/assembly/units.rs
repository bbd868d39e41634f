//! Units in which sizes are near one: of the objective by its derivatives, of variables by guess
//! and bounds, of constraints by their gradients.
//!
//! Iterates remain in the units of the problem; constants of algorithms are multiples of units.
//!
//! A. Wächter, L. T. Biegler, Math. Program. 106 (2006), section 3.8.

use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::qp::element::set;
use crate::qp::interior::{at, is_initial_state_fixed};
use crate::qp::{
    Bounds, QpView, StageDims, StageOffsetsIter, add_symmetric_product, copy_common, is_marked, part,
    part_mut,
};
use crate::scalar::Real;
use core::ops::Range as Stages;

/// The largest unit; its inverse is the smallest one. Squares of units are finite.
const MAX_UNIT: f64 = 1e12;
/// Units between this and its inverse are replaced by one, and leave tolerances unchanged.
pub(in crate::ocp) const NEAR_ONE_RATIO: f64 = 100.0;

/// The reduced objective unit is at least the previous one times this number of rounding errors
/// over the tolerance.
const ROUNDING_ERROR_MARGIN: f64 = 10.0;
/// The rounding error of a sum, in multiples of the unit roundoff times the largest term.
const SUM_ROUNDING_FACTOR: f64 = 4.0;
/// IPOPT's `nlp_upper_bound_inf`: larger bounds are no measure of the size of variables.
const BOUND_INFINITY: f64 = 1e19;

/// The objective unit, and the smallest unit of a row.
#[derive(Clone, Copy, Debug)]
pub(in crate::ocp) struct ProblemScaling {
    /// The unit of the objective and of multipliers.
    pub objective_unit: f64,
    /// The smallest unit of a row, at most one.
    pub min_row_unit: f64,
}

/// The units of a problem.
#[derive(Clone, Copy, Debug)]
pub(in crate::ocp) struct ScalingUnits<'a, T> {
    pub scaling: ProblemScaling,
    /// The units of variables and constraints.
    pub rows: &'a [T],
}

/// The factor of a tolerance: the unit if it is below one, one up to a unit of 100, and a hundredth
/// of larger units.
pub(in crate::ocp) fn tolerance_factor(unit: f64) -> f64 {
    unit.min(1.0).max(unit / NEAR_ONE_RATIO)
}

/// The unit of products of slacks and multipliers at the end of a run, for this value of the
/// objective: the sum of products is the distance of the objective from its minimum.
///
/// It is the magnitude of the objective, at most `objective_unit` and at least
/// `min(objective_unit, 1)`. Distant origins of variables increase `objective_unit` only.
pub(in crate::ocp) fn product_unit(objective: f64, objective_unit: f64) -> f64 {
    if objective.is_finite() {
        objective.abs().clamp(objective_unit.min(1.0), objective_unit)
    } else {
        objective_unit
    }
}

/// The smallest and the largest magnitude of a quantity.
#[derive(Clone, Copy)]
struct MagnitudeRange {
    smallest: f64,
    largest: f64,
}

impl MagnitudeRange {
    const EMPTY: Self = Self { smallest: f64::INFINITY, largest: 0.0 };

    /// Adds a magnitude; zeros and infinite bounds are ignored.
    fn add<T: Real>(&mut self, size: T) {
        let size = size.abs().to_f64();
        if size > 0.0 && size.is_finite() {
            (self.smallest, self.largest) = (self.smallest.min(size), self.largest.max(size));
        }
    }

    /// The number in the range that is nearest to one; one for an empty range.
    fn unit<T: Real>(&self) -> T {
        let Self { smallest: least, largest: most } = *self;
        let unit = if most == 0.0 { 1.0 } else { least.max(most.min(1.0)) };
        T::from_f64(unit.clamp(1.0 / MAX_UNIT, MAX_UNIT))
    }

    /// The unit, replaced by one between 1/100 and 100.
    fn unit_unless_near_one<T: Real>(&self) -> T {
        let unit = self.unit::<T>();
        let wide = T::from_f64(NEAR_ONE_RATIO);
        if unit <= wide && unit * wide >= T::ONE { T::ONE } else { unit }
    }
}

impl<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Computes all units at the iterate, where the QP was written without second derivatives of
    /// constraints.
    ///
    /// `rows` receives a unit for each row; `scratch` has memory for the variables of a stage. With
    /// `has_distant_origins` the unit of a state with a distant origin is that of a state without
    /// bounds.
    pub(in crate::ocp) fn compute_units(
        &self,
        rows: &mut [T],
        scratch: &mut [T],
        has_distant_origins: bool,
    ) -> ProblemScaling {
        rows.fill(T::ONE);
        let (qp, (v, _)) = (self.qp.view(), self.iterate.variables_and_costates());
        for span in self.problem.spans(qp.dims.len()) {
            let last = span.end.saturating_sub(1);
            let (path, terminal) = (span.start..last, last..span.end);
            let StageDims { nx, nu, .. } = qp.dims.get(span.start).copied().unwrap_or_default();
            // Zero for states without bounds whose guess is zero.
            for i in 0..nx + nu {
                // Shared controls have one unit over all stages, other controls of the last stage
                // their own.
                let is_single_variable = i < nx || is_marked(qp.shared(), i - nx);
                let stages = if is_single_variable { span.clone() } else { path.clone() };
                set_variable_unit(qp, v, (stages, i), rows);
            }
            for i in 0..nx {
                set_driven_state_unit(qp, (span.clone(), i), rows, has_distant_origins);
            }
            let last_controls = qp.dims.get(last).map_or(0, |dims| dims.nu);
            for j in (0..last_controls).filter(|&j| !is_marked(qp.shared(), j)) {
                set_variable_unit(qp, v, (terminal.clone(), nx + j), rows);
            }
            for stages in [path, terminal] {
                for i in 0..qp.dims.get(stages.start).map_or(0, |dims| dims.ng) {
                    set_row_unit(qp, v, (stages.clone(), i), rows);
                }
            }
        }
        let force = compute_objective_unit(qp, v, rows, scratch);
        let least = rows.iter().filter(|&&unit| unit > T::ZERO).fold(T::ONE, |m, &unit| m.min(unit));
        ProblemScaling { objective_unit: force, min_row_unit: least.to_f64() }
    }

    /// Returns a smaller objective unit if objective and gradient at the iterate are below a
    /// hundredth of the present one. For example, a cost `(x − r)²` with a large `r` is large at
    /// the guess, and small at a solution nearby. `rows` are the units of rows, `tolerance` is
    /// the smallest tolerance of residuals in units of the objective. With `counts_changes` the
    /// unit also covers the rounding errors of the terms of the gradient.
    pub(in crate::ocp) fn reduced_objective_unit(
        &self,
        rows: &[T],
        objective_unit: f64,
        (tolerance, counts_changes): (f64, bool),
        scratch: &mut [T],
    ) -> Option<f64> {
        let (qp, (v, _)) = (self.qp.view(), self.iterate.variables_and_costates());
        let [slope, change] = largest_gradient_and_change(qp, v, rows, scratch).map(T::to_f64);
        let size = slope.max(self.objective.abs().to_f64()).max(1.0);
        let terms = if counts_changes { objective_unit.max(change) } else { objective_unit };
        let smaller_unit = size.max(ROUNDING_ERROR_MARGIN * T::EPSILON / tolerance * terms);
        (smaller_unit * NEAR_ONE_RATIO < objective_unit).then_some(smaller_unit)
    }

    /// The largest magnitude of variables and their bounds, at least one.
    pub(in crate::ocp) fn largest_magnitude(&self) -> f64 {
        let mut largest =
            self.iterate.variables_and_costates().0.iter().fold(T::ONE, |m, v| m.max(v.abs())).to_f64();
        for stage in self.qp().stages() {
            for bounds in [stage.x_bounds(), stage.u_bounds()] {
                for (&lower, &upper) in bounds.lower.iter().zip(bounds.upper) {
                    // Fixed variables count, however large.
                    let infinity = if lower == upper { f64::INFINITY } else { BOUND_INFINITY };
                    let sizes = [lower, upper].map(|bound| bound.abs().to_f64());
                    largest = sizes.into_iter().filter(|&size| size < infinity).fold(largest, f64::max);
                }
            }
        }
        largest
    }

    /// The rounding error of gaps, and of distances from bounds: a multiple of the unit roundoff
    /// times the largest variable of the iterate, projected onto its bounds.
    pub(in crate::ocp) fn gap_rounding_error(&self) -> f64 {
        let mut largest = T::ZERO;
        for (stage, stage_point) in self.qp().stages().zip(self.iterate.stages()) {
            for (bounds, values) in [(stage.x_bounds(), stage_point.x), (stage.u_bounds(), stage_point.u)] {
                let limits = bounds.lower.iter().zip(bounds.upper);
                for (&value, (&lower, &upper)) in values.iter().zip(limits) {
                    largest = largest.max(value.max(lower).min(upper).abs());
                }
            }
        }
        SUM_ROUNDING_FACTOR * T::EPSILON * largest.to_f64()
    }

    /// The rounding error of gradients: a multiple of the unit roundoff times the largest product
    /// of a curvature and a variable of the iterate.
    pub(in crate::ocp) fn gradient_rounding_error(&self) -> f64 {
        let ((v, _), mut largest) = (self.iterate.variables_and_costates(), T::ZERO);
        for (place, stage) in StageOffsetsIter::<T>::new(self.qp.dims()).zip(self.qp().stages()) {
            let curvatures = stage.arrays().hessian.iter().step_by(place.ld + 1);
            for (&curvature, &v) in curvatures.zip(part(v, place.v, place.n)) {
                largest = largest.max((curvature * v).abs());
            }
        }
        SUM_ROUNDING_FACTOR * T::EPSILON * largest.to_f64()
    }
}

/// Computes the unit of a variable over all stages, from its guess and bounds; one if it is near
/// one.
fn set_variable_unit<T: Real>(
    qp: QpView<'_, T>,
    v: &[T],
    (stages, i): (Stages<usize>, usize),
    units: &mut [T],
) {
    let mut range = MagnitudeRange::EMPTY;
    let mut guess = T::ZERO;
    let variable_places =
        || StageOffsetsIter::<T>::new(qp.dims).filter(|place| stages.contains(&place.stage) && i < place.n);
    let stages_of_places = qp.stages().skip(stages.start);
    for (place, stage) in variable_places().zip(stages_of_places) {
        guess = guess.max(at(v, (place.v + i) as u32).abs());
        let (bounds, i) = if i < place.nx { (stage.x_bounds(), i) } else { (stage.u_bounds(), i - place.nx) };
        let Bounds { lower, upper, .. } = bounds;
        lower.get(i).into_iter().chain(upper.get(i)).for_each(|&bound| range.add(bound));
        // The distance between two bounds does not depend on an offset, as in temperatures from 298
        // to 398.
        if let (Some(&lower), Some(&upper)) = (lower.get(i), upper.get(i)) {
            range.add(upper - lower);
        }
    }
    // Guesses below one do not reduce a unit that no bound determines.
    if range.largest > 0.0 || guess > T::ONE {
        range.add(guess);
    }
    let is_state = variable_places().next().is_some_and(|place| i < place.nx);
    let is_unknown = is_state && range.largest == 0.0 && guess == T::ZERO;
    let unit = if is_unknown { T::ZERO } else { range.unit_unless_near_one() };
    for place in variable_places() {
        set(units, place.row + i, unit);
    }
}

/// Computes the unit of a state without bounds whose guess is zero, or whose origin is distant: the
/// change by controls in an interval, at least one, since states accumulate such changes.
///
/// An origin is distant if the curvature of such a change is below `NEAR_ONE_RATIO` rounding errors
/// of the objective unit, the square of the unit: a QP in these units does not see the controls.
/// Changes by other states are ignored: large terms of dynamics cancel.
fn set_driven_state_unit<T: Real>(
    qp: QpView<'_, T>,
    (stages, i): (Stages<usize>, usize),
    units: &mut [T],
    has_distant_origins: bool,
) {
    let variable_places =
        || StageOffsetsIter::<T>::new(qp.dims).filter(|place| stages.contains(&place.stage));
    let unit = variable_places().next().map_or(T::ONE, |place| at(units, (place.row + i) as u32));
    let is_unknown = unit == T::ZERO;
    if !(is_unknown || has_distant_origins) {
        return;
    }
    let mut driven = T::ZERO;
    for (place, stage) in variable_places().zip(qp.stages().skip(stages.start)) {
        let Bounds { lower, upper, .. } = stage.x_bounds();
        let is_bounded = lower
            .iter()
            .zip(upper)
            .nth(i)
            .is_some_and(|(&lower, &upper)| lower != upper && (lower.is_finite() || upper.is_finite()));
        if is_bounded && !is_unknown {
            return;
        }
        if i >= place.next {
            continue;
        }
        let column = part(stage.arrays().matrix, i * place.ld + place.nx, place.nu);
        for (&b, &unit) in column.iter().zip(part(units, place.row + place.nx, place.nu)) {
            driven = driven.max((b * unit).abs());
        }
    }
    let change = driven.max(T::ONE);
    let rounding = T::EPSILON * NEAR_ONE_RATIO * (unit * unit).to_f64();
    let is_distant = driven > T::ZERO && rounding > (change * change).to_f64();
    if !(is_unknown || is_distant) {
        return;
    }
    let mut range = MagnitudeRange::EMPTY;
    range.add(change);
    let unit = range.unit_unless_near_one();
    variable_places().filter(|place| i < place.nx).for_each(|place| set(units, place.row + i, unit));
}

/// Computes the unit of a constraint over stages, from its gradients and its distance from its
/// bounds.
fn set_row_unit<T: Real>(qp: QpView<'_, T>, v: &[T], (stages, i): (Stages<usize>, usize), units: &mut [T]) {
    let mut range = MagnitudeRange::EMPTY;
    let (mut largest_gradient, mut bound_distance) = (T::ZERO, T::ZERO);
    for (place, stage) in
        StageOffsetsIter::<T>::new(qp.dims).zip(qp.stages()).filter(|(p, _)| stages.contains(&p.stage))
    {
        let view = stage.arrays();
        let column = part(view.matrix, (place.next + i) * place.ld, place.ld);
        let v = part(v, place.v, place.ld);
        let mut value = T::ZERO;
        for ((&g, &v), &unit) in column.iter().zip(v).zip(part(units, place.row, place.n)) {
            value = value + g * v;
            largest_gradient = largest_gradient.max((g * unit).abs());
        }
        let Bounds { lower, upper, .. } = stage.g_bounds();
        let mut nearest_distance = T::from_f64(f64::INFINITY);
        for &bound in lower.get(i).into_iter().chain(upper.get(i)) {
            nearest_distance = nearest_distance.min((value - bound).abs());
        }
        if nearest_distance.is_finite() {
            bound_distance = bound_distance.max(nearest_distance);
        }
    }
    range.add(largest_gradient);
    range.add(bound_distance);
    let unit = range.unit_unless_near_one();
    for place in StageOffsetsIter::<T>::new(qp.dims).filter(|place| stages.contains(&place.stage)) {
        set(units, place.row + place.ld + i, unit);
    }
}

/// Computes the objective unit: the largest derivative of the objective with respect to a variable
/// in its unit, or the change of this derivative if the variable changes by its unit or its
/// magnitude. At many guesses gradients vanish.
fn compute_objective_unit<T: Real>(qp: QpView<'_, T>, v: &[T], rows: &[T], scratch: &mut [T]) -> f64 {
    let [slope, change] = largest_gradient_and_change(qp, v, rows, scratch);
    let mut range = MagnitudeRange::EMPTY;
    range.add(slope.max(change));
    range.unit::<T>().to_f64()
}

/// Returns the largest gradient and its largest change, with units of rows.
fn largest_gradient_and_change<T: Real>(qp: QpView<'_, T>, v: &[T], rows: &[T], scratch: &mut [T]) -> [T; 2] {
    let ([mut largest_gradient, mut largest_change], fixed) = ([T::ZERO; 2], is_initial_state_fixed(qp));
    for (place, stage) in StageOffsetsIter::<T>::new(qp.dims).zip(qp.stages()) {
        let view = stage.arrays();
        let (v, gradient) = (part(v, place.v, place.ld), part_mut(scratch, 0, place.ld));
        copy_common(gradient, part(view.gradient, 0, place.ld));
        add_symmetric_product(gradient, view.hessian, place.ld, v, place.n);
        let curvatures = view.hessian.iter().step_by(place.ld + 1);
        let fixed_states = if fixed && place.stage == 0 { place.nx } else { 0 };
        let units = part(rows, place.row, place.n);
        for (((&slope, &curvature), &v), &unit) in
            gradient.iter().zip(curvatures).zip(v).zip(units).skip(fixed_states)
        {
            let change = curvature * v.abs().max(unit);
            largest_gradient = largest_gradient.max(slope.abs() * unit);
            largest_change = largest_change.max(change.abs() * unit);
        }
    }
    [largest_gradient, largest_change]
}
