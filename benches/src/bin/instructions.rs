//! Instructions of one call, counted by callgrind, against the reviewed counts of
//! `instructions.txt`.
//!
//! ```text
//! cargo run --release --manifest-path benches/Cargo.toml --bin instructions            compares; fails beyond 2 %
//! cargo run --release --manifest-path benches/Cargo.toml --bin instructions -- accept  writes the counts
//! ```
//!
//! Counts do not depend on what else the machine does, but on the compiler, so a new one means new
//! counts. The program runs itself under valgrind with a few calls and with more: the difference is
//! what the calls cost.

use casados::prelude::Start;
use casados_benches::calls::{open_calls, options};
use casados_benches::case::{Case, Family, Mode};
use casados_benches::record::repository_path;
use std::fmt::Write;
use std::process::{Command, ExitCode};

type Failure = Box<dyn std::error::Error>;

const FILE: &str = "benches/instructions.txt";
/// Code that nobody touched moves by this much when its neighbours are compiled anew.
const TOLERANCE: f64 = 0.02;
const FEW_CALLS: usize = 2;
const MANY_CALLS: usize = 12;

fn cases() -> Result<Vec<Case>, String> {
    let gauss = Family::Gauss;
    Ok(vec![
        Case::pendulum(gauss, 2, 1),
        Case::pendulum(gauss, 4, 4),
        Case::chain(5, gauss, 2, 1),
        Case::chain(5, gauss, 4, 4),
        Case::chain(7, gauss, 2, 1),
        Case::chain(7, gauss, 4, 4),
        Case::awe()?,
    ])
}

/// What runs under valgrind.
fn run_case(name: &str, mode: &str, calls: &str) -> Result<(), Failure> {
    let case = cases()?.into_iter().find(|case| case.name == name).ok_or("no such case")?;
    let mode = Mode::ALL_MODES.into_iter().find(|m| m.name() == mode).ok_or("no such mode")?;
    let mut integrator = open_calls(&case, options(&case, 1e-8, Start::Zero))?;
    for _ in 0..calls.parse::<usize>()? {
        integrator.call_input(mode, 0).map_err(|e| e.to_string())?;
    }
    Ok(())
}

fn count_instructions(case: &Case, mode: Mode, calls: usize) -> Result<f64, Failure> {
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(std::env::current_exe()?)
        .args([&case.name, mode.name(), &calls.to_string()])
        .output()?;
    let text = String::from_utf8_lossy(&output.stderr);
    let line = text.lines().find_map(|line| line.split_once("Collected :"));
    let (_, number) =
        line.ok_or_else(|| format!("valgrind says: {}", text.lines().last().unwrap_or_default()))?;
    Ok(number.trim().parse()?)
}

fn run() -> Result<bool, Failure> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let words: Vec<_> = arguments.iter().map(String::as_str).collect();
    let accept = match words[..] {
        [] => false,
        ["accept"] => true,
        [case, mode, calls] => return run_case(case, mode, calls).map(|()| true),
        _ => return Err("usage: instructions [accept]".into()),
    };
    if Command::new("valgrind").arg("--version").output().is_err() {
        println!("no valgrind here: nothing is counted");
        return Ok(true);
    }
    let path = repository_path(FILE);
    let reviewed = std::fs::read_to_string(&path).unwrap_or_default();
    let known = |key: &str| {
        let line =
            reviewed.lines().filter_map(|line| line.split_once('=')).find(|(name, _)| name.trim() == key);
        line.and_then(|(_, number)| number.trim().parse::<f64>().ok())
    };
    let mut new = String::from(
        "# Instructions of one call, from zero, tolerance 1e-8 / steps; written by `instructions -- accept`.\n",
    );
    let mut good = true;
    for case in cases()? {
        for mode in Mode::ALL_MODES {
            let key = format!("{} {}", case.name, mode.name());
            let per_call = (count_instructions(&case, mode, MANY_CALLS)?
                - count_instructions(&case, mode, FEW_CALLS)?)
                / (MANY_CALLS - FEW_CALLS) as f64;
            writeln!(new, "{key} = {per_call:.0}")?;
            let change = known(&key).map(|old| per_call / old - 1.0);
            let off = change.is_none_or(|change| change.abs() > TOLERANCE);
            good &= !off;
            let change = change.map_or("new".into(), |c| format!("{:+.2} %", 100.0 * c));
            println!("{key:<32} {per_call:>12.0}  {change}{}", if off && !accept { "  <-" } else { "" });
        }
    }
    if accept {
        std::fs::write(path, new)?;
    }
    Ok(good || accept)
}

fn main() -> ExitCode {
    match run() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => {
            eprintln!("counts have moved: review them, then `instructions -- accept`");
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("instructions: {error}");
            ExitCode::FAILURE
        }
    }
}
