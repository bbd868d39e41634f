//! Models of index one beside the same with their algebraic states eliminated by hand: steps,
//! Jacobians, factorisations, iterations, user CPU time.
//!
//! ```text
//! cargo run --release --manifest-path benches/Cargo.toml -p error_control --bin index_one -- [part of a name]
//! ```

#[path = "../../../../examples/models/ivp/mod.rs"]
mod models;
#[path = "../more_plants.rs"]
mod more_plants;
#[path = "../../../../tests/ivp/algebraic/plants.rs"]
#[allow(dead_code)]
mod plants;

use casados::{Adaptive, AdaptiveOptions, AdaptiveStatistics, Radau};
use cpu_time::ProcessTime;
use models::chemistry::AkzoNobel;
use models::vibrations::{Beam, ExplicitBeam};
use more_plants::{AkzoEliminated, Fekete, FeketeEliminated};
use nalgebra::SVector;
use plants::{Exchanger, ExchangerEliminated, Pipes, PipesEliminated, Tanks, TanksEliminated};
use reference_data::Record;

/// The clock resolves so many calls; the fastest ones are told.
const REPEATED: u32 = 8;

/// The time of a call, its result and its work.
type Made = (f64, Vec<f64>, AdaptiveStatistics);

macro_rules! solve {
    ($model:ty, $np:literal, $x0:expr, $p:expr, $t:expr, $tolerance:expr, $atol:expr) => {{
        let options = AdaptiveOptions { rtol: $tolerance, atol: $atol * $tolerance, ..Default::default() };
        let mut adaptive = Adaptive::<$model, Radau>::new(options).expect("valid");
        let x0 = SVector::from_column_slice(&$x0);
        if $np > 0 {
            adaptive.set_parameters(&SVector::<f64, $np>::from_column_slice(&$p)).expect("finite");
        }
        let x = adaptive.solve(&x0, &SVector::zeros(), $t).expect("a solution").x;
        let mut time = f64::INFINITY;
        let all = ProcessTime::now();
        while all.elapsed().as_secs_f64() < 0.2 {
            let start = ProcessTime::now();
            for _ in 0..REPEATED {
                adaptive.solve(&x0, &SVector::zeros(), $t).expect("a solution");
            }
            time = time.min(start.elapsed().as_secs_f64() / f64::from(REPEATED));
        }
        (time, x.as_slice().to_vec(), *adaptive.statistics())
    }};
}

fn show(name: &str, tolerance: f64, atol: f64, (algebraic, ordinary): (Made, Made)) {
    let difference = algebraic.1.iter().zip(&ordinary.1).map(|(a, b)| (a - b).abs() / (atol + b.abs()));
    let difference = difference.fold(0.0, f64::max) / tolerance;
    print!("| {name} | {tolerance:e} | {:.2} | {difference:.2} |", algebraic.0 / ordinary.0);
    for (time, _, work) in [algebraic, ordinary] {
        let AdaptiveStatistics {
            steps,
            rejected,
            failed,
            residuals,
            jacobians,
            factorizations,
            iterations,
            ..
        } = work;
        print!(
            " {:.3} ms: {steps}+{rejected}+{failed}, {residuals}, {jacobians}, {factorizations}, {iterations} |",
            1e3 * time
        );
    }
    println!();
}

/// Start values of Fekete's points: an uneven spiral on the sphere, at rest.
fn spiral() -> Vec<f64> {
    let mut x0 = vec![0.0; 36];
    for i in 0..6 {
        let height = 0.9 - 0.33 * i as f64;
        let (angle, radius) = (1.1 * i as f64 + 0.3, (1.0 - height * height).sqrt());
        x0[3 * i..3 * i + 3].copy_from_slice(&[radius * angle.cos(), radius * angle.sin(), height]);
    }
    x0
}

fn main() {
    let part = std::env::args().nth(1).unwrap_or_default();
    println!(
        "| model | tolerance | time, DAE/ODE | difference in tolerances | DAE: steps+rejected+failed, evaluations, Jacobians, factorisations, iterations | ODE |"
    );
    println!("| --- | --- | --- | --- | --- | --- |");
    let set = Record::load("ivp/algebraic.json").expect("the reference is there");
    for tolerance in [1e-4, 1e-6, 1e-8, 1e-10] {
        macro_rules! compare {
            ($name:literal, $dae:ty, $ode:ty) => {
                if $name.contains(part.as_str()) {
                    let record = set.record($name).expect("a problem");
                    let (x0, t) = (record.list("x0").expect("states"), record.number("t").expect("a time"));
                    show(
                        $name,
                        tolerance,
                        1.0,
                        (
                            solve!($dae, 0, x0, [], t, tolerance, 1.0),
                            solve!($ode, 0, x0, [], t, tolerance, 1.0),
                        ),
                    );
                }
            };
        }
        if "beam".contains(part.as_str()) {
            let record =
                Record::load("ivp/vibrations.json").and_then(|set| set.record("beam_10")).expect("a problem");
            let x0 = record.list("x0").expect("states");
            show(
                "beam",
                tolerance,
                1.0,
                (
                    solve!(Beam<20, 10, 30>, 0, x0, [], 5.0, tolerance, 1.0),
                    solve!(ExplicitBeam<20>, 0, x0, [], 5.0, tolerance, 1.0),
                ),
            );
        }
        compare!("pipes", Pipes, PipesEliminated);
        compare!("tanks", Tanks, TanksEliminated);
        compare!("exchanger", Exchanger, ExchangerEliminated);
        if "fekete".contains(part.as_str()) {
            let x0 = spiral();
            show(
                "fekete",
                tolerance,
                1.0,
                (
                    solve!(Fekete, 0, x0, [], 10.0, tolerance, 1.0),
                    solve!(FeketeEliminated, 0, x0, [], 10.0, tolerance, 1.0),
                ),
            );
        }
        if "akzo".contains(part.as_str()) {
            let record =
                Record::load("ivp/ends.json").and_then(|set| set.record("akzo_nobel")).expect("a problem");
            let (x0, p) = (record.list("x0").expect("states"), record.list("p").expect("parameters"));
            show(
                "akzo",
                tolerance,
                1e-3,
                (
                    solve!(AkzoNobel, 9, x0, p, 180.0, tolerance, 1e-3),
                    solve!(AkzoEliminated, 9, x0, p, 180.0, tolerance, 1e-3),
                ),
            );
        }
    }
}
