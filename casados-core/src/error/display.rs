//! Messages of errors.

use super::{Argument, Error, Place, Quantity, Refusal, Started, Unsettled};
use core::fmt;

/// A hint how to set the initial guess.
const START_VALUE_HINT: &str = "set a start value near the solution by `nominal(z = ..)` in the attribute of the model, or by `set_start`";

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
    /// Writes the quantity that is not finite, and its value.
    fn fmt_value(self, f: &mut fmt::Formatter<'_>, equation: usize, value: f64) -> fmt::Result {
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
                write!(f, "the tableau is not explicit: stage {stage} depends on itself or on a later stage")
            }
            Error::NonFiniteInput { argument: Argument::H, value, .. } => {
                write!(f, "the length `h` of the interval is {value}: it must be finite")
            }
            Error::NonFiniteInput { argument: Argument::T, value, .. } => {
                write!(f, "the time `t` is {value}: it must be finite")
            }
            Error::NonFiniteInput { argument, index, name: "", value } => {
                write!(f, "element {index} of {argument} is {value}: it must be finite")
            }
            Error::NonFiniteInput { argument, name, value, .. } => {
                write!(f, "`{name}` of {argument} is {value}: it must be finite")
            }
            Error::ParametersNotSet => {
                f.write_str("the model has parameters: call `set_parameters` before the first step")
            }
            Error::StartNotGiven => {
                f.write_str("the start values are `Start::Given`: call `set_start` before the first step")
            }
            Error::NonFiniteModel { quantity, equation, value, at } => {
                quantity.fmt_value(f, equation, value)?;
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
                quantity.fmt_value(f, equation, value)?;
                write!(f, " at {at}; `{unknown}` started at {start}: {START_VALUE_HINT}")
            }
            Error::Singular { unknown, at } => write!(
                f,
                "the Newton matrix is singular at {at}: with this step size the equations do not determine `{unknown}`. \
                 Take other start values (`nominal(..)` in the attribute of the model, or `set_start`), or shorter steps"
            ),
            Error::NotPivoted { step } => write!(
                f,
                "step {step} needs the dense fallback, which `memory::Refusing` has no memory for: take \
                 `memory::Pivoting`, or declare `nominal(..)` and `range(..)` of the variables"
            ),
            Error::NotConverged { residual, equation, unknown, increment, at, started } => {
                write!(
                    f,
                    "Newton's method did not converge at {at}: equation {equation} has a relative residual of \
                     {residual:e}, and `{unknown}` a last relative increment of {increment:e}"
                )?;
                match started {
                    Some(Started { unknown, value }) => {
                        write!(f, ". `{unknown}` started at {value}: {START_VALUE_HINT}")
                    }
                    None => Ok(()),
                }
            }
            Error::SingularAlgebraic { unknown, at } => write!(
                f,
                "Newton's method did not converge at {at}: ∂f/∂z becomes singular along `{unknown}` between the start \
                 values and the last iterate. The algebraic equations may have no solution there (fold)"
            ),
            Error::InconsistentStart { t, equation, residual, unknown, value, singular } => {
                write!(f, "no consistent `xdot` and `z` were found at t = {t}: ")?;
                match singular {
                    true => write!(f, "the equations do not determine `{unknown}`")?,
                    false => f.write_str("Newton's method did not converge")?,
                }
                write!(
                    f,
                    ". Last value of `{unknown}`: {value:e}; residual of equation {equation}: {residual:e}. Give start \
                     values near a solution: `nominal(..)` in the attribute of the model, or `set_start`"
                )
            }
            Error::Overflow { step, index } => {
                write!(
                    f,
                    "overflow in step {step}, at element {index} of the unknowns or of a result: take shorter steps, or \
                     check the scaling of the model and its start values"
                )
            }
            Error::NonFiniteFunction { function, output, value, at } => {
                write!(
                    f,
                    "output {output} of the function {function} is {value} at {at}: keep its arguments inside its domain"
                )
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
                    Refusal::Resolution => {
                        "it is below the resolution of the time; scale the time, or start nearer to t = 0"
                    }
                };
                f.write_str(reason_text)?;
                let Some(Unsettled { equation, residual, unknown, value, algebraic }) = unsettled else {
                    return Ok(());
                };
                write!(
                    f,
                    "; equation {equation} has a relative residual of {residual:e}, and `{unknown}`, {value:e} at this \
                     time, does not converge"
                )?;
                f.write_str(match (reason, algebraic) {
                    (Refusal::SingularAlgebraic { .. }, _) => "",
                    (_, true) => {
                        ". Either the algebraic equations have no solution after this time (∂f/∂z becomes singular), or \
                         they are discontinuous: declare an event"
                    }
                    (_, false) => {
                        ". Either the solution ends here, or the model is discontinuous: declare an event, or write the \
                         condition as `if` or `max`"
                    }
                })
            }
            Error::TooManySteps { t, steps, stiff, rounding } => {
                write!(f, "t = {t} was reached after {steps} steps, the maximum")?;
                if stiff {
                    f.write_str("; the model appears stiff: take an implicit method, `Adaptive<_, Radau>`")?;
                }
                let Some(factor) = rounding else {
                    return f.write_str(if stiff { "; otherwise raise `max_steps`" } else { ": raise `max_steps`" });
                };
                write!(
                    f,
                    "; the tolerances are below rounding errors of the model, which limited most steps: tolerances \
                     larger by a factor of {factor:.1} need about half of `max_steps`"
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
                "events accumulate at t = {t} (Zeno): event {event}, of the function {function}, recurs at ever shorter \
                 intervals, {events} events so far. End the integration before by a terminal event, or continue with a \
                 model of the state at rest"
            ),
            Error::TooManyEvents { t, events } => {
                write!(f, "t = {t} was reached after {events} events, the maximum: raise it by `set_most_events`")
            }
            Error::Grazing { event, function, t } => write!(
                f,
                "event {event}, of the function {function}, has no slope at its zero at t = {t} (grazing): the event time \
                 has no derivative there. Change the initial state or the parameters slightly"
            ),
            Error::GuardOfAlgebraicStates { function } => write!(
                f,
                "the event function {function} depends on algebraic states: second derivatives across this event are not \
                 available. Write it in terms of x, u and p"
            ),
            Error::DependsOnTime { function } => write!(
                f,
                "{function} depends on the time: second derivatives across events, and first ones across events of \
                 algebraic states, need an autonomous model. Add the time as a state, `ẋ = 1`"
            ),
            Error::Intervals { controls, ends } => {
                write!(
                    f,
                    "{controls} controls for {ends} intervals: give one control for each interval, and at least one \
                     interval"
                )
            }
            Error::NoInterpolation => f.write_str(
                "the tableau is not a collocation method: it has no dense output, and no algebraic states at the ends of \
                 the interval",
            ),
            Error::NoResult => f.write_str("there is no result yet: no call has succeeded"),
            Error::NotProjected { equation, derivative, residual } => write!(
                f,
                "projection failed: derivative {derivative} of the constraint of equation {equation} is violated by \
                 {residual:e}. The state is too far from the constraints, or these are redundant there: take shorter \
                 steps"
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
