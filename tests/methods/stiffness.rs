//! Stiffness up to 1e12, and small numbers beside large ones.

use super::pollution::{self, Pollution};
use crate::models::chemistry::{E5Conserved, Hires, Oregonator, Robertson};
use crate::models::oscillators::VanDerPolScaled;
use casados::__private::Matrix;
use casados::model::{VectorP, VectorX};
use casados::{Adaptive, AdaptiveOptions, Dae, Error, Gauss, Irk, Options, Radau, RadauIIA, Shape, ode};
use nalgebra::{SVector, vector};
use reference_data::Record;

/// `sin t`, whatever the stiffness.
#[ode]
fn prothero_robinson(x: f64, p: f64, t: f64) -> f64 {
    p * (x - t.sin()) + t.cos()
}

/// `e^{−2t}, e^{−t}`, whatever the stiffness. p = [1/ε].
#[ode]
fn kaps(x: [f64; 2], p: f64) -> [f64; 2] {
    let [y1, y2] = x;
    [-(p + 2.0) * y1 + p * y2 * y2, y1 - y2 - y2 * y2]
}

#[ode]
fn dahlquist(x: f64, p: f64) -> f64 {
    p * x
}

/// Stiff problems reduce the order to that of the stages, and no further; and the stiffer, the
/// better is Radau IIA. Gauss methods, which do not damp, come to a limit.
#[test]
fn t05_order_reduction() {
    /// Steps of 1/2 to 1/32, all of them long beside `1/λ`.
    const STEPS: [usize; 5] = [2, 4, 8, 16, 32];
    /// Rounding of the slope `λ (x − sin t)`, divided by `λ`, and of 32 sums.
    const FLOOR: f64 = 32.0 * f64::EPSILON;
    macro_rules! errors {
        ($method:ty, $lambda:expr) => {
            STEPS.map(|steps| {
                let mut irk = Irk::<ProtheroRobinson, $method>::new(Options { steps, ..Default::default() })
                    .expect("valid");
                irk.set_parameters(&vector![$lambda]).expect("finite");
                let x = irk.solve(&vector![0.0], &SVector::zeros(), 1.0).expect("a solution").x[0];
                (x - 1.0f64.sin()).abs()
            })
        };
    }
    let slopes = |errors: &[f64; 5], s: f64, name: &str| {
        // From the longest steps to the shortest that are not at rounding.
        let above = errors.iter().take_while(|error| **error > 100.0 * FLOOR).count();
        if above > 1 {
            let slope = (errors[0] / errors[above - 1]).log2() / (above - 1) as f64;
            assert!(slope >= s - 0.2, "{name}, s = {s}: {slope} of {errors:?}");
        }
    };
    macro_rules! check {
        ($($s:literal)*) => {$(
            let radau = [-1e4, -1e8, -1e12].map(|lambda| errors!(RadauIIA<$s>, lambda));
            let gauss = [-1e4, -1e8, -1e12].map(|lambda| errors!(Gauss<$s>, lambda));
            radau.iter().for_each(|errors| slopes(errors, $s as f64, "Radau IIA"));
            gauss.iter().for_each(|errors| slopes(errors, $s as f64, "Gauss"));
            for step in 0..STEPS.len() {
                assert!(radau[1][step] <= radau[0][step] + FLOOR && radau[2][step] <= radau[1][step] + FLOOR);
                // R(z) is 1 − O(1/z) in size: what is left of that after 32 steps with z = 3e6.
                assert!(gauss[2][step] <= 1.001 * gauss[1][step] + FLOOR, "s = {}: {gauss:?}", $s);
            }
        )*};
    }
    check!(1 2 3 4 5);
}

/// `max |found − expected| / |expected|`
fn relative(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    found
        .iter()
        .zip(expected)
        .map(|(found, expected)| (found - expected).abs() / expected.abs())
        .fold(0.0, f64::max)
}

fn end_values(name: &str) -> (Vec<f64>, Vec<f64>, Vec<Record>) {
    let set = Record::load("ivp/ends.json").expect("the reference is there");
    let problem = set.record(name).expect("a problem");
    (
        problem.list("x0").expect("x0"),
        problem.list("p").unwrap_or_default(),
        problem.records("ends").expect("end values"),
    )
}

/// The relative errors of the worst component at the end times of a problem, of all or of the first
/// states; and how many iterations a step took at most.
fn errors<M: Dae>(
    name: &str,
    nx: usize,
    [rtol, atol]: [f64; 2],
    values: impl Fn(&[f64], &[f64]) -> Vec<f64>,
) -> Result<Vec<f64>, Error>
where
    VectorX<M, f64>: slices::Filled,
    VectorP<M, f64>: slices::Filled,
    M::Shape: Shape<VectorU<f64> = SVector<f64, 0>>,
{
    use slices::Filled;
    let (x0, p, ends) = end_values(name);
    let mut adaptive = Adaptive::<M, Radau>::new(AdaptiveOptions { rtol, atol, ..Default::default() })?;
    if M::Shape::NP > 0 {
        adaptive.set_parameters(&Filled::from_slice(&p))?;
    }
    let x0 = Filled::from_slice(&x0[..nx]);
    ends.iter()
        .map(|end| {
            let t = end.number("t").expect("a time");
            let result = *adaptive.solve(&x0, &SVector::zeros(), t)?;
            let work = *adaptive.statistics();
            let tried = work.steps + work.rejected + work.failed;
            assert!(work.iterations <= 10 * tried, "{work:?}");
            let found = values(result.x.as_slice(), result.z.as_slice());
            Ok(relative(&found, &end.list("y").expect("end values")))
        })
        .collect()
}

/// Vectors from slices, of any length.
mod slices {
    use nalgebra::SVector;
    pub trait Filled {
        fn from_slice(values: &[f64]) -> Self;
    }
    impl<const N: usize> Filled for SVector<f64, N> {
        fn from_slice(values: &[f64]) -> Self {
            Self::from_column_slice(values)
        }
    }
}

fn states(x: &[f64], _: &[f64]) -> Vec<f64> {
    x.to_vec()
}

#[test]
fn t06_stiffness_of_1e12() {
    let name = "van_der_pol_scaled_1e-12";
    let found = errors::<VanDerPolScaled>(name, 2, [3e-13, 3e-13], states).expect("a solution");
    println!("Van der Pol {found:?}");
    assert!(found.iter().all(|error| *error <= 1e-10), "{found:?}");
    // In equal steps.
    let mut irk = Irk::<Kaps, RadauIIA<5>>::new(Options { steps: 16, ..Default::default() }).expect("valid");
    irk.set_parameters(&vector![1e12]).expect("finite");
    let x = irk.solve(&vector![1.0, 1.0], &SVector::zeros(), 1.0).expect("a solution").x;
    assert!(relative(x.as_slice(), &[f64::exp(-2.0), f64::exp(-1.0)]) <= 1e-10, "{x}");
    assert!(irk.statistics().iterations <= 10 * 16, "{:?}", irk.statistics());
    macro_rules! check {
        ($($s:literal)*) => {$(
            let mut irk = Irk::<Dahlquist, RadauIIA<$s>>::new(Options::default()).expect("valid");
            irk.set_parameters(&vector![-1e12]).expect("finite");
            let x = irk.solve(&vector![1.0], &SVector::zeros(), 1.0).expect("a solution").x[0];
            // e^{−1e12} is zero, R(−1e12) is s(s + …)/1e12 at most.
            assert!(x.abs() <= if $s == 1 { 1.1e-12 } else { 1e-11 } * $s as f64, "s = {}: {x:e}", $s);
            assert!(irk.statistics().iterations <= 10, "{:?}", irk.statistics());
        )*};
    }
    check!(1 2 3 4 5 6 7 8 9);
}

/// Every component is right relative to its own size: concentrations from 1 to 1e-14 (Robertson),
/// to 1e-18 (pollution of the air), to 1e-65 (E5). Absolute tolerances are below all of them.
#[test]
fn t12_relative_accuracy_over_decades() {
    for rtol in [1e-6, 1e-9] {
        let found = errors::<Robertson>("robertson", 3, [rtol, 1e-8 * rtol], states).expect("a solution");
        println!("Robertson, {rtol:e}: {found:?}");
        assert!(found.iter().all(|error| *error <= 100.0 * rtol), "{rtol:e}: {found:?}");
        let values = |x: &[f64], z: &[f64]| vec![x[0], x[1], z[0], x[2]];
        let found = errors::<E5Conserved>("e5", 3, [rtol, 1e-80 * rtol], values).expect("a solution");
        println!("E5, {rtol:e}: {found:?}");
        assert!(found.iter().all(|error| *error <= 100.0 * rtol), "{rtol:e}: {found:?}");
        let options = AdaptiveOptions { rtol, atol: 1e-20 * rtol, ..Default::default() };
        let mut adaptive = Adaptive::<Pollution, Radau>::new(options).expect("valid");
        let x = adaptive.solve(&pollution::START.into(), &SVector::zeros(), 60.0).expect("a solution").x;
        let error = relative(x.as_slice(), &pollution::END_VALUES);
        println!("pollution, {rtol:e}: {error:e}");
        assert!(error <= 100.0 * rtol, "{rtol:e}: {error:e}");
    }
}

/// The constants of a problem are rounded to `f64`, which changes its solution: by 2.8e-15 of the
/// Oregonator, 1.9e-15 of HIRES. That, and the rounding errors of some hundred steps, is what is
/// left at the tightest tolerance.
#[test]
fn t39_rounding_of_constants() {
    let tight = 1e-14;
    let robertson = errors::<Robertson>("robertson", 3, [tight, 1e-8 * tight], states).expect("a solution");
    let oregonator =
        errors::<Oregonator>("oregonator", 3, [tight, 1e-2 * tight], states).expect("a solution");
    let hires = errors::<Hires>("hires", 8, [tight, 1e-3 * tight], states).expect("a solution");
    println!("Robertson {robertson:?}, Oregonator {oregonator:?}, HIRES {hires:?}");
    assert!(robertson.iter().all(|error| *error <= 100.0 * tight), "{robertson:?}");
    assert!(oregonator.iter().all(|error| *error <= 100.0 * tight), "{oregonator:?}");
    // Its first end lies in a fall, where all errors are 25 times as large.
    assert!(hires[0] <= 25.0 * 100.0 * tight && hires[1] <= 100.0 * tight, "{hires:?}");
}
