//! Where Newton's method converges in no step, the error says which equation, and of what.

use casados::prelude::*;
use nalgebra::vector;

/// A load that grows, and the voltage that supplies it: `z = √(1 − x)` ends at `x = 1`, where
/// `∂f/∂z = 2z` is singular.
#[dae]
fn collapse(xdot: f64, x: f64, z: [f64; 2]) -> [f64; 3] {
    [xdot - 1.0, z[0] - 2.0 * x, z[1] * z[1] - 1.0 + x]
}

#[test]
fn voltage_collapse() {
    for tolerance in [1e-4, 1e-8] {
        let options = AdaptiveOptions { rtol: tolerance, atol: tolerance, ..Default::default() };
        let mut radau = Adaptive::<Collapse, Radau>::new(options).unwrap();
        radau.set_start(&vector![0.0], &vector![0.0, 1.0]).unwrap();
        let error = radau.solve(&vector![0.0], &vector![], 2.0).unwrap_err();
        let Error::StepSizeUnderflow { t, h, unsettled: Some(unsettled), .. } = error else {
            panic!("{error}")
        };
        assert!((t - 1.0).abs() <= 1e-6, "{t}");
        // No step is far below 1e-12 of the interval.
        assert!((1e-13..=4e-12).contains(&h), "{h}");
        assert_eq!((unsettled.equation, unsettled.unknown, unsettled.algebraic), (2, "z[1]", true));
        assert!(error.to_string().contains("∂f/∂z becomes singular"), "{error}");
    }
}

/// Any matrix that determines two algebraic states: `P z = (x, 1)`, `ẋ = −z₀`.
#[dae]
fn any_matrix(xdot: f64, x: f64, z: [f64; 2], p: [f64; 4]) -> [f64; 3] {
    [xdot + z[0], p[0] * z[0] + p[1] * z[1] - x, p[2] * z[0] + p[3] * z[1] - 1.0]
}

/// Of two permutations, and matrices next to them, one has a pivot of zero, whatever the plan is.
#[test]
fn vanishing_planned_pivots() {
    let mut pivoted = 0;
    for tiny in [0.0, 1e-300, 1e-17, 1e-12, 1e-9] {
        for (p, expected) in [([1.0, tiny, tiny, 1.0], (-1.0f64).exp()), ([tiny, 1.0, 1.0, tiny], 0.0)] {
            let options = AdaptiveOptions { rtol: 1e-8, atol: 1e-8, ..Default::default() };
            let mut radau = Adaptive::<AnyMatrix, Radau>::new(options).unwrap();
            radau.set_parameters(&p.into()).unwrap();
            // `e^(−t)` and `1 − t`, to the tolerance and what `tiny` makes of them.
            let x = radau.solve(&vector![1.0], &vector![], 1.0).unwrap().x[0];
            assert!((x - expected).abs() <= 1e-7, "{p:?}: {x} is not {expected}");
            pivoted += radau.statistics().dense;
        }
    }
    assert!(pivoted > 0, "no static order is right for all of these");
}
