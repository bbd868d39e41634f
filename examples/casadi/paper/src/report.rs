//! What solvers of casados tell `paper.py`.

use casados::ocp::Outcome;
use std::error::Error;

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
    pub fn new(outcome: &Outcome, total: f64) -> Self {
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
pub fn write(to: &mut Report, outcome: Result<Report, Box<dyn Error>>) -> i32 {
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
