//! Fast, accurate Runge-Kutta integrators with exact sensitivities for optimal control.
#![no_std]
#![forbid(unsafe_code)]

pub use casados_core::*;
pub use casados_macros::{dae, ode};

/// What most programs need: `use casados::prelude::*;`
pub mod prelude {
    pub use casados_core::prelude::*;
    pub use casados_macros::{dae, ode};
}
