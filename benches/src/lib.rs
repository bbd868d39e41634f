//! What the programs of this package share: cases, calls of the integrators by name, and timing.

pub mod calls;
pub mod case;
pub mod models;
pub mod record;
pub mod time;
