//! Implicit Runge-Kutta methods for fully implicit differential-algebraic equations of index 1.
//!
//! For one step of size `h` the unknowns `k_i ≈ ẋ` and `z_i` at the stages solve
//!
//! ```text
//! ξ_i = x_n + h Σ_j a_ij k_j        0 = f(k_i, ξ_i, u, z_i, p, t_n + c_i h)        i = 1 … s
//! x_{n+1} = x_n + h Σ_i b_i k_i
//! ```
//!
//! by Newton's method. Sensitivities are the exact derivatives of this discrete map, by the
//! implicit function theorem at the converged stages: the Jacobian is evaluated and factorised
//! there, whatever the iteration took. `z` at the ends of an interval is the polynomial through the
//! stages; for stiffly accurate methods its value at the end is the last stage.
//!
//! One file for each thing: `evaluate` the model at the `stages`, `newton`, its `increment` and its
//! `progress`, and, where that does not arrive, `pivoted`, what errors say about where it
//! `start_errors`, and `near_singular` about linear equations, `step`, `forward` by `sweep` over
//! panels of `directions` from their `right_side`, `adjoint`, `hessian` by products of panels
//! (`curvature`) or by a `curved_adjoint` of large models, `along` an integrand, `verify` what was
//! solved, states that are `kinematic`, `dense`; `record` is the memory, `run` what all calls
//! share, `integrator` and its `sensitivities` what users see.

mod adjoint;
mod along;
mod compensated;
mod curvature;
mod curved_adjoint;
mod curved_advance;
mod curved_rows;
mod dense;
mod directions;
mod evaluate;
mod forward;
mod hessian;
mod increment;
mod integrator;
mod kinematic;
mod lone;
mod measure;
mod multiply;
mod near_singular;
mod newton;
mod pivoted;
mod progress;
mod record;
mod refine;
mod right_side;
mod run;
mod sensitivities;
mod stages;
mod start_errors;
mod step;
mod sums;
mod sweep;
mod triangle;
mod verify;
mod write;

pub use adjoint::AdjointMemory;
pub use forward::{DirectionalMemory, ForwardMemory};
pub use integrator::Integrator;

// What steps of variable size are made of too.
#[cfg(feature = "alloc")]
pub(crate) use self::{
    evaluate::dot,
    forward::{StepOf, check_result, multiply},
    pivoted::unknown_name,
    record::{Coefficients, Linearization, Step, Work},
    run::{Arguments, check},
    step::From,
};
#[cfg(feature = "alloc")]
pub(crate) use hessian::{HessianMemory, HessianStep};
// What integrands are computed with too.
pub(crate) use self::{evaluate::not_finite, step::check as check_values};

use crate::memory::Memory;
use crate::model::Dae;
use crate::scalar::Real;
use crate::tableau::{Custom, Gauss, Method, RadauIIA};

/// The implicit integrator of the method `B` for the model `M`, with numbers `T` and memory `W`.
///
/// ```
/// # use casados_core::{Error, Irk, Gauss, Dae, Options, model::{VectorU, VectorX}};
/// # fn example<Pendulum: Dae>(x0: VectorX<Pendulum, f64>, u: VectorU<Pendulum, f64>) -> Result<(), Error> {
/// let mut irk = Irk::<Pendulum, Gauss<4>>::new(Options { steps: 2, ..Default::default() })?;
/// let step = irk.forward(&x0, &u, 0.05)?;
/// let (x, jacobian) = (step.x, step.dx_dx0);
/// # Ok(())
/// # }
/// ```
#[cfg(feature = "alloc")]
pub type Irk<M, B, T = f64, W = crate::memory::Heap> = <B as Implicit>::Integrator<M, T, W>;
/// The implicit integrator of the method `B` for the model `M`, with numbers `T` and memory `W`.
#[cfg(not(feature = "alloc"))]
pub type Irk<M, B, T, W> = <B as Implicit>::Integrator<M, T, W>;

/// A method that an implicit integrator takes.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not an implicit Runge-Kutta method",
    note = "`Gauss<S>`, `RadauIIA<S>` and `Custom<S>` are"
)]
pub trait Implicit {
    /// Its integrator.
    type Integrator<M: Dae, T: Real, W: Memory>;
}

impl<const S: usize> Implicit for Gauss<S>
where
    Self: Method<S>,
{
    type Integrator<M: Dae, T: Real, W: Memory> = Integrator<M, Self, S, T, W>;
}
impl<const S: usize> Implicit for RadauIIA<S>
where
    Self: Method<S>,
{
    type Integrator<M: Dae, T: Real, W: Memory> = Integrator<M, Self, S, T, W>;
}
impl<const S: usize> Implicit for Custom<S> {
    type Integrator<M: Dae, T: Real, W: Memory> = Integrator<M, Self, S, T, W>;
}
