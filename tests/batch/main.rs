//! Many intervals in one call.

#[allow(dead_code)] // Each program takes a part.
#[path = "../../examples/models"]
mod models {
    pub mod awe;
    pub mod chain;
    pub mod pendulum;
    pub mod quadrotor;
}

mod agreement;
mod explicit;
mod failures;
mod horizon;
mod tube;
