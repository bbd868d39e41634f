//! What was measured of one run, and what is best among many.

use super::problems::Problem;
use reference_data::Record;

/// One solver at one accuracy.
#[derive(Clone, Debug)]
pub struct Run {
    pub solver: String,
    /// Whether it is one of this library.
    pub is_own: bool,
    /// The tolerance, or the number of equal steps.
    pub accuracy: f64,
    pub outcome: Result<Outcome, String>,
}

/// A run that came to the end.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// The largest relative error of a component; of the derivatives, relative to the largest of
    /// their row, if they were asked for and are worse.
    pub error: f64,
    /// CPU seconds.
    pub time: f64,
    pub steps: Option<usize>,
    pub factorizations: Option<usize>,
}

/// The error of values at the end, and of derivatives if there are any.
pub fn error(problem: &Problem, y: &[f64], derivatives: &[f64]) -> f64 {
    let mut worst =
        nan_max(y.iter().zip(&problem.y).map(|(found, exact)| (found - exact).abs() / exact.abs()));
    if y.len() != problem.y.len() {
        worst = f64::INFINITY;
    }
    if let (Some(exact), false) = (&problem.derivatives, derivatives.is_empty()) {
        let columns = problem.x0.len() + problem.p.len();
        for (found, exact) in derivatives.chunks(columns).zip(exact.chunks(columns)) {
            // Parameters have sizes of their own: dx/dp p.
            let sizes = problem.x0.iter().map(|_| 1.0).chain(problem.p.iter().map(|p| p.abs()));
            let largest =
                exact.iter().zip(sizes.clone()).map(|(exact, size)| (exact * size).abs()).fold(0.0, f64::max);
            let errors =
                found.iter().zip(exact).zip(sizes).map(|((f, e), size)| ((f - e) * size).abs() / largest);
            worst = worst.max(self::nan_max(errors));
        }
    }
    worst
}

/// NaN is the worst.
fn nan_max(errors: impl Iterator<Item = f64>) -> f64 {
    errors.fold(0.0, |worst, error| if error.is_nan() { f64::INFINITY } else { worst.max(error) })
}

impl Run {
    /// From the answer of a peer.
    pub fn of_peer(problem: &Problem, run: &Record, derivatives: bool) -> Option<Self> {
        let (solver, accuracy) = (run.text("solver").ok()?.to_owned(), run.number("tolerance").ok()?);
        let outcome = match (run.text("error"), run.list("y"), run.number("time")) {
            (Ok(error), ..) => Err(error.to_owned()),
            (_, Ok(y), Ok(time)) => {
                let found = if derivatives { run.list("derivatives").ok()? } else { Vec::new() };
                let steps = run.number("steps").ok().map(|steps| steps as usize);
                Ok(Outcome { error: error(problem, &y, &found), time, steps, factorizations: None })
            }
            _ => Err("no numbers".into()),
        };
        Some(Self { solver, is_own: false, accuracy, outcome })
    }
}

/// The fastest run whose error is no larger.
pub fn fastest(runs: &[Run], ours: bool, error: f64) -> Option<(&Run, Outcome)> {
    let reached = runs.iter().filter(|run| run.is_own == ours).filter_map(|run| {
        let outcome = *run.outcome.as_ref().ok()?;
        (outcome.error <= error).then_some((run, outcome))
    });
    reached.min_by(|(_, a), (_, b)| a.time.total_cmp(&b.time))
}
