//! Integrators with steps of one size: against closed forms, independent implementations and
//! differences.

#[path = "../interval/mod.rs"]
mod interval;
#[allow(dead_code)]
#[path = "../../examples/firmware/src/lost.rs"]
mod lost;
#[allow(dead_code)] // Each program takes a part.
#[path = "../../examples/models"]
mod models {
    pub mod awe;
    pub mod chain;
    pub mod heat;
    pub mod pendulum;
}

mod algebraic;
mod analytic;
mod bindings;
mod cells;
mod erk;
mod erk_reference;
mod examples;
mod heat;
mod kinematic;
mod panels;
