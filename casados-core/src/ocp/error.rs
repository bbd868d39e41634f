//! Every mistake in a problem, and what can go wrong where it is evaluated.

use super::dynamics::Names;
use crate::error::Error;
use crate::qp::{QpError, Side};
use core::fmt;

/// A part of a problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Part {
    /// The nodes in time.
    Times,
    /// States.
    States,
    /// Controls.
    Controls,
    /// Parameters.
    Parameters,
    /// The state at the start.
    InitialState,
    /// Reference of the stage cost.
    Reference,
    /// Reference of the terminal cost.
    TerminalReference,
    /// Weights of a cost.
    Weights,
    /// Bounds of states.
    StateBounds,
    /// Bounds of controls.
    ControlBounds,
    /// Bounds of path constraints.
    PathBounds,
    /// Bounds of terminal constraints.
    TerminalBounds,
    /// Penalties of soft bounds.
    Penalty,
    /// Dimensions of the stages.
    Dimensions,
    /// Memory for numbers.
    Memory,
}

/// A name in an error: its first bytes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Text {
    bytes: [u8; 32],
    length: usize,
}

impl Text {
    pub(super) fn new(text: &str) -> Self {
        let mut length = text.len().min(32);
        while !text.is_char_boundary(length) {
            length -= 1;
        }
        let mut bytes = [0; 32];
        for (to, from) in bytes.iter_mut().zip(text.bytes().take(length)) {
            *to = from;
        }
        Self { bytes, length }
    }
    /// The text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        self.bytes.get(..self.length).and_then(|bytes| core::str::from_utf8(bytes).ok()).unwrap_or_default()
    }
}

impl fmt::Debug for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}

/// A constraint by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConstraintName {
    /// What kind of bounds.
    pub part: Part,
    /// The stage.
    pub stage: usize,
    /// The state or control, or the function.
    pub name: &'static str,
    /// The output of the function; zero of others.
    pub output: usize,
    /// The side.
    pub side: Side,
}

/// What is wrong with a problem, or what went wrong where it was evaluated: what, at which stage,
/// and the values.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum OcpError {
    /// No state or control has this name.
    UnknownName {
        /// The name.
        name: Text,
        /// Those that there are.
        known: Names,
    },
    /// A stage that the horizon does not have.
    NoSuchStage {
        /// What was to be set.
        part: Part,
        /// The stage.
        stage: usize,
        /// How many stages have such a part.
        stages: usize,
    },
    /// A length is not what the problem asks for.
    Length {
        /// What is too short or too long.
        part: Part,
        /// The stage, 0 where it is the whole horizon.
        stage: usize,
        /// The length that is needed.
        expected: usize,
        /// The length that was given.
        found: usize,
    },
    /// A number is infinite or NaN and must not be, or a penalty or weight is negative.
    InvalidValue {
        /// Of what.
        part: Part,
        /// The stage.
        stage: usize,
        /// The element.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// Times of nodes do not increase.
    Times {
        /// The interval.
        interval: usize,
        /// Its start.
        start: f64,
        /// Its end.
        end: f64,
    },
    /// A lower bound is above the upper one.
    CrossedBounds {
        /// Which bounds.
        part: Part,
        /// The stage.
        stage: usize,
        /// The element.
        index: usize,
        /// Its lower bound.
        lower: f64,
        /// Its upper bound.
        upper: f64,
    },
    /// Nobody said what this is.
    Missing {
        /// What.
        part: Part,
        /// The stage.
        stage: usize,
    },
    /// A cost or constraint depends on something that does not exist where it is evaluated:
    /// algebraic states or controls at the end of the horizon, algebraic states of a map.
    NotThere {
        /// The function.
        function: &'static str,
        /// The variable.
        variable: &'static str,
        /// Whether at the end of the horizon.
        terminal: bool,
    },
    /// A function has a value that is not finite.
    NonFiniteFunction {
        /// Its name.
        function: &'static str,
        /// The stage.
        stage: usize,
        /// Which of its outputs, or zero of a sum.
        output: usize,
        /// The value.
        value: f64,
    },
    /// An interval has no result.
    Integration {
        /// Which.
        interval: usize,
        /// Why.
        error: Error,
    },
    /// States are periodic or controls shared, and this solver has no such conditions:
    /// [`Ipm`](super::Ipm) and [`Sqp`](super::Sqp) have.
    Coupled,
    /// An option of the solver is out of its range.
    InvalidOption {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        allowed: &'static str,
    },
    /// The QP has no solution.
    Qp(QpError),
    /// Memory could not be allocated.
    OutOfMemory {
        /// How much was asked for.
        bytes: usize,
    },
}

impl From<QpError> for OcpError {
    fn from(error: QpError) -> Self {
        match error {
            QpError::OutOfMemory { bytes } => Self::OutOfMemory { bytes },
            error => Self::Qp(error),
        }
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Times => "the nodes",
            Self::States => "the states",
            Self::Controls => "the controls",
            Self::Parameters => "the parameters",
            Self::InitialState => "the initial state",
            Self::Reference => "the reference of the stage cost",
            Self::TerminalReference => "the reference of the terminal cost",
            Self::Weights => "the weights",
            Self::StateBounds => "the bounds of the states",
            Self::ControlBounds => "the bounds of the controls",
            Self::PathBounds => "the bounds of the path constraints",
            Self::TerminalBounds => "the bounds of the terminal constraints",
            Self::Penalty => "the penalties",
            Self::Dimensions => "the dimensions of the stages",
            Self::Memory => "the memory",
        })
    }
}

impl fmt::Display for ConstraintName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let side = match self.side {
            Side::Lower => "lower",
            Side::Upper => "upper",
        };
        write!(f, "the {side} bound of `{}`", self.name)?;
        if matches!(self.part, Part::PathBounds | Part::TerminalBounds) {
            write!(f, " (output {})", self.output)?;
        }
        write!(f, " at stage {}", self.stage)
    }
}

impl fmt::Display for OcpError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownName { name, known } => {
                write!(f, "`{}` has no state or control `{}`: its states are", known.model, name.as_str())?;
                list(f, known.x)?;
                f.write_str(", its controls")?;
                list(f, known.u)
            }
            Self::NoSuchStage { part, stage, stages } => {
                write!(f, "there is no stage {stage}: {part} are at stages 0 to {}", stages.saturating_sub(1))
            }
            Self::Length { part, stage, expected, found } => {
                write!(f, "stage {stage}: {part} have {found} elements instead of {expected}")
            }
            Self::InvalidValue { part, stage, index, value } => {
                write!(f, "stage {stage}: element {index} of {part} is {value}")
            }
            Self::Times { interval, start, end } => {
                write!(
                    f,
                    "interval {interval} goes from {start} to {end}: times of nodes are finite and increase"
                )
            }
            Self::CrossedBounds { part, stage, index, lower, upper } => {
                write!(f, "stage {stage}: element {index} of {part} is from {lower} to {upper}")
            }
            Self::Missing { part: Part::InitialState, .. } => f.write_str(
                "nothing is said about the initial state: call `fix_initial_state` or `free_initial_state`",
            ),
            Self::Missing { part, stage } => write!(f, "stage {stage}: {part} were never set"),
            Self::NotThere { function, variable, terminal } => {
                write!(f, "`{function}` depends on `{variable}`, which does not exist ")?;
                f.write_str(if *terminal { "at the end of the horizon" } else { "at the nodes" })
            }
            Self::NonFiniteFunction { function, stage, output, value } => {
                write!(f, "stage {stage}: output {output} of `{function}` is {value}")
            }
            Self::Integration { interval, error } => write!(f, "interval {interval}: {error}"),
            Self::Coupled => f.write_str(
                "states are periodic or controls shared: `Ipm` and `Sqp` solve such problems, this solver does not",
            ),
            Self::InvalidOption { name, value, allowed } => {
                write!(f, "the option `{name}` is {value}: it has to be {allowed}")
            }
            Self::Qp(error) => error.fmt(f),
            Self::OutOfMemory { bytes } => write!(f, "{bytes} bytes of memory could not be allocated"),
        }
    }
}

fn list(f: &mut fmt::Formatter<'_>, names: &[&str]) -> fmt::Result {
    for (i, name) in names.iter().enumerate() {
        let comma = if i == 0 { "" } else { "," };
        write!(f, "{comma} `{name}`")?;
    }
    Ok(())
}

impl core::error::Error for OcpError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Integration { error, .. } => Some(error),
            Self::Qp(error) => Some(error),
            _ => None,
        }
    }
}
