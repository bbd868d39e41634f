//! Every mechanism on and off over sets of problems: what each is worth.
//!
//! ```text
//! cargo run --manifest-path benches/Cargo.toml -p public-problems --bin ablation -- \
//!     [--sets public,collection] [--only part of the mechanism's name]
//! ```

use public_problems::run::{Made, Solver, Task};
use public_problems::switches::{Off, SWITCHES};
use public_problems::table::{self, Sums};
use public_problems::{Entry, Failure, sets};
use std::time::Duration;

/// CPU time after which a run is given up: mechanisms that are off may cost all of it.
const LIMIT: Duration = Duration::from_secs(5);

/// All problems, each once.
fn run(entries: &[Entry], task: &Task<'_>) -> Vec<Made> {
    entries.iter().map(|entry| entry.solve(&Task { limit: LIMIT, ..*task })).collect()
}

/// Solved beside a reference, which knows the best objectives.
fn sums(entries: &[Entry], made: &[Made], reference: &[Made]) -> Sums {
    let mut sums = Sums::default();
    for ((entry, made), reference) in entries.iter().zip(made).zip(reference) {
        sums.add(entry, made, table::best([made, reference]));
    }
    sums
}

fn main() -> Result<(), Failure> {
    let (mut names, mut only) = ("public,collection".to_string(), String::new());
    let mut given = std::env::args().skip(1);
    while let Some(argument) = given.next() {
        let value = given.next().ok_or_else(|| format!("{argument} needs a value"))?;
        match &*argument {
            "--sets" => names = value,
            "--only" => only = value,
            _ => return Err(format!("{argument} is not known").into()),
        }
    }
    println!("| set | solver | off | solved | gained | lost | iterations | QP iterations | CPU ms |");
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for name in names.split(',') {
        let entries = sets::named(name)?;
        for solver in Solver::ALL {
            let reference = run(&entries, &Task::new(solver));
            let row = |off: &str, made: &[Made]| {
                let all = sums(&entries, made, &reference);
                let solved = |made: &Made, entry: &Entry, other: &Made| {
                    table::is_solved(&entry.facts, made, table::best([made, other]))
                };
                let (mut gained, mut lost) = (Vec::new(), Vec::new());
                for ((entry, made), with) in entries.iter().zip(made).zip(&reference) {
                    match (solved(made, entry, with), solved(with, entry, made)) {
                        (true, false) => gained.push(entry.facts.name.clone()),
                        (false, true) => lost.push(entry.facts.name.clone()),
                        _ => {}
                    }
                }
                println!(
                    "| {name} | {} | {off} | {} of {} | {} | {} | {} | {} | {:.0} |",
                    solver.name(),
                    all.solved,
                    all.problems,
                    gained.join(", "),
                    lost.join(", "),
                    all.iterations,
                    all.qp_iterations,
                    1e3 * all.time
                );
            };
            row("–", &reference);
            for (mechanism, off) in SWITCHES.iter().filter(|(mechanism, _)| mechanism.contains(&only)) {
                match (off, solver) {
                    (Off::Sqp(off), Solver::Sqp) => {
                        row(mechanism, &run(&entries, &Task { sqp: &off, ..Task::new(solver) }));
                    }
                    (Off::Ipm(off), Solver::Ipm) => {
                        row(mechanism, &run(&entries, &Task { ipm: &off, ..Task::new(solver) }));
                    }
                    _ => {}
                }
            }
        }
    }
    Ok(())
}
