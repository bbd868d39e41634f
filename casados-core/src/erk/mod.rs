//! Explicit Runge-Kutta methods for models `ẋ = g(x, u, p, t)`, with the exact derivatives of the
//! discrete step.
//!
//! ```text
//! ξ_i = x_n + h Σ_{j<i} a_ij k_j      k_i = g(ξ_i, u, p, t_n + c_i h)      x_{n+1} = x_n + h Σ_i b_i k_i
//! ```
//!
//! The derivatives of `g` are those of the residual `f = c (ẋ − g)`; see [`Ode`]. There is no dense
//! output: an explicit method has no polynomial through its stages that keeps its order.

mod adjoint;
mod along;
mod calls;
mod forward;
mod hessian;
mod integrator;
mod sensitivities;
mod step;

pub use integrator::Integrator;
// What steps of variable size are made of too.
#[cfg(feature = "alloc")]
pub(crate) use step::{Grid, Point, Record, Scheme};

use crate::memory::Memory;
use crate::model::Ode;
use crate::scalar::Real;
use crate::tableau::{Butcher6, Custom, DormandPrince5, DormandPrince8, Euler, Heun, Midpoint, Rk4};

/// An explicit method.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not an explicit method",
    label = "`Erk` needs an explicit Runge-Kutta method",
    note = "explicit: `Euler`, `Midpoint`, `Heun`, `Rk4`, `DormandPrince5`, `Butcher6`, `DormandPrince8`, `Custom<S>`; implicit methods belong to `Irk`"
)]
pub trait Explicit: 'static {
    /// The integrator with this method.
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

/// The explicit integrator of the method `B` for the model `M`, with numbers `T` and memory `W`.
///
/// ```
/// # use casados_core::{Error, Erk, Rk4, Ode, Options, model::{VectorU, VectorX}};
/// # fn example<Pendulum: Ode>(x0: VectorX<Pendulum, f64>, u: VectorU<Pendulum, f64>) -> Result<(), Error> {
/// let mut erk = Erk::<Pendulum, Rk4>::new(Options { steps: 2, ..Default::default() })?;
/// let step = erk.forward(&x0, &u, 0.05)?;
/// let (x, jacobian) = (step.x, step.dx_dx0);
/// # Ok(())
/// # }
/// ```
#[cfg(feature = "alloc")]
pub type Erk<M, B, T = f64, W = crate::memory::Heap> = <B as Explicit>::Integrator<M, T, W>;
/// The explicit integrator of the method `B` for the model `M`, with numbers `T` and memory `W`.
#[cfg(not(feature = "alloc"))]
pub type Erk<M, B, T, W> = <B as Explicit>::Integrator<M, T, W>;
