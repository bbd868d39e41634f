//! Integrals of functions along the solution, in every integrator: against additional states of a
//! model, which give the same sums; against closed forms; first and second derivatives against each
//! other and against differences.

mod least_squares;
mod piecewise;

use casados::prelude::*;
use nalgebra::{Matrix1, Vector1, Vector2, matrix, vector};

/// A pendulum with friction and an algebraic state, driven by `u`; `x = (angle, rate)`.
#[dae]
fn swing(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2], t: f64) -> [f64; 3] {
    [
        xdot[0] - x[1],
        xdot[1] * (1.0 + 0.1 * x[0] * x[0]) + z + p[1] * x[1] - u * (1.0 + 0.1 * t),
        z * (1.0 + 0.2 * x[1] * x[1]) - p[0] * x[0].sin(),
    ]
}

#[function]
fn outputs(x: [f64; 2], z: f64, u: f64, p: [f64; 2], t: f64) -> [f64; 2] {
    [x[0] * x[0] + z * x[1] * p[0] + u * u * x[0], (x[1] * z).cos() * p[1] * (0.5 + t)]
}

/// The same with the integrals as states.
#[dae]
fn with_states(xdot: [f64; 4], x: [f64; 4], z: f64, u: f64, p: [f64; 2], t: f64) -> [f64; 5] {
    [
        xdot[0] - x[1],
        xdot[1] * (1.0 + 0.1 * x[0] * x[0]) + z + p[1] * x[1] - u * (1.0 + 0.1 * t),
        z * (1.0 + 0.2 * x[1] * x[1]) - p[0] * x[0].sin(),
        xdot[2] - (x[0] * x[0] + z * x[1] * p[0] + u * u * x[0]),
        xdot[3] - (x[1] * z).cos() * p[1] * (0.5 + t),
    ]
}

/// The same swing, explicit.
#[ode]
fn explicit(x: [f64; 2], u: f64, p: [f64; 2], t: f64) -> [f64; 2] {
    let z = p[0] * x[0].sin();
    [x[1], (u * (1.0 + 0.1 * t) - z - p[1] * x[1]) / (1.0 + 0.1 * x[0] * x[0])]
}

#[function]
fn explicit_outputs(x: [f64; 2], u: f64, p: [f64; 2], t: f64) -> [f64; 2] {
    [x[0] * x[0] + x[1] * p[0] + u * u * x[0], (x[1] * x[0]).cos() * p[1] * (0.5 + t)]
}

#[ode]
fn explicit_with_states(x: [f64; 4], u: f64, p: [f64; 2], t: f64) -> [f64; 4] {
    let z = p[0] * x[0].sin();
    [
        x[1],
        (u * (1.0 + 0.1 * t) - z - p[1] * x[1]) / (1.0 + 0.1 * x[0] * x[0]),
        x[0] * x[0] + x[1] * p[0] + u * u * x[0],
        (x[1] * x[0]).cos() * p[1] * (0.5 + t),
    ]
}

const X0: Vector2<f64> = vector![0.8, -0.4];
const U: Vector1<f64> = vector![0.3];
const P: Vector2<f64> = vector![1.7, 0.4];
const LAMBDA: Vector2<f64> = vector![0.6, -1.1];
const NU: Vector2<f64> = vector![-0.7, 1.3];

/// A few hundred roundings of terms of size one.
const ROUNDING: f64 = 2e-13;

#[track_caller]
fn assert_close(value: impl AsRef<[f64]>, expected: impl AsRef<[f64]>, tolerance: f64) {
    let (value, expected) = (value.as_ref(), expected.as_ref());
    assert_eq!(value.len(), expected.len());
    for (value, expected) in value.iter().zip(expected) {
        let error = (value - expected).abs();
        assert!(error <= tolerance * expected.abs().max(1.0), "{value} is not {expected}: {error:e}");
    }
}

/// Every mode of an integrator with an integrand against that of the model with two states more.
macro_rules! same_as_states {
    ($small:expr, $large:expr, $outputs:ty) => {{
        let (mut small, mut large) = ($small, $large);
        let mut integral = Quadrature::<$outputs>::new();
        let x0 = vector![X0[0], X0[1], 0.0, 0.0];
        let lambda = vector![LAMBDA[0], LAMBDA[1], NU[0], NU[1]];
        small.set_parameters(&P).unwrap();
        large.set_parameters(&P).unwrap();
        small.set_time(0.2).unwrap();
        large.set_time(0.2).unwrap();
        let h = 0.7;

        let expected = large.solve(&x0, &U, h).unwrap().x;
        let x = small.with(&mut integral).solve(&X0, &U, h).unwrap().x;
        assert_close(x, expected.fixed_rows::<2>(0).into_owned(), ROUNDING);
        assert_close(integral.q, expected.fixed_rows::<2>(2).into_owned(), ROUNDING);

        let expected = *large.forward(&x0, &U, h).unwrap();
        integral.q.fill(f64::NAN);
        small.with(&mut integral).forward(&X0, &U, h).unwrap();
        assert_close(integral.q, expected.x.fixed_rows::<2>(2).into_owned(), ROUNDING);
        assert_close(integral.dq_dx0, expected.dx_dx0.fixed_view::<2, 2>(2, 0).into_owned(), ROUNDING);
        assert_close(integral.dq_du, expected.dx_du.fixed_rows::<2>(2).into_owned(), ROUNDING);
        assert_close(integral.dq_dp, expected.dx_dp.fixed_rows::<2>(2).into_owned(), ROUNDING);

        integral.nu = NU;
        integral.q.fill(f64::NAN);
        let expected = *large.adjoint(&x0, &U, h, &lambda).unwrap();
        let adjoint = *small.with(&mut integral).adjoint(&X0, &U, h, &LAMBDA).unwrap();
        assert_close(integral.q, expected.x.fixed_rows::<2>(2).into_owned(), ROUNDING);
        assert_close(adjoint.grad_x0, expected.grad_x0.fixed_rows::<2>(0).into_owned(), ROUNDING);
        assert_close(adjoint.grad_u, expected.grad_u, ROUNDING);
        assert_close(adjoint.grad_p, expected.grad_p, ROUNDING);

        integral.dq_dp.fill(f64::NAN);
        let expected = *large.hessian(&x0, &U, h, &lambda).unwrap();
        let hessian = *small.with(&mut integral).hessian(&X0, &U, h, &LAMBDA).unwrap();
        assert_close(integral.dq_dp, expected.dx_dp.fixed_rows::<2>(2).into_owned(), ROUNDING);
        assert_close(hessian.grad_x0, adjoint.grad_x0, ROUNDING);
        assert_close(hessian.grad_u, adjoint.grad_u, ROUNDING);
        assert_close(hessian.grad_p, adjoint.grad_p, ROUNDING);
        assert_close(hessian.h_xx, expected.h_xx.fixed_view::<2, 2>(0, 0).into_owned(), ROUNDING);
        assert_close(hessian.h_xu, expected.h_xu.fixed_rows::<2>(0).into_owned(), ROUNDING);
        assert_close(hessian.h_uu, expected.h_uu, ROUNDING);
        assert_close(hessian.h_xp, expected.h_xp.fixed_rows::<2>(0).into_owned(), ROUNDING);
        assert_close(hessian.h_up, expected.h_up, ROUNDING);
        assert_close(hessian.h_pp, expected.h_pp, ROUNDING);

        // Without the integrand nothing of it is left.
        let alone = *small.hessian(&X0, &U, h, &LAMBDA).unwrap();
        assert!((alone.h_pp - hessian.h_pp).norm() > 1e-3);
        let gradient = *small.adjoint(&X0, &U, h, &LAMBDA).unwrap();
        assert_close(alone.grad_p, gradient.grad_p, ROUNDING);
        let forward = *small.forward(&X0, &U, h).unwrap();
        assert_close(alone.grad_p, forward.dx_dp.transpose() * LAMBDA, ROUNDING);
    }};
}

/// Newton's method until nothing changes: both models are at the same point.
fn exact_newton_options(steps: usize) -> Options {
    Options { steps, ..Default::default() }
}

#[test]
fn integrals_as_states() {
    same_as_states!(
        Irk::<Swing, Gauss<3>>::new(exact_newton_options(4)).unwrap(),
        Irk::<WithStates, Gauss<3>>::new(exact_newton_options(4)).unwrap(),
        Outputs
    );
    same_as_states!(
        Irk::<Swing, RadauIIA<2>>::new(exact_newton_options(5)).unwrap(),
        Irk::<WithStates, RadauIIA<2>>::new(exact_newton_options(5)).unwrap(),
        Outputs
    );
    same_as_states!(
        Irk::<Swing, Gauss<1>>::new(exact_newton_options(1)).unwrap(),
        Irk::<WithStates, Gauss<1>>::new(exact_newton_options(1)).unwrap(),
        Outputs
    );
    same_as_states!(
        Irk::<Explicit, Gauss<2>>::new(exact_newton_options(3)).unwrap(),
        Irk::<ExplicitWithStates, Gauss<2>>::new(exact_newton_options(3)).unwrap(),
        ExplicitOutputs
    );
    same_as_states!(
        Erk::<Explicit, Rk4>::new(exact_newton_options(3)).unwrap(),
        Erk::<ExplicitWithStates, Rk4>::new(exact_newton_options(3)).unwrap(),
        ExplicitOutputs
    );
}

/// Derivatives of a run whose steps are kept, against each other and against differences of the
/// values.
macro_rules! derivatives_of_kept_steps {
    ($integrator:ty, $outputs:ty) => {{
        let options = AdaptiveOptions { rtol: 1e-7, atol: 1e-8, ..Default::default() };
        let mut adaptive = <$integrator>::new(options).unwrap();
        adaptive.set_parameters(&P).unwrap();
        let mut integral = Quadrature::<$outputs>::new();
        let mut fit = LeastSquares::<$outputs>::new(&matrix![1.5, 0.2; 0.2, 0.7]);
        integral.nu = NU;
        let end = 2.5;
        adaptive.solve(&X0, &U, end).unwrap();
        assert!(adaptive.statistics().steps > 3);
        adaptive.freeze().unwrap();

        let forward = *adaptive.with(&mut integral).forward(&X0, &U, end).unwrap();
        let x0 = forward.dx_dx0.transpose() * LAMBDA + integral.dq_dx0.transpose() * NU;
        let p = forward.dx_dp.transpose() * LAMBDA + integral.dq_dp.transpose() * NU;
        let u = forward.dx_du.transpose() * LAMBDA + integral.dq_du.transpose() * NU;
        let adjoint = *adaptive.with(&mut integral).adjoint(&X0, &U, end, &LAMBDA).unwrap();
        assert_close(adjoint.grad_x0, x0, ROUNDING);
        assert_close(adjoint.grad_p, p, ROUNDING);
        assert_close(adjoint.grad_u, u, ROUNDING);

        // Central differences of order four with steps of 1e-3: errors of 1e-12 of the value and of
        // 1e-12 by rounding.
        let e = 1e-3;
        let difference = |f: &mut dyn FnMut(f64) -> [f64; 8]| {
            let values = [-2.0, -1.0, 1.0, 2.0].map(|k| f(k * e));
            core::array::from_fn::<f64, 8, _>(|i| {
                (values[0][i] - 8.0 * values[1][i] + 8.0 * values[2][i] - values[3][i]) / (12.0 * e)
            })
        };
        let hessian = *adaptive.with(&mut integral).hessian(&X0, &U, end, &LAMBDA).unwrap();
        assert_close(hessian.grad_p, adjoint.grad_p, ROUNDING);
        let squares = *adaptive.with(&mut fit).hessian(&X0, &U, end, &LAMBDA).unwrap();
        for direction in 0..5 {
            let mut moved = |step: f64| {
                let (mut x0, mut u, mut p) = (X0, U, P);
                match direction {
                    0 | 1 => x0[direction] += step,
                    2 => u[0] += step,
                    _ => p[direction - 3] += step,
                }
                adaptive.set_parameters(&p).unwrap();
                let mut integral = Quadrature::<$outputs>::new();
                integral.nu = NU;
                let gradient = *adaptive.with(&mut integral).adjoint(&x0, &u, end, &LAMBDA).unwrap();
                let mut fit = LeastSquares::<$outputs>::new(&matrix![1.5, 0.2; 0.2, 0.7]);
                let second = *adaptive.with(&mut fit).adjoint(&x0, &u, end, &LAMBDA).unwrap();
                adaptive.set_parameters(&P).unwrap();
                let ([a, b], [c], [d, e]) = (gradient.grad_x0.into(), gradient.grad_u.into(), gradient.grad_p.into());
                let f: [f64; 2] = second.grad_p.into();
                let _ = integral.q;
                [a, b, c, d, e, f[0], f[1], integral.q.dot(&NU)]
            };
            let column = difference(&mut moved);
            let (expected, gradient) = match direction {
                0 | 1 => {
                    let d = direction;
                    (
                        [hessian.h_xx[(0, d)], hessian.h_xx[(1, d)], hessian.h_xu[(d, 0)], hessian.h_xp[(d, 0)],
                         hessian.h_xp[(d, 1)], squares.h_xp[(d, 0)], squares.h_xp[(d, 1)]],
                        (integral.dq_dx0.transpose() * NU)[d],
                    )
                }
                2 => (
                    [hessian.h_xu[(0, 0)], hessian.h_xu[(1, 0)], hessian.h_uu[(0, 0)], hessian.h_up[(0, 0)],
                     hessian.h_up[(0, 1)], squares.h_up[(0, 0)], squares.h_up[(0, 1)]],
                    (integral.dq_du.transpose() * NU)[0],
                ),
                _ => {
                    let d = direction - 3;
                    (
                        [hessian.h_xp[(0, d)], hessian.h_xp[(1, d)], hessian.h_up[(0, d)], hessian.h_pp[(0, d)],
                         hessian.h_pp[(1, d)], squares.h_pp[(0, d)], squares.h_pp[(1, d)]],
                        (integral.dq_dp.transpose() * NU)[d],
                    )
                }
            };
            assert_close(&column[..7], expected, 1e-9);
            assert_close([column[7]], [gradient], 1e-9);
        }
    }};
}

#[test]
fn derivatives_of_adaptive_runs() {
    derivatives_of_kept_steps!(Adaptive<Swing, Radau>, Outputs);
    derivatives_of_kept_steps!(Adaptive<Swing, RadauIIA<3>>, Outputs);
    derivatives_of_kept_steps!(Adaptive<Explicit, DormandPrince5>, ExplicitOutputs);
}

/// `ẋ = −p x + u`
#[ode]
fn decay(x: f64, u: f64, p: f64) -> f64 {
    u - p * x
}

#[function]
fn logarithm(x: f64, _u: f64, _p: f64) -> [f64; 2] {
    [x, (x - 0.9).ln()]
}

#[test]
fn integrands_that_are_not_finite() {
    let mut integral = Quadrature::<Logarithm>::new();
    let (x0, u, p) = (vector![1.0], vector![0.0], vector![1.0]);
    let check = |error: Error| {
        let Error::NonFiniteFunction { function, output, value, at } = error else { panic!("{error}") };
        assert_eq!((function, output), ("Logarithm", 1));
        assert!(value.is_nan());
        assert!(at.step > 0, "{at}");
        assert!(
            error.to_string().starts_with("output 1 of the function Logarithm is NaN at step "),
            "{error}"
        );
    };
    let mut irk = Irk::<Decay, Gauss<2>>::new(Options { steps: 4, ..Default::default() }).unwrap();
    irk.set_parameters(&p).unwrap();
    check(irk.with(&mut integral).solve(&x0, &u, 0.3).unwrap_err());
    check(irk.with(&mut integral).forward(&x0, &u, 0.3).unwrap_err());
    let mut erk = Erk::<Decay, Rk4>::new(Options { steps: 4, ..Default::default() }).unwrap();
    erk.set_parameters(&p).unwrap();
    check(erk.with(&mut integral).solve(&x0, &u, 0.3).unwrap_err());
    let mut radau = Adaptive::<Decay, RadauIIA<3>>::new(AdaptiveOptions::default()).unwrap();
    radau.set_parameters(&p).unwrap();
    check(radau.with(&mut integral).forward(&x0, &u, 0.3).unwrap_err());
    // The integrator is as good as before.
    let x = radau.solve(&x0, &u, 0.3).unwrap().x;
    assert_close(x, [(-0.3_f64).exp()], 1e-5);
}

/// The interval may have no length, and a model no outputs that depend on anything.
#[function]
fn constant(_x: f64, _u: f64, _p: f64) -> f64 {
    2.5
}

#[test]
fn degenerate_integrals() {
    let (x0, u, p) = (vector![1.0], vector![0.0], vector![1.0]);
    let mut integral = Quadrature::<Constant>::boxed().unwrap();
    let mut radau = Adaptive::<Decay, Radau>::new(AdaptiveOptions::default()).unwrap();
    radau.set_parameters(&p).unwrap();
    radau.with(&mut *integral).forward(&x0, &u, 0.0).unwrap();
    assert_eq!(integral.q, Vector1::new(0.0));
    radau.with(&mut *integral).forward(&x0, &u, -2.0).unwrap();
    assert_close(integral.q, [-5.0], 1e-14);
    assert_eq!(integral.dq_dx0, Matrix1::new(0.0));
    let mut irk = Irk::<Decay, Gauss<2>>::new(Options { steps: 3, ..Default::default() }).unwrap();
    irk.set_parameters(&p).unwrap();
    irk.with(&mut *integral).hessian(&x0, &u, 2.0, &vector![0.0]).unwrap();
    assert_close(integral.q, [5.0], 1e-14);
}
