//! Implicit integrators, the functions they export, and the checks of both, on models written by
//! hand, as the contract of models asks for them.

mod models;

mod checks;
mod closed_forms;
mod derivatives;
mod errors;
mod external;
mod pendulum;
mod pendulum_reference;
