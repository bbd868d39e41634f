//! Start values that are wrong, and what is the same whatever they are.

use crate::models::chemistry::AkzoNobel;
use casados::options::Start;
use casados::{Adaptive, AdaptiveOptions, Error, Gauss, Irk, Options, Radau, RadauIIA, dae};
use nalgebra::{SVector, vector};

/// The problem of Kaps without stiffness left: `0 = −y1 + y2²` where ε = p is zero.
#[dae]
fn kaps(xdot: [f64; 2], x: [f64; 2], p: f64) -> [f64; 2] {
    let [y1, y2] = x;
    [p * xdot[0] + (1.0 + 2.0 * p) * y1 - y2 * y2, xdot[1] - (y1 - y2 - y2 * y2)]
}

/// Two branches: `z = ±√x`.
#[dae]
fn branches(xdot: f64, x: f64, z: f64) -> [f64; 2] {
    [xdot - 1.0 - 0.1 * z, z * z - x]
}

/// Two branches of the derivative: `ẋ = ±u x`.
#[dae]
fn square(xdot: f64, x: f64, u: f64) -> f64 {
    xdot * xdot - u * u * x * x
}

const AKZO: [f64; 9] = [18.7, 0.58, 0.09, 0.42, 34.4, 3.3, 115.83, 0.9, 737.0];

fn integrator_with_start(steps: usize) -> Options {
    Options { steps, start: Start::Given, ..Default::default() }
}

/// A start value of `z` is where Newton's method starts, and nothing else.
#[test]
fn t24_inconsistent_algebraic_states() {
    let x0 = vector![0.444, 0.00123, 0.0, 0.007, 0.0];
    let none = SVector::<f64, 0>::zeros();
    let run = |z: f64| {
        let mut irk = Irk::<AkzoNobel, RadauIIA<3>>::new(integrator_with_start(5)).expect("valid");
        irk.set_parameters(&AKZO.into()).expect("finite");
        irk.set_start(&SVector::zeros(), &vector![z]).expect("finite");
        irk.solve(&x0, &none, 0.05).map(|step| (step.x, step.z[0]))
    };
    let (x, z) = run(0.36).expect("a solution");
    // Consistent: z = Ks y1 y4.
    assert!((z - AKZO[6] * x[0] * x[3]).abs() <= 1e-14 * z);
    for wrong in [0.0, 1.0, -3.0, 1e6] {
        match run(wrong) {
            Ok((other, other_z)) => {
                assert!((other_z - z).abs() <= 1e-14 * z, "{wrong:e}: {:e}", other_z - z);
                let error = (other - x).component_div(&x).amax();
                assert!(error <= 1e-14, "{wrong:e}: {error:e}");
            }
            Err(error) => {
                assert!(matches!(error, Error::NotConverged { .. } | Error::NonFiniteModel { .. }), "{error}")
            }
        }
    }
    // A state that contradicts an equation: Radau IIA is on the equation after one step.
    let mut irk = Irk::<Kaps, RadauIIA<3>>::new(Options::default()).expect("valid");
    irk.set_parameters(&vector![0.0]).expect("finite");
    match irk.solve(&vector![2.0, 1.0], &none, 0.1).map(|step| step.x) {
        Ok(x) => assert!((x[0] - x[1] * x[1]).abs() <= 8.0 * f64::EPSILON, "{x}"),
        Err(error) => {
            assert!(matches!(error, Error::Singular { .. } | Error::NotConverged { .. }), "{error}")
        }
    }
    let mut adaptive = Adaptive::<Kaps, Radau>::new(AdaptiveOptions::default()).expect("valid");
    adaptive.set_parameters(&vector![0.0]).expect("finite");
    match adaptive.solve(&vector![2.0, 1.0], &none, 1.0).map(|result| result.x) {
        Ok(x) => assert!((x[0] - x[1] * x[1]).abs() <= 1e-8, "{x}"),
        Err(error) => println!("{error}"),
    }
}

/// The branch of the start is kept through fifty steps, in both directions.
#[test]
fn t25_branch_of_the_start() {
    let none = SVector::<f64, 0>::zeros();
    for sign in [1.0, -1.0] {
        let mut irk = Irk::<Branches, RadauIIA<3>>::new(integrator_with_start(50)).expect("valid");
        irk.set_start(&vector![1.0], &vector![2.0 * sign]).expect("finite");
        let step = *irk.solve(&vector![4.0], &none, 5.0).expect("a solution");
        assert!((step.z[0] - sign * step.x[0].sqrt()).abs() <= 1e-14 * step.z[0].abs(), "{step:?}");
        for i in 0..=50 {
            assert!(irk.dense(0.1 * f64::from(i)).expect("inside").z[0] * sign > 0.0);
        }
        let mut irk = Irk::<Square, Gauss<4>>::new(integrator_with_start(50)).expect("valid");
        irk.set_start(&vector![sign], &SVector::zeros()).expect("finite");
        let x = irk.solve(&vector![1.3], &vector![0.7], 2.0).expect("a solution").x[0];
        let expected = 1.3 * f64::exp(sign * 1.4);
        // Fifty steps of a few roundings each.
        assert!((x - expected).abs() <= 200.0 * f64::EPSILON * expected, "{x} {expected}");
    }
    // Between the branches of the derivative there is no way to choose: the matrix is singular.
    let mut irk = Irk::<Square, Gauss<4>>::new(integrator_with_start(1)).expect("valid");
    irk.set_start(&vector![0.0], &SVector::zeros()).expect("finite");
    match irk.solve(&vector![0.0], &vector![0.7], 0.1).map(|step| step.x[0]) {
        Ok(x) => assert_eq!(x, 0.0),
        Err(error) => {
            assert!(matches!(error, Error::Singular { .. } | Error::NotConverged { .. }), "{error}")
        }
    }
}

/// A thousand calls give the same bits, and a warm start differs from a cold one by rounding;
/// whatever the calls before were.
#[test]
fn t33_determinism_and_warm_starts() {
    let x0 = vector![0.444, 0.00123, 0.0, 0.007, 0.0];
    let none = SVector::<f64, 0>::zeros();
    let make = |start| {
        let options = Options { steps: 2, start, ..Default::default() };
        let mut irk = Irk::<AkzoNobel, RadauIIA<3>>::new(options).expect("valid");
        irk.set_parameters(&AKZO.into()).expect("finite");
        irk
    };
    let mut cold = make(Start::Zero);
    let first = *cold.solve(&x0, &none, 0.01).expect("a solution");
    for call in 0..1000 {
        if call % 100 == 0 {
            cold.solve(&(x0 * 1.5), &none, 0.03).expect("a solution");
        }
        assert_eq!(*cold.solve(&x0, &none, 0.01).expect("a solution"), first);
    }
    let mut warm = make(Start::Warm);
    for garbage in [1.0, 0.5, 3.0, 1e-3] {
        warm.reset();
        warm.set_start(&SVector::zeros(), &vector![1e5 * garbage]).expect("finite");
        // The stages of another state, and of a step a hundred times as long.
        let _ = warm.solve(&(x0 * garbage), &none, 1.0).map(|step| step.x);
        let step = *warm.solve(&x0, &none, 0.01).expect("a solution");
        let error = (step.x - first.x).component_div(&first.x).amax();
        assert!(error <= 1e-14, "{garbage}: {error:e}");
        assert!((step.z[0] / first.z[0] - 1.0).abs() <= 1e-14, "{garbage}: {} {}", step.z[0], first.z[0]);
    }
    // From where the model has no value there is no way: an error, and a cold start is as ever.
    warm.reset();
    warm.set_start(&SVector::repeat(-1e3), &vector![0.0]).expect("finite");
    assert!(matches!(warm.solve(&x0, &none, 0.01).map(|step| step.x), Err(Error::NonFiniteModel { .. })));
    warm.set_start(&SVector::zeros(), &vector![0.0]).expect("finite");
    assert_eq!(warm.solve(&x0, &none, 0.01).expect("a solution").x, first.x);
}
