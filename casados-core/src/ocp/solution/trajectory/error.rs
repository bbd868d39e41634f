//! Errors of trajectories.

use crate::ocp::formulation::error::OcpError;
use alloc::boxed::Box;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

/// An unknown or ambiguous name, or a trajectory that does not fit a problem.
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(20, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// let solution = ocp.solution()?;
/// let error = solution.state("speed").unwrap_err();
/// println!("{error}"); // what there is
/// assert!(matches!(error, TrajectoryError::Unknown { .. }));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
#[non_exhaustive]
pub enum TrajectoryError {
    /// The name is unknown.
    Unknown {
        /// The model.
        model: String,
        /// The name.
        name: String,
        /// The known names.
        known: Vec<String>,
    },
    /// The name matches several quantities.
    Ambiguous {
        /// The name.
        name: String,
        /// The matching names.
        found: Vec<String>,
    },
    /// The number of values, bounds or multipliers differs from that of the problem.
    Length {
        /// The name of the quantity.
        name: String,
        /// The number of values in the trajectory.
        found: usize,
        /// The number of values in the problem.
        expected: usize,
    },
    /// The times of a trajectory that was read are not finite, or decrease.
    Times,
    /// A trajectory that was read has values without a time.
    Beyond {
        /// The name of the quantity.
        name: String,
        /// The index of the time of the first value.
        first: usize,
        /// The number of values.
        found: usize,
        /// The number of times of the trajectory.
        times: usize,
    },
    /// The problem rejects a value.
    Problem(Box<OcpError>),
}

impl fmt::Display for TrajectoryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown { model, name, known } if known.is_empty() => {
                write!(f, "the solution of `{model}` has no variables of this kind, so `{name}` is unknown")
            }
            Self::Unknown { model, name, known } => {
                write!(f, "the solution of `{model}` has no `{name}`: it has")?;
                write_names(f, known)
            }
            Self::Ambiguous { name, found } => {
                write!(f, "`{name}` is ambiguous, it matches")?;
                write_names(f, found)
            }
            Self::Length { name, found, expected } => write!(
                f,
                "the trajectory has {found} values of `{name}` instead of {expected}: for other horizons use \
                 `guess_from`, which interpolates"
            ),
            Self::Times => f.write_str("the times of the trajectory must be finite and must not decrease"),
            Self::Beyond { name, first, found, times } => write!(
                f,
                "`{name}` has {found} values from index {first}, but the trajectory only {times} times"
            ),
            Self::Problem(error) => error.fmt(f),
        }
    }
}

fn write_names(f: &mut fmt::Formatter<'_>, names: &[String]) -> fmt::Result {
    for (i, name) in names.iter().enumerate() {
        let comma = if i == 0 { "" } else { "," };
        write!(f, "{comma} `{name}`")?;
    }
    Ok(())
}

debug_is_display!(TrajectoryError);

impl core::error::Error for TrajectoryError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Problem(error) => Some(&**error),
            _ => None,
        }
    }
}

impl<E: Into<OcpError>> From<E> for TrajectoryError {
    fn from(error: E) -> Self {
        Self::Problem(Box::new(error.into()))
    }
}
