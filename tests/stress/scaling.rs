//! Rows of a model that differ by hundreds of orders of magnitude, known to the macro or not: the
//! results are those of the model with rows as they come.

use casados::prelude::*;
use casados::{dae, ode};
use nalgebra::{SVector, vector};

/// An oscillator with a force that is an algebraic state, its rows multiplied by numbers that the
/// macro does not see (it takes any numbers around one for them when it chooses pivots), or by the
/// literals that it does.
macro_rules! oscillators {
    ($($name:ident $literal:ident $type:ident $literal_type:ident [$a:literal, $b:literal, $c:literal];)*) => {
        $(
            mod $name {
                pub const ROWS: [f64; 3] = [$a, $b, $c];
            }
            #[dae(name = $type)]
            fn $name(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64) -> [f64; 3] {
                [
                    $name::ROWS[0] * (xdot[0] - x[1]),
                    $name::ROWS[1] * (xdot[1] + z - u),
                    $name::ROWS[2] * (z + 0.1 * z * z * z - x[0] - 0.2 * x[1]),
                ]
            }
            #[dae(name = $literal_type)]
            fn $literal(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64) -> [f64; 3] {
                [$a * (xdot[0] - x[1]), $b * (xdot[1] + z - u), $c * (z + 0.1 * z * z * z - x[0] - 0.2 * x[1])]
            }
        )*
        #[test]
        fn rows_in_any_unit() {
            let expected = found::<Plain>();
            $(
                compare(stringify!($name), &found::<$type>(), &expected);
                compare(stringify!($literal), &found::<$literal_type>(), &expected);
            )*
        }
    };
}

oscillators! {
    plain plain_literal Plain PlainLiteral [1.0, 1.0, 1.0];
    large large_literal Large LargeLiteral [1e200, 1.0, 1.0];
    large_force large_force_literal LargeForce LargeForceLiteral [1.0, 1e200, 1.0];
    large_spring large_spring_literal LargeSpring LargeSpringLiteral [1.0, 1.0, 1e200];
    small small_literal Small SmallLiteral [1e-200, 1.0, 1.0];
    small_force small_force_literal SmallForce SmallForceLiteral [1.0, 1e-200, 1.0];
    small_spring small_spring_literal SmallSpring SmallSpringLiteral [1.0, 1.0, 1e-200];
    all_large all_large_literal AllLarge AllLargeLiteral [1e200, 1e200, 1e200];
    all_small all_small_literal AllSmall AllSmallLiteral [1e-200, 1e-200, 1e-200];
    mixed mixed_literal Mixed MixedLiteral [1e150, 1e-150, 1.0];
    mixed_too mixed_too_literal MixedToo MixedTooLiteral [1.0, 1e-150, 1e150];
    mixed_more mixed_more_literal MixedMore MixedMoreLiteral [1e200, 1e-200, 1.0];
    mixed_most mixed_most_literal MixedMost MixedMostLiteral [1e-200, 1e200, 1.0];
    far far_literal Far FarLiteral [1.0, 1e200, 1e-200];
    farther farther_literal Farther FartherLiteral [1.0, 1e-200, 1e200];
}

/// `x₊` alone, and `x₊`, `dx₊/dx₀`, `dx₊/du`, the gradient and the Hessian of `λᵀx₊` by `x₀`, one
/// after the other.
fn found<M: Dae<Shape = casados::Dims<2, 1, 1, 0, 3, 7, 3, 8>>>() -> Vec<f64> {
    let mut irk = Irk::<M, Gauss<3>>::new(Options { steps: 3, ..Default::default() }).unwrap();
    let (x0, u, lambda) = (vector![1.0, 0.5], vector![0.3], vector![0.7, -0.4]);
    let simulated = irk.solve(&x0, &u, 0.4).unwrap().x;
    let step = irk.hessian(&x0, &u, 0.4, &lambda).unwrap();
    let (x, by_x0, by_u) = (step.x.as_slice(), step.dx_dx0.as_slice(), step.dx_du.as_slice());
    let parts = [simulated.as_slice(), x, by_x0, by_u, step.grad_x0.as_slice()];
    [parts.concat(), step.h_xx.as_slice().to_vec()].concat()
}

/// Rows multiplied by numbers that are no powers of two have entries that differ by a rounding.
/// Three steps, each a system of condition below ten, some ten roundings; all results are of size
/// one.
fn compare(name: &str, found: &[f64], expected: &[f64]) {
    assert!(expected.len() == 16 && found.len() == 16);
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= 300.0 * f64::EPSILON, "{name}: {found} {expected}");
    }
}

/// Linear and homogeneous.
#[dae]
fn homogeneous(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64) -> [f64; 3] {
    [xdot[0] - x[1] + 0.3 * z, xdot[1] + 3.0 * x[0] - u, z - 0.5 * x[0] - 0.1 * x[1]]
}

#[ode]
fn homogeneous_rates(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1] - 0.3 * x[0], u - 3.0 * x[0]]
}

/// States and controls multiplied by powers of two over the whole range of numbers: the same bits
/// in everything.
#[test]
fn t27_scale_invariance() {
    macro_rules! check {
        ($integrator:expr) => {
            let run = |exponent: i32| {
                let scale = 2.0f64.powi(exponent);
                let mut integrator = $integrator.expect("valid");
                let (x0, u, lambda) = (vector![scale, 0.3 * scale], vector![-0.7 * scale], vector![0.3, 0.9]);
                let simulated = integrator.solve(&x0, &u, 0.4).expect("a solution").x / scale;
                let step = *integrator.hessian(&x0, &u, 0.4, &lambda).expect("derivatives");
                let adjoint = integrator.adjoint(&x0, &u, 0.4, &lambda).expect("a gradient").grad_x0;
                (
                    simulated,
                    step.x / scale,
                    step.z / scale,
                    step.dx_dx0,
                    step.dx_du,
                    step.grad_x0,
                    step.h_xx,
                    adjoint,
                )
            };
            let expected = run(0);
            for exponent in (-900..=900).step_by(100) {
                assert_eq!(run(exponent), expected, "2^{exponent}");
            }
        };
    }
    let options = Options { steps: 3, ..Default::default() };
    check!(Irk::<Homogeneous, Gauss<1>>::new(options));
    check!(Irk::<Homogeneous, Gauss<4>>::new(options));
    check!(Irk::<Homogeneous, RadauIIA<3>>::new(options));
    check!(Irk::<Homogeneous, RadauIIA<5>>::new(options));
    check!(Erk::<HomogeneousRates, Rk4>::new(options));
    check!(Erk::<HomogeneousRates, DormandPrince8>::new(options));
}

#[ode]
fn decay(x: [f64; 2], p: f64) -> [f64; 2] {
    [p * x[0], p * x[1] + x[0]]
}

/// Numbers that fall below the smallest normal one become denormal and zero, and nothing else; it
/// takes no more iterations.
#[test]
fn t28_denormal_numbers() {
    let options = Options { steps: 60, ..Default::default() };
    macro_rules! check {
        ($integrator:ident, $method:ty) => {
            let mut integrator = $integrator::<Decay, $method>::new(options).expect("valid");
            integrator.set_parameters(&vector![-1.0]).expect("finite");
            let mut x = vector![1e-300, 1e-300];
            integrator.solve(&vector![1.0, 1.0], &SVector::zeros(), 60.0).expect("a solution");
            let ordinary = integrator.statistics().iterations;
            for _ in 0..3 {
                x = integrator.solve(&x, &SVector::zeros(), 60.0).expect("a solution").x;
                assert!(integrator.statistics().iterations <= ordinary + 60);
            }
            assert!(x.amax() <= 1e-320, "{x}");
        };
    }
    check!(Irk, Gauss<3>);
    check!(Irk, RadauIIA<3>);
    check!(Erk, DormandPrince8);
    let options = AdaptiveOptions { atol: 1e-300, ..Default::default() };
    let mut adaptive = Adaptive::<Decay, Radau>::new(options).expect("valid");
    adaptive.set_parameters(&vector![-1.0]).expect("finite");
    let x = adaptive.solve(&vector![1e-290, 1e-290], &SVector::zeros(), 1e3).expect("a solution").x;
    assert!(x.amax() <= 1e-299, "{x}");
    assert!(adaptive.statistics().steps <= 200, "{:?}", adaptive.statistics());
}

/// Steps of any length: those of 1e-300 change nothing, and those of 1e300 with rates of 1e-300 are
/// steps of length one.
#[test]
fn t36_lengths_of_steps() {
    macro_rules! check {
        ($integrator:ident, $method:ty) => {
            let run = |h: f64, rate: f64, x0: f64| {
                let mut integrator = $integrator::<Real, $method>::new(Options::default()).expect("valid");
                integrator.set_parameters(&vector![rate]).expect("finite");
                let step = *integrator.forward(&vector![x0], &SVector::zeros(), h).expect("a step");
                (step.x[0], step.dx_dx0[(0, 0)])
            };
            assert_eq!(run(1e-300, -1.0, 1.0), (1.0, 1.0));
            let expected = run(1.0, -1.0, 1.0);
            for found in [run(1e300, -1e-300, 1.0), run(1e-300, -1e300, 1.0)] {
                // 1e300 · 1e-300 is rounded, and so are its products with coefficients.
                assert!((found.0 - expected.0).abs() <= 16.0 * f64::EPSILON, "{found:?} {expected:?}");
                assert!((found.1 - expected.1).abs() <= 16.0 * f64::EPSILON, "{found:?} {expected:?}");
            }
        };
    }
    check!(Irk, Gauss<1>);
    check!(Irk, Gauss<4>);
    check!(Irk, RadauIIA<3>);
    check!(Irk, RadauIIA<5>);
    check!(Erk, Rk4);
    check!(Erk, DormandPrince8);
}

/// `ẋ = p x`
#[ode]
fn real(x: f64, p: f64) -> f64 {
    p * x
}
