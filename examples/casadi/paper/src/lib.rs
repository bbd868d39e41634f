//! What `paper.py` loads: the chain of masses or the orbit of the aircraft, as an integrator, as a
//! horizon, as a whole problem, and solved by casados' own solvers.
//!
//! One library is one model with one method: features say which.

#![cfg(not(feature = "nothing"))]

#[cfg(feature = "orbit")]
#[path = "../../../models/awe.rs"]
#[allow(dead_code)]
mod awe;
#[cfg(not(any(feature = "orbit", feature = "alone")))]
mod comparison;
#[cfg(feature = "orbit")]
mod orbit;
#[cfg(not(any(feature = "orbit", feature = "alone")))]
mod overhead;
#[cfg(not(feature = "alone"))]
mod report;
#[cfg(not(feature = "orbit"))]
mod shooting;

use std::error::Error;

/// Numbers that `paper.py` has put into the environment.
fn numbers() -> Result<Vec<f64>, Box<dyn Error>> {
    let text = std::env::var("CASADOS_PAPER")?;
    Ok(text.split_whitespace().map(str::parse).collect::<Result<_, _>>()?)
}
