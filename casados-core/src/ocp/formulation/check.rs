//! Checks of the input of a problem. Errors use the names of the model.

use crate::ocp::formulation::error::{OcpError, Part};
use crate::scalar::Real;
use core::ops::{Bound, Range, RangeBounds};

/// Labels of the elements of a part of a problem at a stage, for errors.
#[derive(Clone, Copy)]
pub(in crate::ocp) struct Labels {
    pub part: Part,
    pub stage: usize,
    /// Returns the name of a variable with its index, or of a function with its output.
    pub name: fn(usize) -> (&'static str, usize),
}

impl Labels {
    fn invalid_value(self, index: usize, value: f64) -> OcpError {
        let Self { part, stage, name } = self;
        let (name, index) = name(index);
        OcpError::InvalidValue { part, stage, name, index, value }
    }

    /// Checks that the interval between two bounds is not empty.
    ///
    /// # Errors
    /// [`OcpError::CrossedBounds`], [`OcpError::InvalidValue`]
    pub fn check_bounds<T: Real>(self, index: usize, lower: T, upper: T) -> Result<(), OcpError> {
        let infinity = T::from_f64(f64::INFINITY);
        if lower <= upper && lower < infinity && upper > -infinity {
            return Ok(());
        }
        let (lower, upper) = (lower.to_f64(), upper.to_f64());
        if lower.is_nan() || lower == f64::INFINITY {
            return Err(self.invalid_value(index, lower));
        }
        if upper.is_nan() || upper == f64::NEG_INFINITY {
            return Err(self.invalid_value(index, upper));
        }
        let Self { part, stage, name } = self;
        let (name, index) = name(index);
        Err(OcpError::CrossedBounds { part, stage, name, index, lower, upper })
    }

    /// Checks a penalty. An infinite linear penalty is allowed: the bound is hard.
    ///
    /// # Errors
    /// [`OcpError::InvalidValue`]
    pub fn check_penalty<T: Real>(self, index: usize, linear: T, quadratic: T) -> Result<(), OcpError> {
        let labels = Self { part: Part::Penalty, ..self };
        let is_linear = linear >= T::ZERO;
        if !is_linear {
            return Err(labels.invalid_value(index, linear.to_f64()));
        }
        if !(quadratic >= T::ZERO && quadratic.is_finite()) {
            return Err(labels.invalid_value(index, quadratic.to_f64()));
        }
        Ok(())
    }

    /// # Errors
    /// [`OcpError::InvalidValue`]
    pub fn check_finite<T: Real>(self, values: &[T]) -> Result<(), OcpError> {
        match crate::finite::find_non_finite(values) {
            None => Ok(()),
            Some((index, value)) => Err(self.invalid_value(index, value)),
        }
    }

    /// # Errors
    /// [`OcpError::Length`]
    pub fn check_length<T: Real>(self, values: &[T], expected: usize) -> Result<(), OcpError> {
        let Self { part, stage, .. } = self;
        let found = values.len();
        if found == expected { Ok(()) } else { Err(OcpError::Length { part, stage, expected, found }) }
    }

    /// # Errors
    /// [`OcpError::Length`], [`OcpError::InvalidValue`]
    pub fn check_vector<T: Real>(self, values: &[T], expected: usize) -> Result<(), OcpError> {
        self.check_length(values, expected)?;
        self.check_finite(values)
    }
}

/// Returns the first stage of a range.
pub(in crate::ocp) fn first_stage(stages: &impl RangeBounds<usize>) -> usize {
    match stages.start_bound() {
        Bound::Included(&start) => start,
        Bound::Excluded(&start) => start.saturating_add(1),
        Bound::Unbounded => 0,
    }
}

/// Returns a nonempty range of stages, of which there are `count`.
///
/// # Errors
/// [`OcpError::NoSuchStage`], [`OcpError::EmptyRange`]
pub(in crate::ocp) fn stage_range(
    part: Part,
    stages: &impl RangeBounds<usize>,
    count: usize,
) -> Result<Range<usize>, OcpError> {
    let start = first_stage(stages);
    let end = match stages.end_bound() {
        Bound::Included(&end) => end.saturating_add(1),
        Bound::Excluded(&end) => end,
        Bound::Unbounded if start < count => count,
        Bound::Unbounded => return Err(OcpError::NoSuchStage { part, stage: start, stages: count }),
    };
    if start >= end {
        return Err(OcpError::EmptyRange { part, start, end, stages: count });
    }
    if end > count {
        return Err(OcpError::NoSuchStage { part, stage: end - 1, stages: count });
    }
    Ok(start..end)
}
