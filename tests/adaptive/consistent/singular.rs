//! Linear equations that are singular but for the last digits are refused, and stiff ones are not.

use casados::prelude::*;
use nalgebra::{SVector, Vector1, vector};

/// `ẋ = −x` twice, in two equations that differ by `p`: the solution does not depend on it, its
/// digits do.
#[dae]
fn nearly(xdot: [f64; 2], x: [f64; 2], p: f64) -> [f64; 2] {
    [xdot[0] + xdot[1] + x[0] + x[1], xdot[0] + (1.0 + p) * xdot[1] + x[0] + (1.0 + p) * x[1]]
}

/// The same with the difference as a term of its own.
#[dae]
fn nearly_by_terms(xdot: [f64; 2], x: [f64; 2], p: f64) -> [f64; 2] {
    let sum = xdot[0] + xdot[1] + x[0] + x[1];
    [sum, sum + p * (xdot[1] + x[1])]
}

/// In nonlinear equations.
#[dae]
fn nearly_curved(xdot: [f64; 2], x: [f64; 2], p: f64) -> [f64; 2] {
    let first = x[0].exp() * (xdot[0] + x[0]);
    [first + xdot[1] + x[1], first + (1.0 + p) * xdot[1] + (1.0 + p) * x[1]]
}

/// The end of an interval of 0.6, for every method and several numbers of steps.
macro_rules! ends {
    ($model:ty, $p:expr, $of:expr) => {{
        macro_rules! of_method {
            ($method:ty) => {
                for steps in [1, 2, 5] {
                    let mut irk =
                        Irk::<$model, $method>::new(Options { steps, ..Default::default() }).unwrap();
                    irk.set_parameters(&Vector1::new($p)).unwrap();
                    $of(irk.solve(&vector![1.0, 1.0], &vector![], 0.6).map(|step| step.x));
                    $of(irk.forward(&vector![1.0, 1.0], &vector![], 0.6).map(|step| step.nominal.x));
                }
            };
        }
        of_method!(Gauss<2>);
        of_method!(Gauss<4>);
        of_method!(RadauIIA<3>);
    }};
}

/// Each result is right to what the condition `4/p` leaves, or there is none. Steps of 0.6 have
/// errors below a percent.
#[test]
fn nearly_singular_equations() {
    let exact = f64::exp(-0.6);
    for p in [1e-6, 1e-9, 1e-12, 1e-13] {
        let right = |x: Result<SVector<f64, 2>, Error>| {
            let x = x.unwrap_or_else(|error| panic!("{p:e}: {error}"));
            assert!((x[1] - exact).abs() <= 0.01 + 4.0 * f64::EPSILON / p, "{p:e}: {x}");
        };
        ends!(Nearly, p, right);
        ends!(NearlyByTerms, p, right);
    }
    for p in [1e-15, 5e-16] {
        let refused = |x: Result<SVector<f64, 2>, Error>| match x {
            Err(Error::Singular { unknown: "x[0]" | "x[1]", .. }) => {}
            other => panic!("{p:e}: {other:?}"),
        };
        ends!(Nearly, p, refused);
        ends!(NearlyByTerms, p, refused);
    }
    for p in [1e-13, 1e-14, 1e-15] {
        let refused_or_right = |x: Result<SVector<f64, 2>, Error>| match x {
            Ok(x) => assert!((x[1] - exact).abs() <= 0.1 * exact, "{p:e}: {x}"),
            Err(Error::Singular { .. } | Error::NotConverged { .. }) => {}
            Err(error) => panic!("{p:e}: {error}"),
        };
        ends!(NearlyCurved, p, refused_or_right);
    }
    // Side by side, too: each interval by itself.
    let mut batch = Batch::<Nearly, RadauIIA<3>>::new(Options::default()).unwrap();
    let (x0, p) = ([vector![1.0, 1.0]; 4], [1e-3, 1e-15, 1e-6, 1e-15].map(Vector1::new));
    let mut results = vec![casados::result::Nominal::default(); 4];
    batch.solve(&Intervals { x0: &x0, p: &p, h: &[0.6], ..Default::default() }, &mut results).unwrap_err();
    assert!(batch.status(0).and(batch.status(2)).is_ok());
    assert!(matches!(batch.status(1), Err(Error::Singular { .. })));
    assert!(matches!(batch.status(3), Err(Error::Singular { .. })));
}

/// Fast and slow linear reactions: `a ⇌ b` with the rate `p`, and `b` decays to what is counted.
#[dae]
fn reactions(xdot: [f64; 3], x: [f64; 3], p: f64) -> [f64; 3] {
    let (fast, slow) = (p * (x[0] - x[1]), x[1]);
    [xdot[0] + fast, xdot[1] - fast + slow, xdot[2] - slow]
}

/// A mass between two springs of the stiffness `p`, whose forces cancel at rest.
#[dae]
fn springs(xdot: [f64; 2], x: [f64; 2], z: [f64; 2], p: f64) -> [f64; 4] {
    [xdot[0] - x[1], xdot[1] - z[0] - z[1], z[0] - p * (1.0 - x[0]), z[1] + p * (1.0 + x[0])]
}

/// `p ẋ = −x`, to be followed or to be at rest.
#[dae]
fn relaxation(xdot: [f64; 2], x: [f64; 2], p: f64) -> [f64; 2] {
    [p * xdot[0] + x[0] - x[1], xdot[1] + x[1]]
}

#[test]
fn stiff_equations() {
    for p in [1.0, 1e6, 1e12, 1e15] {
        for steps in [1, 3] {
            let options = Options { steps, ..Default::default() };
            // Beyond 1e16 the digits of the slow motion are none.
            for h in [1e-3, 0.6, 1e3].into_iter().filter(|h| h * p < 1e16) {
                let mut irk = Irk::<Reactions, RadauIIA<3>>::new(options).unwrap();
                irk.set_parameters(&Vector1::new(p)).unwrap();
                for x0 in [[1.0, 0.0, 0.0], [0.0; 3], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
                    let x = irk
                        .solve(&x0.into(), &vector![], h)
                        .unwrap_or_else(|e| panic!("{p:e} {h} {x0:?} {steps}: {e}"))
                        .x;
                    // What there is stays, to rounding of the hp that are exchanged.
                    let total = x0.iter().sum::<f64>();
                    assert!(
                        (x.sum() - total).abs() <= 64.0 * f64::EPSILON * (1.0 + h * p) * total,
                        "{p:e} {h}: {x}"
                    );
                    if total > 0.0 && h == 0.6 && (1e5..1e13).contains(&p) && x0[2] == 0.0 {
                        // The slow motion is e^{−t/2} of the whole; three stages are right to a
                        // thousandth.
                        let expected = 0.5 * total * f64::exp(-0.3);
                        assert!((x[0] - expected).abs() <= 1e-3, "{p:e}: {x}");
                    }
                }
                let mut irk = Irk::<Springs, Gauss<2>>::new(options).unwrap();
                irk.set_parameters(&Vector1::new(p)).unwrap();
                for x0 in [[0.0; 2], [1e-12, 0.0], [0.3, -1.0]] {
                    irk.solve(&x0.into(), &vector![], h).unwrap_or_else(|e| panic!("{p:e} {h}: {e}"));
                }
                let mut irk = Irk::<Relaxation, RadauIIA<3>>::new(options).unwrap();
                irk.set_parameters(&Vector1::new(1.0 / p)).unwrap();
                for x0 in [[0.0; 2], [1.0, 1.0], [1.0, 0.0], [0.0, 1e-300]] {
                    irk.solve(&x0.into(), &vector![], h).unwrap_or_else(|e| panic!("{p:e} {h}: {e}"));
                }
            }
        }
    }
}
