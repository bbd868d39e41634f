//! Adaptive integration: step-size control by an estimate of the local error.
//!
//! Radau IIA methods for stiff and differential-algebraic equations, with one Jacobian for all
//! stages; [`Radau`] selects the number of stages (3, 5 or 7: orders 5, 9 and 13) by the
//! convergence of Newton's method. The algorithm is that of the codes RADAU5 and RADAU (E. Hairer,
//! G. Wanner, Solving Ordinary Differential Equations II, section IV.8; Stiff differential
//! equations solved by Radau methods, J. Comput. Appl. Math. 111 (1999)), for fully implicit
//! equations. [`Gauss`] methods of orders 4 to 12, which do not damp oscillations, with a similar
//! estimate: the difference between the derivative of the polynomial, extrapolated to the end of
//! the step, and that of the solution, solved with the matrix of one eigenvalue. Explicit pairs of
//! orders 5 and 8 ([`DormandPrince5`], [`DormandPrince8`]) for explicit non-stiff models.
//!
//! From the bottom up:
//!
//! - data: `options`, `statistics`, `point`, `tape`;
//! - `tolerances`, `discontinuity` (branches), `newton_monitor` (convergence), `error_estimate`
//!   (second estimate), `step_size` (controllers), `pairs` (coefficients of explicit methods);
//! - `stages` and `replay`: the traits of a step and of its derivatives; `order`: the methods of a
//!   family and order selection;
//! - `consistent`: derivatives at a point; `variational`: error control of sensitivities;
//! - `step`: the loop over the steps of implicit methods; `engine`: the trait of a method;
//!   `methods`: all methods;
//! - `sensitivities`: derivatives of runs; `integrator`: the public interface; `segment` and
//!   `piecewise`: several intervals with their own controls; `events`; `quadrature`: integrands.

mod consistent;
mod discontinuity;
mod engine;
mod error_estimate;
mod events;
mod integrator;
mod methods;
mod newton_monitor;
mod options;
mod order;
mod pairs;
mod piecewise;
mod point;
mod quadrature;
mod replay;
mod segment;
mod sensitivities;
mod stages;
mod statistics;
mod step;
mod step_size;
mod tape;
mod tolerances;
mod variational;

#[cfg(feature = "casadi")]
pub(crate) use engine::Engine;
pub use events::{
    Crossing, Event, Hybrid, HybridAdjoint, HybridForward, HybridHessian, Occurrence, Solution, TimeGradient,
};
pub use integrator::Integrator;
pub use methods::Radau;
pub use options::AdaptiveOptions;
pub use piecewise::{
    Piecewise, PiecewiseAdjoint, PiecewiseForward, PiecewiseHessian, PiecewiseLeastSquares,
    PiecewiseQuadrature, Spanning,
};
pub use statistics::AdaptiveStatistics;

use crate::model::Dae;
use crate::scalar::Real;
use crate::tableau::{DormandPrince5, DormandPrince8, Gauss, RadauIIA};

/// The adaptive integrator of the method `B` for the model `M`, with numbers `T`:
/// `Adaptive<Model, Radau>`.
///
/// The step size is controlled by an estimate of the local error, weighted with `atol + rtol |x|`.
/// Derivatives are those of the accepted steps. Methods are [`Radau`], which selects among orders
/// 5, 9 and 13; `RadauIIA<3>`, `<5>`, `<7>`, and `Gauss<2>` to `Gauss<6>`; and for explicit models
/// `DormandPrince5` and `DormandPrince8`.
///
/// It is an [`Integrator`], whose page documents all calls:
///
/// | call | effect |
/// | --- | --- |
/// | [`new`](Integrator::new) | memory on the heap |
/// | [`set_parameters`](Integrator::set_parameters), [`set_time`](Integrator::set_time), [`set_start`](Integrator::set_start) | `p`, `t` at the start of intervals, initial guess of `ẋ` and `z` |
/// | [`set_relative_tolerances`](Integrator::set_relative_tolerances), [`set_absolute_tolerances`](Integrator::set_absolute_tolerances) | tolerances of individual states |
/// | [`control_sensitivities`](Integrator::control_sensitivities) | error control of sensitivities |
/// | [`solve`](Integrator::solve), [`solve_at`](Integrator::solve_at) | `x₊`, also with the solution at given times |
/// | [`forward`](Integrator::forward) | and derivatives with respect to `(x₀, u, p)` |
/// | [`adjoint`](Integrator::adjoint) | and gradients of `λᵀx₊` |
/// | [`hessian`](Integrator::hessian) | and second derivatives |
/// | [`dense`](Integrator::dense) | the solution within the last interval |
/// | [`freeze`](Integrator::freeze), [`thaw`](Integrator::thaw) | later calls repeat the same steps |
/// | [`times`](Integrator::times), [`statistics`](Integrator::statistics) | the accepted steps, and their cost |
///
/// The default relative tolerance is 1e-6; see [`AdaptiveOptions`]. Units are those of the model.
///
/// # Errors
/// Those of [`Integrator`]: inconsistent initial values, a step size below the minimum, too many
/// steps, a model or inputs that are not finite.
///
/// # Example
/// ```
/// use casados::prelude::*;
/// use nalgebra::{Vector1, vector};
///
/// /// A first-order lag of 1/rate seconds.
/// #[ode]
/// fn lag(x: [f64; 1], u: [f64; 1], p: [f64; 1]) -> [f64; 1] {
///     [p[0] * (u[0] - x[0])]
/// }
///
/// let options = AdaptiveOptions { rtol: 1e-10, atol: 1e-12, ..Default::default() };
/// let mut adaptive = Adaptive::<Lag, Radau>::new(options)?;
/// adaptive.set_parameters(&vector![100.0])?;
/// let step = adaptive.forward(&vector![1.0], &Vector1::zeros(), 0.02)?;
/// // x₊ = x₀ e^(−p h): errors of single steps are below rtol, and steps are a few dozens.
/// let exact = (-2.0_f64).exp();
/// assert!((step.x[0] - exact).abs() < 1e-8);
/// assert!((step.dx_dx0[(0, 0)] - exact).abs() < 1e-8);
/// assert!((adaptive.dense(0.01)?.x[0] - (-1.0_f64).exp()).abs() < 1e-8);
/// # Ok::<(), casados::Error>(())
/// ```
pub type Adaptive<M, B, T = f64> = <B as AdaptiveMethod>::Integrator<M, T>;

/// A method of an adaptive integrator.
///
/// ```
/// use casados::adaptive::AdaptiveMethod;
/// use casados::prelude::*;
/// use nalgebra::vector;
///
/// #[ode]
/// fn decay(x: f64) -> f64 { -x }
///
/// /// An integrator of a method by its options alone.
/// type Of<B> = <B as AdaptiveMethod>::Integrator<Decay, f64>;
///
/// let mut explicit = Of::<DormandPrince5>::new(AdaptiveOptions::default())?;
/// let mut implicit = Of::<Radau>::new(AdaptiveOptions::default())?;
/// let (a, b) = (explicit.solve(&vector![1.0], &vector![], 1.0)?, implicit.solve(&vector![1.0], &vector![], 1.0)?);
/// assert!((a.x[0] - b.x[0]).abs() < 1e-4);
/// # Ok::<(), casados::Error>(())
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a method with an estimate of its error",
    note = "`Radau`, `RadauIIA<3>`, `RadauIIA<5>`, `RadauIIA<7>` and `Gauss<2>` to `Gauss<6>` are, and for explicit models \
            `DormandPrince5` and `DormandPrince8`"
)]
pub trait AdaptiveMethod {
    /// The integrator of the method.
    type Integrator<M: Dae, T: Real>;
}

macro_rules! methods {
    ($($method:ty),*) => {
        $(impl AdaptiveMethod for $method {
            type Integrator<M: Dae, T: Real> = Integrator<M, Self, T>;
        })*
    };
}
methods!(Radau, RadauIIA<3>, RadauIIA<5>, RadauIIA<7>, DormandPrince5, DormandPrince8);
methods!(Gauss<2>, Gauss<3>, Gauss<4>, Gauss<5>, Gauss<6>);
