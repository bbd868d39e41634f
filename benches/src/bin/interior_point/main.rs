//! The nonlinear interior point: the orbit of the aircraft and the chain of masses with exact
//! Hessians, by shooting and by collocation, beside IPOPT with direct collocation (CasADi, where
//! `CASADOS_PYTHON` or `python3` has it), from known starts and from random ones.
//!
//! ```text
//! cargo run --release --manifest-path benches/Cargo.toml --bin interior_point -- --write docs/benchmarks.md
//! ```
//!
//! Times are CPU time of one thread. What is compared takes turns, round by round, and the medians
//! of the rounds count; IPOPT runs once in each of the first rounds. `--only times` (or `horizons`,
//! `starts`) writes one part and leaves the others; `--starts 10` takes fewer random starts than a
//! hundred.

#[path = "../../../../examples/models/awe.rs"]
mod awe;
#[path = "../../../../examples/models/chain_problem.rs"]
mod chain_problem;
#[path = "../../../../examples/awe_orbit/guess.rs"]
mod guess;
#[path = "../../../../examples/awe_orbit/problem.rs"]
mod problem;
mod starts;

use awe::Awe;
use casados::ocp::{
    Barrier, Collocation, Exact, Formulation, HeapIpm, HeapOcp, HeapSqp, Outcome, SecondOrder, Shooting,
};
use casados::prelude::*;
use casados_benches::models::Chain;
use casados_benches::peer::Peer;
use casados_benches::record::{insert_between_markers, load, numbers};
use casados_benches::time::pin_to_last_core;
use cpu_time::ThreadTime;
use reference_data::Record;
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;

type Failure = Box<dyn std::error::Error>;
/// States and controls of all nodes.
type Guess = [Vec<Vec<f64>>; 2];

const ROUNDS: usize = 9;
/// IPOPT takes seconds.
const PEER_ROUNDS: usize = 3;

/// A run: how it ended, and its CPU time in milliseconds.
#[derive(Clone, Copy)]
struct Run {
    outcome: Outcome,
    milliseconds: f64,
}

fn time_run(call: impl FnOnce() -> Result<Outcome, Failure>) -> Result<Run, Failure> {
    let start = ThreadTime::now();
    let outcome = call()?;
    Ok(Run { outcome, milliseconds: 1e3 * start.elapsed().as_secs_f64() })
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// A problem with its solver, to be run again and again from one guess.
fn runner<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
    mut ocp: HeapOcp<P>,
) -> Result<impl FnMut(&Guess) -> Result<Run, Failure>, Failure> {
    let mut ipm = HeapIpm::new(&ocp)?;
    Ok(move |guess: &Guess| {
        problem::set_iterate(&mut ocp, guess)?;
        time_run(|| Ok(ipm.solve(&mut ocp)?))
    })
}

/// The same by sequential quadratic programming with exact Hessians.
fn sequential<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
    mut ocp: HeapOcp<P>,
) -> Result<impl FnMut(&Guess) -> Result<Run, Failure>, Failure> {
    let mut sqp = HeapSqp::new(&ocp)?.exact(Exact::default());
    sqp.options.tolerance = 1e-8;
    Ok(move |guess: &Guess| {
        problem::set_iterate(&mut ocp, guess)?;
        time_run(|| Ok(sqp.solve(&mut ocp)?))
    })
}

type Runner<'r> = &'r mut dyn FnMut(&Guess) -> Result<Run, Failure>;

/// A row for each method, with what IPOPT takes in the same rounds.
fn compare(
    table: &mut String,
    name: &str,
    guess: &Guess,
    methods: &mut [(&str, Runner<'_>)],
    ipopt: &mut Option<Peer>,
    request: &Value,
) -> Result<(), Failure> {
    let mut runs: Vec<Vec<Run>> = vec![Vec::new(); methods.len()];
    let (mut theirs, mut answer) = (Vec::new(), None);
    for round in 0..ROUNDS {
        for (runs, (_, run)) in runs.iter_mut().zip(methods.iter_mut()) {
            runs.push(run(guess)?);
        }
        if let Some(ipopt) = ipopt.as_mut().filter(|_| round < PEER_ROUNDS) {
            let mut request = request.clone();
            (request["x"], request["u"]) = (json!(guess[0]), json!(guess[1]));
            match ipopt.ask(&request) {
                Ok(found) => {
                    theirs.push(1e3 * found["seconds"].as_f64().unwrap_or(f64::NAN));
                    answer = Some(found);
                }
                Err(error) => eprintln!("IPOPT: {error}"),
            }
        }
    }
    let theirs = median(theirs.into_iter());
    for (runs, (method, _)) in runs.iter().zip(methods.iter()) {
        let Some(Run { outcome, .. }) = runs.first() else { continue };
        let of = |part: fn(&Run) -> f64| median(runs.iter().map(part));
        let (total, iterations) = (of(|run| run.milliseconds), outcome.iterations.max(1) as f64);
        let functions = of(|run| 1e3 * (run.outcome.times.linearise + run.outcome.times.search));
        let end = if outcome.is_converged() { "" } else { " (not solved)" };
        writeln!(
            table,
            "| {name}, {method} | {}{end} | {:.8} | {total:.2} | {:.3} | {:.0} % | {:.1} |",
            outcome.iterations,
            outcome.objective,
            total / iterations,
            100.0 * functions / of(|run| 1e3 * run.outcome.times.total()),
            theirs / total,
        )?;
    }
    if let Some(answer) = answer {
        writeln!(
            table,
            "| {name}, IPOPT ({}) | {} | {:.8} | {theirs:.0} | {:.1} | | |",
            answer["status"].as_str().unwrap_or(""),
            answer["iterations"],
            answer["objective"].as_f64().unwrap_or(f64::NAN),
            theirs / answer["iterations"].as_f64().unwrap_or(f64::NAN),
        )?;
    }
    Ok(())
}

const OPTIONS: Options = Options {
    steps: 1,
    newton: Newton {
        tolerance: 0.0,
        max_iterations: 50,
        jacobian: casados::options::Jacobian::Auto,
        fixed_iterations: None,
    },
    start: Start::Zero,
    compensated: false,
};

macro_rules! chain {
    ($nx:literal, $record:expr, $dynamics:expr) => {
        chain_problem::problem!($nx, numbers(&$record["xrest"]), numbers(&$record["x0"]), $dynamics)
    };
}
use chain;
macro_rules! chain_batch {
    ($nx:literal) => {
        Shooting::new(Batch::<Chain<$nx>, Gauss<2>>::new(Options { steps: 2, ..Default::default() })?)
    };
}
use chain_batch;
macro_rules! chain_collocation {
    ($nx:literal) => {
        Collocation::new(Irk::<Chain<$nx>, Gauss<2>>::new(Options { steps: 2, ..Default::default() })?)?
    };
}
use chain_collocation;

fn rest(record: &Value) -> Guess {
    [vec![numbers(&record["xrest"]); 41], vec![vec![0.0; 3]; 40]]
}

fn chain_request(masses: usize, record: &Value) -> Value {
    json!({ "problem": "chain", "masses": masses, "x_rest": numbers(&record["xrest"]),
        "x0": numbers(&record["x0"]), "iterations": 200 })
}

fn measure_times(table: &mut String, orbit: &Record, ipopt: &mut Option<Peer>) -> Result<(), Failure> {
    let h = orbit.number("T")?;
    writeln!(
        table,
        "| | iterations | objective | ms | ms an iteration | functions | IPOPT's time over this |\n| --- | --- | --- | --- | --- | --- | --- |"
    )?;
    let mut shooting =
        runner(problem::orbit_problem(Shooting::new(Batch::<Awe, RadauIIA<4>>::new(OPTIONS)?), h)?)?;
    let mut collocation =
        runner(problem::orbit_problem(Collocation::new(Irk::<Awe, RadauIIA<4>>::new(OPTIONS)?)?, h)?)?;
    let request = json!({ "problem": "orbit", "h": h, "iterations": 200 });
    for name in ["guess_dc", "guess_pow", "guess_init"] {
        let guess = guess::guess(&orbit.record(name)?)?;
        let mut methods: [(&str, Runner<'_>); 2] =
            [("shooting", &mut shooting), ("collocation", &mut collocation)];
        compare(table, &format!("orbit from `{name}`"), &guess, &mut methods, ipopt, &request)?;
    }
    macro_rules! row {
        ($nx:literal, $masses:literal) => {{
            let record = load(concat!("tests/data/ocp/chain_", $masses, ".json"))?;
            let mut shooting = runner(chain!($nx, record, chain_batch!($nx)))?;
            let mut collocation = runner(chain!($nx, record, chain_collocation!($nx)))?;
            let mut sqp = sequential(chain!($nx, record, chain_batch!($nx)))?;
            let mut methods: [(&str, Runner<'_>); 3] =
                [("shooting", &mut shooting), ("collocation", &mut collocation), ("SQP", &mut sqp)];
            let name = concat!("chain of ", $masses, " masses");
            compare(table, name, &rest(&record), &mut methods, ipopt, &chain_request($masses, &record))?;
        }};
    }
    row!(9, 3);
    row!(21, 5);
    row!(33, 7);
    Ok(())
}

/// A pendulum on a cart, over horizons of any length.
#[ode]
fn cart_pole(x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    let [_, theta, v, omega] = x;
    let (s, c) = theta.sin_cos();
    let d = 1.1 - 0.1 * c * c;
    [
        v,
        omega,
        (-0.08 * s * omega * omega + 0.981 * c * s + u[0]) / d,
        (-0.08 * c * s * omega * omega + u[0] * c + 1.1 * 9.81 * s) / (0.8 * d),
    ]
}
#[function]
fn effort(x: [f64; 4], u: [f64; 1]) -> f64 {
    1e-2 * (u[0] * u[0] + x[1] * x[1]) + 1e-3 * (x[0] * x[0] + x[2] * x[2] + x[3] * x[3])
}

/// The time of an iteration over the number of intervals of a second, and that of a recursion with
/// periodic states and without.
fn measure_scaling(table: &mut String, orbit: &Record) -> Result<(), Failure> {
    use casados::ocp::{GeneralCost, Horizon, Problem};
    writeln!(
        table,
        "| intervals | iterations | microseconds of an iteration for each interval |\n| --- | --- | --- |"
    )?;
    let mut horizons = Vec::new();
    for n in [20, 40, 80, 160, 320, 640] {
        let batch = Batch::<CartPole, Gauss<2>>::new(Options::default())?;
        let mut ocp = Problem::new(Shooting::new(batch))
            .stage_cost(GeneralCost::<Effort>::new())
            .on(Horizon::uniform(n, 1.0 / n as f64))?;
        ocp.fix_initial_state(&[0.0, 0.4, 0.0, 0.0])?.bound("u", .., -5.0, 5.0)?;
        ocp.bound("x[0]", 1.., -0.5, 0.5)?;
        horizons.push((n, runner(ocp)?, Vec::new()));
    }
    for _ in 0..ROUNDS {
        for (n, run, runs) in &mut horizons {
            runs.push(run(&[vec![vec![0.0; 4]; *n + 1], vec![vec![0.0]; *n]])?);
        }
    }
    for (n, _, runs) in &horizons {
        let Some(Run { outcome, .. }) = runs.first() else { continue };
        let iterations = outcome.iterations.max(1) as f64;
        let time = median(runs.iter().map(|run| 1e3 * run.milliseconds / iterations / *n as f64));
        writeln!(table, "| {n} | {} | {time:.2} |", outcome.iterations)?;
    }
    let h = orbit.number("T")?;
    let guess = guess::guess(&orbit.record("guess_dc")?)?;
    let shooting = || Ok::<_, Failure>(Shooting::new(Batch::<Awe, RadauIIA<4>>::new(OPTIONS)?));
    let (mut periodic, mut plain) =
        (problem::orbit_problem(shooting()?, h)?, problem::flight_problem(shooting()?, h)?);
    plain.fix_initial_state(&guess[0][0])?;
    let mut times = [Vec::new(), Vec::new()];
    for _ in 0..ROUNDS {
        problem::set_iterate(&mut periodic, &guess)?;
        problem::set_iterate(&mut plain, &guess)?;
        times[0].extend(measure_directions(&mut periodic)?);
        times[1].extend(measure_directions(&mut plain)?);
    }
    let [periodic, plain] = times.map(|times| median(times.into_iter()));
    writeln!(
        table,
        "\nA search direction with 22 periodic states takes {:.2} times as long as one without:\n{periodic:.3} and {plain:.3} ms.",
        periodic / plain
    )?;
    Ok(())
}

/// Milliseconds of search directions that needed one factorisation, without corrections: a
/// recursion for one right-hand side.
fn measure_directions<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
    ocp: &mut HeapOcp<P>,
) -> Result<Vec<f64>, Failure> {
    let mut ipm = HeapIpm::new(ocp)?;
    (ipm.options.max_iterations, ipm.options.barrier) = (12, Barrier::Monotone);
    ipm.solve(ocp)?;
    let plain = ipm.log().0.iter().filter(|i| i.regularisation == 0.0 && i.step > 0.0);
    Ok(plain.map(|iteration| 1e3 * iteration.times.qp).collect())
}

/// A part of the tables, where it is asked for, to its place.
fn run_selected_part(
    arguments: &[String],
    name: &str,
    write: impl FnOnce(&mut String) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let value = |name: &str| argument_value(arguments, name);
    if value("--only").is_some_and(|only| only != name) {
        return Ok(());
    }
    let mut table = String::new();
    write(&mut table)?;
    println!("{table}");
    match value("--write") {
        Some(file) => {
            Ok(insert_between_markers(Path::new(file), &format!("interior point, {name}"), &table)?)
        }
        None => Ok(()),
    }
}

/// What follows an argument.
fn argument_value<'a>(arguments: &'a [String], name: &str) -> Option<&'a str> {
    let at = arguments.iter().position(|argument| argument == name)?;
    arguments.get(at + 1).map(String::as_str)
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().collect();
    const PARTS: [&str; 3] = ["times", "horizons", "starts"];
    if let Some(only) = argument_value(&arguments, "--only").filter(|only| !PARTS.contains(only)) {
        return Err(format!("no part {only:?}: there are {PARTS:?}").into());
    }
    let count = argument_value(&arguments, "--starts").map_or(Ok(100), str::parse)?;
    eprintln!("pinned: {}", pin_to_last_core());
    let mut ipopt = Peer::start("casadi_starts.py", |command| command).ok();
    let orbit = Record::from(load("tests/data/awe/orbit.json")?);
    run_selected_part(&arguments, "times", |table| measure_times(table, &orbit, &mut ipopt))?;
    run_selected_part(&arguments, "horizons", |table| measure_scaling(table, &orbit))?;
    run_selected_part(&arguments, "starts", |table| starts::random_starts(table, &orbit, &mut ipopt, count))
}
