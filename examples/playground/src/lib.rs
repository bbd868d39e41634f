//! casados in the browser: a pendulum that real-time iterations swing up, and an orbit that an
//! interior point finds.
//!
//! The page calls the functions that are exported here with numbers, and reads and writes longer
//! lists of them in place: `*_settings`, `*_state`, … say where they are. There is one pendulum and
//! one orbit. What fails returns 1, and `message` says why.

#[cfg(not(test))] // What takes minutes to compile is tried in a browser.
#[path = "../../models/awe.rs"]
mod awe;
mod controller;
#[cfg(not(test))]
mod orbit;
mod pendulum;
#[cfg(not(test))]
#[path = "../../awe_orbit/problem.rs"]
#[allow(dead_code)] // The flight that is no orbit.
mod problem;
mod pushed;
mod shared;
#[cfg(test)]
mod sliders;

#[cfg(not(test))]
pub use orbit::*;
pub use pendulum::*;
pub use shared::*;
