//! Every mistake in a problem, and what can go wrong where it is evaluated; `messages` say it.

mod named;

pub use named::{ConstraintName, Part, Text};

#[cfg(feature = "alloc")]
use crate::batch::BatchError;
use crate::constrained::Inconsistent;
use crate::error::Error;
use crate::ocp::formulation::names::Names;
use crate::qp::{QpError, QpField};

/// What is wrong with a problem, or what went wrong where it was evaluated: what, at which stage,
/// and the values.
///
/// ```
/// use casados::ocp::{GeneralCost, Horizon, Map, OcpError, Problem};
/// use casados::prelude::*;
///
/// #[function]
/// fn push(x: f64, u: f64) -> f64 { x + u }
/// #[function]
/// fn price(x: f64, u: f64) -> f64 { x * x + u * u }
///
/// let problem = Problem::new(Map::<Push, f64>::new()).stage_cost(GeneralCost::<Price>::new());
/// let mut ocp = problem.on(Horizon::uniform(5, 1.0))?;
/// let error = ocp.bound("v", .., -1.0, 1.0).err();
/// println!("{}", error.map_or(String::new(), |error| error.to_string())); // which names there are
/// assert!(matches!(ocp.bound("u", .., 1.0, -1.0), Err(OcpError::CrossedBounds { .. })));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy)]
#[non_exhaustive]
pub enum OcpError {
    /// No state or control has this name.
    UnknownName {
        /// The name.
        name: Text,
        /// Those that there are.
        known: &'static Names,
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
    /// A range of stages that has none.
    EmptyRange {
        /// What was to be set.
        part: Part,
        /// Where the range begins.
        start: usize,
        /// Before which stage it ends.
        end: usize,
        /// How many stages have such a part.
        stages: usize,
    },
    /// Bounds were to be made soft, and there are none.
    NoBound {
        /// The states or controls.
        name: Text,
        /// The first stage.
        start: usize,
        /// The stage behind the last one.
        end: usize,
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
    /// A number is infinite or NaN and must not be, or a penalty is negative.
    InvalidValue {
        /// Of what.
        part: Part,
        /// The stage.
        stage: usize,
        /// The state, control, parameter or function.
        name: &'static str,
        /// The element, or the output of the function.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// The weights of a least-squares cost are no symmetric, positive semidefinite matrix.
    InvalidWeight {
        /// The function.
        function: &'static str,
        /// The row and the column: two of its outputs.
        outputs: [usize; 2],
        /// The weight.
        value: f64,
        /// What it has to be.
        allowed: &'static str,
    },
    /// The weights of an arrival cost are no symmetric, positive semidefinite matrix.
    InvalidArrivalWeight {
        /// The row and the column: two of the states.
        states: [&'static str; 2],
        /// The weight.
        value: f64,
        /// What it has to be.
        allowed: &'static str,
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
        /// The state, control or function.
        name: &'static str,
        /// The element, or the output of the function.
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
        /// Which of the [phases](crate::ocp::Phases), from 0 on, if there are several.
        phase: Option<u32>,
    },
    /// A derivative is not finite where everything has a value: there is no QP.
    NonFiniteDerivative {
        /// Where it is in the QP: `A`, `B` of dynamics, `C`, `D` of constraints, gradients of
        /// costs; `Q`, `R`, `S` are second derivatives.
        field: QpField,
        /// The stage.
        stage: usize,
        /// What is differentiated: a state at the end of the interval or a constraint; or the first
        /// variable of a second derivative.
        of: &'static str,
        /// The output of a constraint; zero of others.
        output: usize,
        /// The variable.
        by: &'static str,
        /// The value.
        value: f64,
        /// Which of the [phases](crate::ocp::Phases), from 0 on, if there are several.
        phase: Option<u32>,
    },
    /// A derivative of the solution is not finite: numbers of the problem are too far from one.
    NonFiniteSensitivity {
        /// The stage.
        stage: usize,
        /// The state or control of the solution.
        of: &'static str,
        /// What it is differentiated by: a state at the start, or a parameter.
        by: &'static str,
        /// The value.
        value: f64,
    },
    /// An interval has no result.
    Integration {
        /// Which.
        interval: usize,
        /// Why.
        error: Error,
        /// Which of the [phases](crate::ocp::Phases), from 0 on, if there are several.
        phase: Option<u32>,
    },
    /// The simulation of a guess ends in an interval
    /// ([`Ocp::guess_by_simulation`](crate::ocp::Ocp::guess_by_simulation)).
    Simulation {
        /// Which.
        interval: u32,
        /// The largest state at its start.
        state: &'static str,
        /// Its value, in single precision.
        value: f32,
        /// Why.
        error: Error,
    },
    /// Stages of intervals are variables, as of `Collocation`: a simulation needs an integrator,
    /// `Ocp::guess_by_simulation_with`.
    NoIntegrator,
    /// Data say nothing of a variable, or of a combination that it is part of: it has no variance.
    NotIdentifiable {
        /// The state or control.
        name: &'static str,
        /// The stage.
        stage: usize,
    },
    /// An integrator beside the problem, as that of a simulation, has no result.
    Integrator(Error),
    /// A batch beside the problem was given slices of different lengths.
    #[cfg(feature = "alloc")]
    Batch(BatchError),
    /// There are no consistent states to start from.
    Inconsistent(Inconsistent),
    /// States are periodic or controls shared: feedback gains are not defined.
    /// [`Ocp::differentiate`](crate::ocp::Ocp::differentiate) has `du/dx₀`.
    Coupled,
    /// Parameters are free: derivatives of solutions by the others are not known there.
    FreeParameters,
    /// The last run did not end at a solution: there are no derivatives of it.
    NoSolution,
    /// The end of the horizon is free, and no parameter of the model is its duration.
    FixedEndTime {
        /// The model.
        model: &'static str,
    },
    /// Something that cannot be said of this problem.
    Unsupported {
        /// What.
        what: &'static str,
        /// What can be said instead.
        remedy: &'static str,
    },
    /// The end of the horizon is free, and a function depends on the time of the integrator.
    DependsOnTime {
        /// The function.
        function: &'static str,
    },
    /// Points inside of intervals are parts of these that increase, between 0 and 1.
    InvalidPoint {
        /// Which of the points.
        index: usize,
        /// The part of an interval.
        value: f64,
    },
    /// The model has no parameter of this name.
    UnknownParameter {
        /// The name.
        name: Text,
        /// Those that there are.
        known: &'static Names,
    },
    /// The guess of a free parameter is outside of its range.
    OutOfRange {
        /// The parameter.
        name: &'static str,
        /// The guess.
        value: f64,
        /// The range.
        lower: f64,
        /// Its end.
        upper: f64,
    },
    /// An option of the solver is out of its range.
    InvalidOption {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        allowed: &'static str,
    },
    /// A link between phases does not fit them.
    LinkDimension {
        /// The function of the link.
        link: &'static str,
        /// Which of its arguments, or its outputs.
        what: &'static str,
        /// The length that the phases ask for.
        expected: usize,
        /// Its length.
        found: usize,
    },
    /// Something that a phase of several cannot have.
    Phase {
        /// Which, from 0 on.
        phase: usize,
        /// Its model.
        model: &'static str,
        /// What.
        what: &'static str,
    },
    /// The QP has no solution.
    Qp(QpError),
    /// Memory could not be allocated.
    OutOfMemory {
        /// How much was asked for.
        bytes: usize,
    },
}

impl OcpError {
    /// As an error of this phase.
    #[cfg(feature = "alloc")]
    pub(in crate::ocp) fn in_phase(mut self, index: usize) -> Self {
        if let Self::Integration { phase, .. }
        | Self::NonFiniteFunction { phase, .. }
        | Self::NonFiniteDerivative { phase, .. } = &mut self
        {
            *phase = u32::try_from(index).ok();
        }
        self
    }
}

impl From<QpError> for OcpError {
    fn from(error: QpError) -> Self {
        match error {
            QpError::OutOfMemory { bytes } => Self::OutOfMemory { bytes },
            error => Self::Qp(error),
        }
    }
}

impl From<Error> for OcpError {
    fn from(error: Error) -> Self {
        match error {
            Error::OutOfMemory { bytes } => Self::OutOfMemory { bytes },
            error => Self::Integrator(error),
        }
    }
}

#[cfg(feature = "alloc")]
impl From<BatchError> for OcpError {
    fn from(error: BatchError) -> Self {
        match error {
            BatchError::Intervals { first, error, .. } => {
                Self::Integration { interval: first, error, phase: None }
            }
            BatchError::Integrator(error) => error.into(),
            BatchError::OutOfMemory { bytes } => Self::OutOfMemory { bytes },
            error @ BatchError::Length { .. } => Self::Batch(error),
        }
    }
}

impl From<Inconsistent> for OcpError {
    fn from(error: Inconsistent) -> Self {
        Self::Inconsistent(error)
    }
}
