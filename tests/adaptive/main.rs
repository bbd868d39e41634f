//! Integrators that choose their steps, and what runs along every integrator: integrals, events,
//! piecewise constant controls.

#[path = "../data/mod.rs"]
mod data;
#[allow(dead_code)] // Each program takes a part.
#[path = "../../examples/models"]
mod models {
    pub mod ivp;
}

mod consistent;
mod events;
mod gauss;
mod ivp;
mod ivp_sensitivities;
mod piecewise;
mod quadrature;
mod vibrations;
