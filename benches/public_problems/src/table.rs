//! Tables.

use crate::run::Made;
use crate::{Entry, Facts};

/// Whether a run found the optimum that is known: the published one, or the least of those that
/// solvers found here.
#[must_use]
pub fn is_solved(facts: &Facts, made: &Made, best: f64) -> bool {
    let known = match facts.published {
        Some(_) => facts.is_optimum(made.objective),
        None => made.objective - best <= 1e-4 * (1.0 + best.abs()),
    };
    made.converged && known
}

/// The least objective of runs that converged.
#[must_use]
pub fn best<'a>(runs: impl IntoIterator<Item = &'a Made>) -> f64 {
    runs.into_iter().filter(|made| made.converged).map(|made| made.objective).fold(f64::INFINITY, f64::min)
}

/// What a cell says of a run.
#[must_use]
pub fn cell(facts: &Facts, made: &Made, best: f64) -> String {
    let status = made.status.split([';', '\n']).next().unwrap_or("");
    let counts = format!("{} / {} / {:.1}", made.iterations, made.qp_iterations, 1e3 * made.time);
    match (made.converged, is_solved(facts, made, best)) {
        (true, true) => counts,
        (true, false) => format!("{counts}, at {:.6e}", made.objective),
        _ => format!("✗ {counts}: {status}"),
    }
}

/// Sums over many runs.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sums {
    pub problems: usize,
    pub solved: usize,
    pub iterations: usize,
    pub qp_iterations: usize,
    pub worst_step: usize,
    pub time: f64,
}

impl Sums {
    /// Adds a run.
    pub fn add(&mut self, entry: &Entry, made: &Made, best: f64) {
        self.problems += 1;
        self.solved += usize::from(is_solved(&entry.facts, made, best));
        self.iterations += made.iterations;
        self.qp_iterations += made.qp_iterations;
        self.worst_step = self.worst_step.max(made.worst_step);
        self.time += if made.time.is_finite() { made.time } else { 0.0 };
    }
}

/// A line of sums.
#[must_use]
pub fn summary(sums: &Sums) -> String {
    format!(
        "{} of {} solved, {} iterations, {} of QPs (at most {} in a step), {:.0} ms of CPU",
        sums.solved,
        sums.problems,
        sums.iterations,
        sums.qp_iterations,
        sums.worst_step,
        1e3 * sums.time
    )
}
