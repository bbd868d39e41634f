//! Piecewise constant controls: against closed forms, one integration over a single interval, and
//! derivatives against each other and against differences.

use casados::prelude::*;
use nalgebra::{Vector1, Vector2, vector};

/// `ẋ = −p x + u`, `z = x²`
#[dae]
fn decay(xdot: f64, x: f64, z: f64, u: f64, p: f64) -> [f64; 2] {
    [xdot + p * x - u, z - x * x]
}

/// A pendulum with friction whose torque and length are controls.
#[dae]
fn swing(xdot: [f64; 2], x: [f64; 2], z: f64, u: [f64; 2], p: f64, t: f64) -> [f64; 3] {
    [
        xdot[0] - x[1],
        xdot[1] * (1.0 + 0.1 * x[0] * x[0]) + z * (1.0 + u[1]) + p * x[1] - u[0] * (1.0 + 0.1 * t),
        z * (1.0 + 0.2 * x[1] * x[1]) - x[0].sin(),
    ]
}

#[ode]
fn explicit(x: [f64; 2], u: [f64; 2], p: f64, t: f64) -> [f64; 2] {
    [x[1], u[0] * (1.0 + 0.1 * t) - (1.0 + u[1]) * x[0].sin() - p * x[1]]
}

const ENDS: [f64; 3] = [0.7, 1.9, 2.4];

#[track_caller]
fn assert_close(value: impl AsRef<[f64]>, expected: impl AsRef<[f64]>, tolerance: f64) {
    let (value, expected) = (value.as_ref(), expected.as_ref());
    assert_eq!(value.len(), expected.len());
    for (value, expected) in value.iter().zip(expected) {
        let error = (value - expected).abs();
        assert!(error <= tolerance * expected.abs().max(1.0), "{value} is not {expected}: {error:e}");
    }
}

fn options(rtol: f64) -> AdaptiveOptions {
    AdaptiveOptions { rtol, atol: rtol / 10.0, ..Default::default() }
}

/// On each interval `x = u/p + (x_k − u/p) e^{−p(t − t_k)}`: value, by `x₀`, by each `u_k`, by `p`.
fn closed_form(x0: f64, controls: &[f64; 3], p: f64, t: f64) -> (f64, f64, [f64; 3], f64) {
    let (mut x, mut dx, mut du, mut dp, mut begin) = (x0, 1.0, [0.0; 3], 0.0, 0.0);
    for (k, (u, end)) in controls.iter().zip(ENDS).enumerate() {
        let passed = t.min(end) - begin;
        if passed <= 0.0 {
            break;
        }
        let e = (-p * passed).exp();
        dp = e * dp - passed * e * (x - u / p) - u / (p * p) * (1.0 - e);
        for du in &mut du {
            *du *= e;
        }
        du[k] += (1.0 - e) / p;
        (x, dx, begin) = (u / p + (x - u / p) * e, dx * e, end);
    }
    (x, dx, du, dp)
}

#[test]
fn closed_form_of_decay() {
    let controls = [0.4, -1.2, 2.0];
    let list = controls.map(Vector1::new);
    let (x0, p) = (1.5, 0.8);
    let mut horizon = Piecewise::new(Adaptive::<Decay, Radau>::new(options(1e-10)).unwrap());
    horizon.integrator().set_parameters(&Vector1::new(p)).unwrap();
    let (x, dx, du, dp) = closed_form(x0, &controls, p, ENDS[2]);
    // Ten steps, each with an error of 1e-10, none of which grows.
    let tolerance = 2e-9;
    let end = horizon.solve(&Vector1::new(x0), &list, &ENDS).unwrap();
    assert_close(end.x, [x], tolerance);
    assert_close(end.z, [x * x], tolerance);
    assert_close(end.z0, [x0 * x0], tolerance);
    for t in [0.0, 0.3, 0.7, 1.0, 1.9, 2.1, 2.4] {
        let (x, ..) = closed_form(x0, &controls, p, t);
        let dense = horizon.dense(t).unwrap();
        // The polynomial of three stages is of order three, as is the estimate, which is held at
        // 1e-10^(2/3) = 2e-7.
        assert_close(dense.x, [x], 1e-6);
        assert_close(dense.z, [x * x], 1e-6);
    }
    let forward = horizon.forward(&Vector1::new(x0), &list, &ENDS).unwrap();
    assert_close(forward.dx_dx0, [dx], tolerance);
    assert_close(forward.dx_dp, [dp], tolerance);
    assert_close(forward.dz_dx0, [2.0 * x * dx], tolerance);
    assert_close(forward.dz_dp, [2.0 * x * dp], tolerance);
    for (k, du) in du.into_iter().enumerate() {
        assert_close(forward.dx_du[k], [du], tolerance);
        assert_close(forward.dz_du[k], [2.0 * x * du], tolerance);
    }
    let adjoint = horizon.adjoint(&Vector1::new(x0), &list, &ENDS, &vector![2.0]).unwrap();
    assert_close(adjoint.grad_x0, [2.0 * dx], tolerance);
    assert_close(adjoint.grad_p, [2.0 * dp], tolerance);
    for (k, du) in du.into_iter().enumerate() {
        assert_close(adjoint.grad_u[k], [2.0 * du], tolerance);
    }
    // Backwards in time from the end to the start.
    let back = [ENDS[1], ENDS[0], 0.0];
    let reversed = [list[2], list[1], list[0]];
    horizon.integrator().set_time(ENDS[2]).unwrap();
    let start = horizon.solve(&Vector1::new(x), &reversed, &back).unwrap();
    assert_close(start.x, [x0], 1e-7);
}

macro_rules! derivatives {
    ($integrator:ty) => {{
        const ROUNDING: f64 = 1e-12;
        let mut horizon = Piecewise::new(<$integrator>::new(options(1e-6)).unwrap());
        let (x0, p, lambda) = (vector![0.8, -0.4], Vector1::new(0.4), vector![0.6, -1.1]);
        let controls = [vector![0.3, 0.1], vector![-0.5, 0.2], vector![0.2, -0.3]];
        horizon.integrator().set_parameters(&p).unwrap();
        horizon.integrator().set_time(-0.1).unwrap();
        horizon.solve(&x0, &controls, &ENDS).unwrap();
        assert!(horizon.statistics().steps > 5);
        horizon.freeze().unwrap();
        let solved = *horizon.solve(&x0, &controls, &ENDS).unwrap();
        let forward = horizon.forward(&x0, &controls, &ENDS).unwrap();
        let adjoint = horizon.adjoint(&x0, &controls, &ENDS, &lambda).unwrap();
        let hessian = horizon.hessian(&x0, &controls, &ENDS, &lambda).unwrap();
        assert_close(forward.nominal.x, hessian.forward.nominal.x, ROUNDING);
        assert_close(solved.x, forward.nominal.x, ROUNDING);
        assert_close(adjoint.grad_x0, forward.dx_dx0.transpose() * lambda, ROUNDING);
        assert_close(adjoint.grad_p, forward.dx_dp.transpose() * lambda, ROUNDING);
        assert_close(hessian.adjoint.grad_x0, adjoint.grad_x0, ROUNDING);
        assert_close(hessian.adjoint.grad_p, adjoint.grad_p, ROUNDING);
        for k in 0..3 {
            assert_close(adjoint.grad_u[k], forward.dx_du[k].transpose() * lambda, ROUNDING);
            assert_close(hessian.adjoint.grad_u[k], adjoint.grad_u[k], ROUNDING);
            assert_close(hessian.forward.dx_du[k], forward.dx_du[k], ROUNDING);
        }
        // Rows and columns of the Hessian in the order (x₀, u₀, u₁, u₂, p).
        let whole = |r: usize, c: usize| {
            let (r, c) = (r.min(c), r.max(c));
            match (r, c) {
                (0..2, 0..2) => hessian.h_xx[(r, c)],
                (0..2, 2..8) => hessian.h_xu[(c - 2) / 2][(r, c % 2)],
                (0..2, 8) => hessian.h_xp[(r, 0)],
                (2..8, 2..8) => hessian.h_uu[(r - 2) / 2 * 3 + (c - 2) / 2][(r % 2, c % 2)],
                (2..8, 8) => hessian.h_up[(r - 2) / 2][(r % 2, 0)],
                _ => hessian.h_pp[(0, 0)],
            }
        };
        // Differences of order four with steps of 1e-3, of numbers of size one: 1e-12 of truncation
        // and as much rounding.
        let e = 1e-3;
        for direction in 0..9 {
            let mut moved = |step: f64| {
                let (mut x0, mut controls, mut p) = (x0, controls, p);
                match direction {
                    0..2 => x0[direction] += step,
                    2..8 => controls[(direction - 2) / 2][direction % 2] += step,
                    _ => p[0] += step,
                }
                horizon.integrator().set_parameters(&p).unwrap();
                let adjoint = horizon.adjoint(&x0, &controls, &ENDS, &lambda).unwrap();
                let mut gradient = Vec::from(adjoint.grad_x0.as_slice());
                adjoint.grad_u.iter().for_each(|u| gradient.extend_from_slice(u.as_slice()));
                gradient.extend_from_slice(adjoint.grad_p.as_slice());
                gradient.push(adjoint.nominal.x.dot(&lambda));
                gradient
            };
            let values = [-2.0, -1.0, 1.0, 2.0].map(|k| moved(k * e));
            let column: Vec<f64> = (0..10)
                .map(|i| (values[0][i] - 8.0 * values[1][i] + 8.0 * values[2][i] - values[3][i]) / (12.0 * e))
                .collect();
            horizon.integrator().set_parameters(&p).unwrap();
            let expected: Vec<f64> = (0..9).map(|row| whole(row, direction)).collect();
            assert_close(&column[..9], expected, 1e-9);
            let gradient = match direction {
                0..2 => adjoint.grad_x0[direction],
                2..8 => adjoint.grad_u[(direction - 2) / 2][direction % 2],
                _ => adjoint.grad_p[0],
            };
            assert_close([column[9]], [gradient], 1e-9);
        }
    }};
}

#[test]
fn derivatives_by_three_methods() {
    derivatives!(Adaptive<Swing, Radau>);
    derivatives!(Adaptive<Explicit, DormandPrince8>);
}

#[test]
fn one_interval() {
    let (x0, p, u): (Vector2<f64>, _, _) = (vector![0.8, -0.4], Vector1::new(0.4), vector![0.3, 0.1]);
    let mut single = Adaptive::<Swing, RadauIIA<5>>::new(options(1e-8)).unwrap();
    let mut horizon = Piecewise::new(Adaptive::<Swing, RadauIIA<5>>::new(options(1e-8)).unwrap());
    single.set_parameters(&p).unwrap();
    horizon.integrator().set_parameters(&p).unwrap();
    let lambda = vector![0.6, -1.1];
    let expected = *single.hessian(&x0, &u, 1.5, &lambda).unwrap();
    let found = horizon.hessian(&x0, &[u], &[1.5], &lambda).unwrap();
    assert_eq!(found.forward.nominal, expected.nominal);
    assert_eq!(found.forward.dx_du[0], expected.dx_du);
    assert_eq!(found.forward.dz_dp, expected.dz_dp);
    assert_eq!(found.adjoint.grad_u[0], expected.grad_u);
    assert_close(found.h_uu[0], expected.h_uu, 1e-14);
    assert_close(found.h_xp, expected.h_xp, 1e-14);
    assert_eq!(horizon.statistics(), single.statistics());
}

#[test]
fn invalid_arguments() {
    let mut horizon = Piecewise::new(Adaptive::<Decay, Radau>::new(options(1e-6)).unwrap());
    let (x0, u) = (Vector1::new(1.0), Vector1::new(0.0));
    assert_eq!(horizon.solve(&x0, &[u], &[1.0]).unwrap_err(), Error::ParametersNotSet);
    horizon.integrator().set_parameters(&Vector1::new(1.0)).unwrap();
    let error = horizon.solve(&x0, &[u], &ENDS).unwrap_err();
    assert_eq!(error, Error::Intervals { controls: 1, ends: 3 });
    assert_eq!(
        error.to_string(),
        "1 controls for 3 intervals: give one control for each interval, and at least one interval"
    );
    assert_eq!(horizon.solve(&x0, &[], &[]).unwrap_err(), Error::Intervals { controls: 0, ends: 0 });
    let error = horizon.solve(&x0, &[u, u], &[2.0, 1.0]).unwrap_err();
    assert_eq!(error, Error::Unordered { index: 0, t: 2.0, before: 0.0, end: 1.0 });
    assert_eq!(
        error.to_string(),
        "the times are not in order: element 0 is 2, and not between the one before it, 0, and the end, 1"
    );
    let times = horizon.integrator().solve_at(&x0, &u, 1.0, &[0.5, 0.2], |_, _| ());
    assert_eq!(times.unwrap_err(), Error::Unordered { index: 1, t: 0.2, before: 0.5, end: 1.0 });
    assert_eq!(horizon.freeze().unwrap_err(), Error::NoResult);
    assert_eq!(horizon.dense(0.5).unwrap_err(), Error::NoResult);
    horizon.solve(&x0, &[u, u], &[1.0, 2.0]).unwrap();
    horizon.freeze().unwrap();
    assert!(matches!(horizon.solve(&x0, &[u, u], &[1.0, 2.5]), Err(Error::OutsideInterval { t: 2.5, .. })));
    assert!(matches!(horizon.solve(&x0, &[u], &[1.0]), Err(Error::Intervals { .. })));
    horizon.thaw();
    let x = horizon.solve(&x0, &[u, u], &[1.0, 2.5]).unwrap().x;
    assert_close(x, [(-2.5_f64).exp()], 1e-4);
    assert!(matches!(horizon.dense(2.6), Err(Error::OutsideInterval { .. })));
}

/// `ẋ = 10³⁰⁸ p`
#[ode]
fn pushed(_x: f64, _u: f64, p: f64) -> f64 {
    1e308 * p
}

/// `ẋ = 10⁴ u` and `z = 10³⁰⁶ x`
#[dae]
fn steep(xdot: f64, x: f64, z: f64, u: f64) -> [f64; 2] {
    [xdot - 1e4 * u, 1e-306 * z - x]
}

/// Those of each interval are numbers.
#[test]
fn overflow_of_derivatives() {
    let adaptive = Adaptive::<Pushed, DormandPrince5>::new(options(1e-6)).unwrap();
    let mut horizon = Piecewise::new(adaptive);
    horizon.integrator().set_parameters(&vector![0.0]).unwrap();
    let (x0, u, ends) = (Vector1::new(1.0), [vector![0.0]; 4], [1.0, 2.0, 3.0, 4.0]);
    assert_eq!(horizon.solve(&x0, &u, &ends).unwrap().x, x0);
    for result in [
        horizon.forward(&x0, &u, &ends).map(|_| ()),
        horizon.adjoint(&x0, &u, &ends, &Vector1::new(1.0)).map(|_| ()),
        horizon.hessian(&x0, &u, &ends, &Vector1::new(1.0)).map(|_| ()),
    ] {
        assert!(matches!(result, Err(Error::Overflow { .. })), "{result:?}");
    }

    let mut horizon = Piecewise::new(Adaptive::<Steep, Radau>::new(options(1e-6)).unwrap());
    let (x0, u) = (Vector1::new(0.0), [vector![0.0]; 2]);
    assert!(horizon.solve(&x0, &u, &ends[..2]).is_ok());
    let result = horizon.forward(&x0, &u, &ends[..2]).map(|_| ());
    assert!(matches!(result, Err(Error::Overflow { .. })), "{result:?}");
}
