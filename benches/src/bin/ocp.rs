//! Optimal control of the chain of masses: whole solutions, their linearisations and QPs, beside IPOPT with direct collocation (CasADi,
//! where `CASADOS_PYTHON` or `python3` has it) in the same run, and acados by its times on another day.
//!
//! ```text
//! cargo run --release --manifest-path benches/Cargo.toml --bin ocp
//! ```
//!
//! Times are CPU seconds of one thread, the best of five medians. All end at a residual of 1e-6, from `x = x_rest`, `u = 0`; "condensed"
//! in blocks of five intervals. Ratios are those of the better one.

#[path = "../../../examples/models/chain_problem.rs"]
mod chain_problem;

use casados::ocp::{GaussNewton, HeapSqp, Shooting};
use casados::prelude::*;
use casados::qp::{Condensing, HeapInteriorPoint};
use casados_benches::models::Chain;
use casados_benches::record::{load, numbers, repository};
use casados_benches::time::{measure, pin};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;

type Failure = Box<dyn std::error::Error>;

const ROUNDS: usize = 5;
const BUDGET: Duration = Duration::from_millis(200);

/// IPOPT in a process of its own.
struct Ipopt {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Ipopt {
    fn start() -> Result<Self, Failure> {
        let python = std::env::var("CASADOS_PYTHON").unwrap_or_else(|_| "python3".into());
        let mut child = Command::new(python)
            .arg(repository("benches/peers/casadi_ocp.py"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()?;
        let (Some(input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            return Err("no pipe".into());
        };
        Ok(Self { child, input, output: BufReader::new(output) })
    }
    fn ask(&mut self, request: &Value) -> Result<Value, Failure> {
        writeln!(self.input, "{request}")?;
        loop {
            let mut line = String::new();
            if self.output.read_line(&mut line)? == 0 {
                return Err("it ended".into());
            }
            // IPOPT introduces itself first.
            if let Ok(answer) = serde_json::from_str::<Value>(&line) {
                return match answer["error"].as_str() {
                    Some(error) => Err(error.into()),
                    None => Ok(answer),
                };
            }
        }
    }
}

impl Drop for Ipopt {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// One size with one method: casados, IPOPT if it is there, and milliseconds of acados (whole, linearisation).
macro_rules! row {
    ($ipopt:expr, $nx:literal, $stages:literal x $steps:literal, $acados:expr) => {{
        let masses = ($nx - 3) / 6 + 2;
        let record = load(&format!("tests/data/ocp/chain_{masses}.json"))?;
        let (rest, x0) = (numbers(&record["xrest"]), numbers(&record["x0"]));
        // A thousand times below what the whole is solved to.
        let newton = Newton { tolerance: 1e-9, ..Default::default() };
        let options = Options { steps: $steps, newton, ..Default::default() };
        let batch = || Batch::<Chain<$nx>, Gauss<$stages>>::new(options);
        let mut ocp = chain_problem::problem!($nx, rest.clone(), x0, Shooting::new(batch()?));
        let mut riccati = HeapSqp::new(&ocp)?;
        let mut condensed = HeapSqp::with_solver(&ocp, Condensing::new(5, HeapInteriorPoint::new()))?;
        let outcome = riccati.solve(&mut ocp)?;
        let (mut whole, mut whole_condensed, mut linear) = (f64::INFINITY, f64::INFINITY, f64::INFINITY);
        for _ in 0..ROUNDS {
            let time = measure(BUDGET, || {
                ocp.guess(&rest, &[0.0; 3])?;
                riccati.solve(&mut ocp).map(drop)
            })?;
            whole = whole.min(1e3 * time.median);
            let time = measure(BUDGET, || {
                ocp.guess(&rest, &[0.0; 3])?;
                condensed.solve(&mut ocp).map(drop)
            })?;
            whole_condensed = whole_condensed.min(1e3 * time.median);
            let time = measure(BUDGET, || ocp.linearise(GaussNewton::default()))?;
            linear = linear.min(1e3 * time.median);
        }
        // As often as there are iterations, and once to see that it is done.
        linear *= (outcome.iterations + 1) as f64;
        let request = json!({
            "masses": masses, "x_rest": rest, "x0": numbers(&record["x0"]),
            "stages": $stages, "steps": $steps, "repetitions": 3,
        });
        let ipopt: Option<Value> = match &mut $ipopt {
            // It does not solve every one.
            Some(ipopt) => ipopt.ask(&request).inspect_err(|error| eprintln!("IPOPT: {error}")).ok(),
            None => None,
        };
        let best = whole.min(whole_condensed);
        let (acados_whole, acados_linear): (f64, Option<f64>) = $acados;
        let ratio = |theirs: Option<f64>, mine: f64| {
            theirs.map_or("".into(), |theirs| format!("{theirs:.1} ({:.1})", theirs / mine))
        };
        println!(
            "| {masses} | GL{}x{} | {} | {:.8} | {whole:.2} | {whole_condensed:.2} | {linear:.2} | {} | {} | {} |",
            $stages,
            $steps,
            outcome.iterations,
            outcome.objective,
            ratio(Some(acados_whole), best),
            ratio(acados_linear, linear),
            ratio(ipopt.and_then(|answer| answer["seconds"].as_f64()).map(|s| 1e3 * s), best),
        );
    }};
}

fn main() -> Result<(), Failure> {
    println!("pinned: {}", pin());
    let mut ipopt = Ipopt::start().ok();
    println!("Milliseconds; in brackets how many times those of casados.\n");
    println!(
        "| masses | method | iterations | objective | whole | condensed | linearisations | acados whole | acados linearisations | IPOPT |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    row!(ipopt, 9, 2 x 2, (3.9, Some(2.4)));
    row!(ipopt, 21, 2 x 2, (12.3, Some(8.5)));
    row!(ipopt, 33, 2 x 2, (28.6, Some(20.7)));
    row!(ipopt, 9, 4 x 4, (10.0, None));
    row!(ipopt, 21, 4 x 4, (46.5, None));
    row!(ipopt, 33, 4 x 4, (119.0, None));
    Ok(())
}
