//! [picture]: https://raw.githubusercontent.com/casados/casados/main/docs/benchmarks/awe_orbit.svg
//!
#![doc = include_str!("../README.md")]
//!
//! # The guide
//!
//! [`guide`] has chapters with programs that run, from a first model to firmware;
//! [`guide::language`] says what a model may contain.
#![no_std]
#![forbid(unsafe_code)]

pub use casados_core::*;
pub use casados_macros::{Record, dae, function, ode};

/// What most programs need: `use casados::prelude::*;`
pub mod prelude {
    pub use casados_core::Integrator as _;
    pub use casados_core::prelude::*;
    pub use casados_macros::{dae, function, ode};
}

// Of the documentation only, whose examples are run.
#[cfg(any(doc, doctest))]
pub mod guide;
