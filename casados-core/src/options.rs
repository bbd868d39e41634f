//! Options of an integrator.

use crate::error::Error;

/// Maximum tolerance of Newton's method: one correct digit.
const MAX_RTOL: f64 = 0.1;
/// Maximum number of iterations; Newton's method converges within a few dozen.
const MAX_ITERATIONS: usize = 10_000;

/// Options of an integrator.
///
/// The defaults are one step, and Newton's method to rounding. Later versions may add fields: write
/// `..Default::default()`.
///
/// # Errors
/// Integrators return [`Error::InvalidOption`] for values out of range.
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
    /// Number of steps of equal size in one interval, at least one. Default 1.
    pub steps: usize,
    /// Options of Newton's method for the stages of an implicit method; explicit methods ignore it.
    /// Default: that of [`Newton`].
    pub newton: Newton,
    /// Initial guess of Newton's method. Default [`Start::Nominal`].
    pub start: Start,
    /// Whether the sum over the steps is compensated (Kahan summation), and implicit methods
    /// compute the sums over their stages in double-double arithmetic: for thousands of steps in
    /// one interval, in which rounding errors of `x` accumulate. Default false.
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
/// Later versions may add fields: write `..Default::default()`.
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
    /// The iteration ends when its predicted error is below this tolerance, relative to the
    /// magnitude of each unknown; for a derivative `ẋ` an error below the rounding of `x/h`, which
    /// does not change `x`, is also accepted. Between zero and 0.1; the default zero means
    /// rounding: a few units in the last place of the number type.
    pub tolerance: f64,
    /// Maximum number of iterations; more are the error `NotConverged`. Between 1 and 10000,
    /// default 50. Ignored with `fixed_iterations`.
    pub max_iterations: usize,
    /// The Jacobian of the iteration. Sensitivities always use the Jacobian at the solution.
    /// Default [`Jacobian::Auto`].
    pub jacobian: Jacobian,
    /// A fixed number of iterations, between 1 and 10000, without a convergence test: the same run
    /// time in every call. Default `None`: iterates until `tolerance` is met.
    pub fixed_iterations: Option<usize>,
}

impl Default for Newton {
    fn default() -> Self {
        Self { tolerance: 0.0, max_iterations: 50, jacobian: Jacobian::Auto, fixed_iterations: None }
    }
}

/// The update policy of the Jacobian in Newton's method.
///
/// ```
/// use casados::options::{Jacobian, Newton};
///
/// assert_eq!(Newton::default().jacobian, Jacobian::Auto);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Jacobian {
    /// Reuses the Jacobian of the last step (in the first step, of the initial guess), and
    /// evaluates and factorises a new one when the predicted iterations with the old one cost more.
    /// The costs are the operation counts of the model's structure; the contraction rate is
    /// measured by the increments or, after the first one, by the residual. With three stages or
    /// more a new Jacobian is as `Simplified` up to three times in a step. With a fixed number of
    /// iterations as `Full`.
    #[default]
    Auto,
    /// The average of the Jacobians at the stages, in the eigenbasis of the tableau; updated as
    /// with `Auto`. As `Auto` for tableaux with one or two stages, or without such a basis.
    Simplified,
    /// A new Jacobian and factorisation in every iteration: the exact Newton's method. Growing
    /// increments, which are rejected with older Jacobians, are applied.
    Full,
    /// One Jacobian and factorisation in each step, at the initial guess, and a second one only if
    /// an increment is more than half of the preceding one. With a fixed number of iterations there
    /// is no second one.
    Frozen,
}

impl Jacobian {
    /// Whether factors are reused, and Jacobians averaged, while that costs less than new ones.
    pub(crate) fn is_adaptive(self) -> bool {
        matches!(self, Self::Auto | Self::Simplified)
    }
}

/// The initial guess of Newton's method in the first step of a call.
///
/// Later steps start from the extrapolated polynomial of the preceding step; with five stages or
/// more the algebraic states start from those of its last stage. A call thus stays on the branch of
/// its first step.
///
/// If the equations have several roots, as `z² = x`, the initial guess selects one, and the result
/// does not show which. State the expected value, `#[dae(nominal(z = 0.1))]`, or call `set_start`.
/// Such values are also required if the residual is undefined at `z = 0`, as for `ln z`, or a
/// matrix is singular there, as for `z² = x`.
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
    /// [`Dae::START`](crate::Dae::START): `z` at its `nominal(..)`; without one, at the geometric
    /// mean of a `range(..)` that excludes zero; otherwise at zero. `ẋ` is zero, unless the
    /// equations are nonlinear in it and it has a nominal value. Results are bitwise reproducible.
    #[default]
    Nominal,
    /// `ẋ = 0` and `z = 0`; nominal values are ignored.
    Zero,
    /// The values of `set_start`; an error if it was not called.
    Given,
    /// Warm start: the stages of the same step in the last successful call; in the first call as
    /// `Nominal`. All calls until `reset` stay on the same branch.
    Warm,
}

impl Options {
    /// Lifted integrators: an optimal control problem iterates on the stages together with its own
    /// variables. Each call takes one iteration from the stages of the last call (in the first one
    /// from the nominal values). At convergence the stages agree with those of other options (R.
    /// Quirynen, S. Gros, M. Diehl, "Lifted implicit integrators for direct optimal control", CDC
    /// 2015). Before, the errors at the ends of intervals are quadratic in the last step of the
    /// problem; derivatives are exact at the current stages. The problem may take more iterations:
    /// measure both.
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
    /// [`Error::InvalidOption`] for the first value out of range.
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
