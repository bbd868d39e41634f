//! Events against closed forms: times, states, and their derivatives, which are complex steps
//! through the formulas.

mod algebraic;
mod integrals;
mod second;
mod simultaneous;

use casados::adaptive::HybridHessian;
use casados::prelude::*;
use nalgebra::{Complex, Vector1, Vector2, matrix, vector};

/// A ball, `x = (height, velocity)`, `p = (gravity, restitution)`.
#[ode]
fn ball(x: [f64; 2], p: [f64; 2]) -> [f64; 2] {
    [x[1], -p[0]]
}

#[function]
fn height(x: [f64; 2], _p: [f64; 2]) -> f64 {
    x[0]
}

#[function]
fn bounce(x: [f64; 2], p: [f64; 2]) -> [f64; 2] {
    [x[0], -p[1] * x[1]]
}

/// Times of the first `n` bounces, and height and velocity at `t`, which is after them and before
/// the next.
fn bouncing(w: [Complex<f64>; 4], n: usize, t: f64) -> (Vec<Complex<f64>>, [Complex<f64>; 2]) {
    let [height, velocity, gravity, restitution] = w;
    let speed = (velocity * velocity + gravity * height * 2.0).sqrt();
    let mut times = vec![(velocity + speed) / gravity];
    let mut up = speed * restitution;
    for k in 1..n {
        times.push(times[k - 1] + up * 2.0 / gravity);
        up *= restitution;
    }
    let passed = Complex::new(t, 0.0) - times[n - 1];
    (times, [up * passed - gravity * passed * passed * 0.5, up - gravity * passed])
}

/// `f` and its derivatives in the directions of the arguments.
fn differentiate<const W: usize, const N: usize>(
    w: [f64; W],
    f: impl Fn([Complex<f64>; W]) -> [Complex<f64>; N],
) -> ([f64; N], [[f64; W]; N]) {
    let value = f(w.map(|w| Complex::new(w, 0.0))).map(|y| y.re);
    let mut derivative = [[0.0; W]; N];
    for direction in 0..W {
        let step = |i: usize| Complex::new(w[i], if i == direction { 1e-100 } else { 0.0 });
        for (row, y) in derivative.iter_mut().zip(f(core::array::from_fn(step))) {
            row[direction] = y.im / 1e-100;
        }
    }
    (value, derivative)
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

fn options(rtol: f64) -> AdaptiveOptions {
    AdaptiveOptions { rtol, atol: rtol / 10.0, ..Default::default() }
}

/// Polynomials of degree two are solved exactly by every method: rounding, which each bounce
/// multiplies by the slopes of some units.
const ROUNDING: f64 = 1e-11;

macro_rules! bounces {
    ($method:ty) => {{
        let event = Event::jump::<Height, Bounce>(Crossing::Falling);
        let adaptive = Adaptive::<Ball, $method>::new(options(1e-8)).unwrap();
        let mut hybrid = Hybrid::new(adaptive, &[event]).unwrap();
        let (x0, p, u) = (vector![1.3, 0.4], vector![9.81, 0.8], vector![]);
        hybrid.integrator().set_parameters(&p).unwrap();
        let w = [x0[0], x0[1], p[0], p[1]];
        for (n, t_end) in [(1, 0.9), (2, 1.8), (3, 2.4)] {
            let (value, derivative) = differentiate(w, |w| bouncing(w, n, t_end).1);
            let (times, slopes) = differentiate(w, |w| {
                let times = bouncing(w, n, t_end).0;
                core::array::from_fn::<_, 3, _>(|k| *times.get(k).unwrap_or(&Complex::new(0.0, 0.0)))
            });
            let solution = hybrid.solve(&x0, &u, t_end).unwrap();
            assert!(!solution.terminal);
            assert_eq!(solution.t, t_end);
            assert_eq!(solution.occurrences.len(), n);
            assert_close(solution.nominal.x, value, ROUNDING);
            for (occurrence, t) in solution.occurrences.iter().zip(times) {
                assert_eq!(occurrence.event, 0);
                assert_close([occurrence.t], [t], ROUNDING);
                assert!(occurrence.before[0].abs() < 1e-13);
                assert_eq!(occurrence.after[1], -p[1] * occurrence.before[1]);
            }
            let forward = hybrid.forward(&x0, &u, t_end).unwrap();
            for (row, expected) in derivative.iter().enumerate() {
                assert_close([forward.dx_dx0[(row, 0)], forward.dx_dx0[(row, 1)]], &expected[..2], ROUNDING);
                assert_close([forward.dx_dp[(row, 0)], forward.dx_dp[(row, 1)]], &expected[2..], ROUNDING);
            }
            assert_eq!(forward.times.len(), n);
            for (time, expected) in forward.times.iter().zip(slopes) {
                assert_close(time.x0, &expected[..2], ROUNDING);
                assert_close(time.p, &expected[2..], ROUNDING);
            }
            let lambda = vector![0.7, -1.2];
            let adjoint = hybrid.adjoint(&x0, &u, t_end, &lambda).unwrap();
            assert_close(adjoint.grad_x0, forward.dx_dx0.transpose() * lambda, ROUNDING);
            assert_close(adjoint.grad_p, forward.dx_dp.transpose() * lambda, ROUNDING);
            assert_close(adjoint.solution.nominal.x, value, ROUNDING);
        }
        // Between the second and the third bounce.
        let t = 1.75;
        let (_, x) = bouncing(w.map(|w| Complex::new(w, 0.0)), 2, t);
        assert_close(hybrid.dense(t).unwrap().x, x.map(|x| x.re), ROUNDING);
    }};
}

#[test]
fn a_bouncing_ball() {
    bounces!(Radau);
    bounces!(RadauIIA<7>);
    bounces!(DormandPrince5);
    bounces!(DormandPrince8);
}

/// Bounces come sooner and sooner, without end before `t₁ + 2 v₁ r/(g (1 − r))`, where the ball
/// lies on the ground.
#[test]
fn accumulating_events_are_an_error() {
    let event = Event::jump::<Height, Bounce>(Crossing::Falling);
    let adaptive = Adaptive::<Ball, Radau>::new(options(1e-8)).unwrap();
    let mut hybrid = Hybrid::new(adaptive, &[event]).unwrap();
    hybrid.integrator().set_parameters(&vector![9.81, 0.7]).unwrap();
    let (x0, u) = (vector![1.3, 0.4], vector![]);
    let speed = (0.4f64 * 0.4 + 2.0 * 9.81 * 1.3).sqrt();
    let end = (0.4 + speed) / 9.81 + 2.0 * speed * 0.7 / (9.81 * (1.0 - 0.7));
    // Whether they are counted or not.
    for most in [12, 1000] {
        hybrid.set_most_events(most);
        let error = hybrid.solve(&x0, &u, 5.0).unwrap_err();
        let Error::AccumulatingEvents { t, function: "Height", event: 0, .. } = error else {
            panic!("{error}")
        };
        assert_close([t], [end], 1e-9);
        assert!(error.to_string().starts_with("events accumulate at t = "), "{error}");
        assert_eq!(hybrid.dense(0.1).unwrap_err(), Error::NoResult);
        assert_eq!(hybrid.solve(&x0, &u, 0.8).unwrap().occurrences.len(), 1);
    }
    // Those that do not accumulate are counted.
    let event = Event::jump::<Height, Bounce>(Crossing::Falling);
    let adaptive = Adaptive::<Ball, Radau>::new(options(1e-8)).unwrap();
    let mut hybrid = Hybrid::new(adaptive, &[event]).unwrap();
    hybrid.integrator().set_parameters(&vector![9.81, 1.0]).unwrap();
    hybrid.set_most_events(6);
    let error = hybrid.solve(&x0, &u, 50.0).unwrap_err();
    let Error::TooManyEvents { t, events: 6 } = error else { panic!("{error}") };
    let (times, _) = bouncing([1.3, 0.4, 9.81, 1.0].map(|w| Complex::new(w, 0.0)), 7, 5.0);
    assert_close([t], [times[6].re], 1e-9);
}

/// `ẋ = −p x + u`, `z = x²`
#[dae]
fn decay(xdot: f64, x: f64, z: f64, u: f64, p: f64) -> [f64; 2] {
    [xdot + p * x - u, z - x * x]
}

#[function]
fn level(x: f64, _z: f64, u: f64, p: f64) -> f64 {
    x - (0.1 * p + 0.5 * u)
}

#[function]
fn clock(x: f64, _z: f64, _u: f64, p: f64, t: f64) -> f64 {
    (t - 0.5 * p) * (2.0 + x * x)
}

#[function]
fn refill(x: f64, _z: f64, u: f64, p: f64, t: f64) -> f64 {
    0.5 * x * x + 0.3 * t + p * u + 1.0
}

/// The flow of `decay` over a time `s`.
fn exact_flow(x: Complex<f64>, u: Complex<f64>, p: Complex<f64>, s: Complex<f64>) -> Complex<f64> {
    u / p + (x - u / p) * (-p * s).exp()
}

const X0: f64 = 1.6;
const P: f64 = 0.9;

/// The integration ends at the level `c = p/10 + u`, at `t = ln((x₀ − u/p)/(c − u/p))/p`.
#[test]
fn a_terminal_event() {
    let event = Event::terminal::<Level>(Crossing::Falling);
    let mut hybrid = Hybrid::new(Adaptive::<Decay, Radau>::new(options(1e-11)).unwrap(), &[event]).unwrap();
    let (x0, u, p) = (Vector1::new(X0), Vector1::new(0.05), Vector1::new(P));
    hybrid.integrator().set_parameters(&p).unwrap();
    let (value, derivative) = differentiate([X0, u[0], P], |[x, u, p]| {
        let c = p * 0.1 + u * 0.5;
        [c, ((x - u / p) / (c - u / p)).ln() / p]
    });
    let solution = hybrid.solve(&x0, &u, 10.0).unwrap();
    assert!(solution.terminal);
    // Some steps with errors of 1e-11, which the slope of 0.05 at the level makes errors in time of
    // twenty times as much.
    let tolerance = 2e-9;
    assert_close([solution.t], [value[1]], tolerance);
    assert_close(solution.nominal.x, [value[0]], 1e-14);
    assert_close(solution.nominal.z, [value[0] * value[0]], 1e-13);
    assert_close(solution.nominal.z0, [X0 * X0], 1e-14);
    let forward = hybrid.forward(&x0, &u, 10.0).unwrap();
    let found = [forward.dx_dx0[0], forward.dx_du[0], forward.dx_dp[0]];
    assert_close(found, derivative[0], tolerance);
    let time = forward.times[0];
    // Divided by the slope once more.
    assert_close([time.x0[0], time.u[0], time.p[0]], derivative[1], 20.0 * tolerance);
    let adjoint = hybrid.adjoint(&x0, &u, 10.0, &vector![2.0]).unwrap();
    assert_close([adjoint.grad_x0[0], adjoint.grad_u[0], adjoint.grad_p[0]], found.map(|d| 2.0 * d), 1e-12);
    // In the other direction there is no event.
    let event = Event::terminal::<Level>(Crossing::Rising);
    let mut none = Hybrid::new(Adaptive::<Decay, Radau>::new(options(1e-8)).unwrap(), &[event]).unwrap();
    none.integrator().set_parameters(&p).unwrap();
    let solution = none.solve(&x0, &u, 10.0).unwrap();
    assert!(!solution.terminal && solution.occurrences.is_empty());
}

/// Two events: at `t = p/2` and where the level is reached the state jumps, in ways that depend on
/// everything.
#[test]
fn events_of_all_arguments() {
    let events =
        [Event::jump::<Level, Refill>(Crossing::Falling), Event::jump::<Clock, Refill>(Crossing::Any)];
    let (x0, u, p) = (Vector1::new(X0), Vector1::new(0.05), Vector1::new(P));
    let t_end = 5.0;
    let formula = |[x, u, p]: [Complex<f64>; 3]| {
        let refill = |x: Complex<f64>, t: Complex<f64>| x * x * 0.5 + t * 0.3 + p * u + 1.0;
        let first = p * 0.5;
        let x = refill(exact_flow(x, u, p, first), first);
        let c = p * 0.1 + u * 0.5;
        let second = first + ((x - u / p) / (c - u / p)).ln() / p;
        let x = refill(c, second);
        [exact_flow(x, u, p, Complex::new(t_end, 0.0) - second), first, second]
    };
    let (value, derivative) = differentiate([X0, u[0], P], formula);
    let mut hybrid = Hybrid::new(Adaptive::<Decay, Radau>::new(options(1e-11)).unwrap(), &events).unwrap();
    hybrid.integrator().set_parameters(&p).unwrap();
    let tolerance = 1e-8;
    let forward = hybrid.forward(&x0, &u, t_end).unwrap();
    let list = &forward.solution.occurrences;
    assert_eq!(list.iter().map(|occurrence| occurrence.event).collect::<Vec<_>>(), [1, 0]);
    assert_close([forward.solution.nominal.x[0], list[0].t, list[1].t], value, tolerance);
    assert_close([forward.dx_dx0[0], forward.dx_du[0], forward.dx_dp[0]], derivative[0], tolerance);
    for (time, expected) in forward.times.iter().zip(&derivative[1..]) {
        assert_close([time.x0[0], time.u[0], time.p[0]], expected, 20.0 * tolerance);
    }
    let adjoint = hybrid.adjoint(&x0, &u, t_end, &vector![1.0]).unwrap();
    assert_close([adjoint.grad_x0[0], adjoint.grad_u[0], adjoint.grad_p[0]], derivative[0], tolerance);
}

/// A state that is on the level at the start leaves it, and comes back.
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
fn crossings_in_both_directions() {
    use core::f64::consts::PI;
    let count = |crossing: Crossing, t_end: f64| {
        let event = Event::jump::<First, Same>(crossing);
        let adaptive = Adaptive::<Circle, DormandPrince8>::new(options(1e-10)).unwrap();
        let mut hybrid = Hybrid::new(adaptive, &[event]).unwrap();
        let solution = hybrid.solve(&vector![0.0, 1.0], &vector![], t_end).unwrap().clone();
        assert_close(solution.nominal.x, [t_end.sin(), t_end.cos()], 1e-8);
        solution.occurrences.iter().map(|occurrence| occurrence.t).collect::<Vec<_>>()
    };
    assert_close(count(Crossing::Falling, 10.0), [PI, 3.0 * PI], 1e-8);
    assert_close(count(Crossing::Rising, 10.0), [2.0 * PI], 1e-8);
    assert_close(count(Crossing::Any, 10.0), [PI, 2.0 * PI, 3.0 * PI], 1e-8);
    // Backwards the solution falls first.
    assert_close(count(Crossing::Rising, -4.0), [-PI], 1e-8);
    assert!(count(Crossing::Falling, -4.0).is_empty());
    // A jump to where it was changes nothing.
    let event = Event::jump::<First, Same>(Crossing::Any);
    let adaptive = Adaptive::<Circle, RadauIIA<5>>::new(options(1e-11)).unwrap();
    let mut hybrid = Hybrid::new(adaptive, &[event]).unwrap();
    let forward = hybrid.forward(&Vector2::new(0.0, 1.0), &vector![], 4.0).unwrap();
    let (s, c) = 4.0_f64.sin_cos();
    assert_close(forward.dx_dx0, matrix![c, s; -s, c], 1e-8);
}

#[ode]
fn line(_x: f64) -> f64 {
    1.0
}

#[function]
fn cube(x: f64) -> f64 {
    (x - 1.0).powi(3)
}

#[function]
fn root(x: f64) -> f64 {
    (1.5 - x).sqrt() - 0.1
}

#[test]
fn grazing_and_undefined_functions() {
    let event = Event::terminal::<Cube>(Crossing::Rising);
    let mut hybrid = Hybrid::new(Adaptive::<Line, Radau>::new(options(1e-8)).unwrap(), &[event]).unwrap();
    // Newton's method on a cube gains a third with each of twenty iterations, after a millionth of
    // a step.
    let t = hybrid.solve(&Vector1::new(0.0), &vector![], 4.0).unwrap().t;
    assert_close([t], [1.0], 1e-6);
    let error = hybrid.forward(&Vector1::new(0.0), &vector![], 4.0).unwrap_err();
    assert!(matches!(error, Error::Grazing { event: 0, .. }), "{error}");
    let text = error.to_string();
    assert!(text.starts_with("event 0, of the function Cube, has no slope at its zero at t = "), "{text}");
    let error = hybrid.adjoint(&Vector1::new(0.0), &vector![], 4.0, &vector![1.0]).unwrap_err();
    assert!(matches!(error, Error::Grazing { event: 0, .. }), "{error}");

    let event = Event::terminal::<Root>(Crossing::Rising);
    let mut hybrid = Hybrid::new(Adaptive::<Line, Radau>::new(options(1e-8)).unwrap(), &[event]).unwrap();
    let error = hybrid.solve(&Vector1::new(0.0), &vector![], 4.0).unwrap_err();
    assert!(matches!(error, Error::NonFiniteFunction { function: "Root", output: 0, .. }), "{error}");
}

#[ode]
fn thrown(x: [f64; 2], _u: f64) -> [f64; 2] {
    [x[1], -10.0]
}

#[function]
fn above(x: [f64; 2], _u: f64) -> f64 {
    x[0]
}

/// It has a value at `u = 0`, and no derivative.
#[function]
fn kicked(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[0], u.sqrt() - 0.8 * x[1]]
}

#[test]
fn jumps_without_derivatives_are_an_error() {
    let event = Event::jump::<Above, Kicked>(Crossing::Falling);
    let adaptive = Adaptive::<Thrown, Radau>::new(options(1e-8)).unwrap();
    let mut hybrid = Hybrid::new(adaptive, &[event]).unwrap();
    let (x0, u, lambda) = (vector![5.0, 0.0], vector![0.0], vector![1.0, 1.0]);
    assert!(hybrid.solve(&x0, &u, 1.5).is_ok());
    for result in [
        hybrid.forward(&x0, &u, 1.5).map(|_| ()),
        hybrid.adjoint(&x0, &u, 1.5, &lambda).map(|_| ()),
        hybrid.hessian(&x0, &u, 1.5, &lambda).map(|_| ()),
    ] {
        assert!(matches!(result, Err(Error::Overflow { .. })), "{result:?}");
    }
}
