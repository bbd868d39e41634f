//! Errors of oscillations and of stiff components follow the tolerance: there the order is reduced,
//! and no less may be asked of the estimate than of the solution.
//!
//! Errors are relative to `atol + rtol |x|`, of the worst component. No more than thirty of them
//! are allowed: the errors of hundreds of steps, which stay where nothing is damped, each a part of
//! its tolerance.

use super::tolerances::tell;
use crate::models::ivp::vibrations::{Beam, Modes, Rope, SpringPendulum, Turning};
use casados::{Adaptive, AdaptiveOptions, Radau};
use nalgebra::SVector;
use reference_data::Record;

const TOLERANCES: [f64; 4] = [1e-4, 1e-6, 1e-8, 1e-10];
const ALLOWED_ERRORS: f64 = 30.0;

fn options(tolerance: f64) -> AdaptiveOptions {
    AdaptiveOptions { rtol: tolerance, atol: tolerance, ..Default::default() }
}

/// The largest error in tolerances.
fn in_tolerances(found: &[f64], expected: &[f64], tolerance: f64) -> f64 {
    assert_eq!(found.len(), expected.len());
    let relative = |(found, expected): (&f64, &f64)| (found - expected).abs() / (1.0 + expected.abs());
    found.iter().zip(expected).map(relative).fold(0.0, f64::max) / tolerance
}

/// `(sin t, cos t)`, whatever the eigenvalues: at the end of each step, of which the last alone is
/// shortened.
#[test]
fn errors_of_stiff_components() {
    let eigenvalues =
        [[-30.0, 0.0], [-1e3, 0.0], [-1e5, 0.0], [-100.0, 100.0], [-10.0, 100.0], [0.0, 30.0], [0.0, 1e3]];
    for p in eigenvalues {
        for tolerance in TOLERANCES {
            let mut adaptive = Adaptive::<Turning, Radau>::new(options(tolerance)).expect("valid");
            adaptive.set_parameters(&SVector::from(p)).expect("finite");
            adaptive.solve(&SVector::from([0.0, 1.0]), &SVector::zeros(), 20.0).expect("a solution");
            let times: Vec<f64> = adaptive.times().collect();
            for t in times {
                let x = adaptive.dense(t).expect("inside").x;
                let error = in_tolerances(x.as_slice(), &[t.sin(), t.cos()], tolerance);
                assert!(error <= ALLOWED_ERRORS, "{p:?} at t = {t}: {error} tolerances of {tolerance:e}");
            }
        }
    }
}

/// The states at the ends of the reference, in tolerances.
macro_rules! follows {
    ($name:literal, $model:ty, $method:ty, $allowed:expr) => {
        let set = Record::load("ivp/vibrations.json").expect("the reference is there");
        let record = set.record($name).expect("a problem");
        let (x0, p) = (record.list("x0").expect("states"), record.list("p").expect("parameters"));
        for tolerance in TOLERANCES {
            let mut adaptive = Adaptive::<$model, $method>::new(options(tolerance)).expect("valid");
            adaptive.set_parameters(&SVector::from_column_slice(&p)).expect("finite");
            for end in record.records("ends").expect("ends") {
                let t = end.number("t").expect("a time");
                let x0 = SVector::from_column_slice(&x0);
                let x = adaptive.solve(&x0, &SVector::zeros(), t).expect("a solution").x;
                let expected = end.list("y").expect("values");
                let error = in_tolerances(x.as_slice(), &expected, tolerance);
                let name = concat!($name, " | ", stringify!($method));
                tell(&format!("{name} | {t}"), tolerance, error, adaptive.statistics());
                assert!(error <= $allowed, "t = {t}: {error} tolerances of {tolerance:e}");
            }
        }
    };
}

#[test]
fn beam() {
    follows!("beam_10", Beam<20, 10, 30>, Radau, ALLOWED_ERRORS);
}

#[test]
fn mixed_modes() {
    follows!("modes_damped", Modes, Radau, ALLOWED_ERRORS);
}

#[test]
fn rope() {
    follows!("rope", Rope, Radau, ALLOWED_ERRORS);
}

#[test]
fn spring_pendulum() {
    follows!("spring_pendulum", SpringPendulum, Radau, ALLOWED_ERRORS);
}
