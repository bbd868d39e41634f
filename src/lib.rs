#![doc = include_str!("../README.md")]
//!
//! ## Testing a model of your own
//!
//! With the feature `testing`, among the `dev-dependencies`:
//!
//! ```
//! use casados::prelude::*;
//! use casados::testing::{Points, check_derivatives, check_sensitivities};
//! use nalgebra::{vector, Vector1};
//!
//! /// An oscillator whose spring force is an algebraic state.
//! #[dae]
//! fn oscillator(xdot: [f64; 2], x: [f64; 2], z: f64, p: f64) -> [f64; 3] {
//!     [xdot[0] - x[1], xdot[1] + z, z - p * x[0].sinh()]
//! }
//!
//! // Jacobian, adjoint and Hessian against num-dual, the complex step and differences, at 10 random points.
//! let points = Points::random(10).x(0, 0.5..=2.0);
//! check_derivatives::<Oscillator>(&points).assert();
//!
//! // Forward, adjoint and second-order sensitivities of a step, against each other and against differences.
//! let mut irk = Irk::<Oscillator, RadauIIA<3>>::new(Options { steps: 2, ..Default::default() })?;
//! let (x0, u, p) = (vector![1.0, 0.0], vector![], Vector1::new(2.0));
//! let report = check_sensitivities(&mut irk, &x0, &u, &p, 0.1)?;
//! println!("{report}");
//! report.assert();
//! # Ok::<(), casados::Error>(())
//! ```
#![no_std]
#![forbid(unsafe_code)]

pub use casados_core::*;
pub use casados_macros::{dae, function, ode};

/// What most programs need: `use casados::prelude::*;`
pub mod prelude {
    pub use casados_core::prelude::*;
    pub use casados_macros::{dae, function, ode};
}

/// The examples of the documentation are run.
#[cfg(doctest)]
#[doc = include_str!("../docs/language.md")]
mod language {}
