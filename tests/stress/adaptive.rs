//! Adaptive integration of what has no solution, several, or one that is hard to represent: an
//! answer or an error that says why, and no other end.

use casados::error::{Quantity, Refusal};
use casados::{Adaptive, AdaptiveOptions, DormandPrince5, DormandPrince8, Error, Radau, RadauIIA, dae, ode};
use nalgebra::SVector;

/// `x = tan t`, which ends at π/2.
#[ode]
fn riccati(x: f64) -> f64 {
    1.0 + x * x
}

/// Nothing beyond `t = 1/2`.
#[ode]
fn root(_x: f64, t: f64) -> f64 {
    (0.5 - t).sqrt()
}

/// The algebraic equation determines `z` unless `p` is zero.
#[dae]
fn hidden(xdot: f64, x: f64, z: f64, p: f64, t: f64) -> [f64; 2] {
    [xdot - z, x - t.sin() + p * z]
}

/// Two branches, `z = ±√x`.
#[dae]
fn branches(xdot: f64, x: f64, z: f64) -> [f64; 2] {
    [xdot - 1.0 - 0.1 * z, z * z - x]
}

/// Dry friction: the velocity ends at zero, where its derivative jumps.
#[ode]
fn friction(x: f64) -> f64 {
    if x > 0.0 { -1.0 } else { 1.0 }
}

/// Two decays.
#[ode]
fn decay(x: [f64; 2]) -> [f64; 2] {
    [-x[0] + 0.5 * x[1], -100.0 * x[1]]
}

fn options(tolerance: f64) -> AdaptiveOptions {
    AdaptiveOptions { rtol: tolerance, atol: tolerance, ..Default::default() }
}

fn zero<const N: usize>() -> SVector<f64, N> {
    SVector::zeros()
}

/// Every method.
macro_rules! explicit_and_implicit {
    ($check:ident) => {
        $check!(Radau);
        $check!(RadauIIA<3>);
        $check!(RadauIIA<5>);
        $check!(RadauIIA<7>);
        $check!(DormandPrince5);
        $check!(DormandPrince8);
    };
}

#[test]
fn t30_finite_escape_time() {
    macro_rules! check {
        ($method:ty) => {
            let mut adaptive = Adaptive::<Riccati, $method>::new(options(1e-8)).expect("valid");
            let pole = core::f64::consts::FRAC_PI_2;
            match adaptive.solve(&zero(), &zero(), 1.6).map(|result| result.x) {
                Err(Error::StepSizeUnderflow { t, .. }) => assert!((t - pole).abs() <= 1e-3, "{t}"),
                other => panic!("{other:?}"),
            }
            // And then it is usable: tan 1.
            let x = adaptive.solve(&zero(), &zero(), 1.0).expect("a solution").x[0];
            assert!((x - 1.0f64.tan()).abs() <= 1e-6);
        };
    }
    explicit_and_implicit!(check);
}

#[test]
fn t26_end_of_the_domain() {
    macro_rules! check {
        ($method:ty) => {
            let mut adaptive = Adaptive::<Root, $method>::new(options(1e-6)).expect("valid");
            match adaptive.solve(&zero(), &zero(), 1.0).map(|result| result.x) {
                Err(Error::StepSizeUnderflow { t, reason: Refusal::NotFinite, .. }) => {
                    assert!((0.5 - 1e-6..=0.5).contains(&t), "{t}");
                }
                other => panic!("{other:?}"),
            }
            // The error leaves nothing behind: the bits of a fresh integrator.
            let after = adaptive.solve(&zero(), &zero(), 0.4).expect("a solution").x;
            let mut fresh = Adaptive::<Root, $method>::new(options(1e-6)).expect("valid");
            assert_eq!(after, fresh.solve(&zero(), &zero(), 0.4).expect("a solution").x);
            // Nor is there a start where the model has no value.
            adaptive.set_time(0.7).expect("finite");
            assert!(matches!(
                adaptive.solve(&zero(), &zero(), 1.0).map(|result| result.x),
                Err(Error::NonFiniteModel { quantity: Quantity::Residual, equation: 0, .. })
            ));
        };
    }
    explicit_and_implicit!(check);
}

/// The error names what is not determined.
#[test]
fn t22_index_two() {
    let mut adaptive = Adaptive::<Hidden, Radau>::new(options(1e-6)).expect("valid");
    adaptive.set_parameters(&SVector::from([0.0])).expect("finite");
    match adaptive.solve(&zero(), &zero(), 1.0).map(|result| result.x) {
        Err(Error::InconsistentStart { unknown, singular: true, .. }) => assert_eq!(unknown, "z"),
        other => panic!("{other:?}"),
    }
    adaptive.set_parameters(&SVector::from([1.0])).expect("finite");
    assert!(adaptive.solve(&zero(), &zero(), 1.0).is_ok());
}

/// `z` at the start is found from anywhere, and decides for nothing else.
#[test]
fn t24_inconsistent_start() {
    let run = |z: f64| {
        let mut adaptive = Adaptive::<Hidden, Radau>::new(options(1e-8)).expect("valid");
        adaptive.set_parameters(&SVector::from([1.0])).expect("finite");
        adaptive.set_start(&zero(), &SVector::from([z])).expect("finite");
        let result = adaptive.solve(&SVector::from([0.5]), &zero(), 2.0).expect("a solution");
        (result.x[0], result.z[0], result.z0[0])
    };
    let expected = run(0.0);
    // 0 = x − sin t + z
    assert!((expected.2 + 0.5).abs() <= 1e-15 && (expected.1 - (2.0f64.sin() - expected.0)).abs() <= 1e-14);
    for z in [1.0, -3.0, 1e6] {
        let found = run(z);
        // The start is found to rounding of the start value: ε · 1e6 at most.
        assert!((found.0 - expected.0).abs() <= 1e-9 && (found.1 - expected.1).abs() <= 1e-9, "{found:?}");
    }
}

#[test]
fn t25_branch_of_the_start() {
    for sign in [1.0, -1.0] {
        let mut adaptive = Adaptive::<Branches, Radau>::new(options(1e-8)).expect("valid");
        adaptive.set_start(&zero(), &SVector::from([sign])).expect("finite");
        let result = *adaptive.solve(&SVector::from([4.0]), &zero(), 5.0).expect("a solution");
        assert!((result.z0[0] - 2.0 * sign).abs() <= 1e-14);
        assert!((result.z[0] - sign * result.x[0].sqrt()).abs() <= 1e-8, "{result:?}");
        for t in [0.1, 1.0, 3.3] {
            assert!(adaptive.dense(t).expect("inside").z[0] * sign > 0.0);
        }
    }
}

/// A solution that slides along a jump of the model cannot be followed: there is an end, with an
/// error or within the tolerance of steps that chatter.
#[test]
fn t29_sliding_mode() {
    macro_rules! check {
        ($method:ty) => {
            let options = AdaptiveOptions { max_steps: 2000, ..options(1e-6) };
            let mut adaptive = Adaptive::<Friction, $method>::new(options).expect("valid");
            match adaptive.solve(&SVector::from([1.0]), &zero(), 1.5).map(|result| result.x[0]) {
                Ok(x) => assert!(x.abs() <= 1e-3, "{x}"),
                Err(Error::TooManySteps { t, .. } | Error::StepSizeUnderflow { t, .. }) => {
                    assert!(t >= 1.0 - 1e-3, "{t}");
                }
                Err(other) => panic!("{other:?}"),
            }
        };
    }
    explicit_and_implicit!(check);
}

/// Powers of two, over the whole range of numbers, change no bit of a linear model.
#[test]
fn t27_scaling() {
    macro_rules! check {
        ($method:ty) => {
            let run = |exponent: i32| {
                let scale = 2.0f64.powi(exponent);
                let options = AdaptiveOptions { rtol: 1e-7, atol: 1e-7 * scale, ..Default::default() };
                let mut adaptive = Adaptive::<Decay, $method>::new(options).expect("valid");
                let x0 = SVector::from([scale, 3.0 * scale]);
                let x = adaptive.solve(&x0, &zero(), 0.7).expect("a solution").x;
                (x / scale, adaptive.statistics().steps)
            };
            let expected = run(0);
            for exponent in [-900, -500, -40, 40, 500, 900] {
                assert_eq!(run(exponent), expected, "2^{exponent}");
            }
        };
    }
    explicit_and_implicit!(check);
}

/// Times up to the ends of the range: of the least number there is no tenth.
#[test]
fn t36_long_and_short_intervals() {
    for t in [5e-324, 1e-300, 1e-30, 1e30, 1e300] {
        let mut adaptive = Adaptive::<Decay, Radau>::new(options(1e-6)).expect("valid");
        let x0 = SVector::from([1.0, 1.0]);
        let x = adaptive.solve(&x0, &zero(), t).expect("a solution").x;
        if t < 1.0 {
            assert!((x - x0).amax() <= 1e-14, "{t:e}: {x}");
        } else {
            assert!(x.amax() <= 1e-5, "{t:e}: {x}");
        }
    }
}

/// Beside a state that begins at zero and a tiny absolute tolerance its rate overflows, and so
/// does what the first step would follow from.
#[test]
fn t36_tiny_absolute_tolerance() {
    let options = AdaptiveOptions { atol: 1e-300, ..options(1e-6) };
    macro_rules! check {
        ($method:ty) => {
            let mut adaptive = Adaptive::<Turning, $method>::new(options).expect("valid");
            let x = adaptive.solve(&SVector::from([1.0, 0.0]), &zero(), 1.0).expect("a solution").x;
            assert!((x[0] - 1f64.cos()).abs() <= 1e-4 && (x[1] + 1f64.sin()).abs() <= 1e-4, "{x}");
        };
    }
    check!(DormandPrince5);
    check!(DormandPrince8);
}

/// `ẍ = −x`
#[ode]
fn turning(x: [f64; 2]) -> [f64; 2] {
    [x[1], -x[0]]
}

/// The same input gives the same bits, in every call.
#[test]
fn t33_determinism() {
    let mut adaptive = Adaptive::<Riccati, Radau>::new(options(1e-9)).expect("valid");
    let first = adaptive.solve(&zero(), &zero(), 1.2).expect("a solution").x;
    for t in [0.3, 1.5, 0.9] {
        adaptive.solve(&zero(), &zero(), t).expect("a solution");
        assert_eq!(adaptive.solve(&zero(), &zero(), 1.2).expect("a solution").x, first);
    }
}
