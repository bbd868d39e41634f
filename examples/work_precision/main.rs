//! Error over time on the initial value problems of the stiff test sets, adaptive and with equal
//! steps, beside diffsol and, where CasADi is installed, CVODES and IDAS.
//!
//! ```text
//! cargo run --release --example work_precision [-- --only TEXT] [--without-peers] [--seconds S] [--out FOLDER] [--write FILE]
//! ```
//!
//! Times are the least CPU time of a call in `S` seconds (0.05). Times at equal errors are printed,
//! and written between the marks `<!-- work_precision -->` and `<!-- end -->` of FILE; then all
//! runs are printed; plots are drawn in FOLDER (`plots/work_precision`).

#[path = "../models/ivp/mod.rs"]
mod models;
mod peers;
mod problems;
mod record;
mod report;

use casados::plot::{Curve, Figure, Panel};
use cpu_time::ThreadTime;
use peers::Peer;
use problems::{Method, Problem};
use record::{Outcome, Run, error, fastest};
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

const USAGE: &str = "usage: cargo run --release --example work_precision [-- --only TEXT] [--without-peers] [--seconds S] [--out FOLDER] [--write FILE]";

/// A run that takes longer is not repeated, and more accurate ones are not tried.
const MAX_SECONDS: f64 = 3.0;

struct Arguments {
    only: String,
    peers: bool,
    seconds: f64,
    out: PathBuf,
    write: Option<PathBuf>,
}

fn arguments() -> Result<Arguments, Box<dyn Error>> {
    let out = concat!(env!("CARGO_MANIFEST_DIR"), "/plots/work_precision").into();
    let mut all = Arguments { only: String::new(), peers: true, seconds: 0.05, out, write: None };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut value = || words.next().ok_or(USAGE);
        match word.as_str() {
            "--only" => all.only = value()?,
            "--without-peers" => all.peers = false,
            "--seconds" => all.seconds = value()?.parse()?,
            "--out" => all.out = value()?.into(),
            "--write" => all.write = Some(value()?.into()),
            _ => return Err(USAGE.into()),
        }
    }
    Ok(all)
}

/// All solvers on a problem.
struct Measured {
    name: &'static str,
    title: &'static str,
    /// Whether sensitivities were asked for.
    derivatives: bool,
    runs: Vec<Run>,
}

impl Measured {
    /// Error over time. Of this library lines are solid and times warm, of others dashed and cold.
    fn figure(&self) -> Figure {
        let with = if self.derivatives { ", with sensitivities" } else { "" };
        let mut panel = Panel::new(format!("{}{with}", self.title))
            .x("largest relative error")
            .y("ms")
            .log_x()
            .log_y()
            .x_range(1e-14..1.0);
        let mut drawn: Vec<(&str, bool)> = Vec::new();
        for run in &self.runs {
            let solver = (run.solver.as_str(), run.is_own);
            if drawn.contains(&solver) {
                continue;
            }
            drawn.push(solver);
            let runs = self.runs.iter().filter(|run| run.solver == solver.0);
            let outcomes = runs.filter_map(|run| run.outcome.as_ref().ok()).filter(|o| o.error < 1.0);
            let points: Vec<_> = outcomes.map(|o| (o.error.max(1e-14), 1e3 * o.time)).collect();
            if !points.is_empty() {
                let series = Curve::line(solver.0, points).width(if solver.0 == "Radau" { 3.0 } else { 1.5 });
                panel = panel.with(if run.is_own { series.marked() } else { series.dashed().marked() });
            }
        }
        Figure::new().size(760, 560).with(panel)
    }
}

/// A method at an accuracy.
fn measure(problem: &Problem, method: &Method, accuracy: f64, derivatives: bool, seconds: f64) -> Run {
    let time = || -> Result<Outcome, casados::Error> {
        let mut solver = (method.open)(accuracy, derivatives)?;
        let call = solver()?;
        let (begin, mut least, mut count) = (Instant::now(), f64::INFINITY, 0);
        while count < 2 || begin.elapsed().as_secs_f64() < seconds {
            let start = ThreadTime::now();
            solver()?;
            least = least.min(start.elapsed().as_secs_f64());
            count += 1;
        }
        Ok(Outcome {
            error: error(problem, &call.y, &call.derivatives),
            time: least,
            steps: Some(call.steps),
            factorizations: Some(call.factorizations),
        })
    };
    let outcome = time().map_err(|error| error.to_string());
    Run { solver: method.name.into(), is_own: true, accuracy, outcome }
}

/// All methods of this library on a problem.
fn measure_own_methods(problem: &Problem, derivatives: bool, seconds: f64) -> Vec<Run> {
    let mut runs = Vec::new();
    for method in &problem.methods {
        if derivatives && method.fixed {
            continue;
        }
        let accuracies: Vec<f64> = if method.fixed {
            (0..10).map(|i| 10.0 * f64::from(1 << i)).collect()
        } else {
            (4..=26).map(|i| 10f64.powf(-0.5 * f64::from(i))).collect()
        };
        for accuracy in accuracies {
            let begin = Instant::now();
            runs.push(measure(problem, method, accuracy, derivatives, seconds));
            if begin.elapsed().as_secs_f64() > MAX_SECONDS {
                break;
            }
        }
    }
    runs
}

fn measure_all() -> Result<(), Box<dyn Error>> {
    let arguments = arguments()?;
    let mut peers = if arguments.peers { Peer::start_all() } else { Vec::new() };
    let mut all = Vec::new();
    for problem in problems::all_problems()?.iter().filter(|problem| problem.name.contains(&arguments.only)) {
        for derivatives in [false, true] {
            if derivatives && problem.derivatives.is_none() {
                continue;
            }
            let mut runs = measure_own_methods(problem, derivatives, arguments.seconds);
            for peer in &mut peers {
                match peer.run_solvers(problem, derivatives, arguments.seconds) {
                    Ok(others) => runs.extend(others),
                    Err(error) => eprintln!("{}: {error}", problem.name),
                }
            }
            // The machine has moods: once more, at the other end of the peers' runs.
            for again in measure_own_methods(problem, derivatives, arguments.seconds) {
                let same = |run: &&mut Run| run.solver == again.solver && run.accuracy == again.accuracy;
                if let (Some(Run { outcome: Ok(first), .. }), Ok(second)) =
                    (runs.iter_mut().find(same), &again.outcome)
                {
                    first.time = first.time.min(second.time);
                }
            }
            let with = if derivatives { ", with sensitivities" } else { "" };
            eprintln!("{}{with}", problem.title);
            for digits in [4, 6, 8, 10] {
                let time = |ours| {
                    fastest(&runs, ours, 10f64.powi(-digits))
                        .map(|(run, o)| (run.solver.clone(), 1e3 * o.time))
                };
                eprintln!("    {digits:>2} digits: {:?}, {:?}", time(true), time(false));
            }
            all.push(Measured { name: problem.name, title: problem.title, derivatives, runs });
        }
    }
    let text = report::times_at_equal_errors(&all);
    println!("{text}\n{}", report::runs_at_four_tolerances(&all));
    for measured in &all {
        let with = if measured.derivatives { "_sensitivities" } else { "" };
        measured.figure().save(arguments.out.join(format!("{}{with}.svg", measured.name)))?;
    }
    eprintln!("plots are in {}", arguments.out.display());
    if let Some(file) = arguments.write {
        let (begin, end) = ("<!-- work_precision -->\n", "<!-- end -->");
        let before = std::fs::read_to_string(&file)?;
        let marks = before.split_once(begin).and_then(|(head, rest)| Some((head, rest.split_once(end)?.1)));
        let (head, tail) = marks.ok_or_else(|| format!("{} has no marks", file.display()))?;
        std::fs::write(&file, format!("{head}{begin}{text}{end}{tail}"))?;
    }
    Ok(())
}

fn main() -> ExitCode {
    match measure_all() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("work_precision: {error}");
            ExitCode::FAILURE
        }
    }
}
