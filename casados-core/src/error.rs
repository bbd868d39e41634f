//! Errors of all calls.

mod display;
mod place;

pub use place::{Argument, Place, Quantity};

use crate::tableau::TableauError;

/// The reason why there is no result, with its place and values.
///
/// After an error the integrator is usable, and its warm start is as before the call.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
///
/// #[ode]
/// fn growth(x: [f64; 1], u: [f64; 1]) -> [f64; 1] {
///     [u[0] * x[0].ln()]
/// }
///
/// let mut irk = Irk::<Growth, Gauss<2>>::new(Options::default())?;
/// match irk.solve(&vector![-1.0], &vector![1.0], 0.1) {
///     Err(error @ Error::NonFiniteModel { .. }) => println!("{error}"), // where, and the values
///     other => panic!("{other:?}"),
/// }
/// assert!(irk.solve(&vector![1.0], &vector![1.0], 0.1).is_ok()); // the integrator stays usable
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// An option has an invalid value.
    InvalidOption {
        /// Name of the option.
        option: &'static str,
        /// Value of the option.
        value: f64,
        /// The rule that it violates.
        reason: &'static str,
    },
    /// A tableau is invalid.
    Tableau(TableauError),
    /// An implicit tableau was given to an explicit integrator.
    NotExplicit {
        /// The stage that depends on itself or a later one.
        stage: usize,
    },
    /// An argument of a call has an element that is infinite or NaN.
    NonFiniteInput {
        /// The argument.
        argument: Argument,
        /// Index of the element; in column-major order for matrices.
        index: usize,
        /// Name of the element in the model; empty for times and lengths.
        name: &'static str,
        /// Value of the element.
        value: f64,
    },
    /// The model has parameters that were never set.
    ParametersNotSet,
    /// `Start::Given` is set, but start values were never given.
    StartNotGiven,
    /// The model returned an infinite value or NaN.
    NonFiniteModel {
        /// The quantity that was evaluated.
        quantity: Quantity,
        /// The equation, the row of the residual.
        equation: usize,
        /// The value.
        value: f64,
        /// Place of the evaluation.
        at: Place,
    },
    /// The model has no finite value at the start values of Newton's method, or at a later iterate,
    /// because of the value of an algebraic state.
    NonFiniteStart {
        /// The quantity that was evaluated.
        quantity: Quantity,
        /// The equation, the row of the residual.
        equation: usize,
        /// The value.
        value: f64,
        /// The algebraic state that causes it (the equation has a finite value at another value of
        /// the state), and its start value.
        started: Started,
        /// Place of the evaluation.
        at: Place,
    },
    /// The Newton matrix is singular to rounding: with this step size the equations do not
    /// determine the unknowns.
    Singular {
        /// The unknown whose column depends linearly on the preceding ones: an algebraic state, or
        /// the state of a derivative.
        unknown: &'static str,
        /// Place of the matrix.
        at: Place,
    },
    /// The planned elimination was too inaccurate, or Newton's method did not converge with it, and
    /// the integrator has no dense fallback:
    /// [`fallback::Refusing`](crate::memory::fallback::Refusing). Also for a model without a plan.
    NotPivoted {
        /// Index of the step.
        step: usize,
    },
    /// Newton's method did not converge.
    NotConverged {
        /// The largest residual of an equation, relative to the magnitude of its terms.
        residual: f64,
        /// The equation with this residual.
        equation: usize,
        /// The unknown with the largest last increment relative to its size.
        unknown: &'static str,
        /// The increment of this unknown.
        increment: f64,
        /// Place of the last iteration.
        at: Place,
        /// This unknown if it is an algebraic state, or an algebraic state of the equation, with
        /// its start value; `None` if there is none, or if the iteration started from a solution.
        started: Option<Started>,
    },
    /// Newton's method did not converge in a later step, and `∂f/∂(ẋ, z)` becomes singular between
    /// the initial guess of that step and the last iterate: the solution of the algebraic equations
    /// may end at a fold.
    SingularAlgebraic {
        /// The algebraic state along which the matrix becomes singular.
        unknown: &'static str,
        /// Place of the last iteration.
        at: Place,
    },
    /// No consistent `ẋ` and `z` exist for the initial `x` of an adaptive integration, or Newton's
    /// method does not find them from the values of `set_start`.
    InconsistentStart {
        /// The time.
        t: f64,
        /// The equation with the largest violation.
        equation: usize,
        /// Residual of this equation at the last iterate.
        residual: f64,
        /// The unknown that the equations do not determine, otherwise the one with the largest
        /// change: an algebraic state, or the state of a derivative.
        unknown: &'static str,
        /// Value of the unknown at the last iterate.
        value: f64,
        /// Whether the equations do not determine the unknown.
        singular: bool,
    },
    /// An unknown of the stages or a result exceeds the range of the number type.
    Overflow {
        /// Index of the step.
        step: usize,
        /// Index of the unknown `(ẋ, z)`, or of the element of the result in column-major order.
        index: usize,
    },
    /// An integrand, event function or jump has a value that is not finite.
    NonFiniteFunction {
        /// Name of the function.
        function: &'static str,
        /// Index of the output.
        output: usize,
        /// The value.
        value: f64,
        /// Place of the evaluation.
        at: Place,
    },
    /// The step size underflows: an adaptive integrator cannot continue beyond this time.
    StepSizeUnderflow {
        /// The time that was reached.
        t: f64,
        /// The next step size.
        h: f64,
        /// Why the last step was rejected.
        reason: Refusal,
        /// If Newton's method did not converge: the equation and the unknown that do not settle.
        unsettled: Option<Unsettled>,
    },
    /// An adaptive integrator exceeds the maximal number of steps.
    TooManySteps {
        /// The time that was reached.
        t: f64,
        /// Number of attempted steps.
        steps: usize,
        /// Whether the method is explicit, and most steps were limited by its stability instead of
        /// the error.
        stiff: bool,
        /// Factor by which tolerances must be increased, if the method is explicit and most steps
        /// were limited by rounding errors of the model: about half of `max_steps` then suffice.
        rounding: Option<f64>,
    },
    /// A time outside the interval of the last successful call.
    OutsideInterval {
        /// The time.
        t: f64,
        /// Start of the interval.
        start: f64,
        /// End of the interval.
        end: f64,
    },
    /// Times in a list (ends of intervals, or output times) are not in order: each must lie between
    /// the preceding one and the end.
    Unordered {
        /// Index in the list.
        index: usize,
        /// The time.
        t: f64,
        /// The preceding time, or the start.
        before: f64,
        /// The end.
        end: f64,
    },
    /// Events accumulate at a time (Zeno's paradox), as those of a bouncing ball before it comes to
    /// rest.
    AccumulatingEvents {
        /// The accumulation time, extrapolated from the last three events.
        t: f64,
        /// The event function.
        function: &'static str,
        /// Index of the event.
        event: usize,
        /// Number of events so far.
        events: usize,
    },
    /// The number of events exceeds its maximum.
    TooManyEvents {
        /// The time that was reached.
        t: f64,
        /// Number of events so far.
        events: usize,
    },
    /// An event function touches zero without crossing it (grazing): the event time has no
    /// derivative.
    Grazing {
        /// Index of the event.
        event: usize,
        /// The event function.
        function: &'static str,
        /// The event time.
        t: f64,
    },
    /// Second derivatives across an event whose function depends on algebraic states are not
    /// available.
    GuardOfAlgebraicStates {
        /// The event function.
        function: &'static str,
    },
    /// Second derivatives across an event require that neither the model nor the event functions
    /// depend on the time; first ones across an event of algebraic states require it of the model.
    DependsOnTime {
        /// What depends on the time.
        function: &'static str,
    },
    /// The number of controls differs from the number of intervals, or there is no interval.
    Intervals {
        /// Number of controls.
        controls: usize,
        /// Number of ends of intervals.
        ends: usize,
    },
    /// The nodes of the tableau define no polynomial through the stages: dense output, and
    /// algebraic states at the ends of the interval, are not available.
    NoInterpolation,
    /// The result of the last successful call was requested before any call succeeded.
    NoResult,
    /// The final state could not be projected onto the invariants of the model.
    NotProjected {
        /// Equation of the constraint with the largest violation.
        equation: u32,
        /// Order of the derivative of the constraint.
        derivative: u32,
        /// The largest violation.
        residual: f64,
    },
    /// The memory of a mode could not be allocated.
    OutOfMemory {
        /// Size of the memory; the maximum of `usize` if it overflows.
        bytes: usize,
    },
}

impl From<TableauError> for Error {
    fn from(error: TableauError) -> Self {
        Self::Tableau(error)
    }
}

/// Why a step was rejected.
///
/// ```
/// # use casados::error::Refusal;
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// The tangent: it has a pole at π/2.
/// # #[ode]
/// # fn tangent(x: f64) -> f64 { 1.0 + x * x }
/// // x = tan t has a pole at π/2, which steps approach until none is short enough.
/// let options = AdaptiveOptions { max_steps: 100_000, ..Default::default() };
/// let mut radau = Adaptive::<Tangent, Radau>::new(options)?;
/// let error = radau.solve(&vector![0.0], &vector![], 2.0).unwrap_err();
/// let Error::StepSizeUnderflow { t, reason, .. } = error else { panic!("{error}") };
/// assert!((t - core::f64::consts::FRAC_PI_2).abs() < 1e-3);
/// println!("{reason:?}");
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Refusal {
    /// The estimated error was too large.
    Error,
    /// Newton's method did not converge.
    NotConverged,
    /// The Newton matrix was singular.
    Singular,
    /// `∂f/∂(ẋ, z)` becomes singular at the end of the last step: two solutions of the algebraic
    /// equations meet and end there (fold).
    SingularAlgebraic {
        /// The algebraic state along which the matrix becomes singular.
        unknown: &'static str,
    },
    /// The model returned an infinite value or NaN, or numbers overflowed.
    NotFinite,
    /// The interval is shorter than the spacing of floating-point numbers at the time.
    Resolution,
}

/// An algebraic state, and its start value in Newton's method.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// An acid: of its ions z the logarithm is needed.
/// # #[dae]
/// # fn acid(xdot: f64, x: f64, z: f64) -> [f64; 2] { [xdot + z, z.ln() - x] }
/// // No start value is given, and `z.ln()` has no value at zero.
/// let mut irk = Irk::<Acid, RadauIIA<2>>::new(Options::default())?;
/// let error = irk.solve(&vector![1.0], &vector![], 0.1).unwrap_err();
/// let Error::NonFiniteStart { started, .. } = error else { panic!("{error}") };
/// assert_eq!((started.unknown, started.value), ("z", 0.0));
/// // With one there is a solution.
/// irk.set_start(&vector![0.0], &vector![1.0])?;
/// let z0 = irk.solve(&vector![1.0], &vector![], 1e-3)?.z0[0];
/// assert!((z0 - 1.0_f64.exp()).abs() < 1e-4);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Started {
    /// Name of the state.
    pub unknown: &'static str,
    /// Its start value.
    pub value: f64,
}

/// The equation and the unknown that do not settle, if Newton's method converges for no step size.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// /// A load that grows, and the voltage that supplies it: `z = √(1 − x)`.
/// #[dae(nominal(z = 1.0))]
/// fn collapse(xdot: f64, x: f64, z: f64) -> [f64; 2] { [xdot - 1.0, z * z - 1.0 + x] }
///
/// let mut radau = Adaptive::<Collapse, Radau>::new(AdaptiveOptions::default())?;
/// let error = radau.solve(&vector![0.0], &vector![], 2.0).unwrap_err();
/// let Error::StepSizeUnderflow { t, unsettled: Some(unsettled), .. } = error else { panic!("{error}") };
/// assert!((t - 1.0).abs() < 1e-6);
/// assert_eq!((unsettled.equation, unsettled.unknown), (1, "z"));
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Unsettled {
    /// The equation with the largest residual relative to its terms, at the end of the last
    /// iteration.
    pub equation: usize,
    /// Residual of this equation, relative to its terms.
    pub residual: f64,
    /// The unknown with the largest last increment relative to its tolerance: an algebraic state,
    /// or the state of a derivative.
    pub unknown: &'static str,
    /// Value of this state at the time that was reached.
    pub value: f64,
    /// Whether the state is algebraic.
    pub algebraic: bool,
}
