//! Where an equation changes its branch at once: algebraic states that jump, friction, and a rate
//! that changes by four orders of magnitude. References are closed forms.

use casados::{Adaptive, AdaptiveOptions, Error, Gauss, Radau, dae, ode};
use nalgebra::{SVector, vector};
use std::f64::consts::PI;

const TOLERANCES: [f64; 4] = [1e-4, 1e-6, 1e-8, 1e-10];

/// Errors in tolerances of a model with this method, from these starts to these ends.
macro_rules! largest {
    ($model:ty, $method:ty, $cases:expr, $exact:expr) => {{
        let mut largest = 0.0f64;
        for tolerance in TOLERANCES {
            let options = AdaptiveOptions { rtol: tolerance, atol: tolerance, ..Default::default() };
            let mut adaptive = Adaptive::<$model, $method>::new(options)?;
            for (x0, end) in $cases {
                let x = adaptive.solve(&x0, &SVector::zeros(), end)?.x;
                let exact = $exact(x0, end);
                for (x, exact) in x.iter().zip(exact.iter()) {
                    largest = largest.max((x - exact).abs() / (tolerance * (1.0 + exact.abs())));
                }
            }
        }
        largest
    }};
}

macro_rules! within_thirty_tolerances {
    ($model:ty, $cases:expr, $exact:expr) => {{
        let all = [
            largest!($model, Radau, $cases.clone(), $exact),
            largest!($model, Gauss<3>, $cases.clone(), $exact),
            largest!($model, Gauss<4>, $cases.clone(), $exact),
        ];
        assert!(all.iter().all(|error| *error <= 30.0), "{all:?} tolerances");
    }};
}

/// `z` is 2 or 0.2: of a cubic whose slope is 13 at one and 1.12 at the other.
#[dae(nominal(z = [1.0]))]
fn switched(xdot: [f64; 1], x: [f64; 1], z: [f64; 1], t: f64) -> [f64; 2] {
    let s = if (1.7 * t + 0.2).sin() > 0.0 { 2.0 } else { 0.2 };
    [xdot[0] - (z[0] - x[0]), z[0] + z[0] * z[0] * z[0] - (s + s * s * s)]
}

/// `x` decays to `z` between the borders `1.7 t + 0.2 = k π`; the last value is `z`.
fn switched_exactly(x0: f64, end: f64) -> [f64; 2] {
    let (mut x, mut t, mut k) = (x0, 0.0, 1);
    loop {
        let z = if k % 2 == 1 { 2.0 } else { 0.2 };
        let next = end.min((f64::from(k) * PI - 0.2) / 1.7);
        x = z + (x - z) * (t - next).exp();
        (t, k) = (next, k + 1);
        if t >= end {
            return [x, z];
        }
    }
}

/// Newton's method, whose Jacobian is that of one side, converges in no step over the border.
#[test]
fn algebraic_states_that_jump() -> Result<(), Error> {
    let cases = (0..6).map(|case| (vector![0.3 * f64::from(case)], 6.0 + 0.31 * f64::from(case)));
    let exact = |x0: SVector<f64, 1>, end| [switched_exactly(x0[0], end)[0]];
    within_thirty_tolerances!(Switched, cases, exact);
    Ok(())
}

/// `∂x/∂x₀` is `exp(−t)` whatever `z` does.
#[test]
fn derivatives_over_algebraic_states_that_jump() -> Result<(), Error> {
    let options = AdaptiveOptions { rtol: 1e-8, atol: 1e-8, ..Default::default() };
    macro_rules! check {
        ($($method:ty),*) => {$({
            let mut adaptive = Adaptive::<Switched, $method>::new(options.clone())?;
            let result = adaptive.forward(&vector![0.5], &SVector::zeros(), 4.0)?;
            let [x, z] = switched_exactly(0.5, 4.0);
            let errors = [result.x[0] - x, result.z[0] - z, result.dx_dx0[0] - (-4.0f64).exp()];
            assert!(errors.iter().all(|error| error.abs() <= 30.0 * 1e-8 * 3.0), "{errors:?}");
        })*};
    }
    check!(Radau, Gauss<3>, Gauss<4>);
    Ok(())
}

/// An oscillator with friction, whose Jacobian is constant.
#[ode]
fn rubbed(x: [f64; 2]) -> [f64; 2] {
    [x[1], -x[0] - 0.3 * if x[1] > 0.0 { 1.0 } else { -1.0 }]
}

/// From rest at `x₀ > 0`: half a turn about 0.3, half a turn about −0.3, and so on.
fn exact_rubbed(x0: SVector<f64, 2>, end: f64) -> [f64; 2] {
    let half = (end / PI).floor();
    let at = |n: f64| x0[0] - 0.6 * n;
    let sign = if half % 2.0 == 0.0 { 1.0 } else { -1.0 };
    let radius = at(half) - 0.3;
    let phase = end - half * PI;
    [sign * (0.3 + radius * phase.cos()), -sign * radius * phase.sin()]
}

#[test]
fn friction_reversals() -> Result<(), Error> {
    let cases = (0..10).map(|case| (vector![5.0 + 0.1 * f64::from(case), 0.0], 7.0 + 1.3 * f64::from(case)));
    within_thirty_tolerances!(Rubbed, cases, exact_rubbed);
    Ok(())
}

const FAST_RATE: f64 = 1e4;

/// `x` follows a parabola at once from above, and slowly from below.
#[ode]
fn followed(x: [f64; 1], t: f64) -> [f64; 1] {
    let gap = x[0] - 0.5 * (t - 1.0) * (t - 1.0);
    [-(if gap > 0.0 { 1e4 } else { 1.0 }) * gap]
}

/// `gap = (1 − t)/k + 1/k²` until that is zero, at `1 + 1/k`; behind it that of a rate of one.
fn exact_followed(_: SVector<f64, 1>, end: f64) -> [f64; 1] {
    let border = 1.0 + 1.0 / FAST_RATE;
    [0.5 * (end - 1.0) * (end - 1.0) + 2.0 - end + (1.0 / FAST_RATE - 1.0) * (border - end).exp()]
}

/// With the Jacobian of the fast side increments on the slow one are small, and their rate is
/// nearly one.
#[test]
fn rate_reduced_by_four_orders_of_magnitude() -> Result<(), Error> {
    let x0 = vector![0.5 + 1.0 / FAST_RATE + 1.0 / (FAST_RATE * FAST_RATE)];
    let cases = (0..10).map(|case| (x0, 1.5 + 0.17 * f64::from(case)));
    within_thirty_tolerances!(Followed, cases, exact_followed);
    Ok(())
}
