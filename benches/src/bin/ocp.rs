//! Optimal control of the chain of masses: whole solutions, their linearisations and QPs, beside
//! IPOPT with direct collocation (CasADi, where `CASADOS_PYTHON` or `python3` has it) and acados'
//! SQP (where `ACADOS_SOURCE_DIR` lists installations) in the same run.
//!
//! ```text
//! cargo run --release --manifest-path benches/Cargo.toml --bin ocp
//! ```
//!
//! Times are CPU seconds of one thread, the best of five medians. All end at a residual of 1e-6,
//! from `x = x_rest`, `u = 0`; "condensed" in blocks of five intervals. Ratios are those of the
//! better one. acados is measured in the same rounds, in its fastest setting; see
//! `benches/peers/acados_ocp.py`.

#[path = "../../../examples/models/chain_problem.rs"]
mod chain_problem;

use casados::ocp::{GaussNewton, HeapSqp, Shooting};
use casados::prelude::*;
use casados::qp::{Condensing, HeapInteriorPoint};
use casados_benches::models::Chain;
use casados_benches::peer::Peer;
use casados_benches::record::{load, numbers};
use casados_benches::time::{measure, pin_to_last_core};
use serde_json::{Value, json};
use std::time::Duration;

type Failure = Box<dyn std::error::Error>;

const ROUNDS: usize = 5;
const BUDGET: Duration = Duration::from_millis(200);

/// Those that are there.
struct Peers {
    ipopt: Option<Peer>,
    /// For several targets of BLASFEO, of which the faster counts.
    acados: Vec<Peer>,
}

impl Peers {
    fn start() -> Self {
        let ipopt = Peer::start("casadi_ocp.py", |command| command).ok();
        let acados =
            Peer::acados("acados_ocp.py").inspect_err(|why| println!("acados is not measured: {why}"));
        Self { ipopt, acados: acados.unwrap_or_default().into_iter().map(|(_, peer)| peer).collect() }
    }

    /// Milliseconds of IPOPT.
    fn ipopt(&mut self, request: &Value) -> Option<f64> {
        // It does not solve every one.
        let answer =
            self.ipopt.as_mut()?.ask(request).inspect_err(|error| eprintln!("IPOPT: {error}")).ok()?;
        Some(1e3 * answer["seconds"].as_f64()?)
    }

    /// Milliseconds of acados, whole and linearisation, where they are less than those known so
    /// far.
    fn acados(&mut self, request: &Value, known: &mut [f64; 2], objective: f64) {
        for acados in &mut self.acados {
            let answer = match acados.ask(request) {
                Ok(answer) => answer,
                Err(error) => return eprintln!("acados: {error}"),
            };
            let number = |key: &str| answer[key].as_f64().unwrap_or(f64::NAN);
            // What ends elsewhere is no solution: both stop at a residual of 1e-6.
            if (number("objective") / objective - 1.0).abs() > 1e-5 {
                return eprintln!("acados: objective {}", number("objective"));
            }
            for (known, key) in known.iter_mut().zip(["seconds", "linear"]) {
                *known = known.min(1e3 * number(key));
            }
        }
    }
}

/// One size with one method: casados, and those of the peers that are there.
macro_rules! row {
    ($peers:expr, $nx:literal, $stages:literal x $steps:literal) => {{
        let masses = ($nx - 3) / 6 + 2;
        let record = load(&format!("tests/data/ocp/chain_{masses}.json"))?;
        let (rest, x0) = (numbers(&record["xrest"]), numbers(&record["x0"]));
        // A thousand times below what the whole is solved to.
        let newton = Newton { tolerance: 1e-9, ..Default::default() };
        let options = Options { steps: $steps, newton, ..Default::default() };
        let batch = || Batch::<Chain<$nx>, Gauss<$stages>>::new(options);
        let mut ocp = chain_problem::problem!($nx, rest.clone(), x0, Shooting::new(batch()?));
        let mut riccati = HeapSqp::new(&ocp)?.gauss_newton();
        let mut condensed = HeapSqp::with_solver(&ocp, Condensing::new(5, HeapInteriorPoint::new()))?.gauss_newton();
        let outcome = riccati.solve(&mut ocp)?;
        let (mut whole, mut whole_condensed, mut linear) = (f64::INFINITY, f64::INFINITY, f64::INFINITY);
        let mut request = json!({
            "masses": masses, "x_rest": rest, "x0": numbers(&record["x0"]),
            "stages": $stages, "steps": $steps, "seconds": 0.0,
        });
        // Generates and compiles.
        let mut acados = [f64::INFINITY; 2];
        $peers.acados(&request, &mut acados, outcome.objective);
        request["seconds"] = json!(BUDGET.as_secs_f64());
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
            $peers.acados(&request, &mut acados, outcome.objective);
        }
        // As often as there are iterations, and once to see that it is done.
        linear *= (outcome.iterations + 1) as f64;
        request["repetitions"] = json!(3);
        let ipopt = $peers.ipopt(&request);
        let best = whole.min(whole_condensed);
        let ratio = |theirs: Option<f64>, mine: f64| {
            let known = theirs.filter(|theirs| theirs.is_finite());
            known.map_or("".into(), |theirs| format!("{theirs:.2} ({:.2})", theirs / mine))
        };
        println!(
            "| {masses} | GL{}x{} | {} | {:.8} | {whole:.2} | {whole_condensed:.2} | {linear:.2} | {} | {} | {} |",
            $stages,
            $steps,
            outcome.iterations,
            outcome.objective,
            ratio(Some(acados[0]), best),
            ratio(Some(acados[1]), linear),
            ratio(ipopt, best),
        );
    }};
}

fn main() -> Result<(), Failure> {
    println!("pinned: {}", pin_to_last_core());
    let mut peers = Peers::start();
    println!("Milliseconds; in brackets how many times those of casados.\n");
    println!(
        "| masses | method | iterations | objective | whole | condensed | linearisations | acados whole | acados linearisations | IPOPT |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    row!(peers, 9, 2 x 2);
    row!(peers, 21, 2 x 2);
    row!(peers, 33, 2 x 2);
    row!(peers, 9, 4 x 4);
    row!(peers, 21, 4 x 4);
    row!(peers, 33, 4 x 4);
    Ok(())
}
