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
//! In the order of a call: `integrator` and `sensitivities` are what users see, `driver` what all
//! calls share, `step` the loop over the steps, `stages` the model at them, `newton` the iteration
//! that solves them. Derivatives go `forward`, backwards by the `adjoint`, and to second order with
//! the `hessian`; each is held against its own equations by its `backward_error`. An `integrand` is
//! summed up along the way, `dense_output` interpolates. `kinematic` states are no unknowns;
//! `directions` are what derivatives are found in. `coefficients`, `jacobian_entries`,
//! `stage_array` and `workspace` are the data.

mod adjoint;
mod backward_error;
mod calls;
mod coefficients;
mod dense_output;
mod directions;
mod driver;
mod forward;
mod hessian;
mod integrand;
mod integrator;
mod jacobian_entries;
mod kinematic;
mod newton;
mod sensitivities;
mod stage_array;
mod stages;
mod step;
mod workspace;

pub use adjoint::{AdjointMemory, Adjoints};
pub use forward::{
    directional::{DirectionalMemory, Directionals},
    memory::ForwardMemory,
};
pub use integrator::Integrator;

// Finite checks, which rooms above find here too.
pub(crate) use crate::finite::not_finite;
#[cfg(feature = "alloc")]
pub(crate) use crate::finite::{check_input as check, check_named};

// What steps of variable size are made of too.
#[cfg(feature = "alloc")]
pub(crate) use self::{
    coefficients::{Coefficients, dot},
    driver::Arguments,
    forward::{
        gradient::{check_result, multiply},
        memory::StepOf,
    },
    hessian::pass::{HessianMemory, HessianStep},
    newton::dense_fallback::unknown_name,
    newton::iteration::StageEquations,
    stages::initial_guess::InitialGuess,
    workspace::{Linearization, Step, Work},
};

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
