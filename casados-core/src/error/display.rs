//! What errors say.

use super::{Argument, Error, Place, Quantity, Refusal, Started, Unsettled};
use core::fmt;

/// How other start values are given.
const OTHER_START: &str = "give it a `nominal(z = ..)` in the attribute of the model, or call `set_start` with values near the solution";

impl fmt::Display for Argument {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Argument::X0 => "x0",
            Argument::U => "u",
            Argument::H => "h",
            Argument::P => "p",
            Argument::T => "t",
            Argument::Lambda => "lambda",
            Argument::Nu => "nu",
            Argument::SeedX => "the seed of x0",
            Argument::SeedU => "the seed of u",
            Argument::SeedP => "the seed of p",
            Argument::StartXdot => "the start value of xdot",
            Argument::StartZ => "the start value of z",
        })
    }
}

impl Quantity {
    /// What is not finite, and its value.
    fn write(self, f: &mut fmt::Formatter<'_>, equation: usize, value: f64) -> fmt::Result {
        match self {
            Quantity::Residual => write!(f, "equation {equation} of the model is {value}"),
            Quantity::Jacobian => write!(f, "a derivative of equation {equation} of the model is {value}"),
            Quantity::Adjoint => write!(f, "the adjoint of the model is {value} for variable {equation}"),
            Quantity::Hessian => {
                write!(f, "a second derivative of the model is {value} for variable {equation}")
            }
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "step {}, stage {}, iteration {}", self.step, self.stage, self.iteration)
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Error::InvalidOption { option, value, reason } => {
                write!(f, "the option `{option}` is {value}, but {reason}")
            }
            Error::Tableau(error) => error.fmt(f),
            Error::NotExplicit { stage } => {
                write!(f, "the tableau is not explicit: stage {stage} needs itself or a later one")
            }
            Error::NonFiniteInput { argument: Argument::H, value, .. } => {
                write!(f, "the length `h` of the interval is {value}: it has to be finite")
            }
            Error::NonFiniteInput { argument: Argument::T, value, .. } => {
                write!(f, "the time `t` is {value}: it has to be finite")
            }
            Error::NonFiniteInput { argument, index, name: "", value } => {
                write!(f, "element {index} of {argument} is {value}: it has to be finite")
            }
            Error::NonFiniteInput { argument, name, value, .. } => {
                write!(f, "`{name}` of {argument} is {value}: it has to be finite")
            }
            Error::ParametersNotSet => {
                f.write_str("the model has parameters: call `set_parameters` before the first step")
            }
            Error::StartNotGiven => {
                f.write_str("the start values are `Start::Given`: call `set_start` before the first step")
            }
            Error::NonFiniteModel { quantity, equation, value, at } => {
                quantity.write(f, equation, value)?;
                write!(
                    f,
                    " at {at}: look for roots, logarithms or quotients outside of their domains, or take shorter steps"
                )
            }
            Error::NonFiniteStart {
                quantity,
                equation,
                value,
                started: Started { unknown, value: start },
                at,
            } => {
                quantity.write(f, equation, value)?;
                write!(f, " at {at}; `{unknown}` started at {start}: {OTHER_START}")
            }
            Error::Singular { unknown, at } => write!(
                f,
                "the Newton matrix is singular in the column of `{unknown}` at {at}: with this step size the \
                 equations do not determine it there; if they do elsewhere, start there: `nominal(..)` in the attribute \
                 of the model, or `set_start`"
            ),
            Error::NotPivoted { step } => write!(
                f,
                "step {step} was not solved with the planned elimination, and the integrator has no memory to pivot the \
                 whole matrix"
            ),
            Error::NotConverged { residual, equation, unknown, increment, at, started } => {
                write!(
                    f,
                    "Newton's method did not converge: at {at} the residual of equation {equation} is {residual:e} \
                     relative to its terms, and the last increment of `{unknown}` is {increment:e} relative to its size"
                )?;
                match started {
                    Some(Started { unknown, value }) => write!(
                        f,
                        "; `{unknown}` started at {value}: if the equations have a solution, {OTHER_START}"
                    ),
                    None => Ok(()),
                }
            }
            Error::SingularAlgebraic { unknown, at } => write!(
                f,
                "Newton's method did not converge: between the start values and where it ended, at {at}, ∂f/∂z becomes \
                 singular along `{unknown}`: the algebraic equations may have lost their solution"
            ),
            Error::InconsistentStart { t, equation, residual, unknown, value, singular } => {
                write!(f, "there are no consistent derivatives and algebraic states at t = {t}: ")?;
                match singular {
                    true => write!(f, "the equations do not determine `{unknown}`, which is at {value:e}")?,
                    false => write!(f, "Newton's method does not settle, with `{unknown}` at {value:e}")?,
                }
                write!(
                    f,
                    " where equation {equation} has the residual {residual:e}; if there are some elsewhere, start there: \
                     `nominal(..)` in the attribute of the model, or `set_start`"
                )
            }
            Error::Overflow { step, index } => {
                write!(
                    f,
                    "the numbers overflow in step {step}, at element {index} of the unknowns or of a result"
                )
            }
            Error::NonFiniteFunction { function, output, value, at } => {
                write!(f, "output {output} of the function {function} is {value} at {at}")
            }
            Error::StepSizeUnderflow { t, h, reason, unsettled } => {
                write!(f, "the step size falls to {h:e} at t = {t}: ")?;
                let reason_text = match reason {
                    Refusal::SingularAlgebraic { unknown } => {
                        write!(f, "∂f/∂z becomes singular there along `{unknown}`")?;
                        ", where the algebraic equations lose their solution"
                    }
                    Refusal::Error => {
                        "the estimated error stays above the tolerance; the solution may blow up here, or `atol` is \
                         too large for some states"
                    }
                    Refusal::NotConverged => "Newton's method does not converge",
                    Refusal::Singular => "the Newton matrix is singular",
                    Refusal::NotFinite => "the model is not finite",
                    Refusal::Resolution => "the time does not resolve it",
                };
                f.write_str(reason_text)?;
                let Some(Unsettled { equation, residual, unknown, value, algebraic }) = unsettled else {
                    return Ok(());
                };
                write!(
                    f,
                    "; equation {equation} keeps a residual of {residual:e} relative to its terms, and `{unknown}`, which \
                     is {value:e} at this time, does not settle"
                )?;
                f.write_str(match (reason, algebraic) {
                    (Refusal::SingularAlgebraic { .. }, _) => "",
                    (_, true) => {
                        ": the algebraic equations lose their solution there (∂f/∂z becomes singular), or they jump: then \
                         declare an event"
                    }
                    (_, false) => {
                        ": the solution may end there, or the model jump: then declare an event, or write the condition as \
                         `if` or `max`"
                    }
                })
            }
            Error::TooManySteps { t, steps, stiff, rounding } => {
                write!(f, "t = {t} was reached after {steps} steps, and `max_steps` allows no more")?;
                if stiff {
                    f.write_str("; the model is stiff, so that an implicit method takes fewer: Radau")?;
                }
                let Some(factor) = rounding else { return Ok(()) };
                write!(
                    f,
                    "; the tolerances are below rounding errors of the model, which limited most steps: larger by a \
                     factor of {factor:.1} they need about half of `max_steps`"
                )
            }
            Error::OutsideInterval { t, start, end } => {
                write!(f, "t = {t} is outside the interval from {start} to {end} of the last call")
            }
            Error::Unordered { index, t, before, end } => write!(
                f,
                "the times are not in order: element {index} is {t}, and not between the one before it, {before}, and the \
                 end, {end}"
            ),
            Error::AccumulatingEvents { t, function, event, events } => write!(
                f,
                "events accumulate at t = {t}: event {event}, of the function {function}, happens sooner and sooner after \
                 itself, {events} events so far; end the integration before, by a terminal event, or go on with a model \
                 of what is at rest"
            ),
            Error::TooManyEvents { t, events } => {
                write!(f, "t = {t} was reached after {events} events, and more are not allowed")
            }
            Error::Grazing { event, t } => {
                write!(
                    f,
                    "event {event} touches zero without crossing it at t = {t}: its time has no derivative"
                )
            }
            Error::GuardOfAlgebraicStates { function } => write!(
                f,
                "the function {function} of an event looks at algebraic states: over it there are first derivatives, and no \
                 second ones; write it in terms of x, u and p"
            ),
            Error::DependsOnTime { function } => write!(
                f,
                "{function} depends on the time, by which derivatives over events are not known: add the time as a state"
            ),
            Error::Intervals { controls, ends } => {
                write!(
                    f,
                    "{controls} controls for {ends} intervals: there is one for each, and at least one interval"
                )
            }
            Error::NoInterpolation => f.write_str(
                "the tableau is not that of a collocation method: there is no polynomial through its stages",
            ),
            Error::NoResult => f.write_str("there is no result yet: no call has succeeded"),
            Error::NotProjected { equation, derivative, residual } => write!(
                f,
                "the end of the interval cannot be projected: derivative {derivative} of the constraint of equation \
                 {equation} is violated by {residual:e}, and no consistent state was found nearby, or the constraints \
                 are redundant there; take shorter steps"
            ),
            Error::OutOfMemory { bytes } => write!(f, "{bytes} bytes of memory could not be allocated"),
        }
    }
}

debug_is_display!(Error);

impl core::error::Error for Error {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Tableau(error) => Some(error),
            _ => None,
        }
    }
}
