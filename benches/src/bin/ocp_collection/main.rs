//! The twenty problems of `examples/models/ocps` with default options: from plain guesses, or each
//! varied in fourteen ways; beside IPOPT with the same discretisation (CasADi, where
//! `CASADOS_PYTHON` or `python3` has it).
//!
//! ```text
//! cargo run --release --manifest-path benches/Cargo.toml --bin ocp_collection
//! .. -- [--variations] [part of a name]
//! ```

#[path = "../../../../examples/models/ocps/mod.rs"]
mod ocps;
mod variations;

use casados::ocp::{Formulation, HeapIpm, HeapOcp, HeapSqp, Outcome, SecondOrder};
use casados_benches::peer::Peer;
use ocps::{Failure, Grid};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use variations::{ORIGINAL, VARIATIONS, Variation};

/// What solves the problems.
const SOLVERS: [&str; 3] = ["SQP", "interior point", "IPOPT"];
/// An objective that is larger by this is that of another minimum.
const OTHER_MINIMUM_DISTANCE: f64 = 1e-4;

/// What a solver made of a problem.
#[derive(Clone, Debug)]
struct SolverResult {
    solved: bool,
    iterations: u64,
    objective: f64,
    status: String,
}

impl SolverResult {
    fn from_run<E: std::fmt::Display>(outcome: Result<Outcome, E>) -> Self {
        match outcome {
            Ok(outcome) => Self {
                solved: outcome.is_converged(),
                iterations: outcome.iterations as u64,
                objective: outcome.objective,
                status: outcome.status.to_string(),
            },
            Err(error) => Self::failed(&error),
        }
    }

    fn failed(error: &impl std::fmt::Display) -> Self {
        Self { solved: false, iterations: 0, objective: f64::NAN, status: error.to_string() }
    }

    fn of_peer(answer: Result<Value, String>) -> Self {
        match answer {
            Ok(answer) => Self {
                solved: answer["status"] == "Solve_Succeeded",
                iterations: answer["iterations"].as_u64().unwrap_or(0),
                objective: answer["objective"].as_f64().unwrap_or(f64::NAN),
                status: answer["status"].as_str().unwrap_or("").replace('_', " "),
            },
            Err(error) => Self::failed(&error),
        }
    }
}

/// All solvers on a problem, each from its beginning.
fn solve<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
    name: &str,
    variation: &Variation,
    make: impl Fn(Grid) -> Result<HeapOcp<P>, Failure>,
    ipopt: &mut Option<Peer>,
) -> Result<Vec<SolverResult>, Failure> {
    let begin = || -> Result<HeapOcp<P>, Failure> {
        let mut ocp = make(variation.grid)?;
        variation.apply_variation(&mut ocp)?;
        Ok(ocp)
    };
    let mut ocp = begin()?;
    let request = json!({
        "problem": name,
        "grid": { "intervals": variation.grid.intervals, "length": variation.grid.length },
        "bounds": variation.bounds,
        "x": ocp.iterate().stages().map(|stage| stage.x.to_vec()).collect::<Vec<_>>(),
        "u": ocp.iterate().stages().take(ocp.intervals()).map(|stage| stage.u.to_vec()).collect::<Vec<_>>(),
    });
    let mut made = vec![SolverResult::from_run(HeapSqp::new(&ocp)?.solve(&mut ocp))];
    ocp = begin()?;
    made.push(SolverResult::from_run(HeapIpm::new(&ocp)?.solve(&mut ocp)));
    if let Some(ipopt) = ipopt {
        made.push(SolverResult::of_peer(ipopt.ask(&request)));
    }
    Ok(made)
}

/// What happened on many problems.
#[derive(Default)]
struct Summary {
    problems: usize,
    solved: BTreeMap<usize, usize>,
    /// Iterations where every solver with second derivatives solves the problem.
    iterations: BTreeMap<usize, u64>,
}

impl Summary {
    fn count(&mut self, made: &[SolverResult]) {
        self.problems += 1;
        let compared = made.iter().all(|made| made.solved);
        for (i, made) in made.iter().enumerate() {
            *self.solved.entry(i).or_default() += usize::from(made.solved);
            *self.iterations.entry(i).or_default() += if compared { made.iterations } else { 0 };
        }
    }

    fn print(&self) {
        println!();
        for (i, solver) in SOLVERS.iter().enumerate().filter(|(i, _)| self.solved.contains_key(i)) {
            let (solved, iterations) = (self.solved[&i], self.iterations[&i]);
            println!("{solver}: {solved} of {} solved, {iterations} iterations in sum", self.problems);
        }
    }
}

/// A row of the table: iterations, or how it ended.
fn print(name: &str, made: &[SolverResult]) {
    let best =
        made.iter().filter(|made| made.solved).map(|made| made.objective).fold(f64::INFINITY, f64::min);
    print!("| {name} |");
    for SolverResult { solved, iterations, objective, status } in made {
        let worse = objective - best > OTHER_MINIMUM_DISTANCE * (1.0 + best.abs());
        match (solved, worse) {
            (true, false) => print!(" {iterations} |"),
            (true, true) => print!(" {iterations} (at {objective:.4}, not {best:.4}) |"),
            _ => print!(" ✗ after {iterations}: {} |", status.split(';').next().unwrap_or("")),
        }
    }
    println!();
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let varied = arguments.iter().any(|a| a == "--variations");
    let part = arguments.iter().find(|a| !a.starts_with("--")).map_or("", |part| part);
    let mut ipopt = Peer::start("casadi_collection.py", |command| command).ok();
    let mut summary = Summary::default();
    println!("| problem | {} |", SOLVERS.join(" | "));
    println!("| --- |{}", " --- |".repeat(SOLVERS.len()));
    let variations = if varied { &VARIATIONS[..] } else { &[ORIGINAL] };
    macro_rules! rows {
        ($($theme:ident::$name:ident),* $(,)?) => {$(
            for variation in variations.iter().filter(|_| stringify!($name).contains(part)) {
                let name = stringify!($name);
                let made = solve(name, variation, |grid| ocps::$theme::$name(grid), &mut ipopt)?;
                print(&format!("{name}{}", variation.name), &made);
                summary.count(&made);
            }
        )*};
    }
    ocps::each_ocp!(rows);
    summary.print();
    if !varied && part.is_empty() {
        println!("\nWithout a solution:\n");
        let made =
            solve("car_without_time", &ORIGINAL, |grid| ocps::vehicles::car_within(1.0, grid), &mut ipopt)?;
        print("car_without_time", &made);
        print("walls", &solve("walls", &ORIGINAL, ocps::vehicles::walls, &mut ipopt)?);
    }
    Ok(())
}
