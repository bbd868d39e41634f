//! Batches: many intervals of one model at once, as in multiple shooting.
//!
//! The intervals `(x₀, u, p, λ)` of a horizon are independent. Each has one lane of the widest SIMD
//! registers of the machine, and all lanes are computed by the engine of a single call: the model,
//! stages, elimination, derivatives. Results are written to the caller's slice.
//!
//! Every lane has its own status. If the iteration of an interval does not converge in its group,
//! its derivatives do not satisfy their equations, or a value is not finite, the interval is
//! recomputed alone with the full functionality of a single call: the dense fallback, and detailed
//! errors. A group of an implicit method updates its Jacobian for the slowest lane, so that
//! neighbours change results by rounding errors. Neighbours have no effect with explicit methods.
//!
//! Modules: `intervals` are the inputs, `batch_output` the outputs, `single` integrates one
//! interval or a group in `lanes`, `implicit` and `explicit` implement it for the methods, `chunk`
//! and `worker` distribute the work, `group_call` computes one group, `integrator` is the public
//! interface.

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
/// `Batch<Model, Gauss<4>>`, or `Batch<Model, Rk4>` for an explicit model.
///
/// Intervals `k = 0, 1, …` have their own `(x₀, u, p, t₀, h)`, listed in [`Intervals`]. Each is
/// integrated as by [`Irk`], or by [`Erk`] for an explicit method; groups of them are computed in
/// SIMD lanes and, with the feature `parallel`, on several threads. Results are written to the
/// caller's slice, one element for each.
///
/// `Batch<Model, Custom<S>>` takes user-defined implicit tableaux, and treats explicit ones as
/// implicit; `batch::Integrator<Erk<Model, Custom<S>>>` takes explicit tableaux.
/// `batch::Integrator<Irk<Model, Gauss<2>, f64, Shared>>` uses the kernels that all models share
/// ([`Shared`](crate::memory::Shared)), one interval after the other.
///
/// It is an [`Integrator`], with these functions:
///
/// | | |
/// | --- | --- |
/// | [`new`](Integrator::new), [`with_tableau`](Integrator::with_tableau) | memory on the heap, for any number of intervals |
/// | [`set_start`](Integrator::set_start) | start values of `ẋ` and `z`, which explicit methods do not read |
/// | [`solve`](Integrator::solve) | `x₊`, and `z` at both ends |
/// | [`forward`](Integrator::forward) | and derivatives by `(x₀, u, p)` |
/// | [`adjoint`](Integrator::adjoint), [`forward_adjoint`](Integrator::forward_adjoint) | and gradients of `λᵀx₊`, alone or with derivatives |
/// | [`hessian`](Integrator::hessian), [`hessian_with_z0`](Integrator::hessian_with_z0) | and second derivatives, of `λᵀx₊` or `λᵀx₊ + νᵀz₀` |
/// | [`status`](Integrator::status) | outcome of an interval |
/// | [`statistics`](Integrator::statistics) | statistics of the last call |
///
/// # Errors
/// [`BatchError`]: slices of wrong lengths before anything is computed; otherwise the number of
/// failed intervals, each with its own error. The result of a failed interval remains unchanged.
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

/// A method of a batch for the model `M` with numbers `T`: implicit methods for every model,
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
