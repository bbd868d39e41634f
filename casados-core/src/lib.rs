//! The engine of `casados`: **use `casados`, of which this crate is a part.**
//!
//! Paths of modules may change in any version; those of `casados` follow semantic versioning.
//!
//! Implicit and explicit Runge-Kutta methods for differential-algebraic equations
//! `f(ẋ, x, u, z, p, t) = 0`, with forward, adjoint and second-order sensitivities that are the
//! exact derivatives of the discrete step. `no_std`; memory is static, or on the heap with the
//! feature `alloc`.
//!
//! A model is a type that implements [`Dae`]; the attributes of `casados-macros` generate the
//! implementation from a Rust function.
#![no_std]
#![deny(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic,
        clippy::unreachable,
        clippy::todo,
        clippy::unimplemented
    )
)]

#[cfg(feature = "alloc")]
extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

/// Implements `Debug` of an error by its text, since `unwrap`, and `main` with a `Result`, print
/// `Debug`.
macro_rules! debug_is_display {
    ($error:ty) => {
        impl core::fmt::Debug for $error {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                core::fmt::Display::fmt(self, f)
            }
        }
    };
}

#[cfg(not(any(feature = "std", feature = "libm")))]
compile_error!(
    "casados needs elementary functions: enable the feature `std`, or `libm` for targets without it"
);

#[cfg(feature = "alloc")]
pub mod adaptive;
#[cfg(feature = "alloc")]
pub mod batch;
#[cfg(feature = "casadi")]
pub mod casadi;
pub mod constrained;
#[cfg(feature = "num-dual")]
pub mod dual;
pub mod erk;
pub mod error;
mod finite;
pub mod function;
pub mod integrator;
pub mod irk;
mod linalg;
pub mod memory;
pub mod model;
pub mod ocp;
pub mod options;
pub mod plan;
#[cfg(feature = "plot")]
pub mod plot;
pub mod qp;
pub mod quadrature;
mod record;
pub mod result;
pub mod scalar;
pub mod shape;
pub mod statistics;
pub mod structure;
pub mod tableau;
pub mod tables;
#[cfg(feature = "testing")]
pub mod testing;

#[cfg(feature = "alloc")]
pub use adaptive::{
    Adaptive, AdaptiveOptions, AdaptiveStatistics, Crossing, Event, Hybrid, Piecewise, Radau,
};
#[cfg(feature = "alloc")]
pub use batch::{Batch, BatchError, BatchStatistics, Intervals};
pub use constrained::{Consistent, Constrained, Inconsistent, Projectable, Projected};
pub use erk::Erk;
pub use error::Error;
pub use function::{Function, GraphFunction};
pub use integrator::{Divided, Integrator};
pub use irk::Irk;
#[cfg(feature = "alloc")]
pub use memory::Heap;
pub use memory::{Inline, mode};
pub use model::{Dae, GraphDae, Ode};
pub use options::Options;
pub use quadrature::{LeastSquares, Quadrature};
pub use record::Record;
pub use scalar::{Field, Lanes, Real, Scalar};
pub use shape::{Dims, Shape};
pub use statistics::Statistics;
pub use tableau::{
    Butcher6, Custom, DormandPrince5, DormandPrince8, Euler, Gauss, Heun, Method, Midpoint, RadauIIA, Rk4,
    Tableau, TableauError,
};

// Vectors and matrices of arguments and results are nalgebra types.
pub use nalgebra;

/// Used by generated code and by tests of the engine; may change in any version.
#[doc(hidden)]
pub mod __private {
    #[cfg(feature = "num-dual")]
    pub use crate::dual;
    pub use crate::function::{self, ArrayY, FunctionStructure, begins, by_row};
    pub use crate::memory::{Absent, Fallback, Family, Inside, OptionalPlace, Stored};
    pub use crate::model::{ArrayK, ArrayV, ArrayW, ArrayX, Range};
    pub use crate::scalar::{Float, Known, Piece, Rows, Tangent, elementary};
    pub use crate::shape::{Aligned, Array, Count, Matrix, Outputs, Plain};
    pub use crate::structure::{
        Assembly, Cost, Dependent, DiagonalControl, Elimination, Kinematic, Left, NO_COLUMN, Operations,
        Pattern, Pivot, Reduction, Structure, Supernode, Term, Units, Update, all, by_column, columns,
        symmetric,
    };
    pub use crate::tables;
    pub use crate::{
        Constrained, Dae, Dims, Field, Function, GraphDae, GraphFunction, Lanes, Ode, Projectable, Record,
        Scalar, Shape,
    };
}
