//! The place of an error: the step, the argument, the quantity of the model.

/// The place of an error in a run; all indices start from zero.
///
/// ```
/// # use casados::error::{Place, Quantity};
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// It has no value below zero, where it arrives soon.
/// # #[ode]
/// # fn tank(x: f64) -> f64 { -x.sqrt() - 1.0 }
/// # let mut erk = Erk::<Tank, Rk4>::new(Options { steps: 2, ..Default::default() })?;
/// // Of two steps of 0.5 s, with four stages each, the first one goes below zero.
/// let error = erk.solve(&vector![0.4], &vector![], 1.0).unwrap_err();
/// let Error::NonFiniteModel { at, .. } = error else { panic!() };
/// let Place { step, stage, iteration } = at;
/// assert_eq!((step, iteration), (0, 0));
/// assert!((1..4).contains(&stage));
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// The index of the step in the interval.
    pub step: usize,
    /// The index of the stage in the step.
    pub stage: usize,
    /// The iteration of Newton's method; zero for explicit methods.
    pub iteration: usize,
}

/// An argument of a call.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # use casados::error::Argument;
/// let mut irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
/// let error = irk.solve(&vector![0.0, 0.0], &vector![f64::INFINITY], 0.5).unwrap_err();
/// assert!(matches!(error, Error::NonFiniteInput { argument: Argument::U, index: 0, .. }));
/// let error = irk.solve(&vector![0.0, 0.0], &vector![1.0], f64::NAN).unwrap_err();
/// assert!(matches!(error, Error::NonFiniteInput { argument: Argument::H, .. }));
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Argument {
    /// The state at the start, `x0`.
    X0,
    /// The control `u`.
    U,
    /// The length of the interval, `h`.
    H,
    /// The parameters `p`.
    P,
    /// The time at the start, `t0`, or of dense output, `t`.
    T,
    /// The adjoint seed `λ`.
    Lambda,
    /// The weights `ν` of the algebraic states at the start.
    Nu,
    /// The forward seed of `x0`.
    SeedX,
    /// The forward seed of `u`.
    SeedU,
    /// The forward seed of `p`.
    SeedP,
    /// The initial guess of `ẋ` for Newton's method.
    StartXdot,
    /// The initial guess of `z` for Newton's method.
    StartZ,
}

/// A quantity of a model.
///
/// ```
/// # use casados::error::{Place, Quantity};
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// It has no value below zero, where it arrives soon.
/// # #[ode]
/// # fn tank(x: f64) -> f64 { -x.sqrt() - 1.0 }
/// # let mut erk = Erk::<Tank, Rk4>::new(Options { steps: 2, ..Default::default() })?;
/// let error = erk.solve(&vector![-0.4], &vector![], 1.0).unwrap_err();
/// let Error::NonFiniteModel { quantity, equation, .. } = error else { panic!() };
/// assert_eq!((quantity, equation), (Quantity::Residual, 0));
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Quantity {
    /// The residual `f`.
    Residual,
    /// An entry of `∂f/∂(ẋ, x, z, u, p)`.
    Jacobian,
    /// An entry of `∇(μᵀ f)`; its index is a variable, not an equation.
    Adjoint,
    /// An entry of `∇²(μᵀ f)`; its index is a variable, not an equation.
    Hessian,
}
