//! Forces that jump inside of a step.

use casados::{
    Adaptive, AdaptiveOptions, DormandPrince5, DormandPrince8, Gauss, Irk, Options, Radau, RadauIIA, ode,
};
use nalgebra::vector;

/// A force that ends at `t = 5`, by the model's own clock or by a control.
#[ode]
fn switched(x: f64, u: f64, t: f64) -> f64 {
    if t < 5.0 { 2.0 - x } else { u - x }
}

#[test]
fn t29_discontinuous_force() {
    // x = 2 − e^{−t} until 5, and decays from there.
    let exact = (2.0 - f64::exp(-5.0)) * f64::exp(-3.0);
    let (x0, u) = (vector![1.0], vector![0.0]);
    // With a stop at the jump the order is full: Gauss methods have no node there.
    let mut errors = [0.0; 2];
    for (error, steps) in errors.iter_mut().zip([4, 8]) {
        let mut irk = Irk::<Switched, Gauss<2>>::new(Options { steps, ..Default::default() }).expect("valid");
        let x = irk.solve(&x0, &u, 5.0).expect("a solution").x;
        irk.set_time(5.0).expect("finite");
        *error = (irk.solve(&x, &u, 3.0).expect("a solution").x[0] - exact).abs();
    }
    let slope = (errors[0] / errors[1]).log2();
    assert!((slope - 4.0).abs() <= 0.5, "{slope} of {errors:?}");
    // Without it steps are refused until the one that contains the jump is short, and the error is
    // that of the tolerance.
    macro_rules! check {
        ($method:ty) => {
            for rtol in [1e-4, 1e-6, 1e-8] {
                let options = AdaptiveOptions { rtol, atol: rtol, max_steps: 2000, ..Default::default() };
                let mut adaptive = Adaptive::<Switched, $method>::new(options).expect("valid");
                let x = adaptive.solve(&x0, &u, 8.0).expect("a solution").x[0];
                let error = (x - exact).abs();
                println!("{} {rtol:e}: {error:e} {:?}", stringify!($method), adaptive.statistics());
                assert!(error <= 100.0 * rtol, "{rtol:e}: {error:e}");
                // A stop, and integration of the rest: at the jump the model has the value of the
                // other side, which is the control's until there.
                let x = adaptive.solve(&x0, &vector![2.0], 5.0).expect("a solution").x;
                adaptive.set_time(5.0).expect("finite");
                let x = adaptive.solve(&x, &u, 3.0).expect("a solution").x[0];
                assert!((x - exact).abs() <= 10.0 * rtol, "{rtol:e}: {:e}", x - exact);
            }
        };
    }
    check!(Radau);
    check!(RadauIIA<3>);
    check!(Gauss<3>);
    check!(Gauss<4>);
    check!(DormandPrince5);
    check!(DormandPrince8);
}

/// Wherever the jump lies in a step: the step over it is as accurate as the tolerance asks, four
/// times what its estimate allows, and the rest of the run twice. Gauss methods have no node at
/// either end: a jump before the first one shows at the start alone. Of four stages the estimate is
/// asked for 500 tolerances of 1e-10: no more than thirty of them may be left.
#[test]
fn jumps_anywhere_in_a_step() {
    macro_rules! check {
        ($method:ty, $allowed:literal) => {
            for rtol in [1e-4, 1e-6, 1e-8, 1e-10] {
                for k in 0..100 {
                    let options = AdaptiveOptions { rtol, atol: rtol, max_steps: 2000, ..Default::default() };
                    let mut adaptive = Adaptive::<Switched, $method>::new(options).expect("valid");
                    let x0 = 1.0 + 0.001 * f64::from(k);
                    let exact = (2.0 + (x0 - 2.0) * f64::exp(-5.0)) * f64::exp(-3.0);
                    let x = adaptive.solve(&vector![x0], &vector![0.0], 8.0).expect("a solution").x[0];
                    let error = (x - exact).abs();
                    assert!(error <= $allowed * rtol, "{} {rtol:e} {x0}: {error:e}", stringify!($method));
                }
            }
        };
    }
    check!(Radau, 6.0);
    check!(Gauss<3>, 6.0);
    check!(Gauss<4>, 30.0);
}
