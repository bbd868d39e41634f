//! How often methods succeed from random starts.

use super::{Failure, Guess, OPTIONS, Runner, guess, median, problem, rest, runner};
use super::{chain, chain_batch, chain_collocation, chain_problem, chain_request};
use crate::awe::Awe;
use casados::ocp::{Collocation, Shooting};
use casados::prelude::*;
use casados_benches::models::Chain;
use casados_benches::peer::Peer;
use casados_benches::record::{load, numbers};
use reference_data::Record;
use serde_json::{Value, json};
use std::fmt::Write;

/// Steele, Lea and Flood (2014): numbers between −1 and 1.
struct SplitMix(u64);

impl SplitMix {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// A start beside another one: every state and control of every node by a random part of `size`.
fn perturbed_start([x, u]: &Guess, seed: u64, size: [&[f64]; 2]) -> Guess {
    let mut random = SplitMix(seed);
    let mut moved = |rows: &Vec<Vec<f64>>, size: &[f64]| {
        let row = |row: &Vec<f64>| row.iter().zip(size).map(|(v, s)| v + s * random.next()).collect();
        rows.iter().map(row).collect()
    };
    [moved(x, size[0]), moved(u, size[1])]
}

/// Half of the range of every state over the nodes.
fn ranges(rows: &[Vec<f64>]) -> Vec<f64> {
    let mut ranges =
        rows.first().map_or(Vec::new(), |row| vec![[f64::INFINITY, f64::NEG_INFINITY]; row.len()]);
    for row in rows {
        for (range, &value) in ranges.iter_mut().zip(row) {
            *range = [range[0].min(value), range[1].max(value)];
        }
    }
    ranges.iter().map(|[low, high]| (high - low) / 2.0).collect()
}

/// How often a method succeeded.
#[derive(Default)]
struct Tally {
    solved: usize,
    best: usize,
    iterations: Vec<f64>,
}

impl Tally {
    fn count(&mut self, solved: bool, iterations: f64, objective: f64, best: f64) {
        if solved {
            self.solved += 1;
            self.best += usize::from(objective <= best + 1e-5 * best.abs().max(1.0));
            self.iterations.push(iterations);
        }
    }
}

fn compare_starts(
    table: &mut String,
    name: &str,
    guesses: &[Guess],
    methods: &mut [(&str, Runner<'_>)],
    ipopt: &mut Option<Peer>,
    request: &Value,
) -> Result<(), Failure> {
    let mut found: Vec<Vec<(bool, f64, f64)>> = vec![Vec::new(); methods.len() + 1];
    for (seed, guess) in guesses.iter().enumerate() {
        for ((method, run), found) in methods.iter_mut().zip(&mut found) {
            // An interval that cannot be integrated is a failure of its method.
            let result = run(guess).map_err(|error| error.to_string());
            let row = result.as_ref().map_or((false, 0.0, 0.0), |run| {
                (run.outcome.is_converged(), run.outcome.iterations as f64, run.outcome.objective)
            });
            if !row.0 {
                let why = result.map_or_else(|error| error, |run| run.outcome.to_string());
                eprintln!("{name}, start {seed}, {method}: {why}");
            }
            found.push(row);
        }
        if let Some(ipopt) = ipopt {
            let mut request = request.clone();
            (request["x"], request["u"]) = (json!(guess[0]), json!(guess[1]));
            let row = ipopt.ask(&request).map_or((false, 0.0, 0.0), |answer| {
                let number = |key: &str| answer[key].as_f64().unwrap_or(f64::NAN);
                (answer["status"] == "solved", number("iterations"), number("objective"))
            });
            if !row.0 {
                eprintln!("{name}, start {seed}, IPOPT: not solved after {} iterations", row.1);
            }
            if let Some(theirs) = found.last_mut() {
                theirs.push(row);
            }
        }
    }
    let solved = found.iter().flatten().filter(|row| row.0);
    let best = solved.fold(f64::INFINITY, |best, row| best.min(row.2));
    let names = methods.iter().map(|(name, _)| *name).chain(["IPOPT"]);
    for (method, rows) in names.zip(&found).filter(|(_, rows)| !rows.is_empty()) {
        let mut tally = Tally::default();
        for &(solved, iterations, objective) in rows {
            tally.count(solved, iterations, objective, best);
        }
        let most = tally.iterations.iter().copied().fold(0.0, f64::max);
        let middle = median(tally.iterations.iter().copied());
        writeln!(
            table,
            "| {name}, {method} | {} of {} | {} | {middle:.0} | {most:.0} |",
            tally.solved,
            rows.len(),
            tally.best
        )?;
    }
    Ok(())
}

pub fn random_starts(
    table: &mut String,
    orbit: &Record,
    ipopt: &mut Option<Peer>,
    count: usize,
) -> Result<(), Failure> {
    let h = orbit.number("T")?;
    writeln!(
        table,
        "| | solved | of these at the best objective | iterations, median | most |\n| --- | --- | --- | --- | --- |"
    )?;
    let circle = guess::guess(&orbit.record("guess_init")?)?;
    let size = ranges(&circle[0]).into_iter().map(|range| 0.2 * range).collect::<Vec<_>>();
    let guesses: Vec<Guess> = (0..count as u64)
        .map(|seed| perturbed_start(&circle, seed, [&size, &[0.1, 0.1, 0.1, 1.0]]))
        .collect();
    let mut shooting =
        runner(problem::orbit_problem(Shooting::new(Batch::<Awe, RadauIIA<4>>::new(OPTIONS)?), h)?)?;
    let mut collocation =
        runner(problem::orbit_problem(Collocation::new(Irk::<Awe, RadauIIA<4>>::new(OPTIONS)?)?, h)?)?;
    let mut methods: [(&str, Runner<'_>); 2] =
        [("shooting", &mut shooting), ("collocation", &mut collocation)];
    let request = json!({ "problem": "orbit", "h": h, "iterations": 200 });
    compare_starts(table, "orbit", &guesses, &mut methods, ipopt, &request)?;

    let record = load("tests/data/ocp/chain_5.json")?;
    let size: Vec<f64> = (0..21).map(|i| if i < 12 { 0.1 } else { 0.5 }).collect();
    let guesses: Vec<Guess> =
        (0..count as u64).map(|seed| perturbed_start(&rest(&record), seed, [&size, &[1.0; 3]])).collect();
    let mut shooting = runner(chain!(21, record, chain_batch!(21)))?;
    let mut collocation = runner(chain!(21, record, chain_collocation!(21)))?;
    let mut methods: [(&str, Runner<'_>); 2] =
        [("shooting", &mut shooting), ("collocation", &mut collocation)];
    compare_starts(table, "chain of 5 masses", &guesses, &mut methods, ipopt, &chain_request(5, &record))
}
