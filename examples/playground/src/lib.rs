//! casados in the browser: a pendulum that real-time iterations swing up, and an orbit that an
//! interior point finds.
//!
//! The page calls the functions that are exported here with numbers, and reads and writes longer
//! lists of them in place: `*_settings`, `*_state`, … say where they are. There is one pendulum and
//! one orbit. What fails returns 1, and `message` says why.

#[path = "../../models/awe.rs"]
mod awe;
mod orbit;
mod pendulum;
#[path = "../../awe_orbit/problem.rs"]
#[allow(dead_code)] // The flight that is no orbit.
mod problem;
mod pushed;
mod shared;

pub use orbit::*;
pub use pendulum::*;
pub use shared::*;
