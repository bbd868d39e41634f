//! Options of integrators.

use crate::error::Error;

/// The largest relative tolerance: one correct digit.
const MAX_RTOL: f64 = 0.1;
/// The largest number of iterations; Newton's method converges within a few dozen, if at all.
const MAX_ITERATIONS: usize = 10_000;

/// Options of an integrator.
///
/// The defaults are one step, and Newton's method to rounding. A later version may have more
/// fields: write `..Default::default()`.
///
/// # Errors
/// Invalid values are [`Error::InvalidOption`] of the constructor of the integrator.
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
    /// Number of equal steps in an interval, at least one. Default 1.
    pub steps: usize,
    /// Newton's method for the stages of an implicit method; explicit methods do not read it.
    /// Default: that of [`Newton`].
    pub newton: Newton,
    /// The initial guess of Newton's method. Default [`Start::Nominal`].
    pub start: Start,
    /// Whether sums over the steps are compensated (Kahan summation), and implicit methods compute
    /// the sums of their stages with twice the digits: for thousands of steps in one interval,
    /// where rounding errors of `x` accumulate. Default false.
    pub compensated: bool,
}

impl Default for Options {
    /// One step; Newton's method to rounding, from the nominal values of the model.
    fn default() -> Self {
        Self { steps: 1, newton: Newton::default(), start: Start::default(), compensated: false }
    }
}

/// Newton's method for the equations of the stages.
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
    /// Tolerance of the iteration: it ends when its predicted error is below this, relative to the
    /// size of each unknown; for a derivative `ẋ` an error below the rounding of `x/h`, which does
    /// not change `x`, is also accepted. Between zero and 0.1; zero, the default, means rounding: a
    /// few units in the last place of the number type.
    pub tolerance: f64,
    /// Maximal number of iterations with a tolerance; more are the error `NotConverged`. Between 1
    /// and 10000; default 50.
    pub max_iterations: usize,
    /// The Jacobian of the iteration. Sensitivities always use the Jacobian at the solution.
    /// Default [`Jacobian::Auto`].
    pub jacobian: Jacobian,
    /// A fixed number of iterations, between 1 and 10000, without a convergence test: every call
    /// has the same run time. Default `None`: iterations until convergence.
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
    /// The Jacobian of the initial guess in the first step, that of the last step in later ones;
    /// updated as soon as the predicted iterations with it cost more than an update. The prediction
    /// uses the operation counts of the model's structure and the contraction rate, or after the
    /// first increment the residual. With three stages or more an update is `Simplified`, at most
    /// three times in a step. With a fixed number of iterations as `Full`.
    #[default]
    Auto,
    /// The mean of the Jacobians of the stages, in the eigenbasis of the tableau (Butcher
    /// transformation); updated as with `Auto`. Tableaux of one or two stages, or without such a
    /// basis, use `Auto`.
    Simplified,
    /// Evaluated and factorised in every iteration. Increments are not rejected for their growth,
    /// as those with older Jacobians are: the iterates are those of Newton's method.
    Full,
    /// Evaluated and factorised once in each step, at the initial guess; updated only if increments
    /// do not halve. (A fixed number of iterations has no updates.)
    Frozen,
}

impl Jacobian {
    /// Whether old and shared Jacobians are used while they are cheaper than updates.
    pub(crate) fn is_adaptive(self) -> bool {
        matches!(self, Self::Auto | Self::Simplified)
    }
}

/// The initial guess of Newton's method in the first step of a call.
///
/// In later steps the initial guess is the polynomial through the stages of the preceding step;
/// with five stages or more the algebraic states start at those of its last stage. So a call stays
/// on the branch of its first step.
///
/// If the equations have several roots, as those of `z² = x`, the initial guess selects one, and an
/// undesired root is not detected: declare the range of the model, `#[dae(nominal(z = 0.1))]`, or
/// give values with `set_start`. If a residual has no value at `z = 0`, as that of `ln z`, or a
/// matrix is singular there, as that of `z² = x`, such values are required.
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
    /// The values of `set_start` if it was called, otherwise the nominal values of the model,
    /// [`Dae::START`](crate::Dae::START): `z` at its `nominal(..)`, or without one at the geometric
    /// mean of a `range(..)` that does not contain zero, otherwise at zero. `ẋ` is zero, unless the
    /// equations are nonlinear in it and it has a nominal value. Results are bitwise reproducible.
    #[default]
    Nominal,
    /// `ẋ = 0` and `z = 0`, independently of the nominal values.
    Zero,
    /// The values of `set_start`; an error if it was not called.
    Given,
    /// The stages of the same step in the last successful call; in the first call as `Nominal`. All
    /// calls stay on the branch that was found first, until `reset`.
    Warm,
}

impl Options {
    /// Returns options with lifted stages for an optimal control problem, which then solves their
    /// equations too: each call makes one iteration, from the stages of the last one (in the first
    /// call from the nominal values). Stages converge together with the iterates of the problem,
    /// and at convergence agree with those of any other options (R. Quirynen, S. Gros, M. Diehl,
    /// "Lifted implicit integrators for direct optimal control", CDC 2015). Until then, ends of
    /// intervals have errors of second order in the last step; derivatives are exact at the present
    /// stages. Measure whether it saves more than the additional iterations of the problem cost.
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

    /// Checks the options.
    ///
    /// # Errors
    /// [`Error::InvalidOption`] for the first invalid value.
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
