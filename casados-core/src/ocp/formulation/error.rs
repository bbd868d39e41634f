//! Every mistake in a problem, and what can go wrong where it is evaluated; `messages` say it.

#[cfg(feature = "alloc")]
use crate::batch::BatchError;
use crate::constrained::Inconsistent;
use crate::error::Error;
use crate::ocp::formulation::names::Names;
use crate::qp::{QpError, QpField, Side};
use core::fmt;

/// A part of a problem.
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # #[function]
/// # fn effort(_x: [f64; 2], u: f64) -> f64 { u }
/// # let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
/// #     .running_cost(LeastSquaresCost::<Effort>::diagonal(&[1.0]))
/// #     .on(Horizon::uniform(10, 0.1))?;
/// # ocp.fix_initial_state(&[0.0, 0.0])?.bound("x[0]", 10.., 1.0, 1.0)?;
/// # ocp.guess(&[0.0, 0.0], &[0.0])?;
/// // Two states, but one number.
/// let error = ocp.fix_initial_state(&[0.0]).unwrap_err();
/// let part = Part::InitialState;
/// assert!(matches!(error, OcpError::Length { part: p, expected: 2, found: 1, .. } if p == part));
/// println!("{error}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Part {
    /// The nodes in time.
    Times,
    /// States.
    States,
    /// Controls.
    Controls,
    /// Multipliers.
    Multipliers,
    /// Parameters.
    Parameters,
    /// Ranges of free parameters.
    ParameterBounds,
    /// The state at the start.
    InitialState,
    /// Weights of an arrival cost.
    Arrival,
    /// Reference of the stage cost.
    Reference,
    /// Reference of the terminal cost.
    TerminalReference,
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
/// let error = ocp.bound("v", .., -1.0, 1.0).err().ok_or("there is one")?;
/// assert!(matches!(error, OcpError::UnknownName { name, .. } if name.as_str() == "v"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Text {
    bytes: [u8; 32],
    length: usize,
}

impl Text {
    pub(in crate::ocp) fn new(text: &str) -> Self {
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
/// ocp.bound("u", .., -0.01, 0.01)?.bound("x", 20.., 0.0, 0.0)?;
/// let outcome = HeapSqp::new(&ocp)?.solve(&mut ocp)?;
/// let Status::Infeasible { constraint, violation } = outcome.status else { return Err("there is a way".into()) };
/// println!("{constraint}: {violation:.1}"); // "the upper bound of `x` at stage 20: 0.8"
/// assert!((constraint.name, constraint.stage) == ("x", 20) && (violation - 0.8).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
        /// What, and what can be said instead.
        what: &'static str,
    },
    /// The end of the horizon is free, and a function depends on the time of the integrator.
    DependsOnTime {
        /// The function.
        function: &'static str,
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
            BatchError::Intervals { first, error, .. } => Self::Integration { interval: first, error },
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
