//! Single precision is double precision with other roundings: the differences are those of the
//! arguments, propagated by the derivatives, and of the steps.

use super::everything::Everything;
use casados::{Erk, Gauss, Irk, Options, RadauIIA, Rk4, ode};
use nalgebra::vector;

/// A pendulum, pushed.
#[ode]
fn pushed(x: [f64; 2], u: f64, p: [f64; 2]) -> [f64; 2] {
    [x[1], u - p[0] * x[0].sin() - p[1] * x[1]]
}

/// `|x₃₂ − x₆₄|` and `|S₃₂ − S₆₄|` beside the bounds that conditions give, worst of many points.
///
/// Rounding the arguments to `ε/2` of their size changes `x` by `Σ_j |S_ij w_j| ε/2`; each step
/// rounds `x`, its stages and their increments, a dozen roundings, which the remaining steps
/// propagate with at most `max |S|`; and derivatives change by second derivatives, which are of the
/// size of `|S|² M` with the curvature `M` of the model.
macro_rules! compare {
    ($name:literal, $single:expr, $double:expr, $steps:expr, $curvature:expr, $points:expr, $h:expr) => {{
        let (mut single, mut double) = ($single.expect("valid"), $double.expect("valid"));
        let eps = f64::from(f32::EPSILON);
        let mut worst = [0.0f64; 2];
        for (x0, u, p) in $points {
            double.set_parameters(&p).expect("finite");
            single.set_parameters(&p.map(|p| p as f32)).expect("finite");
            let exact = *double.forward(&x0, &u, $h).expect("a solution");
            let (x0, u32, h) = (x0.map(|x| x as f32), u.map(|u| u as f32), $h as f32);
            let found = *single.forward(&x0, &u32, h).expect("a solution");
            let size =
                exact.dx_dx0.abs().row_sum().amax().max(exact.dx_dx0.abs().column_sum().amax()).max(1.0);
            let inputs = exact.dx_dx0.abs() * x0.map(|x| f64::from(x).abs())
                + exact.dx_du.abs() * u.abs()
                + exact.dx_dp.abs() * p.abs();
            let state = exact.x.amax().max(1.0);
            let steps = 12.0 * $steps as f64 * size * state;
            // The length of the interval is rounded too: ẋ h ε/2, of the size of the increments.
            for i in 0..2 {
                let bound = eps * (inputs[i] / 2.0 + steps);
                let error = (f64::from(found.x[i]) - exact.x[i]).abs();
                worst[0] = worst[0].max(error / bound);
            }
            let bound = eps * (inputs.amax() / 2.0 + steps) * size * (1.0 + $curvature);
            let error = (found.dx_dx0.map(f64::from) - exact.dx_dx0).amax();
            worst[1] = worst[1].max(error / bound);
        }
        println!("{}: {worst:?}", $name);
        // Not above the bounds, and not so far below that they say nothing.
        assert!(worst.iter().all(|ratio| *ratio <= 1.0), "{}: {worst:?}", $name);
        assert!(worst.iter().all(|ratio| *ratio >= 1e-3), "{}: {worst:?}", $name);
    }};
}

#[test]
fn single_precision() {
    let points = || {
        (0..40).map(|k| {
            let wave = |i: i32| (f64::from(7 * k + 3 * i)).sin();
            (vector![wave(1), wave(2)], vector![wave(3)], vector![9.81 + wave(4), 0.1 + 0.1 * wave(5)])
        })
    };
    // The curvature of the pendulum is p₀ h² at most.
    macro_rules! pushed {
        ($name:literal, $integrator:ident, $method:ty, $steps:literal) => {
            let options = Options { steps: $steps, ..Default::default() };
            compare!(
                $name,
                $integrator::<Pushed, $method, f32>::new(options),
                $integrator::<Pushed, $method>::new(options),
                $steps,
                10.0,
                points(),
                1.0
            );
        };
    }
    pushed!("Gauss, s = 3", Irk, Gauss<3>, 4);
    pushed!("Gauss, s = 1", Irk, Gauss<1>, 16);
    pushed!("Radau IIA, s = 4", Irk, RadauIIA<4>, 4);
    pushed!("RK4", Erk, Rk4, 16);
    // A fully implicit model: its algebraic state and the matrix of ẋ have conditions of order one
    // to ten at these points.
    let points = || {
        (0..40).map(|k| {
            let wave = |i: i32| (f64::from(5 * k + 3 * i)).sin();
            let p = vector![1.3 + 0.3 * wave(4), 2.1 + 0.3 * wave(5)];
            (vector![0.5 * wave(1), 0.5 * wave(2)], vector![0.5 + 0.3 * wave(3)], p)
        })
    };
    let options = Options { steps: 3, ..Default::default() };
    compare!(
        "implicit",
        Irk::<Everything, RadauIIA<3>, f32>::new(options),
        Irk::<Everything, RadauIIA<3>>::new(options),
        3,
        10.0,
        points(),
        0.3
    );
}
