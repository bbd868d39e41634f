//! Scaling of the QP by units: variables, constraints and objective are near one for the QP solver,
//! the regularisation and the penalties.
//!
//! ```text
//! v = D v̂        c = R ĉ        f = φ f̂        D, R, φ: units
//! ```
//!
//! Units are powers of two: scaling and unscaling are exact.

use super::Sqp;
use super::run_state::RunState;
use crate::ocp::assembly::units::{
    NEAR_ONE_RATIO, ProblemScaling, ScalingUnits, product_unit, tolerance_factor,
};
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::nlp::elastic_mode::{self, Worst};
use crate::qp::interior::at;
use crate::qp::{
    Arrays, Qp, QpField, QpSolver, Residuals, SolutionView, StageDims, StageOffsetsIter, padded_len, part,
    part_mut,
};
use crate::scalar::Real;

/// The largest unit in single precision; its square is finite.
const MAX_SINGLE_PRECISION_UNIT: f64 = 8192.0;
/// The mantissa bits of a number, without which it is a power of two.
const MANTISSA_BITS: u64 = (1 << 52) - 1;

/// The length of the memory for the units of rows.
pub(super) const fn unit_memory_len<T>(dims: &[StageDims]) -> usize {
    let (mut length, mut rest) = (0_usize, dims);
    while let Some((first, others)) = rest.split_first() {
        length = length.saturating_add(saturating_padded_len::<T>(first.nx.saturating_add(first.nu)));
        length = length.saturating_add(saturating_padded_len::<T>(first.ng));
        rest = others;
    }
    length
}

/// The length of a padded vector.
const fn saturating_padded_len<T>(n: usize) -> usize {
    if n > usize::MAX / 2 { usize::MAX } else { padded_len::<T>(n) }
}

/// The largest power of two that is at most a positive number.
fn floor_power_of_two<T: Real>(unit: f64) -> f64 {
    let unit = if T::EPSILON < 1e-10 {
        unit
    } else {
        unit.clamp(1.0 / MAX_SINGLE_PRECISION_UNIT, MAX_SINGLE_PRECISION_UNIT)
    };
    f64::from_bits(unit.to_bits() & !MANTISSA_BITS)
}

/// The direction of scaling.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum ScalingDirection {
    /// From the units of the problem to scaled units.
    Scale,
    /// Back to the units of the problem.
    Unscale,
}

/// Scaling factors of a QP.
#[derive(Clone, Copy)]
pub(super) struct QpScaling<'a, T> {
    units: ScalingUnits<'a, T>,
    direction: ScalingDirection,
    /// Whether the factors are those of tolerances, not the units.
    for_tolerances: bool,
}

impl<T: Real> QpScaling<'_, T> {
    fn factor(&self, unit: f64) -> T {
        let unit = if self.for_tolerances { floor_power_of_two::<T>(tolerance_factor(unit)) } else { unit };
        T::from_f64(if self.direction == ScalingDirection::Scale { unit } else { 1.0 / unit })
    }

    fn objective_factor(&self) -> T {
        self.factor(self.units.scaling.objective_unit)
    }

    /// The factors of a range of rows.
    fn row_factors(&self, begin: usize, count: usize) -> impl Iterator<Item = T> + Clone {
        part(self.units.rows, begin, count).iter().map(|unit| self.factor(unit.to_f64()))
    }

    /// Scales the data of a QP.
    fn scale_qp<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(&self, qp: &mut Qp<T, D, M>) {
        let force = self.objective_factor();
        let mut row = 0;
        for mut stage in qp.stages_mut() {
            let Arrays { ld, next, rows, matrix, hessian, gradient, offset, limits, .. } = stage.arrays();
            let row_units = self.row_factors(row, rows);
            row += rows;
            let next_units = self.row_factors(row, next).chain(row_units.clone().skip(ld));
            for (column, to) in matrix.chunks_exact_mut(ld.max(1)).zip(next_units) {
                column.iter_mut().zip(row_units.clone()).for_each(|(a, unit)| *a = *a * unit / to);
            }
            for (column, other) in hessian.chunks_exact_mut(ld.max(1)).zip(row_units.clone()) {
                column.iter_mut().zip(row_units.clone()).for_each(|(h, unit)| *h = *h * unit * other / force);
            }
            gradient.iter_mut().zip(row_units.clone()).for_each(|(g, unit)| *g = *g * unit / force);
            offset.iter_mut().zip(self.row_factors(row, next)).for_each(|(b, unit)| *b = *b / unit);
            // Lower and upper bounds, and for both the linear and the quadratic penalties.
            for (values, kind) in limits.chunks_exact_mut(rows.max(1)).zip([0, 0, 1, 2, 1, 2]) {
                for (value, unit) in values.iter_mut().zip(row_units.clone()) {
                    *value = match kind {
                        0 => *value / unit,
                        1 => *value * unit / force,
                        _ => *value * unit * unit / force,
                    };
                }
            }
        }
    }

    /// Scales a point with its multipliers.
    fn scale_point(&self, SolutionView { dims, v, dynamics, lower, upper }: SolutionView<'_, T>) {
        for place in StageOffsetsIter::<T>::new(dims) {
            let units = self.row_factors(place.row, place.n);
            part_mut(v, place.v, place.n).iter_mut().zip(units).for_each(|(v, unit)| *v = *v / unit);
        }
        self.scale_multipliers(SolutionView { dims, v, dynamics, lower, upper });
    }

    /// Scales multipliers only.
    fn scale_multipliers(&self, SolutionView { dims, dynamics, lower, upper, .. }: SolutionView<'_, T>) {
        let force = self.objective_factor();
        for place in StageOffsetsIter::<T>::new(dims) {
            let behind = self.row_factors(place.row + place.rows, place.next);
            let dynamics = part_mut(dynamics, place.dynamics, place.next);
            dynamics.iter_mut().zip(behind).for_each(|(pi, unit)| *pi = *pi * unit / force);
            for side in [&mut *lower, &mut *upper] {
                let units = self.row_factors(place.row, place.rows);
                let side = part_mut(side, place.row, place.rows);
                side.iter_mut().zip(units).for_each(|(m, unit)| *m = *m * unit / force);
            }
        }
    }
}

impl<S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Sqp<S, C, T, D, M> {
    /// Computes the units at the iterate. The QP must be written there.
    pub(super) fn find_units<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
    ) {
        let rows = self.workspace.as_mut().get_mut(saved_penalties_end(ocp)..).unwrap_or_default();
        let ProblemScaling { objective_unit: force, .. } =
            ocp.compute_units(rows, self.trial_point.view_mut().v, true);
        let force = if (1.0 / NEAR_ONE_RATIO..=NEAR_ONE_RATIO).contains(&force) {
            1.0
        } else {
            floor_power_of_two::<T>(force)
        };
        let mut least: f64 = 1.0;
        for unit in &mut *rows {
            let rounded = floor_power_of_two::<T>(unit.to_f64());
            *unit = T::from_f64(rounded);
            least = least.min(rounded);
        }
        let are_all_one = force == 1.0 && rows.iter().all(|&unit| unit == T::ONE);
        state.scaling =
            (!are_all_one).then_some(ProblemScaling { objective_unit: force, min_row_unit: least });
        if !are_all_one {
            // Tolerances of scaled residuals are up to this factor smaller, since units are rounded
            // to powers of two.
            self.qp_solver.require(self.options.tolerance / (2.0 * NEAR_ONE_RATIO));
        }
    }

    /// Replaces the objective unit by a smaller one, computed at the iterate, if that of the guess
    /// is far too large; from then on products of slacks and multipliers have their own unit.
    /// Returns whether a unit has been replaced.
    pub(super) fn rescale_objective<P: Program<T>>(
        &mut self,
        ocp: &Ocp<P, T, D, M>,
        state: &mut RunState<'_, T>,
    ) -> bool {
        let Some(sizes) =
            state.scaling.as_mut().filter(|_| !(state.has_rescaled_objective || state.is_elastic))
        else {
            return false;
        };
        let rows = self.workspace.as_ref().get(saved_penalties_end(ocp)..).unwrap_or_default();
        let scratch = self.trial_point.view_mut().v;
        // QPs are solved to a hundredth of the tolerance.
        let least = self.options.tolerance / NEAR_ONE_RATIO;
        let smaller = ocp.reduced_objective_unit(rows, sizes.objective_unit, (least, false), scratch);
        let products = product_unit(ocp.objective.to_f64(), sizes.objective_unit);
        if smaller.is_none() && tolerance_factor(products) >= tolerance_factor(sizes.objective_unit) {
            return false;
        }
        sizes.objective_unit = smaller.map_or(sizes.objective_unit, floor_power_of_two::<T>);
        state.has_rescaled_objective = true;
        true
    }

    /// Scales or unscales the QP, the iterate and the solution.
    pub(super) fn scale_qp_and_points<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &RunState<'_, T>,
        way: ScalingDirection,
    ) {
        let Some(units) = scaling_units(self.workspace.as_ref(), ocp, state) else { return };
        let scale = QpScaling { units, direction: way, for_tolerances: false };
        scale.scale_qp(&mut ocp.qp);
        scale.scale_point(ocp.iterate.view_mut());
        scale.scale_point(self.qp_solution.view_mut());
    }

    /// Scales or unscales the multipliers of the solution and the weights of violations.
    pub(super) fn scale_weights<P: Program<T>>(
        &mut self,
        ocp: &Ocp<P, T, D, M>,
        state: &RunState<'_, T>,
        way: ScalingDirection,
    ) {
        let Some(units) = scaling_units(self.workspace.as_ref(), ocp, state) else { return };
        let scale = QpScaling { units, direction: way, for_tolerances: false };
        scale.scale_multipliers(self.qp_solution.view_mut());
        scale.scale_multipliers(self.violation_weights.view_mut());
    }

    /// Computes multipliers of active bounds from the stationarity where the QP solver cannot
    /// compute them from distances: the rounding error of these, in units, is above the tolerance
    /// of QPs.
    pub(super) fn update_bound_multipliers<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &RunState<'_, T>,
    ) {
        self.scale_qp_and_points(ocp, state, ScalingDirection::Scale);
        let rounding = ocp.gap_rounding_error();
        if rounding > self.options.tolerance / (2.0 * NEAR_ONE_RATIO) {
            ocp.bound_multipliers_by_stationarity(rounding, self.trial_point.view_mut().v);
        }
        self.scale_qp_and_points(ocp, state, ScalingDirection::Unscale);
    }

    /// Returns the largest residual, relative to the factors of tolerances.
    pub(super) fn nlp_error<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &RunState<'_, T>,
        residuals: &Residuals,
    ) -> f64 {
        let Some(units) = scaling_units(self.workspace.as_ref(), ocp, state) else {
            return residuals.largest();
        };
        let mut scale = QpScaling { units, direction: ScalingDirection::Scale, for_tolerances: true };
        scale.scale_qp(&mut ocp.qp);
        scale.scale_point(ocp.iterate.view_mut());
        let (mut scaled_residuals, _) = ocp.residuals();
        let rounding = ocp.gap_rounding_error();
        for residual in [&mut scaled_residuals.dynamics, &mut scaled_residuals.inequalities] {
            *residual = if *residual <= rounding { 0.0 } else { *residual };
        }
        if state.has_rescaled_objective {
            let force = units.scaling.objective_unit;
            let products = product_unit(ocp.objective.to_f64(), force);
            scaled_residuals.complementarity *= tolerance_factor(force) / tolerance_factor(products);
        }
        scale.direction = ScalingDirection::Unscale;
        scale.scale_qp(&mut ocp.qp);
        scale.scale_point(ocp.iterate.view_mut());
        scaled_residuals.largest()
    }

    /// Converts a violation from scaled units to units of the problem.
    pub(super) fn unscaled_violation<P: Program<T>>(&self, ocp: &Ocp<P, T, D, M>, worst: Worst) -> Worst {
        let rows = self.workspace.as_ref().get(saved_penalties_end(ocp)..).unwrap_or_default();
        let places = StageOffsetsIter::<T>::new(ocp.qp.dims()).find(|place| place.stage == worst.stage);
        let unit = places.map_or(1.0, |place| {
            let begin = match worst.field {
                QpField::StateBounds => 0,
                QpField::ControlBounds => place.nx,
                _ => place.ld,
            };
            at(rows, (place.row + begin + worst.index) as u32).to_f64()
        });
        Worst { violation: worst.violation * unit, ..worst }
    }
}

/// The units in the workspace, unless all are one.
fn scaling_units<'s, P, T, D, M>(
    work: &'s [T],
    ocp: &Ocp<P, T, D, M>,
    state: &RunState<'_, T>,
) -> Option<ScalingUnits<'s, T>>
where
    P: Program<T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
{
    let rows = work.get(saved_penalties_end(ocp)..).unwrap_or_default();
    state.scaling.map(|sizes| ScalingUnits { scaling: sizes, rows })
}

/// The saved linear penalties in the workspace.
pub(super) fn saved_penalties_mut<'s, P, T, D, M>(work: &'s mut [T], ocp: &Ocp<P, T, D, M>) -> &'s mut [T]
where
    P: Program<T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
{
    work.get_mut(ocp.ends()..saved_penalties_end(ocp)).unwrap_or_default()
}

/// The end of the penalties in the workspace, where the units start.
pub(super) fn saved_penalties_end<
    P: Program<T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
>(
    ocp: &Ocp<P, T, D, M>,
) -> usize {
    ocp.ends() + elastic_mode::penalty_memory_len(ocp.qp.dims())
}
