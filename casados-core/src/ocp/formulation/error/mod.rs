//! Errors of a problem and of its evaluation; `messages` formats them.

mod named;

pub use named::{ConstraintName, Part, Text};

#[cfg(feature = "alloc")]
use crate::batch::BatchError;
use crate::constrained::Inconsistent;
use crate::error::Error;
use crate::ocp::formulation::names::Names;
use crate::qp::{QpError, QpField};

/// An error in a problem or in its evaluation, with names, stage and values.
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
    /// No variable has this name.
    UnknownName {
        /// The name.
        name: Text,
        /// The names of the model.
        known: &'static Names,
    },
    /// A phase that joined phases do not have.
    NoSuchPhase {
        /// The phase.
        phase: usize,
        /// The number of phases.
        phases: usize,
    },
    /// A stage that the horizon does not have.
    NoSuchStage {
        /// The part to be set.
        part: Part,
        /// The stage.
        stage: usize,
        /// The number of stages with this part.
        stages: usize,
    },
    /// An empty range of stages.
    EmptyRange {
        /// The part to be set.
        part: Part,
        /// The start of the range.
        start: usize,
        /// The end of the range (exclusive).
        end: usize,
        /// The number of stages with this part.
        stages: usize,
    },
    /// There are no bounds to be softened.
    NoBound {
        /// The name of the variables or constraints.
        name: Text,
        /// The first stage.
        start: usize,
        /// The stage after the last one.
        end: usize,
    },
    /// A length differs from that of the problem.
    Length {
        /// The part with this length.
        part: Part,
        /// The stage; 0 for the whole horizon.
        stage: usize,
        /// The required length.
        expected: usize,
        /// The given length.
        found: usize,
    },
    /// A number is infinite or NaN where it must be finite, or a penalty is negative.
    InvalidValue {
        /// The part.
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
    /// The weights of a least-squares cost are not a symmetric, positive semidefinite matrix.
    InvalidWeight {
        /// The function.
        function: &'static str,
        /// The row and the column: two of its outputs.
        outputs: [usize; 2],
        /// The weight.
        value: f64,
        /// The requirement.
        allowed: &'static str,
    },
    /// The weights of an arrival cost are not a symmetric, positive semidefinite matrix.
    InvalidArrivalWeight {
        /// The row and the column: two of the states.
        states: [&'static str; 2],
        /// The weight.
        value: f64,
        /// The requirement.
        allowed: &'static str,
    },
    /// The times of the nodes do not increase.
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
        /// The kind of bounds.
        part: Part,
        /// The stage.
        stage: usize,
        /// The state, control or function.
        name: &'static str,
        /// The element, or the output of the function.
        index: usize,
        /// The lower bound.
        lower: f64,
        /// The upper bound.
        upper: f64,
    },
    /// A required part is not set.
    Missing {
        /// The part.
        part: Part,
        /// The stage.
        stage: usize,
    },
    /// A cost or constraint depends on a variable that does not exist at its node: algebraic states
    /// or controls at the end of the horizon, algebraic states of a map.
    NotThere {
        /// The function.
        function: &'static str,
        /// The variable.
        variable: &'static str,
        /// Whether the node is the end of the horizon.
        terminal: bool,
    },
    /// A function has a value that is not finite.
    NonFiniteFunction {
        /// Its name.
        function: &'static str,
        /// The stage.
        stage: usize,
        /// The output; zero for a sum.
        output: usize,
        /// The value.
        value: f64,
        /// Which of the [phases](crate::ocp::Phases), from 0 on, if there are several.
        phase: Option<u32>,
    },
    /// A derivative is not finite at a point where all functions are: there is no QP.
    NonFiniteDerivative {
        /// The part of the QP: `A`, `B` of dynamics, `C`, `D` of constraints, gradients of costs;
        /// `Q`, `R`, `S` are second derivatives.
        field: QpField,
        /// The stage.
        stage: usize,
        /// The differentiated quantity: a state at the end of the interval or a constraint; or the
        /// first variable of a second derivative.
        of: &'static str,
        /// The output of a constraint, otherwise zero.
        output: usize,
        /// The variable of the derivative.
        by: &'static str,
        /// The value.
        value: f64,
        /// Which of the [phases](crate::ocp::Phases), from 0 on, if there are several.
        phase: Option<u32>,
    },
    /// A derivative of the solution is not finite: the problem is badly scaled.
    NonFiniteSensitivity {
        /// The stage.
        stage: usize,
        /// The state or control of the solution.
        of: &'static str,
        /// The variable of the derivative: an initial state or a parameter.
        by: &'static str,
        /// The value.
        value: f64,
    },
    /// The integration of an interval failed.
    Integration {
        /// The interval.
        interval: usize,
        /// The error of the integrator.
        error: Error,
        /// Which of the [phases](crate::ocp::Phases), from 0 on, if there are several.
        phase: Option<u32>,
    },
    /// The simulation of a guess failed in an interval
    /// ([`Ocp::guess_by_simulation`](crate::ocp::Ocp::guess_by_simulation)).
    Simulation {
        /// The interval.
        interval: u32,
        /// The largest state at its start.
        state: &'static str,
        /// Its value, in single precision.
        value: f32,
        /// The error of the integrator.
        error: Error,
    },
    /// The dynamics have stages as variables, as `Collocation` has: a simulation needs an
    /// integrator, `Ocp::guess_by_simulation_with`.
    NoIntegrator,
    /// The data do not determine a variable, or a combination with it: it has no variance.
    NotIdentifiable {
        /// The state or control.
        name: &'static str,
        /// The stage.
        stage: usize,
    },
    /// A separate integrator, as that of a simulation, failed.
    Integrator(Error),
    /// A separate batch was given slices of different lengths.
    #[cfg(feature = "alloc")]
    Batch(BatchError),
    /// No consistent initial states were found.
    Inconsistent(Inconsistent),
    /// States are periodic or controls shared: feedback gains are not defined.
    /// [`Ocp::differentiate`](crate::ocp::Ocp::differentiate) has `du/dx₀`.
    Coupled,
    /// Parameters are free: derivatives by the other parameters are not supported.
    FreeParameters,
    /// The last run did not end at a solution: derivatives are not defined.
    NoSolution,
    /// The end time is free, but no parameter of the model is its duration.
    FixedEndTime {
        /// The model.
        model: &'static str,
    },
    /// A feature that this problem does not support.
    Unsupported {
        /// The feature.
        what: &'static str,
        /// The alternative.
        remedy: &'static str,
    },
    /// A running cost, which is evaluated at nodes, depends on a control that is a polynomial in
    /// every interval.
    CostAtNodes {
        /// The function.
        function: &'static str,
        /// The coefficient of the control.
        coefficient: &'static str,
    },
    /// The end time is free, and a function depends on the time of the integrator.
    DependsOnTime {
        /// The function.
        function: &'static str,
    },
    /// Points inside intervals must be increasing fractions between 0 and 1.
    InvalidPoint {
        /// The index of the point.
        index: usize,
        /// The fraction.
        value: f64,
    },
    /// The model has no parameter of this name.
    UnknownParameter {
        /// The name.
        name: Text,
        /// The names of the model.
        known: &'static Names,
    },
    /// The guess of a free parameter is outside its range.
    OutOfRange {
        /// The parameter.
        name: &'static str,
        /// The guess.
        value: f64,
        /// The lower limit of the range.
        lower: f64,
        /// The upper limit of the range.
        upper: f64,
    },
    /// An option of the solver is out of its range.
    InvalidOption {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The allowed values.
        allowed: &'static str,
    },
    /// The dimensions of a link do not match its phases.
    LinkDimension {
        /// The function of the link.
        link: &'static str,
        /// The argument or the outputs with this dimension.
        what: &'static str,
        /// The dimension of the phases.
        expected: usize,
        /// The dimension of the link.
        found: usize,
    },
    /// A phase has a feature that phases do not support.
    Phase {
        /// The phase, counted from 0.
        phase: usize,
        /// The model of the phase.
        model: &'static str,
        /// The feature.
        what: &'static str,
    },
    /// The QP solver failed.
    Qp(QpError),
    /// Memory could not be allocated.
    OutOfMemory {
        /// The size of the allocation.
        bytes: usize,
    },
}

impl OcpError {
    /// Adds the phase to an error.
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
