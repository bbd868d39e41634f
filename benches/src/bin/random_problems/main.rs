//! Errors over tolerances on random problems: beside a reference by Gauss's method of order 18, in
//! steps that end where the force of a problem does.
//!
//! ```text
//! cargo run --release --manifest-path benches/Cargo.toml --bin random_problems
//! .. -- [--problems 40] [--each] [part of a family's name]
//! ```
//!
//! Of each family and method: the median and the largest error in tolerances at `atol = rtol`, of
//! the worst component at the end, and in brackets the median of the evaluations of the model.
//! `--each` prints every run instead: family and number, method, tolerance, error, evaluations.

mod models;
mod problems;
#[path = "../../../../examples/models/ivp/vibrations.rs"]
#[allow(dead_code)]
mod vibrations;

use casados::{Adaptive, AdaptiveOptions, DormandPrince5, DormandPrince8, Error, Gauss, Irk, Options, Radau};
use models::{
    Body, Contact, Forced, Kinetics, Kinked, Linear, Orbit, Prey, Pushed, Relaxation, Rods, Springs,
};
use nalgebra::SVector;
use problems::{FAMILIES, Problem, problem};
use std::collections::BTreeMap;
use vibrations::SpringPendulum;

const TOLERANCES: [f64; 4] = [1e-4, 1e-6, 1e-8, 1e-10];
/// A reference counts where steps a half and a third as long differ by no more than this.
const MAX_REFERENCE_ERROR: f64 = 1e-12;

/// What a run made of a problem.
struct Made {
    x: Vec<f64>,
    evaluations: usize,
}

macro_rules! family {
    ($name:ident: $model:ident, $nx:literal, $nz:literal, $np:literal; $($label:literal $method:ty),*) => {
        mod $name {
            use super::*;

            const METHODS: &[&str] = &[$($label),*];

            fn start(problem: &Problem) -> (SVector<f64, $nx>, SVector<f64, $np>) {
                (SVector::from_column_slice(&problem.x0), SVector::from_column_slice(&problem.p))
            }

            /// In steps of an adaptive run, each taken in `pieces`.
            fn reference(problem: &Problem, pieces: usize) -> Result<Vec<f64>, Error> {
                let (mut x, p) = start(problem);
                let mut adaptive = Adaptive::<$model, Radau>::new(options(1e-10))?;
                let mut irk = Irk::<$model, Gauss<9>>::new(Options { steps: pieces, ..Default::default() })?;
                if $np > 0 {
                    adaptive.set_parameters(&p)?;
                    irk.set_parameters(&p)?;
                }
                adaptive.solve(&x, &SVector::zeros(), problem.t)?;
                let mut times: Vec<f64> = adaptive.times().chain(problem.discontinuity_times()).collect();
                times.sort_by(f64::total_cmp);
                times.dedup_by(|next, last| *next - *last < 1e-13 * *next);
                for ends in times.windows(2) {
                    irk.set_time(ends[0])?;
                    x = irk.solve(&x, &SVector::zeros(), ends[1] - ends[0])?.x;
                }
                Ok(x.as_slice().to_vec())
            }

            fn run(problem: &Problem, method: &str, tolerance: f64) -> Result<Made, Error> {
                let (x0, p) = start(problem);
                $(if method == $label {
                    let mut adaptive = Adaptive::<$model, $method>::new(options(tolerance))?;
                    if $np > 0 {
                        adaptive.set_parameters(&p)?;
                    }
                    let x = adaptive.solve(&x0, &SVector::zeros(), problem.t)?.x.as_slice().to_vec();
                    return Ok(Made { x, evaluations: adaptive.statistics().residuals });
                })*
                Err(Error::NoResult)
            }

            pub const FAMILY: Family = Family { methods: METHODS, reference, run };
        }
    };
}
macro_rules! families {
    ($($name:ident: $model:ident, $nx:literal, $np:literal);*) => {
        $(family!(
            $name: $model, $nx, 0, $np;
            "Radau" Radau, "Gauss, s = 3" Gauss<3>, "Gauss, s = 4" Gauss<4>,
            "Dormand-Prince 8" DormandPrince8, "Dormand-Prince 5" DormandPrince5
        );)*
    };
}
families!(
    springs: Springs, 20, 22; linear: Linear, 6, 42; orbit: Orbit, 4, 0; kinetics: Kinetics, 5, 8;
    relaxation: Relaxation, 2, 1; forced: Forced, 2, 5; prey: Prey, 2, 2; body: Body, 3, 3;
    pushed: Pushed, 2, 4; kinked: Kinked, 2, 7; contact: Contact, 2, 3; spring_pendulum: SpringPendulum, 4, 1
);
family!(
    rods: Rods, 8, 2, 2;
    "Radau" Radau, "Gauss, s = 3" Gauss<3>, "Gauss, s = 4" Gauss<4>
);

/// What a family of problems is solved by.
struct Family {
    methods: &'static [&'static str],
    reference: fn(&Problem, usize) -> Result<Vec<f64>, Error>,
    run: fn(&Problem, &str, f64) -> Result<Made, Error>,
}

fn family(name: &str) -> Family {
    match name {
        "springs" | "modes" => springs::FAMILY,
        "linear" | "imaginary" => linear::FAMILY,
        "orbit" => orbit::FAMILY,
        "rods" => rods::FAMILY,
        "kinetics" => kinetics::FAMILY,
        "relaxation" => relaxation::FAMILY,
        "forced" => forced::FAMILY,
        "prey" => prey::FAMILY,
        "body" => body::FAMILY,
        "pushed" => pushed::FAMILY,
        "kinked" => kinked::FAMILY,
        "contact" => contact::FAMILY,
        _ => spring_pendulum::FAMILY,
    }
}

fn options(tolerance: f64) -> AdaptiveOptions {
    AdaptiveOptions { rtol: tolerance, atol: tolerance, max_steps: 60_000, ..Default::default() }
}

/// The largest difference, relative to one and the size of a component.
fn difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs() / (1.0 + b.abs())).fold(0.0, f64::max)
}

/// Errors in tolerances and evaluations of all runs of a method at a tolerance.
#[derive(Default)]
struct RunStatistics {
    errors: Vec<f64>,
    evaluations: Vec<f64>,
    failed: usize,
}

impl RunStatistics {
    fn table_cell(&mut self) -> String {
        let Self { errors, evaluations, failed } = self;
        for numbers in [&mut *errors, &mut *evaluations] {
            numbers.sort_by(f64::total_cmp);
        }
        let Some(worst) = errors.last() else { return "–".into() };
        let middle = errors.len() / 2;
        let failed = if *failed > 0 { format!(", {failed} stopped") } else { String::new() };
        format!("{:.2}, {:.3} ({:.0}{failed})", errors[middle], worst, evaluations[middle])
    }
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let (mut problems, mut each, mut part) = (40, false, String::new());
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--each" => each = true,
            "--problems" => {
                problems = arguments.next().and_then(|count| count.parse().ok()).unwrap_or(problems)
            }
            _ => part = argument,
        }
    }
    if !each {
        println!("| problems | method | 1e-4 | 1e-6 | 1e-8 | 1e-10 |\n| --- | --- | --- | --- | --- | --- |");
    }
    for name in FAMILIES.into_iter().filter(|name| name.contains(&part)) {
        measure_family(name, problems, each);
    }
}

/// All problems of a family.
fn measure_family(name: &'static str, problems: u64, each: bool) {
    let Family { methods, reference, run } = family(name);
    let mut runs: BTreeMap<(usize, usize), RunStatistics> = BTreeMap::new();
    for seed in 0..problems {
        let problem = problem(name, seed);
        let (Ok(other), Ok(exact)) = (reference(&problem, 2), reference(&problem, 3)) else { continue };
        if difference(&other, &exact).is_nan() || difference(&other, &exact) > MAX_REFERENCE_ERROR {
            eprintln!("{name} {seed} has no reference");
            continue;
        }
        for (method, label) in methods.iter().enumerate() {
            for (column, tolerance) in TOLERANCES.into_iter().enumerate() {
                let runs = runs.entry((method, column)).or_default();
                match run(&problem, label, tolerance) {
                    Ok(Made { x, evaluations }) => {
                        let error = difference(&x, &exact) / tolerance;
                        if each {
                            println!("{name} {seed}; {label}; {tolerance:e}; {error:.3}; {evaluations}");
                        }
                        runs.errors.push(error);
                        runs.evaluations.push(evaluations as f64);
                    }
                    Err(_) => runs.failed += 1,
                }
            }
        }
    }
    for (method, label) in methods.iter().enumerate().filter(|_| !each) {
        let cells =
            (0..TOLERANCES.len()).map(|column| runs.entry((method, column)).or_default().table_cell());
        println!("| {name} | {label} | {} |", cells.collect::<Vec<_>>().join(" | "));
    }
}
