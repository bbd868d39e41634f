//! Many intervals of one model at once, as multiple shooting wants them.
//!
//! Intervals `(x₀, u, p, λ)` of a horizon do not depend on each other. So each of them gets a lane
//! of the widest registers that the machine has, and all lanes go through the same engine as a
//! single call: the model, Newton's method, elimination, derivatives. Results are written into the
//! caller's slice.
//!
//! Every lane is judged by itself. An interval whose iteration did not converge in its group, whose
//! derivatives do not satisfy their equations, or whose result is not finite, is computed again
//! alone, with all that a single call can do: the whole matrix pivoted, and an error that says what
//! is wrong. Within a group the Jacobian is renewed as the slowest lane needs it: so neighbours
//! change a result by rounding errors.
//!
//! One file for each thing: `intervals` what is given, `answer` what is asked, `group` intervals
//! side by side in `lanes`, `work` who computes what, `integrator` what users see.

mod answer;
mod error;
mod group;
mod integrator;
mod intervals;
mod lanes;
mod statistics;
mod work;

pub use error::{BatchError, Slice};
pub use integrator::Integrator;
pub use intervals::Intervals;
#[cfg(feature = "casadi")]
pub(crate) use intervals::vector;
pub use statistics::BatchStatistics;

use crate::model::Dae;
use crate::scalar::Real;
use crate::tableau::{Custom, Gauss, Method, RadauIIA};

/// The implicit integrator of many intervals, of the method `B` for the model `M`, with numbers
/// `T`.
///
/// ```
/// # use casados_core::{Batch, BatchError, Gauss, Dae, Error, Intervals, Options, result::Forward, model::{VectorU, VectorX}};
/// # fn example<Pendulum: Dae>(x0: &[VectorX<Pendulum, f64>], u: &[VectorU<Pendulum, f64>]) -> Result<(), Box<dyn std::error::Error>> {
/// let mut batch = Batch::<Pendulum, Gauss<4>>::new(Options { steps: 2, ..Default::default() })?;
/// let mut results = vec![Forward::default(); x0.len()];
/// batch.forward(&Intervals { x0, u, h: &[0.05], ..Default::default() }, &mut results)?;
/// for step in &results {
///     let (x, jacobian) = (step.x, step.dx_dx0);
/// }
/// # Ok(())
/// # }
/// ```
///
/// Some intervals may fail:
///
/// ```
/// # use casados_core::{Batch, BatchError, Gauss, Dae, Intervals, result::Nominal};
/// # fn example<M: Dae>(batch: &mut Batch<M, Gauss<4>>, intervals: &Intervals<M>, results: &mut [Nominal<M>]) -> Result<(), BatchError> {
/// match batch.solve(intervals, results) {
///     Err(BatchError::Intervals { .. }) => {
///         for i in 0..results.len() {
///             if let Err(error) = batch.status(i) {
///                 println!("interval {i}: {error}");
///             }
///         }
///     }
///     others => others?,
/// }
/// # Ok(())
/// # }
/// ```
pub type Batch<M, B, T = f64> = <B as Batched>::Integrator<M, T>;

/// A method that a batch takes.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not an implicit Runge-Kutta method",
    label = "a batch needs an implicit Runge-Kutta method",
    note = "`Gauss<S>`, `RadauIIA<S>` and `Custom<S>` are, for explicit models too; `Erk` integrates one interval after the other with \
            explicit methods"
)]
pub trait Batched {
    /// Its integrator.
    type Integrator<M: Dae, T: Real>;
}

impl<const S: usize> Batched for Gauss<S>
where
    Self: Method<S>,
{
    type Integrator<M: Dae, T: Real> = Integrator<M, Self, S, T>;
}
impl<const S: usize> Batched for RadauIIA<S>
where
    Self: Method<S>,
{
    type Integrator<M: Dae, T: Real> = Integrator<M, Self, S, T>;
}
impl<const S: usize> Batched for Custom<S> {
    type Integrator<M: Dae, T: Real> = Integrator<M, Self, S, T>;
}
