//! What can be chosen about an integrator.

use crate::error::Error;

/// Solutions without a digit that is right are none.
const MAX_RTOL: f64 = 0.1;
/// Newton's method is there after a few dozens, or never.
const MAX_ITERATIONS: usize = 10_000;

/// What can be chosen about an integrator.
///
/// Newton's method to rounding and one step are the defaults. A later version may have more fields:
/// write `..Default::default()`.
///
/// # Errors
/// What makes no sense is [`Error::InvalidOption`] of the integrator that is made with it.
///
/// # Example
/// ```
/// use casados::options::{Jacobian, Newton, Start};
/// use casados::prelude::*;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
///
/// let newton = Newton { tolerance: 1e-8, jacobian: Jacobian::Frozen, ..Default::default() };
/// let options = Options { steps: 4, newton, start: Start::Warm, ..Default::default() };
/// assert!(Irk::<Cart, Gauss<2>>::new(options).is_ok());
/// let none = Options { steps: 0, ..options };
/// assert!(matches!(Irk::<Cart, Gauss<2>>::new(none), Err(Error::InvalidOption { option: "steps", .. })));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Steps of equal size in one interval, at least one. Default 1.
    pub steps: usize,
    /// How the stages of an implicit method are solved; explicit methods do not read it.
    /// Default: those of [`Newton`].
    pub newton: Newton,
    /// Where Newton's method starts. Default [`Start::Nominal`].
    pub start: Start,
    /// Whether what the sum over the steps rounds off is carried along to the next step (Kahan's
    /// summation), and implicit methods compute the sums of their stages with twice the digits: for
    /// thousands of steps in one interval, where rounding errors of `x` would add up.
    /// Default false.
    pub compensated: bool,
}

impl Default for Options {
    /// One step; Newton to rounding, from the nominal values of the model.
    fn default() -> Self {
        Self { steps: 1, newton: Newton::default(), start: Start::default(), compensated: false }
    }
}

/// How the equations of the stages are solved.
///
/// A later version may have more fields: write `..Default::default()`.
///
/// ```
/// use casados::options::Newton;
///
/// // The same run time in every call.
/// let newton = Newton { fixed_iterations: Some(3), ..Default::default() };
/// assert_eq!(newton.tolerance, 0.0); // to rounding, if iterations were not fixed
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Newton {
    /// The iteration ends when its error is expected below this, relative to the size of each
    /// unknown (of a derivative `ẋ` also below `|x/h|`, the change that rounds to none in `x`).
    /// Between zero and 0.1; zero, the default, means rounding: a few units in the last place of
    /// the number type.
    pub tolerance: f64,
    /// With a tolerance: more iterations than these are the error `NotConverged`. Between 1 and
    /// 10000; 50 by default.
    pub max_iterations: usize,
    /// Which Jacobian the iteration takes. Sensitivities always take the one of the solution.
    /// Default [`Jacobian::Auto`].
    pub jacobian: Jacobian,
    /// Exactly these iterations, between 1 and 10000, and no test for convergence: the same run
    /// time in every call. Default `None`: as many as the tolerance asks for.
    pub fixed_iterations: Option<usize>,
}

impl Default for Newton {
    fn default() -> Self {
        Self { tolerance: 0.0, max_iterations: 50, jacobian: Jacobian::Auto, fixed_iterations: None }
    }
}

/// The Jacobian in Newton's method.
///
/// ```
/// use casados::options::{Jacobian, Newton};
///
/// assert_eq!(Newton::default().jacobian, Jacobian::Auto);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Jacobian {
    /// That of the start values in the first step, that of the last step in later ones; evaluated
    /// and factorised anew as soon as the iterations that are still expected with it cost more (by
    /// the counts of operations in the model's structure, and the rate at which increments shrink,
    /// or after the first one the residual). With three stages or more a new one is `Simplified` up
    /// to three times in a step. With a fixed number of iterations as `Full`.
    #[default]
    Auto,
    /// The mean of the stages' Jacobians, in the eigenbasis of the tableau; renewed as with `Auto`.
    /// Tableaux of one or two stages, or without such a basis, take `Auto`.
    Simplified,
    /// Evaluated and factorised in every iteration. No increment is rejected for its growth, as
    /// those of older Jacobians are: the iterates are those of Newton's method.
    Full,
    /// Evaluated and factorised once in each step, at the start values; once more only where
    /// increments do not shrink to half of the last one. (With a fixed number of iterations this is
    /// not asked.)
    Frozen,
}

impl Jacobian {
    /// Whether old factors, and those of the mean of the stages, do as long as they cost less than
    /// new ones.
    pub(crate) fn is_adaptive(self) -> bool {
        matches!(self, Self::Auto | Self::Simplified)
    }
}

/// Where Newton's method starts in the first step of a call.
///
/// In the steps after it the start is the polynomial through the stages of the step before; with
/// five stages or more the algebraic states start at those of its last stage. So a call stays on
/// the branch on which its first step was.
///
/// Where the equations have several roots, as `z² = x` does, the start decides for one, and a root
/// that nobody wants looks like any other: say where the model lives, `#[dae(nominal(z = 0.1))]`,
/// or give values with `set_start`. Where a residual has no value at `z = 0`, as that of `ln z`, or
/// a matrix there is singular, as that of `z² = x`, there is no solution without such values.
///
/// ```
/// use casados::options::Start;
/// use casados::prelude::*;
/// use nalgebra::vector;
///
/// /// `z² = x` has two roots; the model lives on the positive one.
/// #[dae(nominal(z = 1.0))]
/// fn tank(xdot: [f64; 1], x: [f64; 1], z: [f64; 1], u: [f64; 1]) -> [f64; 2] {
///     [xdot[0] - u[0] + z[0], z[0] * z[0] - x[0]]
/// }
///
/// let mut irk = Irk::<Tank, RadauIIA<2>>::new(Options::default())?;
/// assert!(irk.solve(&vector![4.0], &vector![2.0], 0.1)?.z[0] > 0.0);
///
/// let mut irk = Irk::<Tank, RadauIIA<2>>::new(Options { start: Start::Given, ..Default::default() })?;
/// irk.set_start(&vector![0.0], &vector![-1.0])?;
/// assert!(irk.solve(&vector![4.0], &vector![2.0], 0.1)?.z[0] < 0.0);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Start {
    /// The values of `set_start` if it was called, else the nominal values of the model,
    /// [`Dae::START`](crate::Dae::START): `z` at its `nominal(..)`, or, where there is none, at the
    /// geometric mean of a `range(..)` that does not contain zero; else at zero. `ẋ` is zero,
    /// unless the equations are nonlinear in it and it has a nominal value. The same input gives
    /// the same bits in every call.
    #[default]
    Nominal,
    /// `ẋ = 0` and `z = 0`, whatever the nominal values are.
    Zero,
    /// The values of `set_start`; an error if it was not called.
    Given,
    /// The stages of the same step in the last successful call; in the first one as with `Nominal`.
    /// A branch that was found once is kept from call to call, until `reset`.
    Warm,
}

impl Options {
    /// Stages lifted to the level of a problem of optimal control, which then solves their
    /// equations too: each call takes one iteration, from the stages of the last one (in the first
    /// call from the nominal values). Stages converge with the iterates instead of in every one of
    /// them, and at convergence agree with those of any other options (R. Quirynen, S. Gros, M.
    /// Diehl, "Lifted implicit integrators for direct optimal control", CDC 2015). Until then ends
    /// of intervals have errors of second order in the last step; derivatives are exact at the
    /// stages that there are. Whether that saves more than an iteration more of the problem costs
    /// is to be measured.
    ///
    /// ```
    /// # use casados_core::options::{Options, Start};
    /// let options = Options { steps: 2, ..Default::default() }.lifted();
    /// assert_eq!((options.start, options.newton.fixed_iterations), (Start::Warm, Some(1)));
    /// ```
    #[must_use]
    pub fn lifted(self) -> Self {
        let newton = Newton { fixed_iterations: Some(1), ..self.newton };
        Self { newton, start: Start::Warm, ..self }
    }

    /// # Errors
    /// [`Error::InvalidOption`] for the first value that makes no sense.
    pub fn check(&self) -> Result<(), Error> {
        let invalid = |option, value, reason| Err(Error::InvalidOption { option, value, reason });
        if self.steps == 0 {
            return invalid("steps", 0.0, "an interval has at least one step");
        }
        let newton = &self.newton;
        if !(0.0..=MAX_RTOL).contains(&newton.tolerance) {
            return invalid("newton.tolerance", newton.tolerance, "a tolerance is between 0 and 0.1");
        }
        let limits = [
            ("newton.max_iterations", Some(newton.max_iterations)),
            ("newton.fixed_iterations", newton.fixed_iterations),
        ];
        for (option, iterations) in limits {
            if let Some(count) = iterations.filter(|count| !(1..=MAX_ITERATIONS).contains(count)) {
                return invalid(option, count as f64, "Newton's method takes between 1 and 10000 iterations");
            }
        }
        Ok(())
    }
}
