//! Many intervals of one model at once, as multiple shooting wants them.
//!
//! Intervals `(x₀, u, p, λ)` of a horizon do not depend on each other. So each of them gets a lane
//! of the widest registers that the machine has, and all lanes go through the same engine as a
//! single call: the model, stages, elimination, derivatives. Results are written into the caller's
//! slice.
//!
//! Every lane is judged by itself. An interval whose iteration did not converge in its group, whose
//! derivatives do not satisfy their equations, or which met a value that is not finite, is computed
//! again alone, with all that a single call can do: the whole matrix pivoted, and an error that
//! says what is wrong. Within a group of an implicit method the Jacobian is renewed as the slowest
//! lane needs it: so neighbours change a result by rounding errors. Of an explicit method they
//! change nothing.
//!
//! One file for each thing: `intervals` what is given, `answer` what is asked, `single` what
//! integrates an interval alone or several in `lanes`, `implicit` and `explicit` the methods that
//! do, `work` who computes what, `integrator` what users see.

mod batch_output;
mod chunk;
mod error;
mod explicit;
mod group_call;
mod implicit;
mod integrator;
mod intervals;
mod lanes;
mod single;
mod statistics;
mod worker;

pub(crate) use batch_output::BatchOutput;
pub use error::{BatchError, Slice};
pub use integrator::Integrator;
pub use intervals::Intervals;
#[cfg(feature = "casadi")]
pub(crate) use intervals::vector;
pub use single::{Single, Standard};
pub use statistics::BatchStatistics;

use crate::erk::Erk;
use crate::irk::Irk;
use crate::model::{Dae, Ode};
use crate::scalar::Real;
use crate::tableau::{
    Butcher6, Custom, DormandPrince5, DormandPrince8, Euler, Gauss, Heun, Method, Midpoint, RadauIIA, Rk4,
};

/// The integrator of many intervals, of the method `B` for the model `M`, with numbers `T`:
/// `Batch<Model, Gauss<4>>`, or `Batch<Model, Rk4>` of an explicit model.
///
/// Intervals `k = 0, 1, …` have their own `(x₀, u, p, t₀, h)`, which [`Intervals`] lists; each is
/// integrated as [`Irk`] does, or [`Erk`] of an explicit method, side by side in registers and,
/// with the feature `parallel`, over threads. Results are written into the caller's slice, an
/// element for each.
///
/// `Batch<Model, Custom<S>>` takes implicit tableaux of one's own, and explicit ones as if they
/// were implicit; `batch::Integrator<Erk<Model, Custom<S>>>` takes explicit ones as they are.
/// `batch::Integrator<Irk<Model, Gauss<2>, f64, Shared>>` takes the kernels that all models share
/// ([`Shared`](crate::memory::Shared)), one interval after the other.
///
/// It is an [`Integrator`], whose page has all that it can do:
///
/// | | |
/// | --- | --- |
/// | [`new`](Integrator::new), [`with_tableau`](Integrator::with_tableau) | memory on the heap, for any number of intervals |
/// | [`set_start`](Integrator::set_start) | start values of `ẋ` and `z`, which explicit methods do not read |
/// | [`solve`](Integrator::solve) | `x₊`, and `z` at both ends |
/// | [`forward`](Integrator::forward) | and derivatives by `(x₀, u, p)` |
/// | [`adjoint`](Integrator::adjoint), [`forward_adjoint`](Integrator::forward_adjoint) | and gradients of `λᵀx₊`, alone or with derivatives |
/// | [`hessian`](Integrator::hessian), [`hessian_with_z0`](Integrator::hessian_with_z0) | and second derivatives, of `λᵀx₊` or `λᵀx₊ + νᵀz₀` |
/// | [`status`](Integrator::status) | what happened to an interval |
/// | [`statistics`](Integrator::statistics) | what the last call did |
///
/// # Errors
/// [`BatchError`]: slices of wrong lengths before anything is computed; afterwards, how many
/// intervals failed, each for itself. An interval that fails leaves its result as it was.
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
/// let mut batch = Batch::<Cart, Gauss<2>>::new(Options::default())?;
/// let x0 = [vector![0.0, 1.0], vector![1.0, 0.0], vector![2.0, -1.0]];
/// let mut ends = vec![casados::result::Forward::default(); 3];
/// // One control and one length for all.
/// let intervals = Intervals { x0: &x0, u: &[vector![2.0]], h: &[0.5], ..Default::default() };
/// batch.forward(&intervals, &mut ends)?;
/// for (x, end) in x0.iter().zip(&ends) {
///     assert!((end.x - vector![x[0] + 0.5 * x[1] + 0.25, x[1] + 1.0]).norm() < 1e-14);
///     assert!((end.dx_du - vector![0.125, 0.5]).norm() < 1e-14);
/// }
///
/// // One that fails does so alone.
/// let x0 = [vector![0.0, 1.0], vector![f64::NAN, 0.0]];
/// let mut ends = vec![casados::result::Nominal::default(); 2];
/// let failed = batch.solve(&Intervals { x0: &x0, ..intervals }, &mut ends);
/// assert!(matches!(failed, Err(BatchError::Intervals { .. })));
/// assert!(batch.status(0).is_ok());
/// assert!(matches!(batch.status(1), Err(Error::NonFiniteInput { .. })));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub type Batch<M, B, T = f64> = Integrator<<B as Batched<M, T>>::Single>;

/// A method that a batch of the model `M` takes, with numbers `T`: implicit ones for every model,
/// explicit ones for explicit models.
///
/// ```
/// use casados::batch::Batched;
/// use casados::prelude::*;
/// use casados::{Rk4, result::Nominal};
/// use nalgebra::vector;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
///
/// /// Where carts are that stood still, whatever the method.
/// fn ends<B: Batched<Cart, f64>>(mut batch: Batch<Cart, B>) -> Result<[f64; 3], BatchError> {
///     let (x0, u) = ([vector![0.0, 0.0]; 3], [1.0, 2.0, 3.0].map(|u| vector![u]));
///     let mut ends = [Nominal::default(); 3];
///     batch.solve(&Intervals { x0: &x0, u: &u, h: &[1.0], ..Default::default() }, &mut ends)?;
///     Ok(ends.map(|end| end.x[0]))
/// }
/// let (options, exact) = (Options::default(), [0.5, 1.0, 1.5]);
/// let explicit = ends::<Rk4>(Batch::<Cart, Rk4>::new(options)?)?;
/// let implicit = ends::<Gauss<2>>(Batch::<Cart, Gauss<2>>::new(options)?)?;
/// for ends in [explicit, implicit] {
///     assert!(ends.iter().zip(exact).all(|(end, exact)| (end - exact).abs() < 1e-14));
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a Runge-Kutta method of a fixed step",
    label = "a batch needs a Runge-Kutta method of a fixed step",
    note = "explicit: `Euler`, `Midpoint`, `Heun`, `Rk4`, `DormandPrince5`, `Butcher6`, `DormandPrince8`; implicit: `Gauss<S>`, `RadauIIA<S>`, `Custom<S>`"
)]
pub trait Batched<M: Dae, T: Real> {
    /// The integrator of a single interval.
    type Single: Single<Model = M, Number = T>;
}

impl<M: Dae, T: Real, const S: usize> Batched<M, T> for Gauss<S>
where
    Self: Method<S>,
{
    type Single = Irk<M, Self, T>;
}
impl<M: Dae, T: Real, const S: usize> Batched<M, T> for RadauIIA<S>
where
    Self: Method<S>,
{
    type Single = Irk<M, Self, T>;
}
impl<M: Dae, T: Real, const S: usize> Batched<M, T> for Custom<S> {
    type Single = Irk<M, Self, T>;
}

macro_rules! explicit {
    ($($method:ident),* $(,)?) => { $(
        impl<M: Ode, T: Real> Batched<M, T> for $method {
            type Single = Erk<M, Self, T>;
        }
    )* };
}
explicit!(Euler, Midpoint, Heun, Rk4, DormandPrince5, Butcher6, DormandPrince8);
