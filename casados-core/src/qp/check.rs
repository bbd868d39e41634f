//! Checks of the data of a QP.

use super::bounds::Bounds;
use super::error::{QpError, QpField};
use super::problem::QpView;
use crate::scalar::Real;

/// Checks all numbers of a QP.
///
/// # Errors
/// [`QpError::InvalidValue`], [`QpError::CrossedBounds`]
///
/// ```
/// # use casados::qp::*;
/// # // x₊ = x + u from x₀ = 1, with |u| ≤ 0.4, three intervals of ½ (x² + 0.1 u²).
/// # let mut dims = [StageDims::new(1, 1, 0); 4];
/// # dims[3].nu = 0;
/// # let mut qp = HeapQp::<f64>::new(&dims)?;
/// # for mut stage in qp.stages_mut() {
/// #     stage.a_mut().set(0, 0, 1.0);
/// #     stage.b_mut().set(0, 0, 1.0);
/// #     stage.q_mut().set(0, 0, 1.0);
/// #     stage.r_mut().set(0, 0, 0.1);
/// #     stage.u_bounds_mut().set(0, -0.4, 0.4);
/// # }
/// # qp.fix_initial_state(&[1.0])?;
/// assert!(check(qp.view()).is_ok());
/// if let Some(mut last) = qp.stage_mut(3) {
///     last.q_mut().set(0, 0, f64::NAN);
/// }
/// let error = check(qp.view()).unwrap_err();
/// assert!(matches!(error, QpError::InvalidValue { field: QpField::Q, stage: 3, .. }));
/// # Ok::<(), casados::qp::QpError>(())
/// ```
pub fn check<T: Real>(qp: QpView<'_, T>) -> Result<(), QpError> {
    for (k, stage) in qp.stages().enumerate() {
        let blocks = [
            (QpField::A, stage.a(), false),
            (QpField::B, stage.b(), false),
            (QpField::C, stage.c(), false),
            (QpField::D, stage.d(), false),
            (QpField::Q, stage.q(), true),
            (QpField::R, stage.r(), true),
            (QpField::S, stage.s(), false),
        ];
        for (field, block, symmetric) in blocks {
            let (rows, columns) = block.shape();
            for column in 0..columns {
                for row in if symmetric { column } else { 0 }..rows {
                    finite(field, k, column * rows + row, block.get(row, column).unwrap_or(T::ZERO))?;
                }
            }
        }
        let vectors = [
            (QpField::Offset, stage.offset()),
            (QpField::GradientX, stage.gradient_x()),
            (QpField::GradientU, stage.gradient_u()),
        ];
        for (field, vector) in vectors {
            for (i, &value) in vector.iter().enumerate() {
                finite(field, k, i, value)?;
            }
        }
    }
    check_all_bounds(qp)
}

/// Checks all bounds and penalties of a QP.
pub(super) fn check_all_bounds<T: Real>(qp: QpView<'_, T>) -> Result<(), QpError> {
    for (k, stage) in qp.stages().enumerate() {
        // The invalid bound is located only if there is one.
        if !are_valid_bounds(&stage.all_bounds()) {
            report_invalid_bound(QpField::StateBounds, k, &stage.x_bounds())?;
            report_invalid_bound(QpField::ControlBounds, k, &stage.u_bounds())?;
            report_invalid_bound(QpField::GeneralBounds, k, &stage.g_bounds())?;
        }
    }
    Ok(())
}

fn finite<T: Real>(field: QpField, stage: usize, index: usize, value: T) -> Result<(), QpError> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(QpError::InvalidValue { field, stage, index, value: value.to_f64() })
    }
}

/// Returns whether the interval between two bounds is not empty.
#[inline(always)]
fn is_nonempty_interval<T: Real>(lower: T, upper: T) -> bool {
    let infinity = T::from_f64(f64::INFINITY);
    (lower <= upper) & (lower < infinity) & (upper > -infinity)
}

/// Returns whether a linear penalty is valid. It may be infinite: then the bound is hard.
#[inline(always)]
fn is_linear_penalty<T: Real>(penalty: T) -> bool {
    penalty >= T::ZERO
}

#[inline(always)]
fn is_quadratic_penalty<T: Real>(penalty: T) -> bool {
    (penalty >= T::ZERO) & (penalty < T::from_f64(f64::INFINITY))
}

/// Returns whether all bounds and penalties are valid, without a branch for each.
fn are_valid_bounds<T: Real>(bounds: &Bounds<'_, T>) -> bool {
    let mut good = true;
    for (&lower, &upper) in bounds.lower.iter().zip(bounds.upper) {
        good &= is_nonempty_interval(lower, upper);
    }
    for (&lower, &upper) in bounds.lower_linear.iter().zip(bounds.upper_linear) {
        good &= is_linear_penalty(lower) & is_linear_penalty(upper);
    }
    for (&lower, &upper) in bounds.lower_quadratic.iter().zip(bounds.upper_quadratic) {
        good &= is_quadratic_penalty(lower) & is_quadratic_penalty(upper);
    }
    good
}

/// Returns the error of the first invalid bound or penalty.
fn report_invalid_bound<T: Real>(
    field: QpField,
    stage: usize,
    bounds: &Bounds<'_, T>,
) -> Result<(), QpError> {
    for (index, (&lower, &upper)) in bounds.lower.iter().zip(bounds.upper).enumerate() {
        if is_nonempty_interval(lower, upper) {
            continue;
        }
        let (l, u) = (lower.to_f64(), upper.to_f64());
        return Err(if l.is_nan() || l == f64::INFINITY {
            QpError::InvalidValue { field, stage, index, value: l }
        } else if u.is_nan() || u == f64::NEG_INFINITY {
            QpError::InvalidValue { field, stage, index, value: u }
        } else {
            QpError::CrossedBounds { field, stage, index, lower: l, upper: u }
        });
    }
    let linear =
        [bounds.lower_linear, bounds.upper_linear].map(|all| (all, is_linear_penalty as fn(T) -> bool));
    let quadratic = [bounds.lower_quadratic, bounds.upper_quadratic]
        .map(|all| (all, is_quadratic_penalty as fn(T) -> bool));
    for (penalties, is_penalty) in linear.into_iter().chain(quadratic) {
        if let Some((index, penalty)) =
            penalties.iter().enumerate().find(|(_, penalty)| !is_penalty(**penalty))
        {
            return Err(QpError::InvalidValue {
                field: QpField::Penalty,
                stage,
                index,
                value: penalty.to_f64(),
            });
        }
    }
    Ok(())
}
