//! The start of an adaptive integration: consistent `ẋ` and `z`, or an error that names what is
//! not.

#[path = "consistent/allocations.rs"]
mod allocations;
#[path = "consistent/calls.rs"]
mod calls;
#[path = "consistent/roots.rs"]
mod roots;
#[path = "consistent/singular.rs"]
mod singular;

use casados::prelude::*;
use nalgebra::{Vector1, vector};

/// `ẋ = −x`, and two algebraic states of which `z₁² = x − 2`: no solution for `x < 2`.
#[dae]
fn root(xdot: f64, x: f64, z: [f64; 2]) -> [f64; 3] {
    [xdot + x, z[0] - 3.0 * x, z[1] * z[1] - (x - 2.0)]
}

#[test]
fn solutions_near_start_values() {
    let mut radau = Adaptive::<Root, Radau>::new(AdaptiveOptions::default()).unwrap();
    for sign in [1.0, -1.0] {
        radau.set_start(&vector![0.0], &vector![0.0, sign]).unwrap();
        let z0 = radau.solve(&vector![6.0], &vector![], 0.5).unwrap().z0;
        assert!((z0 - vector![18.0, sign * 2.0]).norm() < 1e-13, "{z0}");
    }
}

/// A rate needs a value, and no derivative.
#[ode]
fn widening(x: f64) -> f64 {
    x.sqrt()
}

#[test]
fn rates_without_a_value() {
    let mut pair = Adaptive::<Widening, DormandPrince5>::new(AdaptiveOptions::default()).unwrap();
    // The other solution that begins at zero.
    assert_eq!(pair.solve(&vector![0.0], &vector![], 1.0).unwrap().x[0], 0.0);
    let error = pair.solve(&vector![-1.0], &vector![], 1.0).unwrap_err();
    assert!(matches!(error, Error::NonFiniteModel { equation: 0, value, .. } if value.is_nan()), "{error}");
    let mut radau = Adaptive::<Widening, Radau>::new(AdaptiveOptions::default()).unwrap();
    assert_eq!(radau.solve(&vector![-1.0], &vector![], 1.0).unwrap_err().to_string(), error.to_string());
}

#[test]
fn messages_about_missing_solutions() {
    let mut radau = Adaptive::<Root, Radau>::new(AdaptiveOptions::default()).unwrap();
    radau.set_time(0.25).unwrap();
    radau.set_start(&vector![0.0], &vector![0.0, 1.0]).unwrap();
    let error = radau.solve(&vector![1.0], &vector![], 0.5).unwrap_err();
    let Error::InconsistentStart { t, equation, residual, unknown, value, .. } = error else {
        panic!("{error}")
    };
    assert_eq!((t, equation, unknown), (0.25, 2, "z[1]"));
    // z² + 1 at the value that is named, which is never below one.
    assert!(residual >= 1.0 && (residual - (value * value + 1.0)).abs() <= 1e-12 * residual, "{error}");
    let text = error.to_string();
    assert!(
        text.starts_with("no consistent `xdot` and `z` were found at t = 0.25: ")
            && text.contains("`z[1]`")
            && text.contains("; residual of equation 2: "),
        "{text}"
    );
    // A start from which there is one.
    radau.set_start(&vector![0.0], &vector![0.0, 1.0]).unwrap();
    assert!(radau.solve(&vector![3.0], &vector![], 0.25).is_ok());
}

/// Index two: `z` occurs in no equation that could determine it when `p = 0`.
#[dae]
fn hidden(xdot: [f64; 2], x: [f64; 2], z: f64, p: f64) -> [f64; 3] {
    [xdot[0] - z, xdot[1] + x[1], p * z + x[0] - x[1]]
}

#[test]
fn messages_about_undetermined_states() {
    let mut radau = Adaptive::<Hidden, RadauIIA<5>>::new(AdaptiveOptions::default()).unwrap();
    radau.set_parameters(&Vector1::new(0.0)).unwrap();
    let error = radau.solve(&vector![1.5, 1.0], &vector![], 0.5).unwrap_err();
    // Nothing could be solved: at ẋ = 0 and z = 0 the residuals are 0, 1 and 0.5.
    let expected = Error::InconsistentStart {
        t: 0.0,
        equation: 1,
        residual: 1.0,
        unknown: "z",
        value: 0.0,
        singular: true,
    };
    assert_eq!(error, expected);
}
