//! Plants whose algebraic equations have two roots, or lose them.

use casados::options::{Jacobian, Newton};
use casados::prelude::*;
use nalgebra::{SVector, vector};

/// Ions by `ion² + ion/2 = a`, where one root is negative, beside two linear algebraic states.
#[dae(nominal(z = [1.0, 10.0, 0.1]))]
fn reactor(xdot: [f64; 4], x: [f64; 4], z: [f64; 3]) -> [f64; 7] {
    let ([a, b, temperature, level], [rate, heat, ion]) = (x, z);
    [
        xdot[0] + rate,
        xdot[1] - rate + 0.1 * b,
        xdot[2] - heat + 0.2 * (temperature - 300.0),
        xdot[3] + 0.01 * level,
        rate - 0.3 * a - 0.1 * b,
        heat - 20.0 * rate + 0.05 * temperature,
        ion * ion + 0.5 * ion - a,
    ]
}

#[test]
fn positive_concentrations_of_a_reactor() {
    let none = SVector::<f64, 0>::zeros();
    let states: Vec<_> = (0..100).map(|i| vector![0.5 + 0.01 * f64::from(i), 0.4, 310.0, 1.0]).collect();
    for jacobian in [Jacobian::Auto, Jacobian::Simplified, Jacobian::Full, Jacobian::Frozen] {
        let newton = Newton { jacobian, ..Default::default() };
        for steps in [1, 5] {
            let options = Options { newton, steps, ..Default::default() };
            let mut irk = Irk::<Reactor, RadauIIA<3>>::new(options).unwrap();
            let mut gauss = Irk::<Reactor, Gauss<2>>::new(options).unwrap();
            for x0 in &states {
                let z = irk.solve(x0, &none, 1e-3).unwrap().z;
                assert!(z[2] > 0.0, "{jacobian:?} {}", x0[0]);
                assert!(gauss.solve(x0, &none, 1e-3).unwrap().z[2] > 0.0, "{jacobian:?} {}", x0[0]);
            }
            let mut batch = Batch::<Reactor, RadauIIA<3>>::new(options).unwrap();
            let mut results = vec![casados::result::Nominal::default(); states.len()];
            batch.solve(&Intervals { x0: &states, h: &[1e-3], ..Default::default() }, &mut results).unwrap();
            for (x0, step) in states.iter().zip(&results) {
                assert!(step.z[2] > 0.0, "{jacobian:?} {}", x0[0]);
            }
        }
    }
    let mut radau = Adaptive::<Reactor, Radau>::new(AdaptiveOptions::default()).unwrap();
    for x0 in &states {
        assert!(radau.solve(x0, &none, 1e-3).unwrap().z[2] > 0.0, "{}", x0[0]);
    }
}

/// The voltage at the end of a line, `v² − v + x = 0`, of a load that grows to more than the line
/// can carry: at `x = 1/4` its two solutions meet.
#[dae(nominal(z = [1.0, 0.0]))]
fn line(xdot: f64, x: f64, z: [f64; 2]) -> [f64; 3] {
    let [voltage, current] = z;
    [xdot - 1.0, current - 3.0 * x, voltage * voltage - voltage + x]
}

#[test]
fn message_about_voltage_collapse() {
    let (x0, none) = (vector![0.1], SVector::<f64, 0>::zeros());
    let mut radau = Adaptive::<Line, Radau>::new(AdaptiveOptions::default()).unwrap();
    let error = radau.solve(&x0, &none, 1.0).unwrap_err();
    let casados::Error::StepSizeUnderflow { t, reason, .. } = error else { panic!("{error}") };
    assert!((t - 0.15).abs() < 1e-6, "{error}");
    assert_eq!(reason, casados::error::Refusal::SingularAlgebraic { unknown: "z[0]" }, "{error}");
    assert!(error.to_string().contains("`z[0]`") && error.to_string().contains("∂f/∂z"), "{error}");
    for steps in [7, 20] {
        let mut irk = Irk::<Line, RadauIIA<3>>::new(Options { steps, ..Default::default() }).unwrap();
        let error = irk.solve(&x0, &none, 1.0).unwrap_err();
        let casados::Error::SingularAlgebraic { unknown, .. } = error else { panic!("{error}") };
        assert_eq!(unknown, "z[0]", "{error}");
        assert!(error.to_string().contains("∂f/∂z becomes singular along `z[0]`"), "{error}");
        // Before the collapse there is nothing to be said.
        assert!((irk.solve(&x0, &none, 0.1).unwrap().z[0] - 0.5 - f64::sqrt(0.05)).abs() < 1e-6);
    }
}
