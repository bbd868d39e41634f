//! Stress: what breaks integrators, and what must not break here.

#[path = "../../examples/models/ivp/chemistry.rs"]
mod chemistry;
#[path = "../interval/mod.rs"]
mod interval;
#[path = "../systems/mod.rs"]
mod systems;

mod adaptive;
mod elimination;
mod identities;
mod invariants;
mod orbit;
mod order;
mod scaling;
mod stability;
mod tableaux;
