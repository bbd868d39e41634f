//! Explicit methods over jumps, and on stiff models.
//!
//! The references are SciPy's `DOP853` with tolerances of 3e-14 from jump to jump, each located by
//! Newton's method, on the smooth equations between them.

use crate::models::ivp::vibrations::ExplicitBeam;
use casados::{Adaptive, AdaptiveOptions, DormandPrince5, DormandPrince8, Error, Radau, ode};
use core::f64::consts::PI;
use nalgebra::{SVector, vector};

const TOLERANCES: [f64; 7] = [1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10];
const ALLOWED: f64 = 30.0;

/// Dry friction.
#[ode]
fn friction(x: [f64; 2], t: f64) -> [f64; 2] {
    let sign = if x[1] >= 0.0 { 1.0 } else { -1.0 };
    [x[1], -x[0] - 0.3 * sign + 2.0 * (0.7 * t).cos()]
}

/// A stop that is a thousand times as stiff as the spring.
#[ode]
fn stop(x: [f64; 2], t: f64) -> [f64; 2] {
    [x[1], -x[0] - 0.1 * x[1] - 1000.0 * (x[0] - 1.0).max(0.0) + 1.5 * t.cos()]
}

/// A fast lag behind a slow signal, or no lag and the same signal.
#[ode]
fn lag(x: [f64; 2], p: f64, t: f64) -> [f64; 2] {
    [x[1], -x[0] - p * (x[1] - t.cos())]
}

/// The error at the ends stays below what is allowed at each tolerance.
macro_rules! follows {
    ($model:ty, $method:ty, $ends:expr) => {
        for tolerance in TOLERANCES {
            let options = AdaptiveOptions { rtol: tolerance, atol: tolerance, ..Default::default() };
            let mut adaptive = Adaptive::<$model, $method>::new(options).expect("valid");
            for (end, expected) in $ends {
                let x = adaptive.solve(&vector![0.0, 0.0], &SVector::zeros(), end).expect("a solution").x;
                for (x, expected) in x.iter().zip(expected) {
                    let error = (x - expected).abs() / (1.0 + expected.abs()) / tolerance;
                    assert!(error <= ALLOWED, "{error} tolerances of {tolerance:e} at {end}");
                }
            }
        }
    };
}

/// Where a force jumps between two stages the difference of the two methods may be an eightieth of
/// the error. After a refusal by much it counts eight times.
#[test]
fn error_estimates_across_jumps() {
    follows!(Friction, DormandPrince5, FRICTION);
    follows!(Friction, DormandPrince8, FRICTION);
    follows!(Stop, DormandPrince5, STOP);
    follows!(Stop, DormandPrince8, STOP);
}

/// Whether too many steps are said to be those of a stiff model.
macro_rules! stiff {
    ($method:ty, $rate:literal) => {{
        let options = AdaptiveOptions { max_steps: 1000, ..Default::default() };
        let mut adaptive = Adaptive::<Lag, $method>::new(options).expect("valid");
        adaptive.set_parameters(&vector![$rate]).expect("finite");
        match adaptive.solve(&vector![0.0, 1.0], &SVector::zeros(), 1e4) {
            Err(error @ Error::TooManySteps { stiff, rounding: None, .. }) => {
                assert_eq!(error.to_string().contains("Radau"), stiff);
                stiff
            }
            other => panic!("{other:?}"),
        }
    }};
}

#[test]
fn stiffness_detection() {
    assert!(stiff!(DormandPrince5, 1e4) && stiff!(DormandPrince8, 1e4));
    assert!(!stiff!(DormandPrince5, 0.0) && !stiff!(DormandPrince8, 0.0));
    assert!(!stiff!(Radau, 0.0));
}

/// The elastic beam of forty pieces to `t = π`, whose equations multiply rounding errors by `n⁴`.
/// SciPy's `DOP853` takes 6,894 steps (`benches/error_control/dop853.py`). Half as many more are
/// allowed; if rounding errors counted like errors of the method, there would be over 100,000.
#[test]
fn accumulation_of_rounding_errors() {
    let options = AdaptiveOptions { rtol: 1e-12, atol: 1e-12, keep_steps: false, ..Default::default() };
    let mut adaptive = Adaptive::<ExplicitBeam<80>, DormandPrince8>::new(options).expect("valid");
    adaptive.solve(&SVector::zeros(), &SVector::zeros(), PI).expect("a solution");
    let steps = adaptive.statistics().steps;
    assert!(steps <= 6894 + 6894 / 2, "{steps}");
}

/// A mass swings by one around a point that is 10⁹ away.
#[ode]
fn far_away(x: [f64; 2]) -> [f64; 2] {
    [x[1], 1e9 - x[0]]
}

/// The velocity has a rounding error of `h ε 10⁹ = 2e-7 h` in each step, above a tolerance of 1e-12
/// in steps of 5e-6. The error says by which factor tolerances have to be larger, and with these
/// the steps suffice.
macro_rules! below_rounding {
    ($method:ty) => {{
        let solve = |tolerance| {
            let options =
                AdaptiveOptions { rtol: tolerance, atol: tolerance, max_steps: 20_000, ..Default::default() };
            let mut adaptive = Adaptive::<FarAway, $method>::new(options)?;
            adaptive.solve(&vector![1e9 + 1.0, 0.0], &SVector::zeros(), 300.0)?;
            Ok(())
        };
        match solve(1e-12) {
            Err(error @ Error::TooManySteps { stiff: false, rounding: Some(factor), .. }) => {
                assert!(error.to_string().contains("rounding"));
                solve(factor * 1e-12).unwrap_or_else(|error| panic!("{factor}: {error}"));
            }
            other => panic!("{other:?}"),
        }
    }};
}

#[test]
fn tolerances_below_rounding() {
    below_rounding!(DormandPrince5);
    below_rounding!(DormandPrince8);
}

const FRICTION: [(f64, [f64; 2]); 3] = [
    (11.06, [1.3818565022058193, -4.894546338144082]),
    (16.74, [3.5062619034265534, 0.8893476247483977]),
    (20.0, [0.35099546908603196, -1.265726162977955]),
];

const STOP: [(f64, [f64; 2]); 3] = [
    (11.06, [-0.1179402304157693, 0.20110867081267003]),
    (16.74, [-2.070039037397163, -0.5303260283721611]),
    (20.0, [-1.3626362254970126, -1.2218599608539351]),
];
