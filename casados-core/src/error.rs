//! All errors of integrators.

mod display;
mod place;

pub use place::{Argument, Place, Quantity};

use crate::tableau::TableauError;

/// The cause of a failed call, with its place and the values that explain it.
///
/// After an error the integrator remains usable, and its warm start is that before the call.
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
    /// An option is out of range.
    InvalidOption {
        /// The option.
        option: &'static str,
        /// Its value.
        value: f64,
        /// The reason.
        reason: &'static str,
    },
    /// A tableau is invalid.
    Tableau(TableauError),
    /// The tableau of an explicit integrator is implicit.
    NotExplicit {
        /// The stage that depends on itself or on a later one.
        stage: usize,
    },
    /// An element of an argument is infinite or NaN.
    NonFiniteInput {
        /// The argument.
        argument: Argument,
        /// The index of the element; for matrices in column-major order.
        index: usize,
        /// The name of the element in the model; empty for times and lengths.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// The model has parameters, and `set_parameters` was not called.
    ParametersNotSet,
    /// The option is `Start::Given`, and `set_start` was not called.
    StartNotGiven,
    /// The model returned an infinite value or NaN.
    NonFiniteModel {
        /// The evaluated quantity.
        quantity: Quantity,
        /// The equation: the row of the residual.
        equation: usize,
        /// The value.
        value: f64,
        /// The place.
        at: Place,
    },
    /// The model is not finite at the initial guess of Newton's method or an iterate, because of
    /// the value of an algebraic state.
    NonFiniteStart {
        /// The evaluated quantity.
        quantity: Quantity,
        /// The equation: the row of the residual.
        equation: usize,
        /// The value.
        value: f64,
        /// An algebraic state for which another value makes the equation finite, and its initial
        /// guess.
        started: Started,
        /// The place.
        at: Place,
    },
    /// The Newton matrix is singular to rounding: with this step size the equations do not
    /// determine the unknowns.
    Singular {
        /// The unknown whose column depends linearly on the preceding ones: the state whose
        /// derivative it is, or the algebraic state.
        unknown: &'static str,
        /// The place.
        at: Place,
    },
    /// The planned elimination lost too many digits, or Newton's method did not converge with it,
    /// and the memory of the integrator excludes pivoting of the whole matrix:
    /// [`fallback::Refusing`](crate::memory::fallback::Refusing). Also for a model without a plan.
    NotPivoted {
        /// The step.
        step: usize,
    },
    /// Newton's method did not converge.
    NotConverged {
        /// The largest residual of an equation relative to the magnitude of its terms.
        residual: f64,
        /// This equation.
        equation: usize,
        /// The unknown with the largest last increment relative to its magnitude.
        unknown: &'static str,
        /// This increment.
        increment: f64,
        /// The place of the last iteration.
        at: Place,
        /// One of these unknowns that is an algebraic state, and its initial guess; `None` if there
        /// is none, or if the initial guess continues a solution.
        started: Option<Started>,
    },
    /// Newton's method did not converge in a later step, and `∂f/∂z` becomes singular between the
    /// initial guess of that step and the last iterate: the solution of the algebraic equations may
    /// end at a fold.
    SingularAlgebraic {
        /// The algebraic state in the kernel of `∂f/∂z`.
        unknown: &'static str,
        /// The place of the last iteration.
        at: Place,
    },
    /// No `ẋ` and `z` satisfy the equations for the initial `x` of an adaptive integration, or
    /// Newton's method does not find them from the values of `set_start`.
    InconsistentStart {
        /// The time.
        t: f64,
        /// The equation with the largest violation.
        equation: usize,
        /// Its residual at the last iterate of Newton's method.
        residual: f64,
        /// The unknown that the equations do not determine, otherwise the one with the largest
        /// increment: the state whose derivative it is, or the algebraic state.
        unknown: &'static str,
        /// Its value at the last iterate of Newton's method.
        value: f64,
        /// Whether the equations do not determine it.
        singular: bool,
    },
    /// An unknown of the stages, or a result, overflows the number type.
    Overflow {
        /// The step.
        step: usize,
        /// The index of the unknown `(ẋ, z)`, or of the element of the result in column-major
        /// order.
        index: usize,
    },
    /// The value of an integrand, event function or jump is not finite.
    NonFiniteFunction {
        /// The name of the function.
        function: &'static str,
        /// The index of the output.
        output: usize,
        /// The value.
        value: f64,
        /// The place.
        at: Place,
    },
    /// An adaptive integrator reduced the step size below its minimum.
    StepSizeUnderflow {
        /// The reached time.
        t: f64,
        /// The size of the next step.
        h: f64,
        /// The reason of the last rejection.
        reason: Refusal,
        /// The equation and the unknown that do not converge, if Newton's method failed.
        unsettled: Option<Unsettled>,
    },
    /// An adaptive integrator exceeded [`max_steps`](crate::AdaptiveOptions::max_steps).
    TooManySteps {
        /// The reached time.
        t: f64,
        /// The number of attempted steps.
        steps: usize,
        /// Whether the problem is stiff: stability limited most steps of an explicit method.
        stiff: bool,
        /// The factor by which to increase the tolerances, if rounding errors of the model limited
        /// most steps of an explicit method: about half of `max_steps` then suffice.
        rounding: Option<f64>,
    },
    /// A time outside of the interval of the last successful call.
    OutsideInterval {
        /// The time.
        t: f64,
        /// The start of the interval.
        start: f64,
        /// The end of the interval.
        end: f64,
    },
    /// Ends of intervals or times of outputs that are not in order between the start and the end.
    Unordered {
        /// The index in the list.
        index: usize,
        /// The time.
        t: f64,
        /// The preceding time, or the start.
        before: f64,
        /// The end.
        end: f64,
    },
    /// Events accumulate at a time (Zeno's paradox), as when a bouncing ball comes to rest.
    AccumulatingEvents {
        /// The time at which they accumulate, extrapolated from the last four events.
        t: f64,
        /// The name of the event function.
        function: &'static str,
        /// The index of the event.
        event: usize,
        /// The number of events so far.
        events: usize,
    },
    /// More events than the maximum.
    TooManyEvents {
        /// The reached time.
        t: f64,
        /// The number of events so far.
        events: usize,
    },
    /// An event function touches zero without a crossing: the time of the event has no derivative.
    Grazing {
        /// The index of the event.
        event: usize,
        /// The name of its function.
        function: &'static str,
        /// Its time.
        t: f64,
    },
    /// Second derivatives are not available for an event function of algebraic states.
    GuardOfAlgebraicStates {
        /// The name of the function.
        function: &'static str,
    },
    /// The model or a function depends on time at an event, which second derivatives exclude; first
    /// derivatives exclude it for event functions of algebraic states.
    DependsOnTime {
        /// The name of the model or function that depends on time.
        function: &'static str,
    },
    /// The number of controls is not that of the intervals, or there is no interval.
    Intervals {
        /// The number of controls.
        controls: usize,
        /// The number of ends of intervals.
        ends: usize,
    },
    /// The nodes of the tableau do not define a polynomial through the stages: there is no dense
    /// output, and there are no algebraic states at the ends of the interval.
    NoInterpolation,
    /// A query about the last successful call, without such a call.
    NoResult,
    /// The end of an interval could not be projected onto the invariants of the model.
    NotProjected {
        /// The equation of the invariant with the largest violation.
        equation: u32,
        /// The order of the derivative of this equation that is the invariant.
        derivative: u32,
        /// The violation.
        residual: f64,
    },
    /// The memory of a mode could not be allocated.
    OutOfMemory {
        /// The size; `usize::MAX` if it overflows.
        bytes: usize,
    },
}

impl From<TableauError> for Error {
    fn from(error: TableauError) -> Self {
        Self::Tableau(error)
    }
}

/// The reason of a step rejection.
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
    /// `∂f/∂z` becomes singular at the end of the last step: two solutions of the algebraic
    /// equations merge, and none exists beyond (a fold).
    SingularAlgebraic {
        /// The algebraic state in the kernel of `∂f/∂z`.
        unknown: &'static str,
    },
    /// The model returned an infinite value or NaN, or the numbers overflowed.
    NotFinite,
    /// The interval is shorter than the resolution of the time.
    Resolution,
}

/// An algebraic state and its initial guess.
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
    /// The name of the state.
    pub unknown: &'static str,
    /// The initial guess.
    pub value: f64,
}

/// The equation and the unknown for which Newton's method fails at every step size.
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
    /// The equation with the largest residual relative to its terms at the last iterate.
    pub equation: usize,
    /// This relative residual.
    pub residual: f64,
    /// The unknown with the largest last increment relative to its tolerance: the state whose
    /// derivative it is, or the algebraic state.
    pub unknown: &'static str,
    /// The value of this state at the reached time.
    pub value: f64,
    /// Whether it is an algebraic state.
    pub algebraic: bool,
}
