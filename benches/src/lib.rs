//! What the programs of this package share: cases, calls of the integrators by name, peers in other
//! processes, and timing.

pub mod calls;
pub mod case;
pub mod models;
pub mod peer;
pub mod record;
pub mod time;
