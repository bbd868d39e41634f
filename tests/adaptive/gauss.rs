//! Gauss methods with steps of variable size: the error follows the tolerance with the order of the
//! method, quadratic invariants stay, stiff and algebraic equations are solved, derivatives are
//! those of the steps.

use casados::prelude::*;
use nalgebra::{Vector1, matrix, vector};

fn options(rtol: f64) -> AdaptiveOptions {
    AdaptiveOptions { rtol, atol: rtol, ..Default::default() }
}

#[track_caller]
fn assert_close(value: impl AsRef<[f64]>, expected: impl AsRef<[f64]>, tolerance: f64) {
    let (value, expected) = (value.as_ref(), expected.as_ref());
    assert_eq!(value.len(), expected.len());
    for (value, expected) in value.iter().zip(expected) {
        let error = (value - expected).abs();
        assert!(error <= tolerance * expected.abs().max(1.0), "{value} is not {expected}: {error:e}");
    }
}

/// `x(t) = 1 / (1 + t²)` solves `ẋ = −2 t x²` from `x(0) = 1`: all of its steps have different
/// sizes.
#[ode]
fn bell(x: f64, t: f64) -> f64 {
    -2.0 * t * x * x
}

/// The error at the end, and the number of steps.
macro_rules! run {
    ($stages:literal, $options:expr) => {{
        let mut gauss = Adaptive::<Bell, Gauss<$stages>>::new($options).unwrap();
        gauss.set_time(-5.0).unwrap();
        gauss.solve(&Vector1::new(1.0 / 26.0), &vector![], 4.5).unwrap();
        let steps = gauss.statistics().steps;
        // To rounding.
        gauss.freeze().unwrap();
        let x = gauss.solve(&Vector1::new(1.0 / 26.0), &vector![], 4.5).unwrap().x[0];
        ((x - 0.8).abs(), steps)
    }};
}

macro_rules! follows {
    ($stages:literal) => {{
        let tolerances = [1e-4, 1e-6, 1e-8, 1e-10];
        let errors = tolerances.map(|rtol| run!($stages, options(rtol)).0);
        for (error, rtol) in errors.iter().zip(tolerances) {
            // Errors at the start grow like x², by (0.8 · 26)².
            assert!(*error <= 400.0 * rtol, "{error:e} at {rtol:e} with {} stages", $stages);
        }
        // Over six digits of the tolerance the error falls by five to seven and a half; by less
        // where it is at rounding.
        let slope = (errors[0] / errors[3]).log10() / 6.0;
        assert!($stages == 6 || (0.8..=1.25).contains(&slope), "{slope} with {} stages: {errors:?}", $stages);
    }};
}

#[test]
fn the_error_follows_the_tolerance() {
    follows!(2);
    follows!(3);
    follows!(4);
    follows!(5);
    follows!(6);
}

macro_rules! order {
    ($stages:literal, $steps:literal) => {{
        // Steps of one size: no estimate is above a tolerance of one.
        let error = |steps: usize| {
            let h = 4.5 / steps as f64;
            let equal = AdaptiveOptions {
                rtol: 1.0,
                atol: 1.0,
                initial_step: Some(h),
                max_step: h,
                ..Default::default()
            };
            let (error, taken) = run!($stages, equal);
            assert!(taken.abs_diff(steps) <= 1, "{taken} steps instead of {steps}");
            error
        };
        let order = (error($steps) / error(2 * $steps)).log2();
        // Before rounding is reached, steps are hardly smaller than the distance of the poles at
        // ±i: above the order.
        let excess = order - 2.0 * f64::from($stages);
        assert!(
            (-0.3..2.0).contains(&excess),
            "order {order} with {} stages: {:e}",
            $stages,
            error(2 * $steps)
        );
    }};
}

#[test]
fn the_order_is_twice_the_number_of_stages() {
    order!(2, 100);
    order!(3, 30);
    order!(4, 12);
}

/// Two oscillators that are coupled by a cubic term, with the invariant `x₀² + x₁²`.
#[ode]
fn rotation(x: [f64; 2], t: f64) -> [f64; 2] {
    let speed = 1.0 + 0.9 * (3.0 * t).sin() + x[0] * x[0];
    [speed * x[1], -speed * x[0]]
}

#[test]
fn quadratic_invariants() {
    let mut gauss = Adaptive::<Rotation, Gauss<3>>::new(options(1e-5)).unwrap();
    let x = gauss.solve(&vector![0.6, 0.8], &vector![], 200.0).unwrap().x;
    let steps = gauss.statistics().steps;
    assert!(steps > 300);
    // What Newton's method leaves of each step: at most 0.03 of what is tolerated of its estimate,
    // 0.1 · 1e-5^(4/6).
    assert!((x.norm() - 1.0).abs() < 0.03 * 4.7e-5 * steps as f64, "{:e}", x.norm() - 1.0);
    // The steps solved to rounding: nothing but rounding.
    gauss.freeze().unwrap();
    let x = gauss.solve(&vector![0.6, 0.8], &vector![], 200.0).unwrap().x;
    assert!((x.norm() - 1.0).abs() < 4.0 * f64::EPSILON * steps as f64, "{:e}", x.norm() - 1.0);
    // Radau methods damp.
    let mut radau = Adaptive::<Rotation, RadauIIA<3>>::new(options(1e-5)).unwrap();
    radau.solve(&vector![0.6, 0.8], &vector![], 200.0).unwrap();
    radau.freeze().unwrap();
    let x = radau.solve(&vector![0.6, 0.8], &vector![], 200.0).unwrap().x;
    assert!((x.norm() - 1.0).abs() > 1e-10);
}

/// `ẋ = −p (x − cos t) − sin t`, solved by `cos t` however large `p` is.
#[ode]
fn stiff(x: f64, p: f64, t: f64) -> f64 {
    -p * (x - t.cos()) - t.sin()
}

#[test]
fn stiff_equations_are_solved() {
    for p in [1.0, 1e3, 1e6] {
        let mut gauss = Adaptive::<Stiff, Gauss<3>>::new(options(1e-7)).unwrap();
        gauss.set_parameters(&Vector1::new(p)).unwrap();
        let x = gauss.solve(&Vector1::new(1.0), &vector![], 10.0).unwrap().x;
        // Errors of stiff components stay: those of all steps, at most 0.1 · 1e-7^(4/6) each.
        let steps = gauss.statistics().steps;
        assert_close(x, [10.0_f64.cos()], 2.2e-6 * steps as f64);
        // The estimate is filtered: the steps are those of the cosine.
        assert!(gauss.statistics().steps < 400, "{p}: {:?}", gauss.statistics());
    }
}

/// A pendulum with friction; the force is an algebraic state.
#[dae]
fn swing(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: f64, t: f64) -> [f64; 3] {
    [
        xdot[0] - x[1],
        xdot[1] * (1.0 + 0.1 * x[0] * x[0]) + z + p * x[1] - u * (1.0 + 0.1 * t),
        z * (1.0 + 0.2 * x[1] * x[1]) - x[0].sin(),
    ]
}

macro_rules! derivatives {
    ($stages:literal) => {{
        const ROUNDING: f64 = 1e-12;
        let mut gauss = Adaptive::<Swing, Gauss<$stages>>::new(options(1e-7)).unwrap();
        let (x0, u, p, lambda) = (vector![0.8, -0.4], vector![0.3], Vector1::new(0.4), vector![0.6, -1.1]);
        gauss.set_parameters(&p).unwrap();
        let end = 3.0;
        let chosen = *gauss.solve(&x0, &u, end).unwrap();
        assert!(gauss.statistics().steps > 3);
        // z satisfies its equation at the end, not only at the stages.
        let z = |x: nalgebra::Vector2<f64>| x[0].sin() / (1.0 + 0.2 * x[1] * x[1]);
        assert_close(chosen.z, [z(chosen.x)], 1e-14);
        gauss.freeze().unwrap();
        let kept = *gauss.solve(&x0, &u, end).unwrap();
        assert_close(kept.x, chosen.x, 1e-7);
        assert_close(kept.z, [z(kept.x)], 1e-14);
        let forward = *gauss.forward(&x0, &u, end).unwrap();
        let adjoint = *gauss.adjoint(&x0, &u, end, &lambda).unwrap();
        let hessian = *gauss.hessian(&x0, &u, end, &lambda).unwrap();
        assert_close(adjoint.grad_x0, forward.dx_dx0.transpose() * lambda, ROUNDING);
        assert_close(adjoint.grad_p, forward.dx_dp.transpose() * lambda, ROUNDING);
        assert_close(hessian.grad_u, adjoint.grad_u, ROUNDING);
        let e = 1e-3;
        // Differences of order four: 1e-12 of truncation and as much rounding.
        let difference = |f: &mut dyn FnMut(f64) -> [f64; 4]| {
            let values = [-2.0, -1.0, 1.0, 2.0].map(|k| f(k * e));
            core::array::from_fn::<f64, 4, _>(|i| {
                (values[0][i] - 8.0 * values[1][i] + 8.0 * values[2][i] - values[3][i]) / (12.0 * e)
            })
        };
        let by_state = difference(&mut |step| {
            let adjoint = *gauss.adjoint(&(x0 + vector![step, 0.0]), &u, end, &lambda).unwrap();
            [adjoint.grad_x0[1], adjoint.grad_u[0], adjoint.x[1], adjoint.z[0]]
        });
        let expected =
            [hessian.h_xx[(1, 0)], hessian.h_xu[(0, 0)], forward.dx_dx0[(1, 0)], forward.dz_dx0[(0, 0)]];
        assert_close(by_state, expected, 1e-9);
        let by_parameter = difference(&mut |step| {
            gauss.set_parameters(&(p + vector![step])).unwrap();
            let adjoint = *gauss.adjoint(&x0, &u, end, &lambda).unwrap();
            [adjoint.grad_x0[1], adjoint.grad_p[0], adjoint.x[0], adjoint.z[0]]
        });
        let expected =
            [hessian.h_xp[(1, 0)], hessian.h_pp[(0, 0)], forward.dx_dp[(0, 0)], forward.dz_dp[(0, 0)]];
        assert_close(by_parameter, expected, 1e-9);
    }};
}

#[test]
fn derivatives_of_the_steps() {
    derivatives!(2);
    derivatives!(3);
    derivatives!(4);
    derivatives!(5);
}

/// What else is built on adaptive integrators takes Gauss methods too.
#[ode]
fn circle(x: [f64; 2]) -> [f64; 2] {
    [x[1], -x[0]]
}

#[function]
fn first(x: [f64; 2]) -> f64 {
    x[0]
}

#[function]
fn same(x: [f64; 2]) -> [f64; 2] {
    [x[0], x[1]]
}

#[test]
fn dense_output_events_and_integrals() {
    let mut gauss = Adaptive::<Circle, Gauss<4>>::new(options(1e-10)).unwrap();
    let x0 = vector![0.0, 1.0];
    gauss.solve(&x0, &vector![], 6.0).unwrap();
    // The polynomial of four stages is of order four, as is the estimate, which is held at 0.1 ·
    // 1e-10^(5/8) = 6e-8.
    for t in [0.1, 1.0, 2.7, 5.9] {
        assert_close(gauss.dense(t).unwrap().x, [f64::sin(t), f64::cos(t)], 1e-6);
    }
    let mut integral = Quadrature::<First>::new();
    gauss.with(&mut integral).forward(&x0, &vector![], 2.0).unwrap();
    assert_close(integral.q, [1.0 - 2.0_f64.cos()], 1e-9);
    assert_close(integral.dq_dx0, matrix![2.0_f64.sin(), 1.0 - 2.0_f64.cos()], 1e-9);
    let mut hybrid = Hybrid::new(gauss, &[Event::jump::<First, Same>(Crossing::Any)]).unwrap();
    let times: Vec<f64> =
        hybrid.solve(&x0, &vector![], 7.0).unwrap().occurrences.iter().map(|at| at.t).collect();
    assert_close(times, [core::f64::consts::PI, core::f64::consts::TAU], 1e-8);
}
