//! The models: those of the examples.

#[path = "../../examples/models/awe.rs"]
pub mod awe;
#[path = "../../examples/models/pendulum.rs"]
pub mod pendulum;

/// The chain of masses, in the sizes that are measured.
pub mod chain {
    include!(concat!(env!("OUT_DIR"), "/chain.rs"));
}

pub use awe::Awe;
pub use chain::{Chain, stretched};
pub use pendulum::Pendulum;
