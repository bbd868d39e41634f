//! casados beside its peers, in one run: times and errors of simulation, forward and adjoint
//! sensitivities and Hessians of a pendulum, of chains of masses and of an aircraft on a tether.
//!
//! CasADi takes part where `python3`, or the interpreter that `CASADOS_PYTHON` names, has it;
//! acados where that has `acados_template` and `ACADOS_SOURCE_DIR` lists installations; diffsol
//! with the feature of that name. Nothing is installed.

mod acados;
mod adaptive;
mod casadi;
#[cfg(feature = "diffsol")]
mod diffsol;
mod growth;
mod json;
mod machine;
mod plots;
mod reference_times;
mod report;
mod rows;

use acados::Acados;
use casadi::Casadi;
use casados_benches::case::{Case, Family};
use casados_benches::record::{insert_between_markers, repository_path};
use casados_benches::time::pin_to_last_core;
use growth::ScalingWithSize;
use reference_times::ReferenceTimes;
use rows::Peers;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

type Failure = Box<dyn std::error::Error>;

const USAGE: &str = "\
usage: cargo run --release --manifest-path benches/Cargo.toml [--features diffsol] [-- OPTIONS]
    --only TEXT      cases whose name contains TEXT, such as `awe` or `chain 5`; no growth, no work-precision
    --seconds S      budget of one measurement, default 0.3; of each of CasADi's two, the same
    --no-peers       casados alone
    --out FOLDER     where compare.md, compare.json and the plots go, default plots/compare
    --write FILE     the tables go into FILE instead, between the lines `<!-- compare -->` and `<!-- end of compare -->`";

/// How long a measurement lasts.
#[derive(Clone, Copy)]
pub struct MeasurementBudget {
    /// Seconds.
    pub seconds: f64,
}

impl MeasurementBudget {
    fn budget(self) -> Duration {
        Duration::from_secs_f64(self.seconds)
    }
}

struct Arguments {
    only: Option<String>,
    effort: MeasurementBudget,
    peers: bool,
    out: PathBuf,
    write: Option<PathBuf>,
}

fn arguments() -> Result<Arguments, Failure> {
    let mut all = Arguments {
        only: None,
        effort: MeasurementBudget { seconds: 0.3 },
        peers: true,
        out: repository_path("plots/compare"),
        write: None,
    };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut value = || words.next().ok_or(USAGE);
        match word.as_str() {
            "--only" => all.only = Some(value()?),
            "--seconds" => all.effort.seconds = value()?.parse()?,
            "--no-peers" => all.peers = false,
            "--out" => all.out = value()?.into(),
            "--write" => all.write = Some(value()?.into()),
            _ => return Err(USAGE.into()),
        }
    }
    Ok(all)
}

fn cases() -> Result<Vec<Case>, String> {
    use Family::{Gauss, Rk4};
    let mut cases = vec![
        Case::pendulum(Gauss, 2, 1).with_reference("pendulum/pendulum_T005_irk_s2n1.json")?,
        Case::pendulum(Gauss, 4, 4),
    ];
    for masses in [3, 5, 7, 9, 13, 33] {
        for (stages, steps) in [(2, 1), (4, 4)] {
            let case = Case::chain(masses, Gauss, stages, steps);
            let file = format!("chain/chain_{masses}_irk_s{stages}n{steps}.json");
            let known = repository_path("tests/data").join(&file).exists();
            cases.push(if known { case.with_reference(&file)? } else { case });
        }
    }
    cases.push(Case::awe()?);
    cases.push(Case::pendulum(Rk4, 4, 1).with_reference("pendulum/pendulum_T005_erk4n1.json")?);
    cases.push(Case::chain(5, Rk4, 4, 1).with_reference("chain/chain_5_erk4n1.json")?);
    cases.push(Case::chain(9, Rk4, 4, 1));
    Ok(cases)
}

/// Everything that was measured.
#[derive(Default)]
pub struct Results {
    machine: Vec<String>,
    rows: Vec<rows::Row>,
    scale: f64,
    adaptive: Vec<adaptive::SolverRow>,
    growth: Vec<ScalingWithSize>,
    precision: Option<(Vec<growth::Precision>, f64)>,
}

/// Those that are there, and a line about each.
fn start_peers(wanted: bool) -> (Peers, Vec<String>) {
    let mut peers = Peers::default();
    let mut lines = Vec::new();
    match if wanted { Casadi::start() } else { Err("not asked for".into()) } {
        Ok(casadi) => {
            lines.push(casadi.versions.clone());
            peers.casadi = Some(casadi);
        }
        Err(why) => lines.push(format!("without CasADi: {why}")),
    }
    match if wanted { Acados::start_all() } else { Err("not asked for".into()) } {
        Ok(all) => {
            lines.extend(all.iter().map(|acados| acados.version.clone()));
            peers.acados = all;
        }
        Err(why) => lines.push(format!("acados is not measured: {why}")),
    }
    (peers, lines)
}

fn measure_all() -> Result<(), Failure> {
    let arguments = arguments()?;
    let effort = arguments.effort;
    let pinned = pin_to_last_core();
    let anchors = ReferenceTimes::load()?;
    let (mut peers, versions) = start_peers(arguments.peers);
    versions.iter().for_each(|version| eprintln!("{version}"));
    let mut results = Results { machine: machine::describe(pinned, &versions), ..Default::default() };

    for case in cases()? {
        if arguments.only.as_ref().is_some_and(|text| !case.name.contains(text)) {
            continue;
        }
        eprintln!("{}", case.name);
        results.rows.extend(rows::measure_case(&case, &mut peers, effort)?);
        for row in results.rows.iter().rev().take(4).rev() {
            eprintln!("    {:<11} {:10.2} µs", row.mode.name(), 1e6 * row.cold.time.median);
        }
    }
    rows::carry_over(&mut results.rows, &anchors);
    results.scale = anchors.median_machine_ratio(&results.rows);

    if arguments.only.is_none() {
        if let Some(casadi) = peers.casadi.as_mut() {
            eprintln!("solvers with step-size control");
            results.adaptive = adaptive::measure_adaptive(casadi, effort)?;
            eprintln!("work-precision");
            results.precision = Some(growth::work_precision(casadi, effort)?);
        }
        eprintln!("growth");
        for (stages, steps) in [(2, 1), (4, 4)] {
            results.growth.push(ScalingWithSize::measure(&[9, 13, 17, 33, 65], stages, steps, effort)?);
        }
    }

    let text = report::markdown(&results);
    println!("{text}");
    std::fs::create_dir_all(&arguments.out)?;
    std::fs::write(arguments.out.join("compare.json"), json::seconds_of(&results).to_string() + "\n")?;
    plots::draw_all(&results, &arguments.out)?;
    match &arguments.write {
        Some(file) => insert_between_markers(file, "compare", &text)?,
        None => std::fs::write(arguments.out.join("compare.md"), &text)?,
    }
    eprintln!("tables, JSON and plots are in {}", arguments.out.display());
    Ok(())
}

fn main() -> ExitCode {
    match measure_all() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("compare: {error}");
            ExitCode::FAILURE
        }
    }
}
