//! Explicit Runge-Kutta methods for models `ẋ = g(x, u, p, t)`, with the exact derivatives of the
//! discrete step.
//!
//! ```text
//! ξ_i = x_n + h Σ_{j<i} a_ij k_j      k_i = g(ξ_i, u, p, t_n + c_i h)      x_{n+1} = x_n + h Σ_i b_i k_i
//! ```
//!
//! The derivatives of `g` are those of the residual `f = c (ẋ − g)`; see [`Ode`]. Dense output is
//! not available: the stages of an explicit method define no interpolation polynomial of its order.

mod adjoint;
mod engine;
mod forward;
mod forward_sweep;
mod hessian;
mod integrator;
mod integrator_trait;
mod non_finite;
#[cfg(feature = "alloc")]
mod panels;
mod scheme;
mod sensitivities;
mod stage_integrand;
mod step;
mod tiles;

pub use integrator::Integrator;
// Also used by adaptive integrators and batches.
#[cfg(feature = "alloc")]
pub(crate) use scheme::{Grid, Scheme};
#[cfg(feature = "alloc")]
pub(crate) use step::{StagePoint, StepRecord, UnitStride};
// Used by batches.
#[cfg(feature = "alloc")]
pub(crate) use {
    engine::{Engine, MaskedResult},
    panels::ColumnPanels,
    stage_integrand::NoIntegrand,
};

use crate::memory::Memory;
use crate::model::Ode;
use crate::scalar::Real;
use crate::tableau::{Butcher6, Custom, DormandPrince5, DormandPrince8, Euler, Heun, Midpoint, Rk4};

/// An explicit method.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// let mut rk4 = Erk::<Cart, Rk4>::new(Options::default())?;
/// let mut euler = Erk::<Cart, Euler>::new(Options { steps: 4, ..Default::default() })?;
/// let (x0, u) = (vector![0.0, 0.0], vector![2.0]);
/// assert!((rk4.solve(&x0, &u, 1.0)?.x[0] - 1.0).abs() < 1e-14);
/// assert!((euler.solve(&x0, &u, 1.0)?.x[0] - 0.75).abs() < 1e-14); // of order one
/// # Ok::<(), casados::Error>(())
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not an explicit method",
    label = "`Erk` needs an explicit Runge-Kutta method",
    note = "explicit: `Euler`, `Midpoint`, `Heun`, `Rk4`, `DormandPrince5`, `Butcher6`, `DormandPrince8`, `Custom<S>`; implicit methods belong to `Irk`"
)]
pub trait Explicit: 'static {
    /// The integrator of this method.
    type Integrator<M: Ode, T: Real, W: Memory>;
}

macro_rules! explicit {
    ($($method:ty: $stages:literal),* $(,)?) => {
        $(impl Explicit for $method {
            type Integrator<M: Ode, T: Real, W: Memory> = Integrator<M, $method, $stages, T, W>;
        })*
    };
}
explicit!(Euler: 1, Midpoint: 2, Heun: 2, Rk4: 4, DormandPrince5: 6, Butcher6: 7, DormandPrince8: 12);

impl<const S: usize> Explicit for Custom<S> {
    type Integrator<M: Ode, T: Real, W: Memory> = Integrator<M, Self, S, T, W>;
}

/// The explicit integrator of the method `B` for the model `M`, with numbers `T` and memory `W`:
/// `Erk<Model, Rk4>`.
///
/// ```text
/// ξ_i = x_n + h Σ_{j<i} a_ij k_j      k_i = g(ξ_i, u, p, t_n + c_i h)      x_{n+1} = x_n + h Σ_i b_i k_i
/// ```
///
/// It is an [`Integrator`], with these functions:
///
/// | | |
/// | --- | --- |
/// | [`new`](Integrator::new) | memory on the heap; [`inline`](Integrator::inline) inside, [`with_tableau`](Integrator::with_tableau) for a user-defined tableau |
/// | [`set_parameters`](Integrator::set_parameters), [`set_time`](Integrator::set_time) | `p`, and `t` at the start of intervals |
/// | [`solve`](Integrator::solve) | `x₊` |
/// | [`forward`](Integrator::forward), [`directional`](Integrator::directional) | and derivatives by `(x₀, u, p)`: all of them, or in given directions |
/// | [`adjoint`](Integrator::adjoint), [`adjoint_many`](Integrator::adjoint_many) | and gradients of `λᵀx₊` |
/// | [`hessian`](Integrator::hessian), [`forward_adjoint`](Integrator::forward_adjoint) | and gradients with second derivatives, or with first ones |
/// | [`with`](Integrator::with) | quadratures |
/// | [`statistics`](Integrator::statistics) | statistics of the last call |
///
/// [`Batch`](crate::Batch) computes many intervals at once, in SIMD lanes.
///
/// By default an interval is one step: [`Options`](crate::Options). Its fields `newton` and `start`
/// have no effect. Units are those of the model; results have its dimensions.
///
/// # Errors
/// `Error::NonFiniteModel` if the model has no value, `Error::NonFiniteInput`,
/// `Error::ParametersNotSet`, `Error::Overflow`; `Error::OutOfMemory` in the first call of each
/// kind.
///
/// # Example
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
///
/// /// x = [position m, velocity m/s], u = [acceleration m/s²].
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
///
/// let mut erk = Erk::<Cart, Rk4>::new(Options { steps: 2, ..Default::default() })?;
/// let step = erk.forward(&vector![0.0, 1.0], &vector![2.0], 0.5)?;
/// // Of polynomials the method is exact: x₊ = (x + v h + u h²/2, v + u h).
/// assert!((step.x - vector![0.75, 2.0]).norm() < 1e-14);
/// assert!((step.dx_du - vector![0.125, 0.5]).norm() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
#[cfg(feature = "alloc")]
pub type Erk<M, B, T = f64, W = crate::memory::Heap> = <B as Explicit>::Integrator<M, T, W>;
/// The explicit integrator of the method `B` for the model `M`, with numbers `T` and memory `W`.
#[cfg(not(feature = "alloc"))]
pub type Erk<M, B, T, W> = <B as Explicit>::Integrator<M, T, W>;
