//! What optimised programs have to show as well: agreement with the references, where loops are
//! unrolled, and a million steps. `cargo test --release --test optimised`.

#[allow(dead_code)] // Each program takes a part.
#[path = "../../examples/models"]
mod models {
    pub mod awe;
    pub mod chain;
    pub mod pendulum;
}
#[path = "../methods/orbit.rs"]
mod orbit;

mod long_runs;
mod reference;
