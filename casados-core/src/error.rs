//! Every way in which a run can end without a result.

mod display;
mod place;

pub use place::{Argument, Place, Quantity};

use crate::tableau::TableauError;

/// Why there is no result: what, where, and the values that say so.
///
/// After an error the integrator is usable, and its warm start is as it was before the call.
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
    /// An option has a value that makes no sense.
    InvalidOption {
        /// The option.
        option: &'static str,
        /// Its value.
        value: f64,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// A tableau makes no sense.
    Tableau(TableauError),
    /// The tableau that was given to an explicit integrator is implicit.
    NotExplicit {
        /// The stage that needs itself or a later one.
        stage: usize,
    },
    /// An argument of a call has an element that is infinite or NaN.
    NonFiniteInput {
        /// The argument.
        argument: Argument,
        /// The element; of matrices in column-major order.
        index: usize,
        /// What the model calls it; empty of times and lengths.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// The model has parameters, and they were never set.
    ParametersNotSet,
    /// Start values were asked for with `Start::Given`, and they were never given.
    StartNotGiven,
    /// The model returned an infinite value or NaN.
    NonFiniteModel {
        /// What was evaluated.
        quantity: Quantity,
        /// The equation, the row of the residual.
        equation: usize,
        /// The value.
        value: f64,
        /// Where.
        at: Place,
    },
    /// The model has no finite value where Newton's method starts, or where it leads from there,
    /// because of the value of an algebraic state.
    NonFiniteStart {
        /// What was evaluated.
        quantity: Quantity,
        /// The equation, the row of the residual.
        equation: usize,
        /// The value.
        value: f64,
        /// The algebraic state with another value of which the equation has one, and where it
        /// started.
        started: Started,
        /// Where.
        at: Place,
    },
    /// The Newton matrix is singular to rounding: with this step size the equations do not
    /// determine the unknowns.
    Singular {
        /// The unknown whose column depends on those of the unknowns before it: the state whose
        /// derivative it is, or the algebraic state.
        unknown: &'static str,
        /// Where.
        at: Place,
    },
    /// The planned elimination was not good enough here, or Newton's method did not converge with
    /// it, and the memory of the integrator has no place to pivot the whole matrix:
    /// [`fallback::Refusing`](crate::memory::fallback::Refusing). Also of a model without a plan.
    NotPivoted {
        /// The step.
        step: usize,
    },
    /// Newton's method did not converge.
    NotConverged {
        /// The residual of an equation relative to the magnitude of its terms, the largest.
        residual: f64,
        /// The equation that has it.
        equation: usize,
        /// The unknown with the largest last increment relative to its size.
        unknown: &'static str,
        /// This increment.
        increment: f64,
        /// Where it ended.
        at: Place,
        /// An algebraic state of these, and its start value; if there is one, and the start was no
        /// continuation of a solution.
        started: Option<Started>,
    },
    /// Newton's method did not converge in a later step, and `∂f/∂z` becomes singular between the
    /// start values of that step and where the iteration led to: the algebraic equations may have
    /// lost their solution at a fold.
    SingularAlgebraic {
        /// The algebraic state along which it does.
        unknown: &'static str,
        /// Where the iteration ended.
        at: Place,
    },
    /// There are no `ẋ` and `z` that satisfy the equations for the `x` where an adaptive
    /// integration starts, or Newton's method does not find them from the values of `set_start`.
    InconsistentStart {
        /// The time.
        t: f64,
        /// The equation that is violated most.
        equation: usize,
        /// By how much: its residual where Newton's method ended.
        residual: f64,
        /// The unknown that the equations do not determine, or else the one that moved most: the
        /// state whose derivative it is, or the algebraic state.
        unknown: &'static str,
        /// Its value where Newton's method ended.
        value: f64,
        /// Whether the equations do not determine it.
        singular: bool,
    },
    /// An unknown of the stages, or a result, is beyond the range of the number type.
    Overflow {
        /// The step.
        step: usize,
        /// The unknown `(ẋ, z)`, or the element of the result in column-major order.
        index: usize,
    },
    /// A function that is integrated along has a value that is not finite.
    NonFiniteFunction {
        /// Its name.
        function: &'static str,
        /// Which of its outputs.
        output: usize,
        /// The value.
        value: f64,
        /// Where.
        at: Place,
    },
    /// No step size was short enough: an adaptive integrator cannot get beyond this time.
    StepSizeUnderflow {
        /// The time that was reached.
        t: f64,
        /// The step that would be next.
        h: f64,
        /// Why the one before was refused.
        reason: Refusal,
        /// Where Newton's method did not converge: what does not settle.
        unsettled: Option<Unsettled>,
    },
    /// An adaptive integrator needs more steps than its options allow.
    TooManySteps {
        /// The time that was reached.
        t: f64,
        /// How many steps were tried.
        steps: usize,
        /// Whether the method is explicit and its stability limited most of them, not the error.
        stiff: bool,
        /// The factor by which tolerances have to be larger, if the method is explicit and rounding
        /// errors of the model limited most steps: then about half of `max_steps` suffice.
        rounding: Option<f64>,
    },
    /// A time outside the interval of the last successful call.
    OutsideInterval {
        /// The time.
        t: f64,
        /// Begin of the interval.
        start: f64,
        /// End of the interval.
        end: f64,
    },
    /// Times of a list, ends of intervals or those of outputs, that are not in order: each lies
    /// between the one before it and the end.
    Unordered {
        /// Which one of the list.
        index: usize,
        /// The time.
        t: f64,
        /// The time before it, or the start.
        before: f64,
        /// The end.
        end: f64,
    },
    /// Events come sooner and sooner after each other, without end before a time (the paradox of
    /// Zeno): from there on a ball that bounces lies on the ground.
    AccumulatingEvents {
        /// The time at which they accumulate, as far as the last three foretell it.
        t: f64,
        /// The function of the event.
        function: &'static str,
        /// Which event it is.
        event: usize,
        /// How many events happened.
        events: usize,
    },
    /// More events than are allowed.
    TooManyEvents {
        /// The time that was reached.
        t: f64,
        /// How many events happened.
        events: usize,
    },
    /// A function touches zero and does not cross it: the time of the event has no derivative.
    Grazing {
        /// Which event.
        event: usize,
        /// Its function.
        function: &'static str,
        /// Its time.
        t: f64,
    },
    /// Second derivatives over an event of a function that looks at algebraic states.
    GuardOfAlgebraicStates {
        /// The function.
        function: &'static str,
    },
    /// Second derivatives over an event need that nothing there depends on the time; first ones
    /// over that of a function of algebraic states need it of the model.
    DependsOnTime {
        /// What does.
        function: &'static str,
    },
    /// Not one control for each interval, or no interval at all.
    Intervals {
        /// How many controls there are.
        controls: usize,
        /// How many ends of intervals there are.
        ends: usize,
    },
    /// The nodes of the tableau define no polynomial through the stages: there is no dense output,
    /// and there are no algebraic states at the ends of the interval.
    NoInterpolation,
    /// A question about the last successful call, and there was none.
    NoResult,
    /// The end of an interval could not be projected onto the invariants of the model.
    NotProjected {
        /// The equation of the invariant that is violated most.
        equation: u32,
        /// Which derivative of it the invariant is.
        derivative: u32,
        /// By how much.
        residual: f64,
    },
    /// The memory of a mode could not be allocated.
    OutOfMemory {
        /// Its size; the largest number if that is not even a number.
        bytes: usize,
    },
}

impl From<TableauError> for Error {
    fn from(error: TableauError) -> Self {
        Self::Tableau(error)
    }
}

/// Why a step was refused.
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
    /// Its estimated error was too large.
    Error,
    /// Newton's method did not converge.
    NotConverged,
    /// The Newton matrix was singular.
    Singular,
    /// `∂f/∂z` becomes singular at the end of the last step: two solutions of the algebraic
    /// equations meet there, and none is beyond (a fold).
    SingularAlgebraic {
        /// The algebraic state along which it does.
        unknown: &'static str,
    },
    /// The model returned an infinite value or NaN, or the numbers overflowed.
    NotFinite,
    /// The interval is shorter than the distance of the time from the next number.
    Resolution,
}

/// An algebraic state, and where Newton's method started for it.
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
    /// Its name.
    pub unknown: &'static str,
    /// Its start value.
    pub value: f64,
}

/// What does not settle where Newton's method converges in no step, however short.
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
    /// The equation with the largest residual beside its terms, where the last iteration ended.
    pub equation: usize,
    /// This residual relative to the terms.
    pub residual: f64,
    /// The unknown that the last increment changed most beside its tolerance: the state whose
    /// derivative it is, or the algebraic state.
    pub unknown: &'static str,
    /// The value of this state at the time that was reached.
    pub value: f64,
    /// Whether it is an algebraic state.
    pub algebraic: bool,
}
