//! Integrals of functions along the solution, in every integrator: against additional states of a
//! model, which give the same sums; against closed forms; first and second derivatives against each
//! other and against differences.

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
fn exact(steps: usize) -> Options {
    Options { steps, ..Default::default() }
}

#[test]
fn the_same_as_states_of_the_model() {
    same_as_states!(
        Irk::<Swing, Gauss<3>>::new(exact(4)).unwrap(),
        Irk::<WithStates, Gauss<3>>::new(exact(4)).unwrap(),
        Outputs
    );
    same_as_states!(
        Irk::<Swing, RadauIIA<2>>::new(exact(5)).unwrap(),
        Irk::<WithStates, RadauIIA<2>>::new(exact(5)).unwrap(),
        Outputs
    );
    same_as_states!(
        Irk::<Swing, Gauss<1>>::new(exact(1)).unwrap(),
        Irk::<WithStates, Gauss<1>>::new(exact(1)).unwrap(),
        Outputs
    );
    same_as_states!(
        Irk::<Explicit, Gauss<2>>::new(exact(3)).unwrap(),
        Irk::<ExplicitWithStates, Gauss<2>>::new(exact(3)).unwrap(),
        ExplicitOutputs
    );
    same_as_states!(
        Erk::<Explicit, Rk4>::new(exact(3)).unwrap(),
        Erk::<ExplicitWithStates, Rk4>::new(exact(3)).unwrap(),
        ExplicitOutputs
    );
}

/// `ẋ = −p x + u`
#[ode]
fn decay(x: f64, u: f64, p: f64) -> f64 {
    u - p * x
}

#[function]
fn residuals(x: f64, u: f64, p: f64) -> [f64; 2] {
    [x - 0.3, 0.5 * u + p]
}

const T: f64 = 1.3;

/// With `u = 0`, `x = x₀ e^{−pt}` and `r = (x − 0.3, p)`:
///
/// ```text
/// ∫ r₀ r₀ = x₀² e₂ − 0.6 x₀ e₁ + 0.09 T        e_k = (1 − e^{−kpT})/(kp)
/// dr₀/dx₀ = e^{−pt}, dr₀/du = (1 − e^{−pt})/p, dr₀/dp = −t x₀ e^{−pt}
/// ```
struct Exact {
    value: f64,
    grad: [f64; 3],
    hessian: [[f64; 3]; 3],
}

fn exact_least_squares(x0: f64, p: f64, w: [[f64; 2]; 2]) -> Exact {
    let n = 400;
    let mut exact = Exact { value: 0.0, grad: [0.0; 3], hessian: [[0.0; 3]; 3] };
    // Boole's rule on 400 pieces of length 0.003: an error of (0.003)^6.
    let boole = [7.0, 32.0, 12.0, 32.0, 7.0];
    for piece in 0..n {
        for (node, weight) in boole.iter().enumerate() {
            let h = T / f64::from(n);
            let t = h * (f64::from(piece) + node as f64 / 4.0);
            let weight = weight * h / 90.0;
            let e = (-p * t).exp();
            let r = [x0 * e - 0.3, p];
            let d = [[e, 0.0], [(1.0 - e) / p, 0.5], [-t * x0 * e, 1.0]];
            for k in 0..2 {
                for l in 0..2 {
                    exact.value += 0.5 * weight * r[k] * w[k][l] * r[l];
                    for i in 0..3 {
                        exact.grad[i] += weight * d[i][k] * w[k][l] * r[l];
                        for j in 0..3 {
                            exact.hessian[i][j] += weight * d[i][k] * w[k][l] * d[j][l];
                        }
                    }
                }
            }
        }
    }
    exact
}

fn assert_least_squares(found: &LeastSquares<Residuals>, exact: &Exact, tolerance: f64) {
    assert_close([found.value], [exact.value], tolerance);
    assert_close([found.grad_x0[0], found.grad_u[0], found.grad_p[0]], exact.grad, tolerance);
    assert_close(
        [found.h_xx[0], found.h_xu[0], found.h_uu[0], found.h_xp[0], found.h_up[0], found.h_pp[0]],
        [
            exact.hessian[0][0],
            exact.hessian[0][1],
            exact.hessian[1][1],
            exact.hessian[0][2],
            exact.hessian[1][2],
            exact.hessian[2][2],
        ],
        tolerance,
    );
}

#[test]
fn least_squares_against_the_closed_form() {
    let (x0, u, p) = (vector![1.4], vector![0.0], vector![0.9]);
    let w = [[2.0, 0.5], [0.5, 3.0]];
    let weights = matrix![2.0, 0.5; 0.5, 3.0];
    let exact = exact_least_squares(x0[0], p[0], w);

    let mut fit = LeastSquares::<Residuals>::new(&weights);
    let mut irk = Irk::<Decay, Gauss<4>>::new(Options { steps: 6, ..Default::default() }).unwrap();
    irk.set_parameters(&p).unwrap();
    irk.with(&mut fit).forward(&x0, &u, T).unwrap();
    // Order eight with steps of 0.2: 1e-12.
    assert_least_squares(&fit, &exact, 1e-11);

    let mut fit = LeastSquares::<Residuals>::new(&weights);
    let mut erk = Erk::<Decay, DormandPrince8>::new(Options { steps: 12, ..Default::default() }).unwrap();
    erk.set_parameters(&p).unwrap();
    erk.with(&mut fit).forward(&x0, &u, T).unwrap();
    assert_least_squares(&fit, &exact, 1e-11);

    let options = AdaptiveOptions { rtol: 1e-11, atol: 1e-12, ..Default::default() };
    let mut fit = LeastSquares::<Residuals>::new(&weights);
    let mut radau = Adaptive::<Decay, Radau>::new(options).unwrap();
    radau.set_parameters(&p).unwrap();
    radau.with(&mut fit).forward(&x0, &u, T).unwrap();
    assert_least_squares(&fit, &exact, 1e-9);
    let mut fit = LeastSquares::<Residuals>::new(&weights);
    let mut pair = Adaptive::<Decay, DormandPrince8>::new(options).unwrap();
    pair.set_parameters(&p).unwrap();
    pair.with(&mut fit).forward(&x0, &u, T).unwrap();
    assert_least_squares(&fit, &exact, 1e-9);
}

/// Of a linear model and residual the matrix of Gauss and Newton is the exact Hessian.
#[ode]
fn linear(x: [f64; 2], u: f64, t: f64) -> [f64; 2] {
    [x[1] * (1.0 + t), -2.0 * x[0] - 0.3 * x[1] + u]
}

#[function]
fn tracking(x: [f64; 2], u: f64) -> [f64; 3] {
    [x[0] - 1.0, 0.4 * x[1] + 0.2 * u, 0.1 * u]
}

#[test]
fn gauss_newton_is_exact_where_nothing_is_curved() {
    let weights = matrix![2.0, 0.5, 0.0; 0.5, 3.0, -0.1; 0.0, -0.1, 1.0];
    let (x0, u, zero) = (vector![0.4, -0.2], vector![0.7], vector![0.0, 0.0]);
    let mut fit = LeastSquares::<Tracking>::new(&weights);
    let mut irk = Irk::<Linear, RadauIIA<3>>::new(Options { steps: 3, ..Default::default() }).unwrap();
    let hessian = *irk.with(&mut fit).hessian(&x0, &u, 0.9, &zero).unwrap();
    assert_close(hessian.h_xx, fit.h_xx, ROUNDING);
    assert_close(hessian.h_xu, fit.h_xu, ROUNDING);
    assert_close(hessian.h_uu, fit.h_uu, ROUNDING);
    assert_close(hessian.grad_x0, fit.grad_x0, ROUNDING);
    assert_close(hessian.grad_u, fit.grad_u, ROUNDING);
    assert!(fit.h_xx.determinant() > 0.1);
    // φ is quadratic: φ(w + d) = φ(w) + gᵀd + dᵀHd/2.
    let d = vector![0.5, -1.5];
    let mut moved = LeastSquares::<Tracking>::new(&weights);
    irk.with(&mut moved).solve(&(x0 + d), &u, 0.9).unwrap();
    let expected = fit.value + fit.grad_x0.dot(&d) + 0.5 * (d.transpose() * fit.h_xx * d)[0];
    assert_close([moved.value], [expected], ROUNDING);

    let mut erk = Erk::<Linear, Rk4>::new(Options { steps: 3, ..Default::default() }).unwrap();
    let hessian = *erk.with(&mut fit).hessian(&x0, &u, 0.9, &zero).unwrap();
    assert_close(hessian.h_xx, fit.h_xx, ROUNDING);
    assert_close(hessian.h_xu, fit.h_xu, ROUNDING);
    assert_close(hessian.h_uu, fit.h_uu, ROUNDING);
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

#[function]
fn logarithm(x: f64, _u: f64, _p: f64) -> [f64; 2] {
    [x, (x - 0.9).ln()]
}

#[test]
fn values_that_are_not_finite_are_errors() {
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

/// Over several intervals with controls of their own: what the integrals are as states.
#[test]
fn integrals_over_piecewise_constant_controls() {
    let controls = [0.3, -0.7, 1.1].map(Vector1::new);
    let ends = [0.4, 0.9, 1.2];
    let nu = vector![0.9, -0.5];
    let options = AdaptiveOptions { rtol: 1e-11, atol: 1e-12, ..Default::default() };
    let mut horizon = Piecewise::new(Adaptive::<Swing, Radau>::new(options).unwrap());
    horizon.integrator().set_parameters(&P).unwrap();
    let mut states = Piecewise::new(Adaptive::<WithStates, Radau>::new(options).unwrap());
    states.integrator().set_parameters(&P).unwrap();
    let start = vector![X0[0], X0[1], 0.0, 0.0];
    let lambda = vector![LAMBDA[0], LAMBDA[1], nu[0], nu[1]];
    let expected = states.adjoint(&start, &controls, &ends, &lambda).unwrap();

    let mut integral = Quadrature::<Outputs>::new();
    integral.nu = nu;
    let end = horizon.with(&mut integral).solve(&X0, &controls, &ends).unwrap().x;
    let q = integral.q;
    let found = horizon.with(&mut integral).adjoint(&X0, &controls, &ends, &LAMBDA).unwrap();
    assert_eq!((found.nominal.x, integral.q), (end, q));
    // Two sequences of a dozen steps, each with an error of 1e-11 of numbers around one.
    let close = |a: f64, b: f64| assert!((a - b).abs() <= 1e-9 * b.abs().max(1.0), "{a} {b}");
    for i in 0..2 {
        close(q[i], expected.nominal.x[2 + i]);
        close(found.grad_x0[i], expected.grad_x0[i]);
        close(found.grad_p[i], expected.grad_p[i]);
    }
    for (found, expected) in found.grad_u.iter().zip(&expected.grad_u) {
        close(found[0], expected[0]);
    }
    // Of the same steps, exactly: the gradient is that of what is computed.
    horizon.freeze().unwrap();
    let mut value = |delta: f64| {
        let mut moved = controls;
        moved[1][0] += delta;
        let x = horizon.with(&mut integral).solve(&X0, &moved, &ends).unwrap().x;
        LAMBDA.dot(&x) + nu.dot(&integral.q)
    };
    let delta = 1e-3;
    let difference =
        (8.0 * (value(delta) - value(-delta)) - (value(2.0 * delta) - value(-2.0 * delta))) / (12.0 * delta);
    // Truncation δ⁴ f⁽⁵⁾/30, rounding ε/δ.
    assert!((difference - found.grad_u[1][0]).abs() <= 1e-11, "{difference} {}", found.grad_u[1][0]);
}

/// The same with all derivatives: those of the integrals as states, of the same tolerance.
#[test]
fn derivatives_of_integrals_over_piecewise_constant_controls() {
    let controls = [vector![0.3], vector![-0.8], vector![0.5]];
    let ends = [0.4, 0.9, 1.2];
    let options = AdaptiveOptions { rtol: 1e-11, atol: 1e-12, ..Default::default() };
    let mut horizon = Piecewise::new(Adaptive::<Swing, Radau>::new(options).unwrap());
    horizon.integrator().set_parameters(&P).unwrap();
    let mut states = Piecewise::new(Adaptive::<WithStates, Radau>::new(options).unwrap());
    states.integrator().set_parameters(&P).unwrap();
    let start = vector![X0[0], X0[1], 0.0, 0.0];
    let lambda = vector![LAMBDA[0], LAMBDA[1], NU[0], NU[1]];
    let expected = states.hessian(&start, &controls, &ends, &lambda).unwrap();
    // Two sequences of a dozen steps, each with an error of 1e-11 of numbers around one; of second
    // derivatives around ten.
    let close = |a: f64, b: f64| assert!((a - b).abs() <= 1e-8 * b.abs().max(1.0), "{a} {b}");

    let mut integral = Quadrature::<Outputs>::new();
    integral.nu = NU;
    let (forward, first) = horizon.with(&mut integral).forward(&X0, &controls, &ends).unwrap();
    let (found, second) = horizon.with(&mut integral).hessian(&X0, &controls, &ends, &LAMBDA).unwrap();
    assert_eq!((&found.forward, &second), (&forward, &first));
    assert_eq!(forward, horizon.forward(&X0, &controls, &ends).unwrap());
    assert_eq!(integral.dq_dx0, matrix![0.0, 0.0; 0.0, 0.0]);
    for i in 0..2 {
        close(integral.q[i], expected.forward.nominal.x[2 + i]);
        for j in 0..2 {
            close(first.dq_dx0[(i, j)], expected.forward.dx_dx0[(2 + i, j)]);
            close(first.dq_dp[(i, j)], expected.forward.dx_dp[(2 + i, j)]);
            close(found.h_xx[(i, j)], expected.h_xx[(i, j)]);
            close(found.h_xp[(i, j)], expected.h_xp[(i, j)]);
            close(found.h_pp[(i, j)], expected.h_pp[(i, j)]);
        }
        for k in 0..3 {
            close(first.dq_du[k][i], expected.forward.dx_du[k][2 + i]);
            close(found.h_xu[k][i], expected.h_xu[k][i]);
            close(found.h_up[k][i], expected.h_up[k][i]);
        }
        close(found.adjoint.grad_x0[i], expected.adjoint.grad_x0[i]);
        close(found.adjoint.grad_p[i], expected.adjoint.grad_p[i]);
    }
    for (found, expected) in found.h_uu.iter().zip(&expected.h_uu) {
        close(found[0], expected[0]);
    }
    for (found, expected) in found.adjoint.grad_u.iter().zip(&expected.adjoint.grad_u) {
        close(found[0], expected[0]);
    }
}

/// Least squares over several intervals: gradients and exact second derivatives against differences
/// of the same steps.
#[test]
fn least_squares_over_piecewise_constant_controls() {
    let controls = [vector![0.3], vector![-0.8], vector![0.5]];
    let ends = [0.4, 0.9, 1.2];
    let mut fit = LeastSquares::<Outputs>::new(&matrix![1.5, 0.2; 0.2, 0.7]);
    let mut horizon = Piecewise::new(Adaptive::<Swing, Gauss<3>>::new(AdaptiveOptions::default()).unwrap());
    horizon.integrator().set_parameters(&P).unwrap();
    horizon.solve(&X0, &controls, &ends).unwrap();
    horizon.freeze().unwrap();
    let (found, integral) = horizon.with(&mut fit).hessian(&X0, &controls, &ends, &LAMBDA).unwrap();
    let adjoint = horizon.with(&mut fit).adjoint(&X0, &controls, &ends, &LAMBDA).unwrap();
    let forward = &found.forward;
    assert_close(found.adjoint.grad_x0, adjoint.grad_x0, ROUNDING);
    assert_close(found.adjoint.grad_p, adjoint.grad_p, ROUNDING);
    assert_close(forward.dx_dx0.transpose() * LAMBDA + integral.grad_x0, adjoint.grad_x0, ROUNDING);
    assert_close(forward.dx_dp.transpose() * LAMBDA + integral.grad_p, adjoint.grad_p, ROUNDING);
    for k in 0..3 {
        assert_close(forward.dx_du[k].transpose() * LAMBDA + integral.grad_u[k], adjoint.grad_u[k], ROUNDING);
        let mut moved = |delta: f64| {
            let mut controls = controls;
            controls[k][0] += delta;
            let adjoint = horizon.with(&mut fit).adjoint(&X0, &controls, &ends, &LAMBDA).unwrap();
            let u = adjoint.grad_u;
            [
                adjoint.grad_x0[0],
                adjoint.grad_x0[1],
                u[0][0],
                u[1][0],
                u[2][0],
                adjoint.grad_p[0],
                adjoint.grad_p[1],
            ]
        };
        // Order four with steps of 1e-3: errors of 1e-12 of the value, and as much by rounding.
        let e = 1e-3;
        let values = [-2.0, -1.0, 1.0, 2.0].map(|s| moved(s * e));
        let difference: [f64; 7] = core::array::from_fn(|i| {
            (values[0][i] - 8.0 * values[1][i] + 8.0 * values[2][i] - values[3][i]) / (12.0 * e)
        });
        let uu = |j: usize| found.h_uu[3 * j + k][0];
        let (xu, up) = (found.h_xu[k], found.h_up[k]);
        assert_close(difference, [xu[0], xu[1], uu(0), uu(1), uu(2), up[0], up[1]], 1e-9);
    }
}

#[function]
fn deviation(x: f64, u: f64, _p: f64) -> [f64; 2] {
    [x, 0.5 * u - x]
}

/// Where nothing is curved, the matrix of Gauss and Newton is the Hessian: to rounding, of sums of
/// a few dozen terms. The product `p x` is curved, so that only `x₀` and the controls count.
#[test]
fn gauss_newton_over_piecewise_constant_controls() {
    let mut fit = LeastSquares::<Deviation>::new(&matrix![1.0, 0.1; 0.1, 0.4]);
    let mut horizon = Piecewise::new(Adaptive::<Decay, Radau>::new(AdaptiveOptions::default()).unwrap());
    horizon.integrator().set_parameters(&vector![0.7]).unwrap();
    let (controls, ends) = ([vector![0.3], vector![-0.2]], [0.5, 1.3]);
    let (exact, integral) =
        horizon.with(&mut fit).hessian(&vector![1.2], &controls, &ends, &vector![0.0]).unwrap();
    assert_close(integral.h_xx, exact.h_xx, ROUNDING);
    for k in 0..2 {
        assert!(exact.h_xu[k][0].abs() > 1e-3);
        assert_close(integral.h_xu[k], exact.h_xu[k], ROUNDING);
    }
    for k in 0..4 {
        assert_close(integral.h_uu[k], exact.h_uu[k], ROUNDING);
    }
    let (_, again) = horizon.with(&mut fit).forward(&vector![1.2], &controls, &ends).unwrap();
    assert_eq!(again, integral);
}
