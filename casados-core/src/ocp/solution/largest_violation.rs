//! The largest violation of a hard bound, reported by runs without a solution.

use crate::ocp::formulation::error::ConstraintName;
use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::instance::data::{path_row_count, split_data};
use crate::ocp::formulation::instance::{InitialState, Ocp};
use crate::ocp::formulation::problem::Formulation;
use crate::qp::element::get;
use crate::qp::{QpField, Side, StageDims, part, zeros};
use crate::scalar::Real;
use crate::shape::Shape;

/// The smallest reported violation, relative to bounds above one.
const MIN_REPORTED_VIOLATION: f64 = 1e-6;

/// The largest violation so far.
struct LargestViolation {
    amount: f64,
    place: Option<(QpField, usize, usize, Side)>,
}

impl LargestViolation {
    /// Compares a value with its bounds; those with finite penalties are soft and ignored.
    fn update<T: Real>(&mut self, place: (QpField, usize, usize), value: T, sides: [(Side, T, T); 2]) {
        for (side, bound, penalty) in sides {
            let (value, bound) = (value.to_f64(), bound.to_f64());
            let amount = if side == Side::Lower { bound - value } else { value - bound };
            let is_hard = !penalty.is_finite();
            if is_hard && amount > self.amount && amount > MIN_REPORTED_VIOLATION * bound.abs().max(1.0) {
                let (field, stage, index) = place;
                *self = Self { amount, place: Some((field, stage, index, side)) };
            }
        }
    }
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Returns the largest violation of a hard bound at the iterate; `None` if a function is not
    /// finite.
    pub(super) fn largest_violation(&mut self) -> Option<(ConstraintName, f64)> {
        let (intervals, layout) = (self.intervals(), self.layout());
        let path = path_row_count::<P, T>(layout);
        let rows = intervals * path + P::Terminal::ROWS;
        let mut values = zeros::<T>(rows).ok()?;
        if rows > 0 {
            if P::Shape::NZ > 0 && P::Dynamics::ALGEBRAIC || self.inner_points.count() > 0 {
                self.update_algebraic().ok()?;
            }
            self.evaluate_constraints(&mut values).ok()?;
        }
        let has_fixed_initial_state =
            matches!(self.initial_state, InitialState::Fixed | InitialState::PartlyFixed);
        let data = split_data::<P, T>(self.data.as_mut(), layout);
        let mut worst = LargestViolation { amount: 0.0, place: None };
        for (k, (stage, stage_point)) in self.qp.view().stages().zip(self.iterate.stages()).enumerate() {
            let count = if k < intervals { path } else { P::Terminal::ROWS };
            let of_stage = |list| part(list, k * path, count);
            let [g, lower, upper] = [&values, &*data.lower, &*data.upper].map(of_stage);
            let (x, u, limits) = (stage.x_bounds(), stage.u_bounds(), stage.g_bounds());
            let states = (QpField::StateBounds, stage_point.x, x.lower, x.upper, x);
            let controls = (QpField::ControlBounds, stage_point.u, u.lower, u.upper, u);
            let general = (QpField::GeneralBounds, g, lower, upper, limits);
            for (field, values, lower, upper, penalties) in [states, controls, general] {
                if has_fixed_initial_state && k == 0 && field == QpField::StateBounds {
                    continue;
                }
                for (i, &value) in values.iter().enumerate() {
                    let below = (Side::Lower, get(lower, i), get(penalties.lower_linear, i));
                    let above = (Side::Upper, get(upper, i), get(penalties.upper_linear, i));
                    worst.update((field, k, i), value, [below, above]);
                }
            }
        }
        let (field, stage, index, side) = worst.place?;
        Some((self.name(field, stage, index, side), worst.amount))
    }
}
