//! Explicit pairs on smooth problems: steps beside those of SciPy's DOP853 (`dop853.py`), and
//! errors.
//!
//! ```text
//! cargo run --release --manifest-path benches/Cargo.toml -p error_control --bin smooth -- [part of a name]
//! ```
//!
//! References are the values of `tests/data/ivp` and closed forms; Arenstorf's orbit is periodic.

#[path = "../../../../examples/models/ivp/mod.rs"]
mod models;

use casados::{Adaptive, AdaptiveOptions, DormandPrince5, DormandPrince8, ode};
use core::f64::consts::TAU;
use models::mechanics::Pleiades;
use models::vibrations::{ExplicitBeam, Kepler, Rope, SpringPendulum};
use nalgebra::SVector;
use reference_data::Record;

/// Predators and prey, whose cycles nothing damps.
#[ode]
fn populations(x: [f64; 2]) -> [f64; 2] {
    [x[0] * (1.0 - x[1]), x[1] * (x[0] - 1.0)]
}

/// `x = (cos t, −sin t)`
#[ode]
fn oscillator(x: [f64; 2]) -> [f64; 2] {
    [x[1], -x[0]]
}

/// Arenstorf's orbit between earth and moon (E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary
/// Differential Equations I, section II.0).
#[ode]
fn arenstorf(x: [f64; 4]) -> [f64; 4] {
    let mu = 0.012277471;
    let (earth, moon) = (x[0] + mu, x[0] - (1.0 - mu));
    let (d1, d2) = (earth * earth + x[1] * x[1], moon * moon + x[1] * x[1]);
    let (d1, d2) = (d1 * d1.sqrt(), d2 * d2.sqrt());
    let along = x[0] + 2.0 * x[3] - (1.0 - mu) * earth / d1 - mu * moon / d2;
    let across = x[1] - 2.0 * x[2] - (1.0 - mu) * x[1] / d1 - mu * x[1] / d2;
    [x[2], x[3], along, across]
}

macro_rules! show {
    ($part:expr, $name:literal, $model:ty, $np:literal, $x0:expr, $p:expr, $t:expr, $y:expr, $steps:expr) => {
        if $name.contains($part) {
            let (x0, t, y): (Vec<f64>, f64, Vec<f64>) = ($x0, $t, $y);
            for (tolerance, reference) in [1e-6, 1e-8, 1e-10, 1e-12].into_iter().zip($steps) {
                macro_rules! of {
                    ($method:ty) => {{
                        let options =
                            AdaptiveOptions { rtol: tolerance, atol: tolerance, ..Default::default() };
                        let mut adaptive = Adaptive::<$model, $method>::new(options).expect("valid");
                        if $np > 0 {
                            let p: Vec<f64> = $p;
                            let p = SVector::<f64, $np>::from_column_slice(&p);
                            adaptive.set_parameters(&p).expect("finite");
                        }
                        let x0 = SVector::from_column_slice(&x0[..]);
                        let error = match adaptive.solve(&x0, &SVector::zeros(), t) {
                            Ok(nominal) => {
                                let pairs = nominal.x.iter().zip(&y);
                                let errors = pairs.map(|(x, y)| (x - y).abs() / (1.0 + y.abs()));
                                format!("{:.2}", errors.fold(0.0, f64::max) / tolerance)
                            }
                            Err(error) => error.to_string(),
                        };
                        (error, *adaptive.statistics())
                    }};
                }
                let (error, work) = of!(DormandPrince8);
                let ratio = work.steps as f64 / f64::from(reference);
                print!(
                    "| {} | {tolerance:e} | {reference} | {} | {} | {ratio:.2} | {} | {error} |",
                    $name, work.steps, work.rejected, work.residuals
                );
                let (error, work) = of!(DormandPrince5);
                println!(" {} | {} | {} | {error} |", work.steps, work.rejected, work.residuals);
            }
        }
    };
}

fn main() {
    let part = std::env::args().nth(1).unwrap_or_default();
    let part = part.as_str();
    println!(
        "| problem | tolerance | DOP853 | Dormand-Prince 8: steps | rejected | ratio | evaluations | error | Dormand-Prince 5: steps | rejected | evaluations | error |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let algebraic =
        Record::load("ivp/algebraic.json").and_then(|set| set.record("beam_40")).expect("a problem");
    let list = |record: &Record, name| record.list(name).expect("numbers");
    let set = Record::load("ivp/vibrations.json").expect("the reference is there");
    let ends = Record::load("ivp/ends.json").expect("the reference is there");
    let x0 = |name: &str| set.record(name).and_then(|record| record.list("x0")).expect("states");
    let end = |set: &Record, name: &str| -> (f64, Vec<f64>) {
        let first = &set.record(name).and_then(|record| record.records("ends")).expect("ends")[0];
        (first.number("t").expect("a time"), first.list("y").expect("values"))
    };
    let of = |name: &str| end(&set, name);
    show!(
        part,
        "beam, n = 40",
        ExplicitBeam<80>,
        0,
        list(&algebraic, "x0"),
        vec![],
        algebraic.number("t").expect("a time"),
        list(&algebraic, "y"),
        STEPS[0]
    );
    show!(
        part,
        "beam, n = 10",
        ExplicitBeam<20>,
        0,
        x0("beam_10"),
        vec![],
        of("beam_10").0,
        of("beam_10").1,
        STEPS[1]
    );
    show!(part, "Kepler", Kepler, 0, x0("kepler"), vec![], of("kepler").0, of("kepler").1, STEPS[2]);
    show!(
        part,
        "populations",
        Populations,
        0,
        x0("populations"),
        vec![],
        of("populations").0,
        of("populations").1,
        STEPS[3]
    );
    show!(
        part,
        "spring pendulum",
        SpringPendulum,
        1,
        x0("spring_pendulum"),
        vec![1e5],
        of("spring_pendulum").0,
        of("spring_pendulum").1,
        STEPS[4]
    );
    show!(part, "rope", Rope, 1, x0("rope"), vec![1e5], of("rope").0, of("rope").1, STEPS[5]);
    show!(part, "oscillator", Oscillator, 0, vec![1.0, 0.0], vec![], 100.0 * TAU, vec![1.0, 0.0], STEPS[6]);
    let orbit = vec![0.994, 0.0, 0.0, -2.001_585_106_379_082_5];
    show!(part, "Arenstorf", Arenstorf, 0, orbit.clone(), vec![], 17.065_216_560_157_963, orbit, STEPS[7]);
    let stars = ends.record("pleiades").and_then(|record| record.list("x0")).expect("states");
    show!(
        part,
        "Pleiades",
        Pleiades,
        0,
        stars,
        vec![],
        end(&ends, "pleiades").0,
        end(&ends, "pleiades").1,
        STEPS[8]
    );
}

/// Accepted steps of DOP853, of SciPy 1.17, at each tolerance.
const STEPS: [[u32; 4]; 9] = [
    [6541, 6175, 6198, 10873],
    [353, 489, 916, 1563],
    [50, 80, 134, 226],
    [72, 121, 208, 358],
    [436, 792, 1544, 2849],
    [404, 674, 1199, 2184],
    [563, 994, 1764, 3136],
    [66, 106, 176, 298],
    [81, 133, 226, 387],
];
