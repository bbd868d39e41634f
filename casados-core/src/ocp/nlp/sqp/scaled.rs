//! The QP in units: its variables, constraints and forces are near one for the solver, for what
//! is added to its Hessian, and for penalties in place of its bounds.
//!
//! ```text
//! v = D v̂        c = R ĉ        f = φ f̂        D, R, φ: units
//! ```
//!
//! These units are powers of two: whatever is scaled and scaled back is what it was, bit by bit.

use super::Sqp;
use super::state::State;
use crate::ocp::assembly::units::{Sizes, Units, WIDE, of_tolerance, unit_of_products};
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::nlp::elastic::{self, Worst};
use crate::qp::interior::at;
use crate::qp::{
    Arrays, Places, Qp, QpField, QpSolver, Residuals, SolutionView, StageDims, padded_len, part, part_mut,
};
use crate::scalar::Real;

/// Units of single precision are no larger: squares of them are numbers.
const FARTHEST: f64 = 8192.0;
/// The bits of a number below its leading digit: without them it is a power of two.
const DIGITS: u64 = (1 << 52) - 1;

/// How many numbers are units of rows.
pub(super) const fn memory<T>(dims: &[StageDims]) -> usize {
    let (mut length, mut rest) = (0_usize, dims);
    while let Some((first, others)) = rest.split_first() {
        length = length.saturating_add(padded::<T>(first.nx.saturating_add(first.nu)));
        length = length.saturating_add(padded::<T>(first.ng));
        rest = others;
    }
    length
}

/// The length of a padded vector.
const fn padded<T>(n: usize) -> usize {
    if n > usize::MAX / 2 { usize::MAX } else { padded_len::<T>(n) }
}

/// The power of two that is not above a positive number.
fn power<T: Real>(unit: f64) -> f64 {
    let unit = if T::EPSILON < 1e-10 { unit } else { unit.clamp(1.0 / FARTHEST, FARTHEST) };
    f64::from_bits(unit.to_bits() & !DIGITS)
}

/// Where numbers go.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Way {
    /// Into units.
    Into,
    /// Into those of the problem.
    Back,
}

/// What numbers are divided by.
#[derive(Clone, Copy)]
pub(super) struct Scale<'a, T> {
    units: Units<'a, T>,
    way: Way,
    /// Whether it is what tolerances are multiplied by, and not the units themselves.
    judges: bool,
}

impl<T: Real> Scale<'_, T> {
    fn of(&self, unit: f64) -> T {
        let unit = if self.judges { power::<T>(of_tolerance(unit)) } else { unit };
        T::from_f64(if self.way == Way::Into { unit } else { 1.0 / unit })
    }

    fn force(&self) -> T {
        self.of(self.units.sizes.force)
    }

    /// Those of some rows.
    fn rows(&self, begin: usize, count: usize) -> impl Iterator<Item = T> + Clone {
        part(self.units.rows, begin, count).iter().map(|unit| self.of(unit.to_f64()))
    }

    /// The data of a QP.
    fn qp<D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(&self, qp: &mut Qp<T, D, M>) {
        let force = self.force();
        let mut row = 0;
        for mut stage in qp.stages_mut() {
            let Arrays { ld, next, rows, matrix, hessian, gradient, offset, limits, .. } = stage.arrays();
            let here = self.rows(row, rows);
            row += rows;
            let behind = self.rows(row, next).chain(here.clone().skip(ld));
            for (column, to) in matrix.chunks_exact_mut(ld.max(1)).zip(behind) {
                column.iter_mut().zip(here.clone()).for_each(|(a, unit)| *a = *a * unit / to);
            }
            for (column, other) in hessian.chunks_exact_mut(ld.max(1)).zip(here.clone()) {
                column.iter_mut().zip(here.clone()).for_each(|(h, unit)| *h = *h * unit * other / force);
            }
            gradient.iter_mut().zip(here.clone()).for_each(|(g, unit)| *g = *g * unit / force);
            offset.iter_mut().zip(self.rows(row, next)).for_each(|(b, unit)| *b = *b / unit);
            // Both bounds; for both of them the linear penalties, and the quadratic ones.
            for (values, kind) in limits.chunks_exact_mut(rows.max(1)).zip([0, 0, 1, 2, 1, 2]) {
                for (value, unit) in values.iter_mut().zip(here.clone()) {
                    *value = match kind {
                        0 => *value / unit,
                        1 => *value * unit / force,
                        _ => *value * unit * unit / force,
                    };
                }
            }
        }
    }

    /// A point with its multipliers.
    fn point(&self, SolutionView { dims, v, dynamics, lower, upper }: SolutionView<'_, T>) {
        for place in Places::<T>::new(dims) {
            let units = self.rows(place.row, place.n);
            part_mut(v, place.v, place.n).iter_mut().zip(units).for_each(|(v, unit)| *v = *v / unit);
        }
        self.multipliers(SolutionView { dims, v, dynamics, lower, upper });
    }

    /// The multipliers alone.
    fn multipliers(&self, SolutionView { dims, dynamics, lower, upper, .. }: SolutionView<'_, T>) {
        let force = self.force();
        for place in Places::<T>::new(dims) {
            let behind = self.rows(place.row + place.rows, place.next);
            let dynamics = part_mut(dynamics, place.dynamics, place.next);
            dynamics.iter_mut().zip(behind).for_each(|(pi, unit)| *pi = *pi * unit / force);
            for side in [&mut *lower, &mut *upper] {
                let units = self.rows(place.row, place.rows);
                let side = part_mut(side, place.row, place.rows);
                side.iter_mut().zip(units).for_each(|(m, unit)| *m = *m * unit / force);
            }
        }
    }
}

impl<S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Sqp<S, C, T, D, M> {
    /// Finds the units at the iterate, where the QP is written.
    pub(super) fn find_units<P: Program<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>, state: &mut State<'_, T>) {
        let rows = self.work.as_mut().get_mut(penalties_end(ocp)..).unwrap_or_default();
        let Sizes { force, .. } = ocp.find_units(rows, self.trial.view_mut().v);
        let force = if (1.0 / WIDE..=WIDE).contains(&force) { 1.0 } else { power::<T>(force) };
        let mut least: f64 = 1.0;
        for unit in &mut *rows {
            let rounded = power::<T>(unit.to_f64());
            *unit = T::from_f64(rounded);
            least = least.min(rounded);
        }
        let are_all_one = force == 1.0 && rows.iter().all(|&unit| unit == T::ONE);
        state.sizes = (!are_all_one).then_some(Sizes { force, least });
        if !are_all_one {
            // Residuals are judged in a hundredth of units, as a power of two.
            self.qp_solver.require(self.options.tolerance / (2.0 * WIDE));
        }
    }

    /// Goes on with a smaller unit of forces, where that of the guess says little of the iterate,
    /// and with products of slacks and multipliers in units of the objective.
    pub(super) fn tightens<P: Program<T>>(
        &mut self,
        ocp: &Ocp<P, T, D, M>,
        state: &mut State<'_, T>,
    ) -> bool {
        let Some(sizes) = state.sizes.as_mut().filter(|_| !(state.has_tightened || state.elastic)) else {
            return false;
        };
        let rows = self.work.as_ref().get(penalties_end(ocp)..).unwrap_or_default();
        let scratch = self.trial.view_mut().v;
        // QPs are solved to a hundredth.
        let least = self.options.tolerance / WIDE;
        let smaller = ocp.smaller_force(rows, sizes.force, (least, false), scratch);
        let products = unit_of_products(ocp.objective.to_f64(), sizes.force);
        if smaller.is_none() && of_tolerance(products) >= of_tolerance(sizes.force) {
            return false;
        }
        sizes.force = smaller.map_or(sizes.force, power::<T>);
        state.has_tightened = true;
        true
    }

    /// The QP, the iterate and the solution, into units or back.
    pub(super) fn scale<P: Program<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>, state: &State<'_, T>, way: Way) {
        let Some(units) = units(self.work.as_ref(), ocp, state) else { return };
        let scale = Scale { units, way, judges: false };
        scale.qp(&mut ocp.qp);
        scale.point(ocp.iterate.view_mut());
        scale.point(self.solution.view_mut());
    }

    /// The multipliers of the solution and the weights of violations, into units or back.
    pub(super) fn scale_weights<P: Program<T>>(
        &mut self,
        ocp: &Ocp<P, T, D, M>,
        state: &State<'_, T>,
        way: Way,
    ) {
        let Some(units) = units(self.work.as_ref(), ocp, state) else { return };
        let scale = Scale { units, way, judges: false };
        scale.multipliers(self.solution.view_mut());
        scale.multipliers(self.weights.view_mut());
    }

    /// The largest residual in what tolerances are multiplied by.
    pub(super) fn judge<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &State<'_, T>,
        residuals: &Residuals,
    ) -> f64 {
        let Some(units) = units(self.work.as_ref(), ocp, state) else { return residuals.largest() };
        let mut scale = Scale { units, way: Way::Into, judges: true };
        scale.qp(&mut ocp.qp);
        scale.point(ocp.iterate.view_mut());
        let (mut judged, _) = ocp.residuals();
        let rounding = ocp.rounding_of_gaps();
        for residual in [&mut judged.dynamics, &mut judged.inequalities] {
            *residual = if *residual <= rounding { 0.0 } else { *residual };
        }
        if state.has_tightened {
            let force = units.sizes.force;
            let products = unit_of_products(ocp.objective.to_f64(), force);
            judged.complementarity *= of_tolerance(force) / of_tolerance(products);
        }
        scale.way = Way::Back;
        scale.qp(&mut ocp.qp);
        scale.point(ocp.iterate.view_mut());
        judged.largest()
    }

    /// A violation in units, in those of the problem.
    pub(super) fn in_problem<P: Program<T>>(&self, ocp: &Ocp<P, T, D, M>, worst: Worst) -> Worst {
        let rows = self.work.as_ref().get(penalties_end(ocp)..).unwrap_or_default();
        let places = Places::<T>::new(ocp.qp.dims()).find(|place| place.stage == worst.stage);
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

/// The units in the memory of a run, where they are not all one.
fn units<'s, P, T, D, M>(work: &'s [T], ocp: &Ocp<P, T, D, M>, state: &State<'_, T>) -> Option<Units<'s, T>>
where
    P: Program<T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
{
    let rows = work.get(penalties_end(ocp)..).unwrap_or_default();
    state.sizes.map(|sizes| Units { sizes, rows })
}

/// The linear penalties that are remembered, in the memory of a run.
pub(super) fn penalties_mut<'s, P, T, D, M>(work: &'s mut [T], ocp: &Ocp<P, T, D, M>) -> &'s mut [T]
where
    P: Program<T>,
    T: Real,
    D: AsRef<[StageDims]>,
    M: AsRef<[T]> + AsMut<[T]>,
{
    work.get_mut(ocp.ends()..penalties_end(ocp)).unwrap_or_default()
}

/// Where penalties end in the memory of a run, and units begin.
pub(super) fn penalties_end<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    ocp: &Ocp<P, T, D, M>,
) -> usize {
    ocp.ends() + elastic::memory(ocp.qp.dims())
}
