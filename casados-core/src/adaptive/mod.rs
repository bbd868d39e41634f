//! Integration with steps of variable size, chosen so that the estimated error of each stays below
//! a tolerance.
//!
//! Radau IIA methods for stiff and differential-algebraic equations, with one Jacobian for all
//! stages and, for [`Radau`], a number of stages (3, 5 or 7: orders 5, 9 and 13) that follows from
//! how Newton's method converges. The algorithm is that of the codes RADAU5 and RADAU (E. Hairer,
//! G. Wanner, Solving Ordinary Differential Equations II, section IV.8; Stiff differential
//! equations solved by Radau methods, J. Comput. Appl. Math. 111 (1999)), for fully implicit
//! equations. [`Gauss`] methods of orders 4 to 12, where oscillations are not to be damped, with an
//! estimate of the same kind: how far the derivative of the polynomial, extrapolated to the end of
//! the step, is from the solution there, through the matrix of one eigenvalue. Explicit pairs of
//! orders 5 and 8 ([`DormandPrince5`], [`DormandPrince8`]) for explicit models that are not stiff.
//!
//! One file for each thing: `stages` what a step is, `collocation` an implicit one and `kernels`
//! its loops, `defect_filter` the second estimate of its error, `orders` the methods of a family
//! and `implicit` the engine of them, `control` the step size, `start` where a run begins and
//! `consistent` at which derivatives, those of explicit models by `rates`, at a `point`, `run` the
//! steps of an interval, `tape` what is remembered of them, `pairs`, `explicit_step` and `explicit`
//! the explicit methods, `replay` and `sensitivities` derivatives of runs, `variational`
//! derivatives that take part in the choice of the steps, `along` an integrand, `segment` one of
//! several intervals, `piecewise` those with controls of their own, `columns` their derivatives and
//! `integrals` those of an integrand, `events`, `integrator` what users see.

mod along;
mod branches;
mod collocation;
mod columns;
mod consistent;
mod control;
mod defect_filter;
mod events;
mod explicit;
mod explicit_step;
mod implicit;
mod integrals;
mod integrator;
mod kernels;
mod norm;
mod options;
mod orders;
mod pairs;
mod piecewise;
mod point;
mod rates;
mod replay;
mod run;
mod segment;
mod sensitivities;
mod stages;
mod start;
mod statistics;
mod tape;
mod variational;

pub use events::{
    Crossing, Event, Hybrid, HybridAdjoint, HybridForward, HybridHessian, Occurrence, Solution, TimeGradient,
};
pub use integrals::{PiecewiseLeastSquares, PiecewiseQuadrature, Spanning};
pub use integrator::Integrator;
pub use options::AdaptiveOptions;
pub use piecewise::{Piecewise, PiecewiseAdjoint, PiecewiseForward, PiecewiseHessian};
#[cfg(feature = "casadi")]
pub(crate) use sealed::Engine;
pub use statistics::AdaptiveStatistics;

use crate::error::Error;
use crate::model::Dae;
use crate::scalar::Real;
use crate::tableau::{DormandPrince5, DormandPrince8, Gauss, Method, RadauIIA};
use alloc::boxed::Box;
use replay::{OneMethod, ThreeMethods};
use stages::Stages;

/// The adaptive integrator of the method `B` for the model `M`, with numbers `T`:
/// `Adaptive<Model, Radau>`.
///
/// Steps are as long as the estimate of their error allows, weighted with `atol + rtol |x|`.
/// Derivatives are those of the accepted steps. Methods are [`Radau`], of orders 5, 9 and 13 as it
/// goes; one of `RadauIIA<3>`, `<5>`, `<7>`, `Gauss<2>` to `Gauss<6>`; and for explicit models
/// `DormandPrince5` and `DormandPrince8`.
///
/// It is an [`Integrator`], whose page has all that it can do:
///
/// | | |
/// | --- | --- |
/// | [`new`](Integrator::new) | memory on the heap |
/// | [`set_parameters`](Integrator::set_parameters), [`set_time`](Integrator::set_time), [`set_start`](Integrator::set_start) | `p`, `t` at the start of intervals, start values of `ẋ` and `z` |
/// | [`set_relative_tolerances`](Integrator::set_relative_tolerances), [`set_absolute_tolerances`](Integrator::set_absolute_tolerances) | tolerances of single states |
/// | [`control_sensitivities`](Integrator::control_sensitivities) | derivatives take part in the error control |
/// | [`solve`](Integrator::solve), [`solve_at`](Integrator::solve_at) | `x₊`, also with the solution at given times |
/// | [`forward`](Integrator::forward) | and derivatives by `(x₀, u, p)` |
/// | [`adjoint`](Integrator::adjoint) | and gradients of `λᵀx₊` |
/// | [`hessian`](Integrator::hessian) | and second derivatives |
/// | [`dense`](Integrator::dense) | the solution inside the last interval |
/// | [`freeze`](Integrator::freeze), [`thaw`](Integrator::thaw) | later calls take the same steps |
/// | [`times`](Integrator::times), [`statistics`](Integrator::statistics) | the accepted steps, and what they took |
///
/// By default six digits: [`AdaptiveOptions`]. Units are those of the model.
///
/// # Errors
/// Those of [`Integrator`]: no consistent start, steps that would have to be too short or too many,
/// a model without a value, inputs that are not finite.
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

/// A method that an adaptive integrator takes.
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
    /// Its integrator.
    type Integrator<M: Dae, T: Real>;
}

/// Radau IIA methods of 3, 5 and 7 stages: more of them where Newton's method converges fast, fewer
/// where it is slow.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
///
/// /// Van der Pol's oscillator, which is stiff.
/// #[ode]
/// fn oscillator(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], 1e3 * (1.0 - x[0] * x[0]) * x[1] - x[0] + u[0]]
/// }
///
/// let mut adaptive = Adaptive::<Oscillator, Radau>::new(AdaptiveOptions::default())?;
/// adaptive.solve(&vector![2.0, 0.0], &vector![0.0], 500.0)?;
/// // An explicit method of fixed steps needs more than 1e6 for the same.
/// assert!(adaptive.statistics().steps < 1000);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Radau;

mod sealed {
    use super::*;
    use crate::model::VectorX;
    use crate::result::Dense;
    use replay::StepDifferentiator;
    use run::{After, Run, Span};
    use tape::Entry;

    /// What a method remembers. Nobody outside can name it.
    pub trait Kind<M: Dae, T: Real>: 'static {
        /// Its memory.
        type State: Default + Send + Sync;
    }

    /// What integrates with steps of variable size, for the models that it can.
    pub trait Engine<M: Dae, T: Real>: Kind<M, T> {
        /// Whether `z` at the end of a step is that of a stage; else it is found from the
        /// equations.
        const ENDS_ON_STAGE: bool;
        /// What takes its steps again.
        type Replays: StepDifferentiator<M, T>;
        /// Integrates an interval; `after` is called after each accepted step.
        ///
        /// # Errors
        /// Whatever ends a run early.
        fn integrate(
            state: &mut Self::State,
            run: &mut Run<'_, M, T>,
            x0: &VectorX<M, T>,
            span: Span<T>,
            after: After<'_, M, T>,
        ) -> Result<(), Error>;
        /// The solution inside a step, from its numbers; `inputs` are variables of the model, of
        /// which `u` and `p` count.
        ///
        /// # Errors
        /// A value of the model that is not finite.
        fn interpolate(
            state: &mut Self::State,
            inputs: &[T],
            entry: &Entry<T>,
            numbers: (&[T], &[T]),
            t: T,
            dense: &mut Dense<M, T>,
        ) -> Result<(), Error>;
        /// What takes a step again.
        fn replays(state: &mut Self::State) -> &mut Self::Replays;
    }

    /// The methods that an integrator may change between.
    pub trait Family: 'static {
        /// How many.
        const LEVELS: usize;
        /// See [`Engine`].
        const ENDS_ON_STAGE: bool;
        /// What takes their steps again.
        type Replays<M: Dae, T: Real>: StepDifferentiator<M, T> + Default + Send + Sync;
        /// One of them.
        ///
        /// # Errors
        /// [`Error::OutOfMemory`]
        fn open<M: Dae, T: Real>(level: usize) -> Result<Box<dyn Stages<M, T> + Send + Sync>, Error>;
    }
}
use sealed::Family;

impl Family for Radau {
    const LEVELS: usize = 3;
    const ENDS_ON_STAGE: bool = true;
    type Replays<M: Dae, T: Real> = ThreeMethods<
        OneMethod<M, RadauIIA<3>, T, 3>,
        OneMethod<M, RadauIIA<5>, T, 5>,
        OneMethod<M, RadauIIA<7>, T, 7>,
    >;
    fn open<M: Dae, T: Real>(level: usize) -> Result<Box<dyn Stages<M, T> + Send + Sync>, Error> {
        match level {
            0 => RadauIIA::<3>::open(0),
            1 => RadauIIA::<5>::open(0),
            _ => RadauIIA::<7>::open(0),
        }
    }
}

macro_rules! single {
    ($($method:ident: $stages:literal, $groups:literal, $ends_on_stage:literal);*) => {
        $(impl Family for $method<$stages> {
            const LEVELS: usize = 1;
            const ENDS_ON_STAGE: bool = $ends_on_stage;
            type Replays<M: Dae, T: Real> = OneMethod<M, Self, T, $stages>;
            fn open<M: Dae, T: Real>(_: usize) -> Result<Box<dyn Stages<M, T> + Send + Sync>, Error> {
                // As many lanes as there are eigenvalues, filled up to registers; stages in groups
                // of four.
                let tableau = <Self as Method<$stages>>::TABLEAU;
                Ok(Box::new(collocation::Collocation::<M, T, $stages, $groups>::new(tableau)?))
            }
        })*
    };
}
single!(RadauIIA: 3, 1, true; RadauIIA: 5, 2, true; RadauIIA: 7, 2, true);
single!(Gauss: 2, 1, false; Gauss: 3, 1, false; Gauss: 4, 1, false; Gauss: 5, 2, false; Gauss: 6, 2, false);

macro_rules! methods {
    ($($method:ty),*) => {
        $(impl AdaptiveMethod for $method {
            type Integrator<M: Dae, T: Real> = Integrator<M, Self, T>;
        })*
    };
}
methods!(Radau, RadauIIA<3>, RadauIIA<5>, RadauIIA<7>, DormandPrince5, DormandPrince8);
methods!(Gauss<2>, Gauss<3>, Gauss<4>, Gauss<5>, Gauss<6>);
