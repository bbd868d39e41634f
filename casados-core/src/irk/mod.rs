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
//! implicit function theorem: the Jacobian is evaluated and factorised at the converged stages,
//! independently of the Jacobians of the iterations. `z` at the ends of an interval is the value of
//! the polynomial through the stages; for stiffly accurate methods its value at the end is the last
//! stage.
//!
//! Modules, in the order of a call: `integrator` and `sensitivities` are the public interface,
//! `driver` is the part that all calls share, `step` the loop over the steps, `stages` the model at
//! the stages, `newton` their solution. `forward`, `adjoint` and `hessian` compute derivatives;
//! `backward_error` checks them. `integrand` evaluates quadratures, `dense_output` interpolates.
//! `kinematic` condenses kinematic states; `directions` are the directions of derivatives.
//! `coefficients`, `jacobian_entries`, `stage_array` and `workspace` are the data.

mod adjoint;
mod backward_error;
mod coefficients;
mod dense_output;
mod directions;
mod driver;
mod forward;
mod hessian;
mod integrand;
mod integrator;
mod integrator_trait;
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

// Also used by adaptive integrators.
#[cfg(feature = "alloc")]
pub(crate) use self::{
    coefficients::{Coefficients, dot},
    driver::Arguments,
    forward::{gradient::gradient_product, memory::StepIndex},
    hessian::backward_pass::{HessianMemory, HessianStep},
    newton::dense_fallback::unknown_name,
    newton::fold::analyse_pivots,
    newton::iteration::StageEquations,
    stages::initial_guess::InitialGuess,
    workspace::{Linearization, StageWorkspace, Step},
};

use crate::memory::Memory;
use crate::model::Dae;
use crate::scalar::Real;
use crate::tableau::{Custom, Gauss, Method, RadauIIA};

/// The implicit integrator of the method `B` for the model `M`, with numbers `T` and memory `W`:
/// `Irk<Model, Gauss<4>>`.
///
/// ```text
/// ξ_i = x_n + h Σ_j a_ij k_j        0 = f(k_i, ξ_i, u, z_i, p, t_n + c_i h)        i = 1 … s
/// x_{n+1} = x_n + h Σ_i b_i k_i
/// ```
///
/// It is an [`Integrator`], with these functions:
///
/// | | |
/// | --- | --- |
/// | [`new`](Integrator::new) | memory on the heap; [`inline`](Integrator::inline) inside, [`with_tableau`](Integrator::with_tableau) for a user-defined tableau |
/// | [`set_parameters`](Integrator::set_parameters), [`set_time`](Integrator::set_time), [`set_start`](Integrator::set_start) | `p`, `t` at the start of intervals, start values of `ẋ` and `z` |
/// | [`solve`](Integrator::solve) | `x₊`, and `z` at both ends |
/// | [`forward`](Integrator::forward), [`directional`](Integrator::directional) | and derivatives by `(x₀, u, p)`: all of them, or in given directions |
/// | [`adjoint`](Integrator::adjoint), [`adjoint_many`](Integrator::adjoint_many) | and gradients of `λᵀx₊` |
/// | [`hessian`](Integrator::hessian), [`forward_adjoint`](Integrator::forward_adjoint) | and gradients with second derivatives, or with first ones |
/// | [`dense`](Integrator::dense), [`dense_forward`](Integrator::dense_forward) | the solution inside the last interval |
/// | [`with`](Integrator::with) | quadratures |
/// | [`statistics`](Integrator::statistics) | statistics of the last call |
///
/// By default an interval is one step, and Newton's method converges to rounding:
/// [`Options`](crate::Options). Units are those of the model; results have its dimensions.
///
/// # Errors
/// Those of [`Integrator`]: a model without a value, an iteration that does not converge, a
/// singular matrix, inputs that are not finite.
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
/// let mut irk = Irk::<Cart, Gauss<2>>::new(Options { steps: 2, ..Default::default() })?;
/// let step = irk.forward(&vector![0.0, 1.0], &vector![2.0], 0.5)?;
/// // Of polynomials the method is exact: x₊ = (x + v h + u h²/2, v + u h).
/// assert!((step.x - vector![0.75, 2.0]).norm() < 1e-14);
/// assert!((step.dx_du - vector![0.125, 0.5]).norm() < 1e-14);
/// let step = irk.adjoint(&vector![0.0, 1.0], &vector![2.0], 0.5, &vector![1.0, 0.0])?;
/// assert!((step.grad_x0 - vector![1.0, 0.5]).norm() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
#[cfg(feature = "alloc")]
pub type Irk<M, B, T = f64, W = crate::memory::Heap> = <B as Implicit>::Integrator<M, T, W>;
/// The implicit integrator of the method `B` for the model `M`, with numbers `T` and memory `W`.
#[cfg(not(feature = "alloc"))]
pub type Irk<M, B, T, W> = <B as Implicit>::Integrator<M, T, W>;

/// A method of an implicit integrator.
///
/// ```
/// use casados::irk::Implicit;
/// use casados::prelude::*;
/// use nalgebra::vector;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
///
/// /// As long as a type says it, any method will do.
/// type Solver<B> = Irk<Cart, B>;
/// fn name<B: Implicit>() -> &'static str {
///     std::any::type_name::<Solver<B>>()
/// }
/// assert!(name::<RadauIIA<2>>().contains("RadauIIA"));
/// let end = Solver::<RadauIIA<2>>::new(Options::default())?.solve(&vector![0.0, 1.0], &vector![2.0], 0.5)?.x;
/// assert!((end - vector![0.75, 2.0]).norm() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
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
