//! Violations of bounds at a point.

use super::error::{QpError, QpField, Side};
use super::layout::{StageOffsets, StageOffsetsIter, part};
use super::problem::QpView;
use super::stage::ConstraintVector;
use crate::scalar::Real;

/// A violated bound and its violation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Violation {
    pub field: QpField,
    pub stage: usize,
    pub index: usize,
    pub side: Side,
    pub violation: f64,
}

impl From<Violation> for QpError {
    fn from(Violation { field, stage, index, side, violation }: Violation) -> Self {
        Self::Infeasible { field, stage, index, side, violation }
    }
}

/// Returns the hard bound with the largest violation at a point `v`, measured in units if there are
/// any, and the sum of all violations without units. A bound is hard if its linear penalty is
/// infinite; `penalties` returns the linear penalties of the lower and the upper bound of a row.
pub(crate) fn largest_violation<T: Real>(
    qp: QpView<'_, T>,
    v: &[T],
    units: &[T],
    mut penalties: impl FnMut(&StageOffsets, usize) -> [T; 2],
) -> (Option<Violation>, f64) {
    let (mut worst, mut most, mut sum): (Option<Violation>, f64, f64) = (None, 0.0, 0.0);
    for place in StageOffsetsIter::<T>::new(qp.dims) {
        let data = part(qp.data, place.data, place.data_len());
        let v = part(v, place.v, place.ld);
        for row in (0..place.n).chain(place.ld..place.ld + place.ng) {
            let value = if row < place.n {
                v.get(row).map_or(0.0, |v| v.to_f64())
            } else {
                let column = part(data, (place.next + row - place.ld) * place.ld, place.n);
                column.iter().zip(v).map(|(c, v)| c.to_f64() * v.to_f64()).sum()
            };
            let bound = |of| data.get(place.constraint_vector_begin(of) + row).map_or(0.0, |b| b.to_f64());
            let excess = [bound(ConstraintVector::Lower) - value, value - bound(ConstraintVector::Upper)];
            let sides = [Side::Lower, Side::Upper].into_iter().zip(excess);
            for ((side, violation), penalty) in sides.zip(penalties(&place, row)) {
                if penalty.is_finite() || violation <= 0.0 {
                    continue;
                }
                sum += violation;
                let unit = units.get(place.row + row).filter(|&&unit| unit > T::ZERO);
                let unit = unit.map_or(1.0, |unit| unit.to_f64());
                if violation > most * unit {
                    most = violation / unit;
                    let (field, index) = place.field_of_row(row);
                    worst = Some(Violation { field, stage: place.stage, index, side, violation });
                }
            }
        }
    }
    (worst, sum)
}

/// Returns the linear penalties of a row.
pub(crate) fn linear_penalties<T: Real>(qp: QpView<'_, T>, place: &StageOffsets, row: usize) -> [T; 2] {
    let data = part(qp.data, place.data, place.data_len());
    [ConstraintVector::LowerLinear, ConstraintVector::UpperLinear]
        .map(|of| data.get(place.constraint_vector_begin(of) + row).copied().unwrap_or(T::ZERO))
}
