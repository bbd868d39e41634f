//! The stages of the blocks, and the origins of their constraints.

use crate::qp::error::{QpError, QpField};
use crate::qp::layout::{StageDims, StageOffsets, StageOffsetsIter, part};
use crate::qp::problem::QpView;
use crate::qp::stage::ConstraintVector;
use crate::scalar::Real;

/// The origin of a row of `Z`, or of a constraint of the condensed problem.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CondensedRow {
    pub kind: Kind,
    /// The original stage.
    pub stage: usize,
    /// The index of a state or control of this stage, or its row in vectors over constraints.
    pub index: usize,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kind {
    /// A state at the end of the block.
    #[default]
    State,
    /// A control.
    Control,
    /// A general constraint, or a bound of an eliminated state.
    Constraint,
}

/// Returns the bounds and penalties of a row.
pub fn row_bounds_and_penalties<T: Real>(data: &[T], place: &StageOffsets, row: usize) -> [T; 6] {
    let all = [
        ConstraintVector::Lower,
        ConstraintVector::Upper,
        ConstraintVector::LowerLinear,
        ConstraintVector::LowerQuadratic,
        ConstraintVector::UpperLinear,
        ConstraintVector::UpperQuadratic,
    ];
    all.map(|vector| {
        part(data, place.constraint_vector_begin(vector) + row, 1).first().copied().unwrap_or(T::ZERO)
    })
}

/// Returns whether a row has a bound.
pub fn is_bounded<T: Real>([lower, upper, ..]: [T; 6]) -> bool {
    lower.is_finite() || upper.is_finite()
}

/// Returns the stages of the blocks; the last stage is a block by itself.
pub fn blocks(stages: usize, block: usize) -> impl Iterator<Item = core::ops::Range<usize>> {
    let last = stages.saturating_sub(1);
    (0..last).step_by(block).map(move |k| k..(k + block).min(last)).chain(core::iter::once(last..stages))
}

/// Converts an error of the condensed problem to the original one.
pub fn expand_error<T: Real>(
    error: QpError,
    qp: QpView<'_, T>,
    size: usize,
    dims: &[StageDims],
    rows: &[CondensedRow],
) -> QpError {
    let find = |stage: usize, field: QpField, index: usize| {
        let range = blocks(qp.dims.len(), size).nth(stage)?;
        match field {
            QpField::GeneralBounds => {
                let before = dims.get(..stage)?.iter().map(|d| d.ng).sum::<usize>();
                let origin = rows.get(before + index)?;
                let place = StageOffsetsIter::<T>::new(qp.dims).nth(origin.stage)?;
                let (field, index) = place.field_of_row(origin.index);
                Some((origin.stage, field, index))
            }
            QpField::ControlBounds => {
                let mut left = index;
                for stage in range.rev() {
                    let nu = qp.dims.get(stage)?.nu;
                    if left < nu {
                        return Some((stage, field, left));
                    }
                    left -= nu;
                }
                None
            }
            _ => Some((range.start, field, index)),
        }
    };
    match error {
        QpError::Infeasible { field, stage, index, side, violation } => {
            let (stage, field, index) = find(stage, field, index).unwrap_or((stage, field, index));
            QpError::Infeasible { field, stage, index, side, violation }
        }
        QpError::NotConvex { stage, index, pivot } => {
            let found = find(stage, QpField::ControlBounds, index);
            let (stage, _, index) = found.unwrap_or((stage, QpField::ControlBounds, index));
            QpError::NotConvex { stage, index, pivot }
        }
        QpError::InvalidValue { .. } | QpError::CrossedBounds { .. } => match crate::qp::check::check(qp) {
            Err(found) => found,
            Ok(()) => error,
        },
        others => others,
    }
}
