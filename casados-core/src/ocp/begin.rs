//! What an integrator of single intervals is told before each, and what it says of one without a
//! result.

use super::dynamics::Interval;
use super::error::OcpError;
use crate::error::Error;

/// What an integrator is told before an interval.
pub(super) trait Begin<T> {
    fn begin(&mut self, interval: &Interval<'_, T>) -> Result<(), Error>;
}

/// The result of an interval.
///
/// # Errors
/// [`OcpError::Integration`]
pub(super) fn at<V>(interval: usize, result: Result<V, Error>) -> Result<V, OcpError> {
    result.map_err(|error| OcpError::Integration { interval, error })
}
