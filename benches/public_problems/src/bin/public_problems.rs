//! Solves problems of public collections by default options, beside their published optima.
//!
//! ```text
//! cargo run --manifest-path benches/Cargo.toml -p public-problems --bin public_problems -- \
//!     [--held-out] [--set collection] [--only part] [--solver Sqp] [--repetitions 3] [--refine 2] \
//!     [--limit 20] [--log] [--ipopt] [--json file]
//! ```
//!
//! Cells are `iterations / iterations of QPs / ms of CPU`. `--ipopt` needs CasADi in the Python of
//! `CASADOS_PYTHON`, and the library that `cargo build` makes beside this program.
//! `--grids` writes `grids.json` instead: IPOPT's objectives on the grids of problems and on those
//! with twice as many intervals.

use public_problems::ipopt::Ipopt;
use public_problems::run::{Made, Solver, Task};
use public_problems::table::{self, Sums};
use public_problems::{Entry, Failure, families, sets};
use serde_json::json;
use std::collections::BTreeMap;
use std::io::Write;
use std::time::Duration;

/// What is asked for.
struct Arguments {
    set: String,
    only: String,
    solvers: Vec<Solver>,
    repetitions: usize,
    refinement: usize,
    log: bool,
    ipopt: bool,
    grids: bool,
    limit: Duration,
    json: Option<String>,
}

impl Arguments {
    fn read() -> Result<Self, Failure> {
        let mut given = std::env::args().skip(1);
        let mut arguments = Self {
            set: "public".into(),
            only: String::new(),
            solvers: Solver::ALL.to_vec(),
            repetitions: 1,
            refinement: 1,
            log: false,
            ipopt: false,
            grids: false,
            limit: Duration::from_secs(20),
            json: None,
        };
        while let Some(argument) = given.next() {
            let mut value = || given.next().ok_or_else(|| format!("{argument} needs a value"));
            match &*argument {
                "--held-out" => arguments.set = "held-out".into(),
                "--set" => arguments.set = value()?,
                "--only" => arguments.only = value()?,
                "--solver" => {
                    let name = value()?;
                    arguments.solvers.retain(|solver| solver.name().eq_ignore_ascii_case(&name));
                }
                "--repetitions" => arguments.repetitions = value()?.parse()?,
                "--refine" => arguments.refinement = value()?.parse()?,
                "--limit" => arguments.limit = Duration::from_secs_f64(value()?.parse()?),
                "--log" => arguments.log = true,
                "--ipopt" => arguments.ipopt = true,
                "--grids" => arguments.grids = true,
                "--json" => arguments.json = Some(value()?),
                _ => return Err(format!("{argument} is not known").into()),
            }
        }
        Ok(arguments)
    }
}

/// The run with the median time.
fn median(mut runs: Vec<Made>) -> Option<Made> {
    runs.sort_by(|a, b| a.time.total_cmp(&b.time));
    let middle = runs.len() / 2;
    runs.into_iter().nth(middle)
}

/// All solvers on a problem, by turns.
fn solve(entry: &Entry, arguments: &Arguments) -> Vec<Made> {
    let mut runs = vec![Vec::new(); arguments.solvers.len() + usize::from(arguments.ipopt)];
    let limit = arguments.limit;
    let mut ipopt =
        arguments.ipopt.then(|| Ipopt::start(&entry.facts.name, arguments.refinement, limit.as_secs_f64()));
    for repetition in 0..arguments.repetitions.max(1) {
        for (solver, runs) in arguments.solvers.iter().zip(&mut runs) {
            let log = arguments.log && repetition == 0;
            runs.push(entry.solve(&Task { log, limit, ..Task::new(*solver) }));
        }
        if let (Some(ipopt), Some(runs)) = (&mut ipopt, runs.last_mut()) {
            let answer = ipopt.as_mut().map_err(|error| error.clone()).and_then(Ipopt::solve);
            runs.push(answer.unwrap_or_else(Made::failed));
        }
    }
    runs.into_iter().filter_map(median).collect()
}

/// Writes what tolerances are derived from.
fn write_grids(limit: Duration) -> Result<(), Failure> {
    let mut grids = BTreeMap::new();
    for entry in sets::public() {
        let on = |refinement| {
            let made = Ipopt::start(&entry.facts.name, refinement, limit.as_secs_f64())?.solve()?;
            Ok::<_, String>(made.converged.then_some(made.objective))
        };
        if let (Some(coarse), Some(fine)) = (on(1)?, on(2)?) {
            grids.insert(entry.facts.name, [coarse, fine]);
        }
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/grids.json");
    Ok(std::fs::write(path, serde_json::to_string_pretty(&grids)? + "\n")?)
}

fn main() -> Result<(), Failure> {
    let arguments = Arguments::read()?;
    if arguments.grids {
        return write_grids(arguments.limit);
    }
    families::refine(arguments.refinement);
    let mut names: Vec<_> = arguments.solvers.iter().map(|solver| solver.name()).collect();
    names.extend(arguments.ipopt.then_some("IPOPT"));
    let mut sums = vec![Sums::default(); names.len()];
    let mut file = arguments.json.as_ref().map(std::fs::File::create).transpose()?;
    println!(
        "| problem | published | {} |\n| --- | --- |{}",
        names.join(" | "),
        " --- |".repeat(names.len())
    );
    for entry in sets::named(&arguments.set)? {
        if !entry.facts.name.contains(&arguments.only) {
            continue;
        }
        let made = solve(&entry, &arguments);
        let best = table::best(&made);
        let cells: Vec<_> = made.iter().map(|made| table::cell(&entry.facts, made, best)).collect();
        let published = entry.facts.published.map_or(String::new(), |f| format!("{f:.8}"));
        println!("| {} | {published} | {} |", entry.facts.name, cells.join(" | "));
        for (made, sums) in made.iter().zip(&mut sums) {
            sums.add(&entry, made, best);
        }
        if let Some(file) = &mut file {
            for (made, solver) in made.iter().zip(&names) {
                let Made { converged, status, objective, iterations, qp_iterations, worst_step, time } = made;
                let row = json!({
                    "problem": entry.facts.name, "solver": solver, "converged": converged,
                    "status": status, "objective": objective, "published": entry.facts.published,
                    "iterations": iterations, "qp_iterations": qp_iterations,
                    "worst_step": worst_step, "time": time, "tags": entry.facts.tags,
                });
                writeln!(file, "{row}")?;
            }
        }
    }
    println!();
    for (name, sums) in names.iter().zip(&sums) {
        println!("{name}: {}", table::summary(sums));
    }
    Ok(())
}
