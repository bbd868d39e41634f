//! Errors of forces whose derivatives jump inside steps follow the tolerance nearly as those of
//! smooth ones do.
//!
//! The reference is a closed form: `ẍ = −4 x − 0.4 ẋ + f(t)` with `f = max(0, sin t)ᵏ`, which is a
//! sum of harmonics from `2jπ` to `(2j + 1)π` and zero from there to `(2j + 2)π`.

use casados::tables::Linear;
use casados::{Adaptive, AdaptiveOptions, DormandPrince5, DormandPrince8, Gauss, Radau, ode};
use nalgebra::{SVector, Vector2, vector};
use std::f64::consts::PI;

const STIFFNESS: f64 = 4.0;
const DAMPING: f64 = 0.4;

/// p = [what max(0, sin t), its square and its cube count].
#[ode]
fn pushed(x: [f64; 2], p: [f64; 3], t: f64) -> [f64; 2] {
    let push = t.sin().max(0.0);
    [x[1], -4.0 * x[0] - 0.4 * x[1] + p[0] * push + p[1] * push * push + p[2] * push * push * push]
}

/// `(m, α, β)` of the terms `α cos m t + β sin m t` of `sinᵏ t`.
fn harmonics(k: usize) -> [(f64, f64, f64); 2] {
    match k {
        1 => [(1.0, 0.0, 1.0), (0.0, 0.0, 0.0)],
        2 => [(0.0, 0.5, 0.0), (2.0, -0.5, 0.0)],
        _ => [(1.0, 0.0, 0.75), (3.0, 0.0, -0.25)],
    }
}

/// The periodic solution `(x, ẋ)` under `sinᵏ t` at a time.
fn forced_solution(k: usize, t: f64) -> Vector2<f64> {
    let mut sum = Vector2::zeros();
    for (m, alpha, beta) in harmonics(k) {
        // (4 − m²) a + 0.4 m b = α,  −0.4 m a + (4 − m²) b = β
        let (real, imaginary) = (STIFFNESS - m * m, DAMPING * m);
        let size = real * real + imaginary * imaginary;
        let a = (real * alpha - imaginary * beta) / size;
        let b = (imaginary * alpha + real * beta) / size;
        let (sin, cos) = (m * t).sin_cos();
        sum += vector![a * cos + b * sin, m * (b * cos - a * sin)];
    }
    sum
}

/// The free solution after a time.
fn free_solution(x: Vector2<f64>, t: f64) -> Vector2<f64> {
    let decay = 0.5 * DAMPING;
    let omega = (STIFFNESS - decay * decay).sqrt();
    let (sin, cos) = (omega * t).sin_cos();
    let b = (x[1] + decay * x[0]) / omega;
    (-decay * t).exp()
        * vector![x[0] * cos + b * sin, (b * omega - decay * x[0]) * cos - (x[0] * omega + decay * b) * sin]
}

fn exact(k: usize, x0: Vector2<f64>, end: f64) -> Vector2<f64> {
    let (mut x, mut t, mut half) = (x0, 0.0, 0usize);
    while t < end {
        let next = end.min(PI * (half as f64 + 1.0));
        let on = |t| if half.is_multiple_of(2) { forced_solution(k, t) } else { Vector2::zeros() };
        x = free_solution(x - on(t), next - t) + on(next);
        (t, half) = (next, half + 1);
    }
    x
}

const TOLERANCES: [f64; 4] = [1e-4, 1e-6, 1e-8, 1e-10];
const CASES: usize = 40;

/// Errors in tolerances, all of them; of each power and tolerance the largest is printed, and in
/// brackets the evaluations of a run.
macro_rules! errors {
    ($name:literal, $method:ty) => {{
        let mut all = Vec::new();
        for k in 1..=3 {
            print!("| {k} | {} |", $name);
            let mut p = SVector::<f64, 3>::zeros();
            p[k - 1] = 1.0;
            for tolerance in TOLERANCES {
                let options = AdaptiveOptions { rtol: tolerance, atol: tolerance, ..Default::default() };
                let mut adaptive = Adaptive::<Pushed, $method>::new(options).expect("valid");
                adaptive.set_parameters(&p).expect("finite");
                let (mut largest, mut evaluations) = (0.0f64, 0);
                for case in 0..CASES {
                    let (phase, end) = (case as f64, 12.0 + 0.2 * case as f64);
                    let x0 = vector![phase.cos(), phase.sin()];
                    let x = adaptive.solve(&x0, &SVector::zeros(), end).expect("a solution").x;
                    evaluations += adaptive.statistics().residuals;
                    let exact = exact(k, x0, end);
                    let relative = |(x, exact): (&f64, &f64)| (x - exact).abs() / (1.0 + exact.abs());
                    let error = x.iter().zip(&exact).map(relative).fold(0.0, f64::max) / tolerance;
                    largest = largest.max(error);
                    all.push(error);
                }
                print!(" {largest:.2} ({}) |", evaluations / CASES);
            }
            println!();
        }
        all
    }};
}

/// The model says where it changes its branch: no run is off by more than thirty tolerances.
/// Where only the shape of the defect tells, one in fifteen is.
#[test]
fn derivative_jumps_within_steps() {
    for errors in [
        errors!("Radau", Radau),
        errors!("Gauss, s = 3", Gauss<3>),
        errors!("Gauss, s = 4", Gauss<4>),
        errors!("Dormand-Prince 5", DormandPrince5),
        errors!("Dormand-Prince 8", DormandPrince8),
    ] {
        let largest = errors.into_iter().fold(0.0, f64::max);
        assert!(largest <= 30.0, "{largest} tolerances");
    }
}

/// A spring that is stiffer on one side: `ẍ = −25 x` where `x > 0`, else `ẍ = −4 x`.
#[ode]
fn two_springs(x: [f64; 2]) -> [f64; 2] {
    let stiffness = if x[0] > 0.0 { 25.0 } else { 4.0 };
    [x[1], -stiffness * x[0]]
}

/// The same by a table.
const FORCE: Linear<3> = Linear::new([-10.0, 0.0, 10.0], [40.0, 0.0, -250.0]);

#[ode]
fn two_springs_of_a_table(x: [f64; 2]) -> [f64; 2] {
    [x[1], FORCE.value(x[0])]
}

/// From `x = 0` with `ẋ = v > 0`: half a period of five radians per second to the right, half a
/// period of two to the left, and so on; `ẋ` is `v` again.
fn between_springs(v: f64, t: f64) -> Vector2<f64> {
    let (right, left) = (PI / 5.0, PI / 2.0);
    let t = t.rem_euclid(right + left);
    let (sign, omega, t) = if t < right { (1.0, 5.0, t) } else { (-1.0, 2.0, t - right) };
    let (sin, cos) = (omega * t).sin_cos();
    sign * vector![v * sin / omega, v * cos]
}

macro_rules! errors_of_springs {
    ($model:ty, $method:ty) => {{
        let mut largest = 0.0f64;
        for (tolerance, case) in TOLERANCES.into_iter().flat_map(|t| (0..10).map(move |case| (t, case))) {
            let options = AdaptiveOptions { rtol: tolerance, atol: tolerance, ..Default::default() };
            let mut adaptive = Adaptive::<$model, $method>::new(options).expect("valid");
            let (v, end) = (1.0 + 0.1 * f64::from(case), 5.0 + 0.37 * f64::from(case));
            let x = adaptive.solve(&vector![0.0, v], &SVector::zeros(), end).expect("a solution").x;
            let exact = between_springs(v, end);
            let relative = |(x, exact): (&f64, &f64)| (x - exact).abs() / (1.0 + exact.abs());
            let error = x.iter().zip(&exact).map(relative).fold(0.0, f64::max) / tolerance;
            largest = largest.max(error);
        }
        largest
    }};
}

/// Where the state decides, the time of the change has an error, too.
#[test]
fn state_dependent_switches() {
    let all = [
        errors_of_springs!(TwoSprings, Radau),
        errors_of_springs!(TwoSprings, Gauss<3>),
        errors_of_springs!(TwoSprings, Gauss<4>),
        errors_of_springs!(TwoSprings, DormandPrince5),
        errors_of_springs!(TwoSprings, DormandPrince8),
        errors_of_springs!(TwoSpringsOfATable, Radau),
        errors_of_springs!(TwoSpringsOfATable, Gauss<4>),
        errors_of_springs!(TwoSpringsOfATable, DormandPrince5),
        errors_of_springs!(TwoSpringsOfATable, DormandPrince8),
    ];
    assert!(all.iter().all(|error| *error <= 30.0), "{all:?} tolerances");
}
