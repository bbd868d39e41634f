//! Explicit methods side by side: against single calls, against closed forms, and failures.

use crate::horizon::*;
use crate::models::quadrotor::Quadrotor;
use casados::batch::Integrator;
use casados::prelude::*;
use casados::result::{Forward, Hessian, Nominal};
use casados::{Butcher6, Custom, DormandPrince5, DormandPrince8, Euler, Heun, Midpoint, Rk4, Tableau};
use nalgebra::{SVector, Vector1, vector};

/// Both round the same operations, a product and a sum of a group together. In a step that are at
/// most thirty on a path through a stage (the model, its derivatives, the sums over stages), each
/// to ε/2 of what is summed up; models here are scaled so that a step enlarges no error by more
/// than a half. So results of `n` steps of `s` stages are `30 n s ε` apart at most.
fn rounding_tolerance(steps: usize, stages: usize) -> f64 {
    30.0 * (steps * stages) as f64
}

/// Every number of intervals that the widest registers divide into groups and a rest.
#[test]
fn every_number_of_intervals() -> Test {
    for count in 1..=17 {
        check::<Erk<_, Rk4, _>>(steps(1), &pendulum::<f64>(count), rounding_tolerance(1, 4))?;
        check::<Erk<_, Rk4, _>>(steps(2), &pendulum::<f32>(count), rounding_tolerance(2, 4))?;
        check::<Erk<_, Rk4, _>>(steps(3), &quadrotor(count), rounding_tolerance(3, 4))?;
    }
    check::<Erk<_, Rk4, _>>(steps(4), &chain::<21>(40), rounding_tolerance(4, 4))
}

#[test]
fn every_method() -> Test {
    let horizon = quadrotor(11);
    check::<Erk<_, Euler, _>>(steps(2), &horizon, rounding_tolerance(2, 1))?;
    check::<Erk<_, Midpoint, _>>(steps(2), &horizon, rounding_tolerance(2, 2))?;
    check::<Erk<_, Heun, _>>(steps(2), &horizon, rounding_tolerance(2, 2))?;
    check::<Erk<_, DormandPrince5, _>>(steps(2), &horizon, rounding_tolerance(2, 6))?;
    check::<Erk<_, Butcher6, _>>(steps(2), &horizon, rounding_tolerance(2, 7))?;
    check::<Erk<_, DormandPrince8, _>>(steps(2), &horizon, rounding_tolerance(2, 12))?;
    let compensated = Options { compensated: true, ..steps(3) };
    check::<Erk<_, Rk4, _>>(compensated, &horizon, rounding_tolerance(3, 4))?;
    // Kutta's method of order three.
    let (a, b) = ([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [-1.0, 2.0, 0.0]], [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0]);
    let tableau = Tableau::new(a, b, [0.0, 0.5, 1.0])?;
    let batch = Integrator::<Erk<Quadrotor, Custom<3>>>::with_tableau(steps(2), tableau)?;
    let single = Erk::<Quadrotor, Custom<3>>::with_tableau(steps(2), tableau)?;
    check_with(batch, single, &horizon, rounding_tolerance(2, 3))
}

/// Hovering, all of them elsewhere.
fn quadrotor(count: usize) -> Horizon<Quadrotor> {
    let wave = |k: usize, i: usize| ((7 * k + 3 * i) as f64).sin();
    Horizon {
        x0: (0..count).map(|k| SVector::from_fn(|i, _| 0.3 * wave(k, i))).collect(),
        u: (0..count).map(|k| SVector::from_fn(|i, _| 2.45 + 0.1 * wave(k, i + 5))).collect(),
        p: vec![],
        h: (0..count).map(|k| 0.05 + 0.001 * k as f64).collect(),
        lambda: (0..count).map(|k| SVector::from_fn(|i, _| wave(k + 2, i))).collect(),
    }
}

/// `ẋ = p x + u t`
#[ode]
fn driven(x: f64, u: f64, p: f64, t: f64) -> f64 {
    p * x + u * t
}

/// Of `ẋ = p x + u t` a step of `Rk4` is `R x + u (t φ + ψ)`, with `z = h p` and
/// `R = Σ_{k≤4} zᵏ/k!`, `φ = h Σ_{k≤3} zᵏ/(k+1)!`, `ψ = h² (1/2 + z/6 + z²/24)`, where the last is
/// the quadrature of the stages: a polynomial of degree three in `h` with an error of order five.
#[test]
fn closed_form() -> Test {
    for count in 1..=17 {
        let x0: Vec<_> = (0..count).map(|k| Vector1::new(1.0 + 0.1 * k as f64)).collect();
        let u: Vec<_> = (0..count).map(|k| Vector1::new(0.2 * k as f64 - 1.0)).collect();
        let p: Vec<_> = (0..count).map(|k| Vector1::new(-0.3 * k as f64)).collect();
        let h: Vec<_> = (0..count).map(|k| 0.1 + 0.01 * k as f64).collect();
        let t0: Vec<_> = (0..count).map(|k| 0.5 * k as f64).collect();
        let mut batch = Batch::<Driven, Rk4>::new(steps(1))?;
        let intervals = Intervals { x0: &x0, u: &u, p: &p, h: &h, t0: &t0 };
        let mut results = vec![Hessian::default(); count];
        batch.hessian(&intervals, &[Vector1::new(3.0)], &mut results)?;
        for (k, result) in results.iter().enumerate() {
            let (x, u, p, h, t) = (x0[k][0], u[k][0], p[k][0], h[k], t0[k]);
            let z = h * p;
            let r = 1.0 + z * (1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0)));
            let phi = h * (1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0)));
            let psi = h * h * (1.0 / 2.0 + z / 6.0 * (1.0 + z / 4.0));
            let of_u = t * phi + psi;
            // dR/dz, dφ/dz, dψ/dz, and their derivatives.
            let r1 = 1.0 + z * (1.0 + z / 2.0 * (1.0 + z / 3.0));
            let r2 = 1.0 + z * (1.0 + z / 2.0);
            let [phi1, psi1] = [h * (0.5 + z / 3.0 + z * z / 8.0), h * h * (1.0 / 6.0 + z / 12.0)];
            let [phi2, psi2] = [h * (1.0 / 3.0 + z / 4.0), h * h / 12.0];
            let (of_p, of_up) = (h * (r1 * x + u * (t * phi1 + psi1)), h * (t * phi1 + psi1));
            let of_pp = h * h * (r2 * x + u * (t * phi2 + psi2));
            let expected = [
                r * x + u * of_u,
                r,
                of_u,
                of_p,
                3.0 * r,
                3.0 * of_u,
                3.0 * of_p,
                0.0,
                0.0,
                0.0,
                3.0 * h * r1,
                3.0 * of_up,
                3.0 * of_pp,
            ];
            let found = [
                result.x[0],
                result.dx_dx0[0],
                result.dx_du[0],
                result.dx_dp[0],
                result.grad_x0[0],
                result.grad_u[0],
                result.grad_p[0],
                result.h_xx[0],
                result.h_xu[0],
                result.h_uu[0],
                result.h_xp[0],
                result.h_up[0],
                result.h_pp[0],
            ];
            // Numbers are below 64: `t u`, and what is summed up to them.
            let limit = rounding_tolerance(1, 4) * f64::EPSILON * 64.0;
            for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
                assert!((found - expected).abs() < limit, "{i} of {k}: {found:e}, {expected:e}");
            }
        }
    }
    Ok(())
}

/// `ẋ = −√x + u / p`: not finite for `x < 0` and for `p = 0`; for `x = 0` it has no derivative.
#[ode]
fn fragile(x: f64, u: f64, p: f64) -> f64 {
    u / p - x.sqrt()
}

/// Intervals that fail say why, as a single call does, leave their results as they were, and change
/// no bit of others.
#[test]
fn failures() -> Test {
    let count = 11;
    for bad in 0..count {
        for kind in 0..4 {
            let mut x0: Vec<_> = (0..count).map(|k| Vector1::new(1.0 + 0.1 * k as f64)).collect();
            let mut p = vec![Vector1::new(2.0); count];
            let u: Vec<_> = (0..count).map(|k| Vector1::new(0.1 * k as f64 + 0.1)).collect();
            let mut batch = Batch::<Fragile, Heun>::new(steps(3))?;
            let mut single = Erk::<Fragile, Heun>::new(steps(3))?;
            let lambda = [Vector1::new(1.0)];
            let all = |x0: &[_], p: &[_], batch: &mut Batch<_, Heun>, before: &Hessian<Fragile>| {
                let mut results = vec![*before; count];
                let intervals = Intervals { x0, u: &u, p, h: &[0.1], ..Default::default() };
                let outcome = batch.hessian(&intervals, &lambda, &mut results);
                (results, outcome)
            };
            let (expected, outcome) = all(&x0, &p, &mut batch, &Hessian::default());
            outcome?;
            match kind {
                0 => x0[bad][0] = f64::NAN,
                1 => x0[bad][0] = -1.0,
                2 => x0[bad][0] = 0.0,
                _ => p[bad][0] = 0.0,
            }
            let mut before = Hessian::default();
            before.h_xx = Vector1::new(42.0);
            let (results, outcome) = all(&x0, &p, &mut batch, &before);
            single.set_parameters(&p[bad])?;
            let error = single.hessian(&x0[bad], &u[bad], 0.1, &lambda[0]).unwrap_err();
            // A value that is not a number equals nothing, not itself.
            let same = |a: &dyn std::fmt::Debug| assert_eq!(format!("{a:?}"), format!("{error:?}"));
            match outcome {
                Err(BatchError::Intervals { failed: 1, first, error }) if first == bad => same(&error),
                other => panic!("{other:?}"),
            }
            same(&batch.status(bad).unwrap_err());
            for k in (0..count).filter(|k| *k != bad) {
                assert_eq!(batch.status(k), Ok(()));
                assert_eq!(results[k], expected[k], "interval {k} beside {bad}, {kind}");
            }
            assert_eq!(results[bad], before);
        }
    }
    Ok(())
}

/// A value that is not finite inside of a step, and finite ones at its end: an error of a single
/// call, whatever the others do.
#[ode]
fn hidden(x: [f64; 2]) -> [f64; 2] {
    [1.0 / x[1], 1.0]
}

#[test]
fn values_inside_of_a_step() -> Test {
    // At the stage in the middle, which the first row of the tableau alone sees, `x₁ = 0`.
    let tableau = Tableau::new([[0.0, 0.0], [1.0, 0.0]], [1.0, 0.0], [0.0, 1.0])?;
    let mut batch = Integrator::<Erk<Hidden, Custom<2>>>::with_tableau(steps(1), tableau)?;
    let mut single = Erk::<Hidden, Custom<2>>::with_tableau(steps(1), tableau)?;
    let x0: Vec<_> = (0..9).map(|k| vector![0.0, k as f64 - 4.0 + 0.5]).collect();
    let intervals = Intervals { x0: &x0, h: &[0.5], ..Default::default() };
    let mut results = vec![Nominal::default(); 9];
    assert!(batch.solve(&intervals, &mut results).is_err());
    for (k, x0) in x0.iter().enumerate() {
        let alone = single.solve(x0, &vector![], 0.5);
        assert_eq!(alone.is_err(), k == 3);
        assert_eq!(batch.status(k), alone.map(|_| ()));
    }
    Ok(())
}

/// What a group cannot have: the widest one that fits into the cache takes its place, and then each
/// interval alone. Memory is that of derivatives; ends are found side by side.
#[test]
fn statistics() -> Test {
    let horizon = quadrotor(16);
    let mut batch = Batch::<Quadrotor, Rk4>::new(steps(5))?;
    batch.forward(&horizon.intervals(), &mut vec![Forward::default(); 16])?;
    let statistics = *batch.statistics();
    assert_eq!((statistics.failed, statistics.redone), (0, 0));
    // A group counts once: four stages of five steps.
    let calls = statistics.groups + statistics.alone;
    assert_eq!((statistics.work.steps, statistics.work.jacobians), (5 * calls, 20 * calls));
    Ok(())
}

/// However many threads there are, results are the same to the last bit.
#[test]
fn threads() -> Test {
    let horizon = quadrotor(40);
    let mut batch = Batch::<Quadrotor, Rk4>::new(steps(2))?;
    let mut expected = vec![Hessian::default(); 40];
    batch.set_threads(1);
    batch.hessian(&horizon.intervals(), &horizon.lambda, &mut expected)?;
    for threads in [2, 3, 8] {
        batch.set_threads(threads);
        let mut results = vec![Hessian::default(); 40];
        batch.hessian(&horizon.intervals(), &horizon.lambda, &mut results)?;
        assert!(results == expected);
    }
    Ok(())
}
