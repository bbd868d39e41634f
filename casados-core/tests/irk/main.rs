//! Implicit integrators on models written by hand, as the contract of models asks for them.

#[path = "../models/mod.rs"]
mod models;

mod closed_forms;
mod derivatives;
mod errors;
mod pendulum;
mod pendulum_reference;
