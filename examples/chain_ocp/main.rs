//! A chain of masses is brought to rest beside a wall: optimal control by multiple shooting and
//! sequential quadratic programming, and what an iteration costs as the chain grows.
//!
//! ```text
//! cargo run --release --example chain_ocp [PICTURE.svg]
//! ```

#[path = "../models/chain.rs"]
#[allow(dead_code)]
mod chain;
#[path = "../models/chain_problem.rs"]
mod chain_problem;

use casados::ocp::{HeapSqp, Outcome, Shooting};
use casados::plot::{Curve, Figure, Panel};
use casados::prelude::*;
use chain::Chain;
use reference_data::Record;
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

const USAGE: &str = "usage: cargo run --release --example chain_ocp [PICTURE.svg]";
/// Whole solutions that are timed; the fastest counts.
const REPETITIONS: usize = 20;

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args_os().skip(1).collect();
    let picture = match &arguments[..] {
        [] => PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/plots/chain_ocp.svg")),
        [path] if path.as_encoded_bytes().ends_with(b".svg") => PathBuf::from(path),
        _ => {
            eprintln!("{USAGE}");
            return ExitCode::FAILURE;
        }
    };
    match run().and_then(|drawing| Ok(drawing.figure().save(&picture)?)) {
        Ok(()) => {
            println!("\n{}", picture.display());
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("chain_ocp: {error}");
            ExitCode::FAILURE
        }
    }
}

/// What is drawn.
#[derive(Default)]
struct Picture {
    /// Milliseconds of an iteration by the number of masses, of each method.
    times: Vec<(String, Vec<(f64, f64)>)>,
    /// States at the nodes.
    states: Vec<Vec<f64>>,
    /// The iterations, which are printed.
    log: String,
}

impl Picture {
    /// The motion as seen from above, at every other node, and what an iteration costs.
    fn figure(&self) -> Figure {
        let motion = Panel::new("Five masses on their way to rest, from above")
            .x("x, m")
            .y("y, m")
            .limit(-0.05)
            .motion(self.states.iter().step_by(2).map(|state| masses(state)));
        let times = Panel::new("Time of an iteration").x("masses").y("ms").log_y();
        let times = self.times.iter().fold(times, |panel, (name, points)| {
            panel.with(Curve::line(name, points.iter().copied()).marked())
        });
        Figure::new().size(1100, 460).with(motion).column(1.0).with(times)
    }
}

/// x and y of the wall and of all masses.
fn masses(state: &[f64]) -> Vec<(f64, f64)> {
    let free = state.len().saturating_sub(3) / 6;
    let places = state.chunks_exact(3).take(free + 1).map(|place| (place[0], place[1]));
    std::iter::once((0.0, 0.0)).chain(places).collect()
}

/// Solves the problem of a size, again and again; the fastest outcome, the iterations of the last
/// one, and the states.
macro_rules! solve {
    ($nx:literal, $stages:literal, $steps:literal) => {{
        let record = Record::load(&format!("ocp/chain_{}.json", ($nx - 3) / 6 + 2))?;
        let (rest, x0) = (record.list("xrest")?, record.list("x0")?);
        // A thousand times below what the whole is solved to.
        let newton = Newton { tolerance: 1e-9, ..Default::default() };
        let options = Options { steps: $steps, newton, ..Default::default() };
        let batch = Batch::<Chain<$nx>, Gauss<$stages>>::new(options)?;
        let mut ocp = chain_problem::problem!($nx, rest.clone(), x0, Shooting::new(batch));
        let mut sqp = HeapSqp::new(&ocp)?.gauss_newton();
        let mut best: Option<Outcome> = None;
        for _ in 0..REPETITIONS {
            ocp.guess(&rest, &[0.0; 3])?;
            let outcome = sqp.solve(&mut ocp)?;
            if !outcome.is_converged() {
                return Err(outcome.to_string().into());
            }
            if best.is_none_or(|best| outcome.times.total() < best.times.total()) {
                best = Some(outcome);
            }
        }
        let states: Vec<Vec<f64>> = ocp.iterate().stages().map(|stage| stage.x.to_vec()).collect();
        (best.ok_or("no run")?, sqp.log().to_string(), states)
    }};
}

/// Problems of all sizes with one method.
macro_rules! sizes {
    ($picture:ident, $stages:literal x $steps:literal) => {{
        let mut series = (format!("GL{}x{}", $stages, $steps), Vec::new());
        sizes!(@ $picture, series, $stages, $steps, 9, 15, 21, 27, 33);
        $picture.times.push(series);
    }};
    (@ $picture:ident, $series:ident, $stages:literal, $steps:literal, $($nx:literal),*) => { $(
        let (outcome, log, states) = solve!($nx, $stages, $steps);
        let (masses, iterations) = (($nx - 3) / 6 + 2, outcome.iterations);
        // The last linearisation finds that it is done, and belongs to the steps before.
        let each = |seconds: f64| 1e3 * seconds / iterations as f64;
        println!(
            "{masses:>6} {:>7} {iterations:>6} {:>16.8} {:>10.2} {:>10.3} {:>10.3} {:>10.3}",
            $series.0,
            outcome.objective,
            1e3 * outcome.times.total(),
            each(outcome.times.total()),
            each(outcome.times.linearise),
            each(outcome.times.qp),
        );
        $series.1.push((masses as f64, each(outcome.times.total())));
        if masses == 5 && $stages == 2 && $steps == 2 {
            $picture.log = log;
            $picture.states = states;
        }
    )* };
}

fn run() -> Result<Picture, Box<dyn Error>> {
    println!(
        "Milliseconds, the fastest of {REPETITIONS}; Gauss-Legendre, stages x steps in each of 40 intervals\n"
    );
    println!("masses  method   iter        objective      whole  iteration  linearise         QP");
    let mut picture = Picture::default();
    sizes!(picture, 2 x 1);
    sizes!(picture, 2 x 2);
    sizes!(picture, 4 x 4);
    println!("\nThe iterations with five masses, GL2x2:\n\n{}", picture.log);
    Ok(picture)
}
