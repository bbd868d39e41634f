//! The default `Radau`, which chooses its order, beside each of its methods alone: user CPU time of
//! a call, evaluations, matrices, errors over tolerances.
//!
//! ```text
//! cargo run --release --manifest-path benches/Cargo.toml -p error_control --bin orders -- [part of a name]
//! ```

#[path = "../../../../examples/models/ivp/mod.rs"]
mod models;

use casados::{Adaptive, AdaptiveOptions, Radau, RadauIIA};
use cpu_time::ProcessTime;
use models::chemistry::{AkzoNobel, E5, Hires, Oregonator, Robertson};
use models::oscillators::VanDerPol;
use nalgebra::SVector;
use reference_data::Record;

/// The clock resolves so many calls; the fastest ones are told.
const REPEATED: u32 = 8;

/// The time of a call in ms, and what it did.
macro_rules! solve {
    ($model:ty, $method:ty, $nx:literal, $np:literal, $record:expr, $tolerance:expr, $atol:expr) => {{
        let options = AdaptiveOptions { rtol: $tolerance, atol: $atol * $tolerance, ..Default::default() };
        let mut adaptive = Adaptive::<$model, $method>::new(options).expect("valid");
        let x0 = SVector::from_column_slice(&$record.list("x0").expect("states")[..$nx]);
        if $np > 0 {
            let p = $record.list("p").expect("parameters");
            adaptive.set_parameters(&SVector::<f64, $np>::from_column_slice(&p)).expect("finite");
        }
        let end = $record.records("ends").expect("ends").into_iter().last().expect("an end");
        let (t, y) = (end.number("t").expect("a time"), end.list("y").expect("values"));
        let x = adaptive.solve(&x0, &SVector::zeros(), t).expect("a solution").x;
        let error = |(x, y): (&f64, &f64)| (x - y).abs() / ($tolerance * ($atol + y.abs()));
        let error = x.iter().zip(&y).map(error).fold(0.0, f64::max);
        let mut time = f64::INFINITY;
        let all = ProcessTime::now();
        while all.elapsed().as_secs_f64() < 0.1 {
            let start = ProcessTime::now();
            for _ in 0..REPEATED {
                adaptive.solve(&x0, &SVector::zeros(), t).expect("a solution");
            }
            time = time.min(start.elapsed().as_secs_f64() / f64::from(REPEATED));
        }
        let work = adaptive.statistics();
        print!(
            " {:.4} ms: {}, {}, {:.2} |",
            1e3 * time,
            work.residuals,
            work.jacobians + work.factorizations,
            error
        );
        time
    }};
}

fn main() {
    let part = std::env::args().nth(1).unwrap_or_default();
    let set = Record::load("ivp/ends.json").expect("the reference is there");
    println!("| problem | tolerance | Radau | s = 3 | s = 5 | s = 7 | Radau over the fastest |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    let (mut sum, mut count) = (0.0, 0);
    for tolerance in [1e-4, 1e-6, 1e-8, 1e-10] {
        macro_rules! compare {
            ($name:literal, $model:ty, $nx:literal, $np:literal, $atol:expr) => {
                if $name.contains(part.as_str()) {
                    let record = set.record($name).expect("a problem");
                    print!("| {} | {tolerance:e} |", $name);
                    let own = solve!($model, Radau, $nx, $np, record, tolerance, $atol);
                    let fastest = solve!($model, RadauIIA<3>, $nx, $np, record, tolerance, $atol)
                        .min(solve!($model, RadauIIA<5>, $nx, $np, record, tolerance, $atol))
                        .min(solve!($model, RadauIIA<7>, $nx, $np, record, tolerance, $atol));
                    println!(" {:.2} |", own / fastest);
                    sum += (own / fastest).ln();
                    count += 1;
                }
            };
        }
        compare!("robertson", Robertson, 3, 3, 1e-6);
        compare!("hires", Hires, 8, 0, 1e-3);
        compare!("oregonator", Oregonator, 3, 4, 1.0);
        compare!("van_der_pol_1e3", VanDerPol, 2, 1, 1.0);
        compare!("van_der_pol_1e6", VanDerPol, 2, 1, 1.0);
        compare!("akzo_nobel", AkzoNobel, 5, 9, 1e-3);
        compare!("e5", E5, 4, 0, 1e-16);
    }
    println!("geometric mean: {:.3}", f64::exp(sum / f64::from(count.max(1))));
}
