//! What `paper.py` loads: the chain of masses or the orbit of the aircraft, as an integrator, as a
//! horizon, as a whole problem, and solved by casados' own solvers.
//!
//! One library is one model with one method: features say which.

#![cfg(not(feature = "nothing"))]

#[cfg(feature = "orbit")]
#[path = "../../../models/awe.rs"]
#[allow(dead_code)]
mod awe;
#[cfg(feature = "orbit")]
mod orbit;
#[cfg(not(feature = "orbit"))]
mod overhead;
#[cfg(not(feature = "orbit"))]
mod shooting;

use casados::ocp::Outcome;
use std::error::Error;

/// Numbers that `paper.py` has put into the environment.
fn numbers() -> Result<Vec<f64>, Box<dyn Error>> {
    let text = std::env::var("CASADOS_PAPER")?;
    Ok(text.split_whitespace().map(str::parse).collect::<Result<_, _>>()?)
}

/// What a solver of casados did.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct Report {
    /// One if it has converged.
    pub converged: f64,
    /// The objective, with penalties.
    pub objective: f64,
    /// Iterations.
    pub iterations: f64,
    /// Seconds of the whole run.
    pub total: f64,
    /// Seconds in functions and integrators: derivatives, and values at trial points.
    pub functions: f64,
}

impl Report {
    fn new(outcome: &Outcome, total: f64) -> Self {
        Self {
            converged: f64::from(u8::from(outcome.is_converged())),
            objective: outcome.objective,
            iterations: outcome.iterations as f64,
            total,
            functions: outcome.times.linearise + outcome.times.search,
        }
    }
}

/// Writes what a solver did; the status is zero if it ran.
fn write(to: &mut Report, outcome: Result<Report, Box<dyn Error>>) -> i32 {
    match outcome {
        Ok(report) => {
            *to = report;
            0
        }
        Err(error) => {
            eprintln!("{error}");
            1
        }
    }
}
