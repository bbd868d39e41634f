//! Tables.

use super::Measured;
use super::record::{Outcome, Run, fastest};
use std::fmt::Write;

const DIGITS: [i32; 4] = [4, 6, 8, 10];

/// Milliseconds with three digits.
fn milliseconds(seconds: f64) -> String {
    let value = 1e3 * seconds;
    let digits = (2 - value.log10().floor() as i32).clamp(0, 5) as usize;
    format!("{value:.digits$}")
}

fn entry(found: Option<(&Run, Outcome)>) -> String {
    found.map_or("–".into(), |(_, outcome)| milliseconds(outcome.time))
}

/// Times at equal errors, of ours and of the fastest peer.
pub fn times_at_equal_errors(all: &[Measured]) -> String {
    let mut text = String::new();
    for derivatives in [false, true] {
        let of = || all.iter().filter(|measured| measured.derivatives == derivatives);
        if of().next().is_none() {
            continue;
        }
        text += if derivatives { "\nWith forward sensitivities by `(x₀, p)`:\n\n" } else { "" };
        text += "| problem |";
        for digits in DIGITS {
            let _ = write!(text, " {digits} digits |");
        }
        text += "\n| --- | --- | --- | --- | --- |\n";
        for measured in of() {
            let _ = write!(text, "| {} |", measured.title);
            for digits in DIGITS {
                let [ours, peer] =
                    [true, false].map(|ours| entry(fastest(&measured.runs, ours, 10f64.powi(-digits))));
                let _ = write!(text, " {ours} / {peer} |");
            }
            text += "\n";
        }
    }
    text
}

/// Everything at four tolerances.
pub fn runs_at_four_tolerances(all: &[Measured]) -> String {
    let mut text = String::new();
    text += "| problem | solver | tolerance or steps | error | steps | factorisations | ms |\n";
    text += "| --- | --- | --- | --- | --- | --- | --- |\n";
    for measured in all {
        let with = if measured.derivatives { ", with sensitivities" } else { "" };
        for run in measured.runs.iter().filter(|run| shown_accuracies(run)) {
            let count = |count: Option<usize>| count.map_or("–".into(), |count| count.to_string());
            let rest = match &run.outcome {
                Ok(outcome) => format!(
                    "{:.1e} | {} | {} | {}",
                    outcome.error,
                    count(outcome.steps),
                    count(outcome.factorizations),
                    milliseconds(outcome.time)
                ),
                Err(_) => "fails | – | – | –".into(),
            };
            let accuracy = if run.accuracy > 1.0 {
                format!("{} steps", run.accuracy)
            } else {
                format!("{:.0e}", run.accuracy)
            };
            let _ = writeln!(text, "| {}{with} | {} | {accuracy} | {rest} |", measured.title, run.solver);
        }
    }
    text
}

/// Tolerances of whole digits; a few numbers of steps.
fn shown_accuracies(run: &Run) -> bool {
    let steps = run.accuracy > 1.0 && [40.0, 640.0].contains(&run.accuracy);
    steps || [1e-4, 1e-6, 1e-8, 1e-10].iter().any(|tolerance| (run.accuracy / tolerance - 1.0).abs() < 1e-6)
}
