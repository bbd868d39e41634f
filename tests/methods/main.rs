//! Methods as the books describe them: constants and order conditions of tableaux, stability
//! functions, orders of convergence, invariants, stiffness. Numbers are those of the list in
//! `tests/stress/main.rs`.

#[allow(dead_code)] // Each program takes a part.
#[path = "../../examples/models/ivp"]
mod models {
    pub mod chemistry;
    pub mod oscillators;
}

mod endpoints;
mod invariants;
mod orbit;
mod order;
mod pollution;
mod properties;
mod stability;
mod stiffness;
mod systems;
mod tableaux;
