//! Checks of trajectories that are read.

use super::{Kind, Series, Trajectory, TrajectoryError};
use crate::scalar::Real;
use alloc::string::String;
use alloc::vec::Vec;

/// A trajectory before it is checked.
#[derive(serde::Deserialize)]
#[serde(rename = "Trajectory")]
pub struct Unchecked<T> {
    model: String,
    times: Vec<T>,
    #[serde(default)]
    time_unit: String,
    series: Vec<Series<T>>,
}

impl<T: Real> TryFrom<Unchecked<T>> for Trajectory<T> {
    type Error = TrajectoryError;
    fn try_from(read: Unchecked<T>) -> Result<Self, TrajectoryError> {
        let Unchecked { model, times, time_unit, series } = read;
        let increase = times.windows(2).all(|pair| matches!(pair, [a, b] if a <= b));
        if !(increase && times.iter().all(|time| time.is_finite())) {
            return Err(TrajectoryError::Times);
        }
        series.iter().try_for_each(|series| series.check(times.len()))?;
        Ok(Self { model, times, time_unit, series })
    }
}

impl<T> Series<T> {
    /// Checks that the values have times, and that bounds and multipliers have as many elements as
    /// the values, or none.
    fn check(&self, times: usize) -> Result<(), TrajectoryError> {
        let fits = |found: usize, expected: usize| match found == expected {
            true => Ok(()),
            false => Err(TrajectoryError::Length { name: self.name.clone(), found, expected }),
        };
        let (first, count) = (self.first, self.values.len());
        if first.checked_add(count).is_none_or(|end| end > times) {
            return Err(TrajectoryError::Beyond { name: self.name.clone(), first, found: count, times });
        }
        let bounds = [self.lower.len(), self.upper.len()];
        let multipliers = [self.lower_multipliers.len(), self.upper_multipliers.len()];
        for length in bounds.into_iter().chain(multipliers).filter(|&length| length > 0) {
            fits(length, count)?;
        }
        match (self.kind, self.costates.len()) {
            (_, 0) => Ok(()),
            (Kind::State | Kind::Control | Kind::Integral, length) => fits(length, count.saturating_sub(1)),
            (_, length) => fits(length, 0),
        }
    }
}
