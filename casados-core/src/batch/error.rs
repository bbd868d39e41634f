//! Errors of batches.

use crate::error::{Argument, Error};
use core::fmt;

/// The reason why results of a batch are missing.
///
/// ```
/// use casados::prelude::*;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
///
/// let mut batch = Batch::<Cart, Gauss<2>>::new(Options::default())?;
/// let mut results = vec![casados::result::Nominal::default(); 3];
/// // No interval, but three places for results.
/// let error = batch.solve(&Intervals { h: &[0.1], ..Default::default() }, &mut results);
/// assert!(matches!(error, Err(BatchError::Length { .. })));
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum BatchError {
    /// A slice does not have one element for each interval (or one for all, if that is allowed).
    /// Nothing was computed.
    Length {
        /// The slice.
        slice: Slice,
        /// Number of its elements.
        length: usize,
        /// Number of intervals.
        intervals: usize,
    },
    /// Some intervals have no result; all others do. `status` returns the error of each interval.
    Intervals {
        /// Number of failed intervals.
        failed: usize,
        /// The first failed interval.
        first: usize,
        /// Its error.
        error: Error,
    },
    /// The integrator could not be created: invalid options or tableau. Nothing was computed.
    Integrator(Error),
    /// Memory could not be allocated. Nothing was computed.
    OutOfMemory {
        /// Size of the allocation.
        bytes: usize,
    },
}

/// A slice that is passed to a batch.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # use casados::batch::Slice;
/// let mut batch = Batch::<Cart, Gauss<2>>::new(Options::default())?;
/// let (x0, u) = ([vector![0.0, 0.0]], [vector![1.0]]);
/// let intervals = Intervals { x0: &x0, u: &u, h: &[0.1], ..Default::default() };
/// let mut results = vec![casados::result::Nominal::default(); 3];
/// // One interval, but places for three results.
/// let error = batch.solve(&intervals, &mut results);
/// let (slice, length) = (Slice::Results, 3);
/// assert_eq!(error, Err(BatchError::Length { slice, length, intervals: 1 }));
/// assert_eq!(slice.to_string(), "results");
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Slice {
    /// An input of the intervals.
    Argument(Argument),
    /// The slice of the results.
    Results,
}

impl fmt::Display for Slice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Argument(Argument::T) => f.write_str("t0"),
            Self::Argument(argument) => argument.fmt(f),
            Self::Results => f.write_str("results"),
        }
    }
}

impl fmt::Display for BatchError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Length { slice, length, intervals } => {
                write!(f, "`{slice}` has {length} elements for {intervals} intervals: ")?;
                f.write_str(match slice {
                    Slice::Results => "give one element for each interval",
                    Slice::Argument(_) => "give one element, or one for each interval",
                })
            }
            Self::Intervals { failed, first, error } => {
                write!(f, "{failed} intervals failed, the first of them interval {first}: {error}")
            }
            Self::Integrator(error) => error.fmt(f),
            Self::OutOfMemory { bytes } => write!(f, "{bytes} bytes could not be allocated"),
        }
    }
}

debug_is_display!(BatchError);

impl core::error::Error for BatchError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Intervals { error, .. } | Self::Integrator(error) => Some(error),
            _ => None,
        }
    }
}

impl From<Error> for BatchError {
    fn from(error: Error) -> Self {
        match error {
            Error::OutOfMemory { bytes } => Self::OutOfMemory { bytes },
            error => Self::Integrator(error),
        }
    }
}
