//! Mechanisms of the error control switched off, one after the other or together, on all sets:
//! errors over thirty tolerances, steps, evaluations.
//!
//! ```text
//! git apply benches/error_control/switches.patch        # on revision eef4232d
//! cargo run --release --manifest-path benches/Cargo.toml -p error_control --features switches \
//!     --bin error_control -- [--problems 20] [number of a mechanism, or several joined by + ..]
//! ```
//!
//! The patch numbers the mechanisms. Without it and its feature the program measures what is there.
//! Random families, the initial value problems, quadratic problems of the stiff DETEST set, kinks
//! and jumps. References are known, or a method of order 18 finds them, in steps that end where
//! forces do.

mod cases;
mod models;
#[path = "../../../tests/ivp/algebraic/plants.rs"]
#[allow(dead_code)]
mod plants;
#[path = "../../src/bin/random_problems/problems.rs"]
#[allow(dead_code)] // Families are chosen by name here.
mod problems;
#[path = "../../src/bin/random_problems/models.rs"]
#[allow(dead_code)]
mod random;
#[path = "../../../examples/models/ivp/mod.rs"]
mod set;

use casados::{Adaptive, AdaptiveOptions, DormandPrince5, DormandPrince8, Error, Gauss, Irk, Options, Radau};
use cases::Case;
use cpu_time::ProcessTime;
use models::{Central, Contact, Converter, Cubic, Forced, Quadratic, Rubbed, Switched};
use nalgebra::SVector;
use plants::Tanks;
use random::{Linear, Rods, Springs};
use set::chemistry::AkzoNobel;
use set::circuits::TransistorAmplifier;
use set::vibrations::Beam;

const TOLERANCES: [f64; 4] = [1e-4, 1e-6, 1e-8, 1e-10];
/// A reference counts where steps a half and a third as long differ by no more than this.
const TRUSTED: f64 = 1e-12;
/// Errors above so many tolerances are misses.
const ALLOWED: f64 = 30.0;

/// What a run made of a problem.
#[derive(Clone, Copy)]
struct Made {
    error: f64,
    steps: f64,
    evaluations: f64,
    matrices: f64,
}

/// What a family of problems is solved by.
struct Family {
    implicit: bool,
    methods: &'static [&'static str],
    reference: fn(&Case, usize) -> Result<Vec<f64>, Error>,
    run: fn(&Case, &str, f64, &[f64]) -> Result<Made, Error>,
}

macro_rules! family {
    ($model:ty, $nx:literal, $np:literal; $($label:literal $method:ty),*) => {{
        fn start(case: &Case) -> (SVector<f64, $nx>, SVector<f64, $np>) {
            (SVector::from_column_slice(&case.x0), SVector::from_column_slice(&case.p))
        }

        /// In steps of an adaptive run, each taken in `pieces`.
        fn reference(case: &Case, pieces: usize) -> Result<Vec<f64>, Error> {
            if let Some(expected) = &case.expected {
                return Ok(expected.clone());
            }
            reference_by!($model, $nx, $np, case, pieces)
        }

        fn run(case: &Case, method: &str, tolerance: f64, exact: &[f64]) -> Result<Made, Error> {
            let (x0, p) = start(case);
            $(if method == $label {
                let mut adaptive = Adaptive::<$model, $method>::new(options(case, tolerance))?;
                if $np > 0 {
                    adaptive.set_parameters(&p)?;
                }
                let x = adaptive.solve(&x0, &SVector::zeros(), case.t)?.x.as_slice().to_vec();
                let statistics = adaptive.statistics();
                return Ok(Made {
                    error: difference(&x, exact, case.atol) / tolerance,
                    steps: (statistics.steps + statistics.rejected + statistics.failed) as f64,
                    evaluations: statistics.residuals as f64,
                    matrices: (statistics.jacobians + statistics.factorizations) as f64,
                });
            })*
            Err(Error::NoResult)
        }
        const METHODS: &[&str] = &[$($label),*];
        Family { methods: METHODS, reference, run, implicit: !METHODS.contains(&"Dormand-Prince 8") || METHODS.len() > 2 }
    }};
}
macro_rules! reference_by {
    ($model:ty, $nx:literal, $np:literal, $case:ident, $pieces:ident) => {{
        let (mut x, p) = (
            SVector::<f64, $nx>::from_column_slice(&$case.x0),
            SVector::<f64, $np>::from_column_slice(&$case.p),
        );
        let mut adaptive = Adaptive::<$model, Radau>::new(options($case, 1e-10))?;
        let mut irk = Irk::<$model, Gauss<9>>::new(Options { steps: $pieces, ..Default::default() })?;
        if $np > 0 {
            adaptive.set_parameters(&p)?;
            irk.set_parameters(&p)?;
        }
        adaptive.solve(&x, &SVector::zeros(), $case.t)?;
        let mut times: Vec<f64> = adaptive.times().chain($case.breaks.iter().copied()).collect();
        times.sort_by(f64::total_cmp);
        times.dedup_by(|next, last| *next - *last < 1e-13 * *next);
        for ends in times.windows(2) {
            irk.set_time(ends[0])?;
            x = irk.solve(&x, &SVector::zeros(), ends[1] - ends[0])?.x;
        }
        Ok(x.as_slice().to_vec())
    }};
}
macro_rules! ode {
    ($model:ty, $nx:literal, $np:literal) => {
        family!(
            $model, $nx, $np;
            "Radau" Radau, "Gauss, s = 4" Gauss<4>,
            "Dormand-Prince 8" DormandPrince8, "Dormand-Prince 5" DormandPrince5
        )
    };
}
macro_rules! dae {
    ($model:ty, $nx:literal, $np:literal) => {
        family!($model, $nx, $np; "Radau" Radau, "Gauss, s = 4" Gauss<4>)
    };
}

/// All sets: name, group, how many cases of so many problems, and one of them.
type Set = (&'static str, &'static str, u64, fn(u64) -> Case, Family);

fn sets(problems: u64) -> Vec<Set> {
    macro_rules! random {
        ($name:literal, $family:expr) => {
            ($name, "random", problems, |seed| cases::random($name, seed), $family)
        };
    }
    macro_rules! of_set {
        ($name:literal, $file:literal, $record:literal, $nx:literal, $atol:literal, $family:expr) => {
            ($name, "ivp", 1, |_| cases::of_set($file, $record, $nx, $atol), $family)
        };
    }
    vec![
        random!("springs", ode!(Springs, 20, 22)),
        random!("modes", ode!(Springs, 20, 22)),
        random!("linear", ode!(Linear, 6, 42)),
        random!("imaginary", ode!(Linear, 6, 42)),
        random!("orbit", ode!(Central, 4, 3)),
        random!("rods", dae!(Rods, 8, 2)),
        random!("kinetics", ode!(Quadratic, 5, 105)),
        random!("relaxation", ode!(Cubic, 2, 6)),
        random!("forced", ode!(Cubic, 2, 6)),
        random!("prey", ode!(Quadratic, 5, 105)),
        random!("body", ode!(Quadratic, 5, 105)),
        random!("spring pendulum", ode!(Central, 4, 3)),
        random!("pushed", ode!(Forced, 2, 11)),
        random!("kinked", ode!(Forced, 2, 11)),
        random!("contact", ode!(Contact, 2, 4)),
        ("quadratic", "detest", 17, cases::quadratic, ode!(Quadratic, 5, 105)),
        of_set!("akzo", "ivp/ends.json", "akzo_nobel", 5, 1e-3, dae!(AkzoNobel, 5, 9)),
        of_set!(
            "amplifier",
            "ivp/ends.json",
            "transistor_amplifier",
            8,
            1e-2,
            dae!(TransistorAmplifier, 8, 0)
        ),
        of_set!("beam", "ivp/vibrations.json", "beam_10", 20, 1.0, dae!(Beam<20, 10, 30>, 20, 0)),
        of_set!("tanks", "ivp/algebraic.json", "tanks", 12, 1.0, dae!(Tanks, 12, 0)),
        ("two springs", "kinks", 20, cases::two_springs, ode!(Contact, 2, 4)),
        ("friction", "kinks", 20, cases::rubbed, ode!(Rubbed, 2, 1)),
        ("switched", "kinks", 20, cases::switched, dae!(Switched, 1, 0)),
        ("converter", "kinks", 20, cases::converter, ode!(Converter, 2, 2)),
        ("spline", "kinks", 20, cases::splined, ode!(Forced, 2, 11)),
    ]
}

fn options(case: &Case, tolerance: f64) -> AdaptiveOptions {
    AdaptiveOptions {
        rtol: tolerance,
        atol: case.atol * tolerance,
        max_steps: 20_000,
        keep_steps: true,
        ..Default::default()
    }
}

/// The largest difference, relative to `atol/rtol` and the size of a component.
fn difference(a: &[f64], b: &[f64], atol: f64) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs() / (atol + b.abs())).fold(0.0, f64::max)
}

/// Switches these mechanisms off.
fn switch_off(mechanisms: u64) {
    #[cfg(feature = "switches")]
    casados::ablation::switch_off(mechanisms);
    #[cfg(not(feature = "switches"))]
    assert_eq!(mechanisms, 0, "switches are a patch of the library");
}

/// All runs of a family, in order.
fn runs(
    family: &Family,
    cases: &[(Case, Vec<f64>)],
    explicit: Option<bool>,
) -> Vec<(&'static str, f64, Option<Made>)> {
    let mut all = Vec::new();
    for (case, exact) in cases {
        for method in family.methods {
            if explicit.is_some_and(|explicit| explicit != method.starts_with("Dormand")) {
                continue;
            }
            for tolerance in TOLERANCES {
                all.push((*method, tolerance, (family.run)(case, method, tolerance, exact).ok()));
            }
        }
    }
    all
}

/// Misses, failures, the worst error.
fn verdict(runs: &[&(&'static str, f64, Option<Made>)]) -> (usize, usize, f64) {
    let made = || runs.iter().filter_map(|run| run.2);
    let misses = made().filter(|made| made.error > ALLOWED).count();
    let failed = runs.iter().filter(|run| run.2.is_none()).count();
    (misses, failed, made().map(|made| made.error).fold(0.0, f64::max))
}

fn main() {
    let (mut problems, mut mechanisms) = (20, Vec::new());
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--problems" => {
                problems = arguments.next().and_then(|count| count.parse().ok()).unwrap_or(problems)
            }
            list => mechanisms
                .push(list.split('+').map(|m| m.parse::<u32>().expect("a number")).collect::<Vec<_>>()),
        }
    }
    let start = ProcessTime::now();
    let sets = sets(problems);
    let mut solved = Vec::new();
    for (name, _, count, case, family) in &sets {
        let mut cases = Vec::new();
        for number in 0..*count {
            let case = case(number);
            let (Ok(other), Ok(exact)) = ((family.reference)(&case, 2), (family.reference)(&case, 3)) else {
                continue;
            };
            let unlike = difference(&other, &exact, case.atol);
            if unlike.is_nan() || unlike > TRUSTED {
                continue;
            }
            cases.push((case, exact));
        }
        eprintln!("{name}: {} of {count}", cases.len());
        solved.push(cases);
    }
    println!("references: {:.1} s", start.elapsed().as_secs_f64());
    let mut base = Vec::new();
    for ((name, group, _, _, family), cases) in sets.iter().zip(&solved) {
        let start = ProcessTime::now();
        let all = runs(family, cases, None);
        let time = start.elapsed().as_secs_f64();
        for method in family.methods {
            let of: Vec<_> = all.iter().filter(|run| run.0 == *method).collect();
            let (misses, failed, worst) = verdict(&of);
            let sum = |f: fn(&Made) -> f64| of.iter().filter_map(|run| run.2.as_ref().map(f)).sum::<f64>();
            println!(
                "base; {group}; {name}; {method}; {}; {misses}; {failed}; {worst:.3}; {}; {}; {}; {time:.3}",
                of.len(),
                sum(|m| m.steps),
                sum(|m| m.evaluations),
                sum(|m| m.matrices)
            );
        }
        base.push(all);
    }
    for list in mechanisms {
        let start = ProcessTime::now();
        switch_off(list.iter().map(|m| 1u64 << m).sum());
        let explicit = list[0] >= 32;
        for (((name, group, _, _, family), cases), before) in sets.iter().zip(&solved).zip(&base) {
            if !explicit && !family.implicit {
                continue;
            }
            let after = runs(family, cases, Some(explicit));
            let before: Vec<_> =
                before.iter().filter(|run| run.0.starts_with("Dormand") == explicit).collect();
            for method in family.methods {
                let (old, new): (Vec<_>, Vec<_>) = (
                    before.iter().copied().filter(|run| run.0 == *method).collect(),
                    after.iter().filter(|run| run.0 == *method).collect(),
                );
                if new.is_empty() {
                    continue;
                }
                let (old_verdict, new_verdict) = (verdict(&old), verdict(&new));
                let pairs: Vec<_> =
                    old.iter().zip(&new).filter_map(|(old, new)| Some((old.2?, new.2?))).collect();
                let ratio = |f: fn(&Made) -> f64| {
                    (pairs.iter().map(|(old, new)| ((f(new) + 1.0) / (f(old) + 1.0)).ln()).sum::<f64>()
                        / pairs.len().max(1) as f64)
                        .exp()
                };
                println!(
                    "{list:?}; {group}; {name}; {method}; {}; {}; {}; {}; {}; {:.3}; {:.3}; {:.4}; {:.4}; {:.4}",
                    new.len(),
                    old_verdict.0,
                    new_verdict.0,
                    old_verdict.1,
                    new_verdict.1,
                    old_verdict.2,
                    new_verdict.2,
                    ratio(|m| m.steps),
                    ratio(|m| m.evaluations),
                    ratio(|m| m.matrices)
                );
            }
        }
        println!("time {list:?}: {:.2}", start.elapsed().as_secs_f64());
    }
}
