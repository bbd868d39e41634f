//! [picture]: https://raw.githubusercontent.com/casados/casados/main/docs/benchmarks/awe_orbit.svg
//!
#![doc = include_str!("../README.md")]
//!
//! # The guide
//!
//! [`guide`] has chapters with programs that run, from a first model to firmware;
//! [`guide::language`] describes what a model may contain.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "casadi")]
pub use casados_core::casadi;
#[cfg(feature = "plot")]
pub use casados_core::plot;
#[cfg(feature = "testing")]
pub use casados_core::testing;
#[cfg(feature = "alloc")]
pub use casados_core::{
    Adaptive, AdaptiveOptions, AdaptiveStatistics, Batch, BatchError, BatchStatistics, Crossing, Event, Heap,
    Hybrid, Intervals, Piecewise, Radau,
};
pub use casados_core::{
    Butcher6, Consistent, Constrained, Custom, Dae, Dims, Divided, DormandPrince5, DormandPrince8, Erk,
    Error, Euler, Function, Gauss, GraphDae, GraphFunction, Heun, Inconsistent, Inline, Integrator, Irk,
    LeastSquares, Method, Midpoint, Ode, Options, Projectable, Projected, Quadrature, RadauIIA, Real, Record,
    Rk4, Shape, Statistics, Tableau, TableauError, mode, nalgebra, ocp, qp, result, tables,
};
pub use casados_macros::{Record, dae, function, ode};

#[doc(hidden)]
pub use casados_core::__private;

/// The names that most programs need: `use casados::prelude::*;`
///
/// Its names do not collide with those of [`ocp`], [`qp`] and nalgebra. A program that does not
/// depend on nalgebra imports it from here, with its macros:
///
/// ```
/// use casados::nalgebra::{self, vector};
/// use casados::prelude::*;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
///
/// let mut erk = Erk::<Cart, Rk4>::new(Options::default())?;
/// let end = erk.solve(&vector![0.0, 1.0], &vector![2.0], 0.5)?;
/// assert!((end.x - vector![0.75, 2.0]).norm() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
pub mod prelude {
    pub use crate::Integrator as _;
    #[doc(no_inline)]
    pub use crate::options::{Jacobian, Newton, Start};
    #[doc(no_inline)]
    pub use crate::result::Seeds;
    #[cfg(feature = "alloc")]
    #[doc(no_inline)]
    pub use crate::{
        Adaptive, AdaptiveOptions, Batch, BatchError, Crossing, Event, Heap, Hybrid, Intervals, Piecewise,
        Radau,
    };
    #[doc(no_inline)]
    pub use crate::{
        Butcher6, Custom, Dae, DormandPrince5, DormandPrince8, Erk, Error, Euler, Function, Gauss, Heun,
        Inline, Irk, LeastSquares, Midpoint, Ode, Options, Quadrature, RadauIIA, Record, Rk4, Tableau, dae,
        function, ode,
    };
}

/// Types of the fields of [`Options`].
///
/// ```
/// use casados::options::{Newton, Start};
/// use casados::prelude::*;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
///
/// let newton = Newton { tolerance: 1e-9, ..Default::default() };
/// let options = Options { steps: 2, newton, start: Start::Warm, ..Default::default() };
/// let irk = Irk::<Cart, Gauss<2>>::new(options)?;
/// assert_eq!(irk.options().steps, 2);
/// # Ok::<(), casados::Error>(())
/// ```
pub mod options {
    pub use casados_core::options::{Jacobian, Newton, Start};
}

/// The contents of an [`Error`]: the argument, the place and the cause.
///
/// ```
/// use casados::error::Argument;
/// use casados::prelude::*;
/// use nalgebra::vector;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
///
/// let mut irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
/// let error = irk.solve(&vector![0.0, f64::NAN], &vector![1.0], 0.5).unwrap_err();
/// println!("{error}"); // which of them, by its name
/// assert!(matches!(error, Error::NonFiniteInput { argument: Argument::X0, .. }));
/// # Ok::<(), casados::Error>(())
/// ```
pub mod error {
    pub use casados_core::error::{Argument, Place, Quantity, Refusal, Started, Unsettled};
}

/// Vectors and matrices of a model, and its properties that are known at compile time.
///
/// The initial state of a generic model `M` is a `VectorX<M, f64>`; of a concrete model it is an
/// `SVector<f64, NX>` of [`nalgebra`].
///
/// ```
/// use casados::model::{VectorU, VectorX};
/// use casados::prelude::*;
/// use nalgebra::vector;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
///
/// /// The state after `n` intervals of a second.
/// fn after<M: Dae>(n: usize, x: &VectorX<M, f64>, u: &VectorU<M, f64>) -> Result<VectorX<M, f64>, Error> {
///     let mut irk = Irk::<M, Gauss<2>>::new(Options::default())?;
///     (0..n).try_fold(*x, |x, _| Ok(irk.solve(&x, u, 1.0)?.x))
/// }
///
/// let x = after::<Cart>(2, &vector![0.0, 0.0], &vector![1.0])?;
/// assert!((x - vector![2.0, 2.0]).norm() < 1e-13);
/// assert_eq!(Cart::describe().x, ["x[0]", "x[1]"]);
/// # Ok::<(), casados::Error>(())
/// ```
pub mod model {
    pub use casados_core::model::{
        Cost, MatrixPC, MatrixPP, MatrixUC, MatrixUP, MatrixUU, MatrixXC, MatrixXP, MatrixXU, MatrixXX,
        MatrixZC, MatrixZP, MatrixZU, MatrixZX, Operations, Pattern, Range, Structure, Units, VectorP,
        VectorU, VectorX, VectorZ,
    };
}

/// Vectors and matrices of a [`Function`].
pub mod function {
    pub use casados_core::function::{
        FunctionStructure, MatrixYP, MatrixYU, MatrixYX, MatrixYY, MatrixYZ, VectorY,
    };
}

/// Implicit methods: the type behind [`Irk`].
pub mod irk {
    pub use casados_core::irk::{Implicit, Integrator};
}

/// Explicit methods: the type behind [`Erk`].
pub mod erk {
    pub use casados_core::erk::{Explicit, Integrator};
}

/// Integration of many intervals in one call: the type behind [`Batch`].
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
///
/// let mut batch = Batch::<Cart, Gauss<2>>::new(Options::default())?;
/// // Each interval has its own state and control; all have the same length.
/// let (x0, u) = ([vector![0.0, 0.0]; 40], [1.0; 40].map(|u| vector![u]));
/// let intervals = Intervals { x0: &x0, u: &u, h: &[0.5], ..Default::default() };
/// let mut ends = vec![casados::result::Forward::default(); 40];
/// batch.forward(&intervals, &mut ends)?;
/// assert!(ends.iter().all(|end| (end.x - vector![0.125, 0.5]).norm() < 1e-14));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[cfg(feature = "alloc")]
pub mod batch {
    pub use casados_core::batch::{Batched, Integrator, Single, Slice, Standard};
}

/// Adaptive step sizes: the type behind [`Adaptive`], and the results of [`Piecewise`] and
/// [`Hybrid`].
#[cfg(feature = "alloc")]
pub mod adaptive {
    pub use casados_core::adaptive::{
        AdaptiveMethod, HybridAdjoint, HybridForward, HybridHessian, Integrator, Occurrence,
        PiecewiseAdjoint, PiecewiseForward, PiecewiseHessian, PiecewiseLeastSquares, PiecewiseQuadrature,
        Solution, Spanning, TimeGradient,
    };
}

/// Integrals along a solution, computed by an integrator.
pub mod integrator {
    pub use casados_core::integrator::With;
    pub use casados_core::quadrature::Integrand;
}

/// Capabilities of an integrator's memory, for trait bounds: `W: Memory + WithForward`.
pub mod memory {
    #[cfg(feature = "alloc")]
    pub use casados_core::memory::Shared;
    pub use casados_core::memory::{
        Memory, WithAdjoint, WithDirectional, WithForward, WithHessian,
        fallback::{Pivoting, Refusing},
    };
}

/// Elementary functions of `f64` and `f32` as methods, for targets without `std`.
///
/// Models import them implicitly. Helper functions outside of a model need
/// `use casados::scalar::Float as _;`.
pub mod scalar {
    pub use casados_core::scalar::Float;
}

/// Models over num-dual, for Rust code that the attributes cannot read.
#[cfg(feature = "num-dual")]
pub mod dual {
    pub use casados_core::dual::{DualModel, DualNum, DualNumCopy};
}

// Compiled for the documentation only; its examples are tests.
#[cfg(any(doc, doctest))]
pub mod guide;
