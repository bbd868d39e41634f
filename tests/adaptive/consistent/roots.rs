//! Which root of several is taken, and what is said where there is none.

use casados::error::Started;
use casados::options::Newton;
use casados::prelude::*;
use casados::{Inline, mode};
use nalgebra::{SVector, Vector1, vector};

/// Decay of an acid `a` whose ions obey `z² + z/2 − a = 0`: one root is positive, the other is no
/// concentration.
#[dae(nominal(z = 0.1))]
fn acid(xdot: f64, x: f64, z: f64) -> [f64; 2] {
    [xdot + 0.3 * z, z * z + 0.5 * z - x]
}

/// `z² − 3z + x = 0`: Newton's method leads from zero to the smaller root.
#[dae(nominal(z = 2.5))]
fn larger(xdot: f64, x: f64, z: f64) -> [f64; 2] {
    [xdot + 0.3 * z, z * z - 3.0 * z + x]
}

/// The same with a range only, whose geometric mean is 2.5.
#[dae(range(z = 1.6..=3.90625))]
fn larger_in_range(xdot: f64, x: f64, z: f64) -> [f64; 2] {
    [xdot + 0.3 * z, z * z - 3.0 * z + x]
}

/// The same over dual numbers.
#[dae(nominal(z = 2.5))]
fn larger_dual<T: num_dual::DualNum<Primitive = f64> + num_dual::DualNumCopy>(xdot: T, x: T, z: T) -> [T; 2] {
    [xdot + z * 0.3, z * z - z * 3.0 + x]
}

/// `ẋ² + ẋ/2 − x = 0`, in which `ẋ` has two roots.
#[dae(nominal(xdot = 1.0))]
fn slope(xdot: f64, x: f64) -> f64 {
    xdot * xdot + 0.5 * xdot - x
}

/// Roots `z = x + kπ` for all integers `k`, with a state that grows through many of them.
#[dae]
fn winding(xdot: f64, x: f64, z: f64) -> [f64; 2] {
    [xdot - 1.0, (z - x).sin()]
}

/// The positive root of `z² + z/2 − a = 0`.
fn positive(a: f64) -> f64 {
    2.0 * a / (0.5 + (0.25 + 4.0 * a).sqrt())
}

/// The larger root of `z² − 3z + x = 0`.
fn large(x: f64) -> f64 {
    0.5 * (3.0 + (9.0 - 4.0 * x).sqrt())
}

/// The root that is wanted at both ends. Roots are more than one apart, and the error of the
/// polynomials through the stages of such short steps is below a ten-thousandth.
fn is_root(root: fn(f64) -> f64, x0: f64, x: f64, z0: f64, z: f64) {
    for (state, z) in [(x0, z0), (x, z)] {
        assert!((z - root(state)).abs() <= 1e-4, "{state}: {z} is not {}", root(state));
    }
}

const X0: f64 = 1.2;

#[test]
fn nominal_values_of_integrators() {
    let (x0, none, lambda) = (vector![X0], SVector::<f64, 0>::zeros(), vector![1.0]);
    macro_rules! check {
        ($model:ty, $root:ident, $method:ty) => {
            for start in [Start::Nominal, Start::Warm] {
                let options = Options { steps: 8, start, ..Default::default() };
                let mut irk = Irk::<$model, $method>::new(options).unwrap();
                // Twice: a warm start stays where it is.
                for _ in 0..2 {
                    let step = *irk.solve(&x0, &none, 0.1).unwrap();
                    is_root($root, X0, step.x[0], step.z0[0], step.z[0]);
                    let step = *irk.forward(&x0, &none, 0.1).unwrap();
                    is_root($root, X0, step.x[0], step.z0[0], step.z[0]);
                    let step = *irk.adjoint(&x0, &none, 0.1, &lambda).unwrap();
                    is_root($root, X0, step.x[0], step.z0[0], step.z[0]);
                    let step = *irk.hessian(&x0, &none, 0.1, &lambda).unwrap();
                    is_root($root, X0, step.x[0], step.z0[0], step.z[0]);
                }
            }
        };
    }
    check!(Acid, positive, Gauss<2>);
    check!(Acid, positive, RadauIIA<3>);
    check!(Acid, positive, Gauss<5>);
    check!(Larger, large, Gauss<2>);
    check!(Larger, large, Gauss<3>);
    check!(Larger, large, RadauIIA<3>);
    check!(Larger, large, Gauss<5>);
    check!(LargerInRange, large, RadauIIA<3>);
    check!(LargerDual, large, RadauIIA<3>);
}

#[test]
fn nominal_values_of_batches_and_lifted_stages() {
    let (x0, none) = (vector![X0], SVector::<f64, 0>::zeros());
    let options = Options { steps: 8, ..Default::default() };
    let mut inline = Irk::<Larger, RadauIIA<2>, f64, Inline<mode::Nominal, 8>>::inline(options).unwrap();
    let step = *inline.solve(&x0, &none, 0.1).unwrap();
    is_root(large, X0, step.x[0], step.z0[0], step.z[0]);

    for start in [Start::Nominal, Start::Warm] {
        let mut batch = Batch::<Larger, RadauIIA<3>>::new(Options { start, ..options }).unwrap();
        let states: Vec<_> = (0..11).map(|i| vector![0.2 + 0.1 * f64::from(i)]).collect();
        let mut results = vec![casados::result::Nominal::default(); states.len()];
        for _ in 0..2 {
            batch.solve(&Intervals { x0: &states, h: &[0.1], ..Default::default() }, &mut results).unwrap();
            for (x0, step) in states.iter().zip(&results) {
                is_root(large, x0[0], step.x[0], step.z0[0], step.z[0]);
            }
        }
    }

    // One iteration in each call: stages converge over the calls.
    let mut lifted = Irk::<Larger, RadauIIA<3>>::new(options.lifted()).unwrap();
    let mut step = *lifted.solve(&x0, &none, 0.1).unwrap();
    for _ in 0..20 {
        step = *lifted.solve(&x0, &none, 0.1).unwrap();
    }
    is_root(large, X0, step.x[0], step.z0[0], step.z[0]);
}

#[test]
fn nominal_values_of_adaptive_integrators() {
    let (x0, none) = (vector![X0], SVector::<f64, 0>::zeros());
    let options = AdaptiveOptions { rtol: 1e-10, atol: 1e-12, ..Default::default() };
    let mut radau = Adaptive::<Larger, Radau>::new(options).unwrap();
    let step = *radau.solve(&x0, &none, 0.1).unwrap();
    is_root(large, X0, step.x[0], step.z0[0], step.z[0]);
    let step = *radau.forward(&x0, &none, 0.1).unwrap();
    is_root(large, X0, step.x[0], step.z0[0], step.z[0]);
    let mut horizon = Piecewise::new(Adaptive::<Larger, Gauss<3>>::new(options).unwrap());
    let end = horizon.forward(&x0, &[none, none], &[0.1, 0.2]).unwrap().nominal;
    is_root(large, X0, end.x[0], end.z0[0], end.z[0]);
    // Values that are given come before nominal ones, here and with equal steps.
    radau.set_start(&vector![0.0], &vector![0.2]).unwrap();
    assert!(radau.solve(&x0, &none, 0.1).unwrap().z0[0] < 1.0);
    let mut irk = Irk::<Larger, RadauIIA<3>>::new(Options::default()).unwrap();
    irk.set_start(&vector![0.0], &vector![0.2]).unwrap();
    assert!(irk.solve(&x0, &none, 0.1).unwrap().z0[0] < 1.0);
    // From zero the other one is found.
    let mut irk =
        Irk::<Larger, RadauIIA<3>>::new(Options { start: Start::Zero, ..Default::default() }).unwrap();
    assert!(irk.solve(&x0, &none, 0.1).unwrap().z0[0] < 1.0);
}

#[test]
fn derivatives_with_several_roots_start_at_their_nominal_values() {
    // In one short step x hardly moves: ẋ is the positive root, and x grows.
    let mut irk = Irk::<Slope, Gauss<4>>::new(Options::default()).unwrap();
    let x = irk.solve(&vector![X0], &vector![], 1e-6).unwrap().x[0];
    assert!(((x - X0) / 1e-6 / positive(X0) - 1.0).abs() < 1e-5, "{x}");
    // Where equations are linear in it, zero is as good as any value, and states start where they
    // are given.
    assert!(Acid::START == [0.0, 0.1] && Slope::START == [1.0] && LargerInRange::START == [0.0, 2.5]);
    assert!(Winding::START.is_empty() && LargerDual::START == Larger::START);
}

#[test]
fn roots_of_later_steps() {
    macro_rules! check {
        ($($method:ty),*) => {$(
            let options = Options { steps: 25, ..Default::default() };
            let mut irk = Irk::<Winding, $method>::new(options).unwrap();
            let step = irk.solve(&vector![0.0], &vector![], 10.0).unwrap();
            // z = x, of a few roundings in each step.
            assert!((step.z[0] - 10.0).abs() < 1e-12, "{}: {}", stringify!($method), step.z[0]);
        )*};
    }
    check!(Gauss<2>, RadauIIA<3>, Gauss<4>, Gauss<5>, RadauIIA<5>, RadauIIA<7>);
}

/// The heat of a reaction by a logarithm, and one that no nominal value helps.
#[dae]
fn logarithm(xdot: f64, x: f64, z: [f64; 2]) -> [f64; 3] {
    [xdot + z[0], z[0] - x, z[1].ln() + z[0]]
}

/// `z² + z + 1 = x`: no root for `x < 3/4`.
#[dae(nominal(z = 2.0))]
fn parabola(xdot: f64, x: f64, z: f64) -> [f64; 2] {
    [xdot + z, z * z + z + 1.0 - x]
}

/// `ln x` of a state that is negative: nothing that a start value of `z` could help.
#[dae]
fn of_state(xdot: f64, x: f64, z: f64) -> [f64; 2] {
    [xdot + z, z - x.ln() + z * z]
}

#[test]
fn errors_say_where_algebraic_states_started() {
    let none = SVector::<f64, 0>::zeros();
    let mut irk = Irk::<Logarithm, RadauIIA<3>>::new(Options::default()).unwrap();
    let mut adaptive = Adaptive::<Logarithm, Radau>::new(AdaptiveOptions::default()).unwrap();
    let errors = [
        irk.solve(&vector![1.0], &none, 0.1).unwrap_err(),
        adaptive.solve(&vector![1.0], &none, 0.1).unwrap_err(),
    ];
    for error in errors {
        let Error::NonFiniteStart { equation: 2, value, started, .. } = error else { panic!("{error}") };
        assert_eq!((value, started), (f64::NEG_INFINITY, Started { unknown: "z[1]", value: 0.0 }));
        let text = error.to_string();
        for part in ["equation 2", "-inf", "`z[1]` started at 0:", "nominal(z = ..)", "`set_start`"] {
            assert!(text.contains(part), "{text}");
        }
    }
    // What they say helps.
    irk.set_start(&vector![0.0], &vector![0.0, 0.25]).unwrap();
    let z = irk.solve(&vector![1.0], &none, 0.0).unwrap().z;
    assert!((z[1] - f64::exp(-1.0)).abs() < 4.0 * f64::EPSILON, "{z}");
    // From one the first iteration leads to zero.
    adaptive.set_start(&vector![0.0], &vector![0.0, 1.0]).unwrap();
    let error = adaptive.solve(&vector![1.0], &none, 0.1).unwrap_err();
    let Error::NonFiniteStart { equation: 2, started, at, .. } = error else { panic!("{error}") };
    assert_eq!((started, at.iteration), (Started { unknown: "z[1]", value: 1.0 }, 1));
    adaptive.set_start(&vector![0.0], &vector![0.0, 0.25]).unwrap();
    adaptive.solve(&vector![1.0], &none, 0.1).unwrap();
    // A value that was given is the one that is named.
    irk.set_start(&vector![0.0], &vector![0.0, -0.25]).unwrap();
    let error = irk.solve(&vector![1.0], &none, 0.0).unwrap_err();
    assert!(error.to_string().contains("`z[1]` started at -0.25:"), "{error}");

    let newton = Newton { max_iterations: 20, ..Default::default() };
    let mut irk = Irk::<Parabola, RadauIIA<2>>::new(Options { newton, ..Default::default() }).unwrap();
    let error = irk.solve(&vector![0.5], &none, 0.0).unwrap_err();
    let Error::NotConverged { started, .. } = error else { panic!("{error}") };
    assert_eq!(started, Some(Started { unknown: "z", value: 2.0 }));
    assert!(error.to_string().contains("`z` started at 2: "), "{error}");
    let mut adaptive = Adaptive::<Parabola, Radau>::new(AdaptiveOptions::default()).unwrap();
    let error = adaptive.solve(&vector![0.5], &none, 0.1).unwrap_err();
    assert!(matches!(error, Error::InconsistentStart { .. }), "{error}");
    assert!(error.to_string().contains("`set_start`"), "{error}");

    // A state is not its start value's fault.
    let mut irk = Irk::<OfState, RadauIIA<2>>::new(Options::default()).unwrap();
    let error = irk.solve(&Vector1::new(-1.0), &none, 0.1).unwrap_err();
    assert!(matches!(error, Error::NonFiniteModel { equation: 1, .. }), "{error}");
}

/// The larger root of [`larger`] with a range that neither is in.
#[dae(range(z = 1.6..=2.0, x = -10.0..=10.0))]
fn elsewhere(xdot: f64, x: f64, z: f64) -> [f64; 2] {
    [xdot + 0.3 * z, z * z - 3.0 * z + x]
}

#[test]
fn warnings_about_ranges() {
    use casados::testing::{Exact, Points, check_derivatives, check_exact, check_sensitivities};
    let (x0, none) = (vector![X0], SVector::<f64, 0>::zeros());
    let mut irk = Irk::<Larger, RadauIIA<2>>::new(Options::default()).unwrap();
    let report = check_sensitivities(&mut irk, &x0, &none, &none, 0.1).unwrap();
    assert!(report.passed() && report.warnings.is_empty(), "{report}");
    let mut irk = Irk::<LargerInRange, RadauIIA<2>>::new(Options::default()).unwrap();
    let report = check_sensitivities(&mut irk, &x0, &none, &none, 0.1).unwrap();
    assert!(report.passed() && report.warnings.is_empty(), "{report}");
    // The same numbers, and a range that they are not in: at both ends.
    let mut irk = Irk::<Elsewhere, RadauIIA<2>>::new(Options::default()).unwrap();
    let report = check_sensitivities(&mut irk, &x0, &none, &none, 0.1).unwrap();
    assert!(report.passed() && report.warnings.len() == 2, "{report}");
    let text = report.to_string();
    assert!(text.contains("warning: ") && text.contains("outside of its range 1.6e0..=2e0"), "{text}");
    assert!(text.contains("nominal(z = ..)"), "{text}");
    let mut fine = Irk::<Elsewhere, RadauIIA<2>>::new(Options { steps: 2, ..Default::default() }).unwrap();
    let report = check_exact(&mut irk, &mut fine, &x0, &none, &none, 0.1, &Exact::default()).unwrap();
    assert_eq!(report.warnings.len(), 2, "{report}");
    // Random points are where the model lives.
    check_derivatives::<LargerInRange>(&Points::random(3)).assert();
}
