//! Messages of errors: the name and place, the values, and the remedy.

use crate::ocp::formulation::error::{ConstraintName, OcpError, Part};
use crate::qp::{QpField, Side};
use core::fmt;

/// The remedy for functions and derivatives that are not finite.
const OUTSIDE_DOMAIN: &str = "take another guess, or bounds that keep the variables inside its domain";

impl Part {
    fn is_bound(self) -> bool {
        let of_variables = matches!(
            self,
            Self::StateBounds | Self::ControlBounds | Self::ParameterBounds | Self::AlgebraicBounds
        );
        of_variables || matches!(self, Self::PathBounds | Self::TerminalBounds)
    }
    fn verb(self) -> &'static str {
        match self {
            Self::InitialState | Self::Reference | Self::TerminalReference | Self::Memory => "has",
            _ => "have",
        }
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Times => "the nodes",
            Self::States => "the states",
            Self::Controls => "the controls",
            Self::Multipliers => "the multipliers",
            Self::Parameters => "the parameters",
            Self::InitialState => "the initial state",
            Self::Arrival => "the weights of the arrival cost",
            Self::Reference => "the reference of the stage cost",
            Self::TerminalReference => "the reference of the terminal cost",
            Self::ParameterBounds => "the ranges of free parameters",
            Self::StateBounds => "the bounds of the states",
            Self::ControlBounds => "the bounds of the controls",
            Self::AlgebraicBounds => "the bounds of the algebraic states",
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
        match self.part {
            Part::ParameterBounds => {}
            _ if self.point > 0 => write!(f, " at point {} inside of interval {}", self.point, self.stage)?,
            _ => write!(f, " at stage {}", self.stage)?,
        }
        PhaseSuffix(self.phase).fmt(f)
    }
}

/// ` of phase 1`, or nothing.
struct PhaseSuffix<T>(Option<T>);

impl<T: fmt::Display> fmt::Display for PhaseSuffix<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Some(phase) => write!(f, " of phase {phase}"),
            None => Ok(()),
        }
    }
}

impl fmt::Display for OcpError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownName { name, known } => {
                write!(f, "`{}` has no variable `{}` of this kind. States:", known.model, name.as_str())?;
                write_names(f, known.x)?;
                for (kind, names) in [("; controls:", known.u), ("; algebraic states:", known.z)] {
                    if !names.is_empty() {
                        f.write_str(kind)?;
                        write_names(f, names)?;
                    }
                }
                Ok(())
            }
            Self::NoSuchStage { part, stage, stages } => {
                let (are, last) = (if part.verb() == "has" { "is" } else { "are" }, stages.saturating_sub(1));
                write!(f, "there is no stage {stage}: {part} {are} at stages 0 to {last}")
            }
            Self::EmptyRange { part, start, end, stages } => write!(
                f,
                "the range of stages {start}..{end} is empty: {part} are at stages 0 to {}",
                stages.saturating_sub(1)
            ),
            Self::NoBound { name, start, end } => write!(
                f,
                "`{}` has no finite bound at stages {start} to {}: call `bound` before `soften`",
                name.as_str(),
                end.saturating_sub(1)
            ),
            Self::Length { part: Part::Dimensions, stage, expected, found } => write!(
                f,
                "dimensions of another problem: {found} instead of {expected} at stage {stage}. Make solvers and memory \
                 for each problem: `HeapSqp::new(&ocp)`"
            ),
            Self::Length { part, stage, expected, found } => {
                let elements = if *found == 1 { "element" } else { "elements" };
                write_stage(f, *part, *stage)?;
                write!(f, "{part} {} {found} {elements} instead of {expected}", part.verb())?;
                f.write_str(if *expected == 0 { ": the problem has none" } else { "" })
            }
            Self::InvalidValue { part, stage, name, index, value } => {
                write_stage(f, *part, *stage)?;
                let (what, allowed) = match part {
                    Part::Penalty => ("a penalty of ", "at least 0, and finite if quadratic"),
                    _ if part.is_bound() => {
                        ("a bound of ", "a number, -inf for no lower bound, or inf for no upper bound")
                    }
                    Part::InitialState => ("the initial value of ", "finite"),
                    Part::Multipliers => ("a multiplier of ", "finite"),
                    Part::Reference | Part::TerminalReference => ("the reference of ", "finite"),
                    _ => ("", "finite"),
                };
                f.write_str(what)?;
                write_element_name(f, *part, name, *index)?;
                write!(f, " is {value}: it must be {allowed}")
            }
            Self::InvalidArrivalWeight { states: [i, j], value, allowed } => {
                match i == j {
                    true => write!(f, "the weight of `{i}` in the arrival cost")?,
                    false => write!(f, "the weight of `{i}` and `{j}` in the arrival cost")?,
                }
                write!(f, " is {value}: it must be {allowed}")
            }
            Self::InvalidWeight { function, outputs: [i, j], value, allowed } => {
                match i == j {
                    true => write!(f, "the weight of output {i} of `{function}`")?,
                    false => write!(f, "the weight of outputs {i} and {j} of `{function}`")?,
                }
                write!(f, " is {value}: it must be {allowed}")
            }
            Self::Times { interval, start, end } => {
                write!(
                    f,
                    "interval {interval} goes from {start} to {end}: times of nodes must be finite and increasing"
                )
            }
            Self::CrossedBounds { part, stage, name, index, lower, upper } => {
                write!(f, "stage {stage}: the lower bound {lower} of ")?;
                write_element_name(f, *part, name, *index)?;
                write!(f, " is above the upper bound {upper}")
            }
            Self::Missing { part: Part::Times, .. } => f.write_str(
                "the horizon has no interval: `Horizon::uniform` takes one at least, `Horizon::nodes` two times",
            ),
            Self::Missing { part: Part::InitialState, .. } => f.write_str(
                "the initial state is undefined: call `fix_initial_state` or `free_initial_state`",
            ),
            Self::Missing { part: Part::Parameters, stage } => {
                write!(f, "stage {stage}: the parameters were never set: call `set_parameters`")
            }
            Self::Missing { part, stage } => write!(f, "stage {stage}: {part} were never set"),
            Self::NotThere { function, variable, terminal } => {
                write!(f, "`{function}` depends on `{variable}`, which does not exist ")?;
                f.write_str(match terminal {
                    true => {
                        "at the end of the horizon: terminal costs and constraints may depend on states and parameters \
                         only; move this term to the running cost or the path constraints"
                    }
                    false => "at the nodes: maps have no algebraic states",
                })
            }
            Self::NonFiniteFunction { function, stage, output, value, phase } => {
                write!(f, "stage {stage}{}: output {output} of `{function}` is {value}: {OUTSIDE_DOMAIN}", PhaseSuffix(*phase))
            }
            Self::NonFiniteDerivative { field, stage, of, output, by, value, phase } => {
                write!(f, "stage {stage}{}: ", PhaseSuffix(*phase))?;
                match field {
                    QpField::A | QpField::B => write!(f, "the derivative of the next `{of}` by `{by}`")?,
                    QpField::C | QpField::D => write!(f, "the derivative of output {output} of `{of}` by `{by}`")?,
                    QpField::GradientX | QpField::GradientU => write!(f, "the derivative of the cost by `{by}`")?,
                    _ => write!(f, "the second derivative of the Lagrangian by `{of}` and `{by}`")?,
                }
                write!(f, " is {value}: {OUTSIDE_DOMAIN}")
            }
            Self::NonFiniteSensitivity { stage, of, by, value } => write!(
                f,
                "stage {stage}: the derivative of the solution `{of}` by `{by}` is {value}: scale states, controls and \
                 costs to about one"
            ),
            Self::Integration { interval, error, phase } => {
                write!(f, "interval {interval}{}: {error}", PhaseSuffix(*phase))
            }
            Self::Simulation { interval, state, value, error } => write!(
                f,
                "the simulation of the guess failed in interval {interval}, at `{state}` = {value:e}: {error}. Change \
                 the initial state or the controls of the guess, or take an adaptive integrator \
                 (`Ocp::guess_by_simulation_with`)"
            ),
            Self::NoIntegrator => f.write_str(
                "collocation has no integrator for a simulation of the guess: give one to \
                 `Ocp::guess_by_simulation_with`",
            ),
            Self::NotIdentifiable { name, stage } => write!(
                f,
                "`{name}` at stage {stage} is not identifiable from the data, so it has no variance: \
                 `Covariance::unidentifiable` lists the directions. Add an arrival cost, samples or a bound"
            ),
            Self::Integrator(error) => error.fmt(f),
            #[cfg(feature = "alloc")]
            Self::Batch(error) => error.fmt(f),
            Self::Inconsistent(error) => error.fmt(f),
            Self::Coupled => f.write_str(
                "feedback gains are not defined for periodic states or shared controls: use `du/dx₀` of \
                 `Ocp::differentiate`",
            ),
            Self::FreeParameters => f.write_str(
                "feedback gains and functions of CasADi do not support free parameters: fix them with \
                 `set_parameters`, or make them states",
            ),
            Self::NoSolution => f.write_str(
                "the last run found no solution to differentiate (see its outcome)",
            ),
            Self::FixedEndTime { model } => write!(
                f,
                "the end time is free, but `{model}` has no duration: name the parameter, \
                 `#[ode(duration = p.duration)]`"
            ),
            Self::Unsupported { what, remedy } => write!(f, "not supported: {what}. {remedy}"),
            Self::NoSuchPhase { phase, phases } => {
                write!(f, "there is no phase {phase}: there are {phases}, counted from 0")
            }
            Self::CostAtNodes { function, coefficient } => write!(
                f,
                "the running cost `{function}` depends on `{coefficient}`, a coefficient of a polynomial \
                 control, of which nodes have the value at the start of an interval alone. Take an integral \
                 of the model, `integrals(..)`, with a terminal cost, or `WithIntegral`"
            ),
            Self::DependsOnTime { function } => write!(
                f,
                "the end time is free, but `{function}` depends on the time and has no duration: name the parameter, \
                 `#[function(duration = p.duration)]`"
            ),
            Self::InvalidPoint { index, value } => write!(
                f,
                "point {index} inside intervals is at {value}: points must be increasing fractions of an interval, \
                 between 0 and 1"
            ),
            Self::UnknownParameter { name, known } => {
                write!(f, "`{}` has no parameter `{}`: ", known.model, name.as_str())?;
                if known.p.is_empty() {
                    return f.write_str("it has none");
                }
                f.write_str("its parameters are")?;
                write_names(f, known.p)
            }
            Self::OutOfRange { name, value, lower, upper } => {
                write!(f, "the guess {value} of `{name}` is outside of its range, {lower} to {upper}")
            }
            Self::InvalidOption { name, value, allowed } => {
                write!(f, "the option `{name}` is {value}: it must be {allowed}")
            }
            Self::LinkDimension { link, what: "output", expected, found } => write!(
                f,
                "the link `{link}` has {found} outputs instead of {expected}: one for each state of the next phase"
            ),
            Self::LinkDimension { link, what, expected, found } => write!(
                f,
                "the link `{link}` has {found} elements of `{what}` instead of {expected}: its function has the \
                 arguments of the model that ends"
            ),
            Self::Phase { phase, model, what } => write!(f, "phase {phase} (`{model}`) cannot have {what}"),
            Self::Qp(error) => error.fmt(f),
            Self::OutOfMemory { bytes } => write!(f, "{bytes} bytes of memory could not be allocated"),
        }
    }
}

/// Writes the stage, unless the part belongs to one stage only.
fn write_stage(f: &mut fmt::Formatter<'_>, part: Part, stage: usize) -> fmt::Result {
    match part {
        Part::InitialState | Part::TerminalReference | Part::Memory => Ok(()),
        _ => write!(f, "stage {stage}: "),
    }
}

/// Writes the name of an element of a part: an output of a function, or a variable.
fn write_element_name(f: &mut fmt::Formatter<'_>, part: Part, name: &str, index: usize) -> fmt::Result {
    match part {
        Part::PathBounds | Part::TerminalBounds | Part::Reference | Part::TerminalReference => {
            write!(f, "output {index} of `{name}`")
        }
        _ => write!(f, "`{name}`"),
    }
}

fn write_names(f: &mut fmt::Formatter<'_>, names: &[&str]) -> fmt::Result {
    for (i, name) in names.iter().enumerate() {
        let comma = if i == 0 { "" } else { "," };
        write!(f, "{comma} `{name}`")?;
    }
    Ok(())
}

debug_is_display!(OcpError);

impl core::error::Error for OcpError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Integration { error, .. } | Self::Simulation { error, .. } | Self::Integrator(error) => {
                Some(error)
            }
            #[cfg(feature = "alloc")]
            Self::Batch(error) => Some(error),
            Self::Inconsistent(error) => Some(error),
            Self::Qp(error) => Some(error),
            _ => None,
        }
    }
}
