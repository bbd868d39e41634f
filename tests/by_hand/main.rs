//! Implicit integrators, and the functions they export, on models written by hand, as the contract
//! of models asks for them.

mod models;

mod closed_forms;
mod derivatives;
mod errors;
mod external;
mod pendulum;
mod pendulum_reference;
