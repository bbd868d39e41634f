//! What solutions keep, methods keep: energy and angular momentum of an orbit, the way back, sums.

use super::orbit::{Kepler, STEP, changes, perihelion};
use crate::models::chemistry::Robertson;
use casados::{Adaptive, AdaptiveOptions, Erk, Gauss, Irk, Options, Radau, RadauIIA, Rk4, ode};
use nalgebra::{SVector, vector};

/// Each step rounds `x` a few times: a random walk of steps of four roundings, and three standard
/// deviations.
fn random_walk(steps: usize) -> f64 {
    3.0 * (steps as f64).sqrt() * 4.0 * f64::EPSILON / 2.0
}

/// Three orbits with 80 steps each.
const STEPS: usize = 240;

macro_rules! of_steps {
    ($method:ty) => {{
        let mut irk = Irk::<Kepler, $method>::new(Options::default()).expect("valid");
        changes(&mut irk, perihelion(0.6, 0.0), STEPS, STEP)
    }};
}

/// A quadratic invariant is kept by every Gauss method, however far from the solution it is.
#[test]
fn t08_angular_momentum() {
    macro_rules! check {
        ($($s:literal)*) => {$(
            let [momentum, _] = of_steps!(Gauss<$s>);
            assert!(momentum <= random_walk(STEPS), "s = {}: {momentum:e}", $s);
        )*};
    }
    check!(1 2 3 4 5 6 7 8 9);
    // Radau IIA does not: it is no property of the test.
    assert!(of_steps!(RadauIIA<3>)[0] > 1e-9);
}

/// The energy is kept as far as the method solves the equation.
#[test]
fn t07_energy() {
    // Rounding of x changes the energy more than the momentum: at the perihelion 1/r and v² cancel,
    // and each is six times the energy.
    let bound = 6.0 * random_walk(STEPS);
    for [_, energy] in [of_steps!(Gauss<8>), of_steps!(Gauss<9>)] {
        assert!(energy <= bound, "{energy:e}");
    }
}

/// As many steps as an unoptimised build takes in a second; a million are in
/// `tests/optimised/long_runs.rs`.
#[test]
fn t09_compensated_sums() {
    const INTERVALS: usize = 4;
    let run = |compensated| {
        let options = Options { steps: 500, compensated, ..Default::default() };
        let mut irk = Irk::<Kepler, Gauss<9>>::new(options).expect("valid");
        changes(&mut irk, perihelion(0.6, 0.0), INTERVALS, 500.0 * STEP)
    };
    let [plain, compensated] = [run(false), run(true)];
    println!("{plain:?} {compensated:?}");
    // Plain sums walk randomly; compensated ones are rounded once in an interval.
    assert!(plain[0] <= random_walk(2000) && plain[1] <= 6.0 * random_walk(2000), "{plain:?}");
    assert!(compensated[0] <= random_walk(2000) / 2.0, "{compensated:?}");
    assert!(compensated[1] <= 6.0 * random_walk(2000) / 2.0, "{compensated:?}");
}

/// Without dynamics nothing but the sum is left: one is lost in each step of `ẋ = 2⁻⁵³`, beside
/// one, unless it is carried along.
#[ode]
fn creep(_x: f64, u: f64) -> f64 {
    u
}

#[test]
fn t09_compensation_between_calls() {
    let (x0, u) = (vector![1.0], vector![f64::EPSILON / 4.0]);
    macro_rules! check {
        ($integrator:ident, $method:ty) => {
            for (compensated, end) in [(false, 1.0), (true, 1.0 + 256.0 * f64::EPSILON)] {
                let options = Options { steps: 1024, compensated, ..Default::default() };
                let mut integrator = $integrator::<Creep, $method>::new(options).expect("valid");
                let step = integrator.forward(&x0, &u, 1024.0).expect("a sum");
                assert_eq!(step.x[0], end);
                // Each of 1024 sums is rounded.
                assert!((step.dx_du[0] - 1024.0).abs() <= 1024.0 * 1024.0 * f64::EPSILON);
                assert_eq!(integrator.solve(&x0, &u, 1024.0).expect("a sum").x[0], end);
                assert_eq!(integrator.adjoint(&x0, &u, 1024.0, &vector![1.0]).expect("a sum").x[0], end);
            }
        };
    }
    check!(Irk, Gauss<2>);
    check!(Irk, RadauIIA<3>);
    check!(Erk, Rk4);
}

/// Gauss methods are symmetric: ten thousand steps, and as many back.
#[test]
fn t10_reversibility() {
    const STEPS: usize = 10_000;
    let mut irk = Irk::<Kepler, Gauss<4>>::new(Options { steps: 100, ..Default::default() }).expect("valid");
    let x0 = perihelion(0.0, 0.0);
    let mut x = x0;
    for h in [STEP, -STEP] {
        for _ in 0..STEPS / 100 {
            x = irk.solve(&x, &SVector::zeros(), 100.0 * h).expect("an orbit").x;
        }
    }
    let error = (x - x0).amax();
    println!("{error:e}");
    assert!(error <= 1e-11, "{error:e}");
}

/// Mass: the sum of the concentrations, the sums of their derivatives.
#[test]
fn t11_linear_invariants_of_reactions() {
    let options = AdaptiveOptions { rtol: 1e-8, atol: 1e-16, ..Default::default() };
    let mut adaptive = Adaptive::<Robertson, Radau>::new(options).expect("valid");
    adaptive.set_parameters(&vector![0.04, 3e7, 1e4]).expect("finite");
    let x0 = vector![1.0, 0.0, 0.0];
    let forward = *adaptive.forward(&x0, &SVector::zeros(), 1e11).expect("a solution");
    let rounding = adaptive.statistics().steps as f64 * f64::EPSILON;
    let sum = forward.x.sum();
    println!("{:e} of {rounding:e}", sum - 1.0);
    assert!((sum - 1.0).abs() <= rounding, "{:e} {rounding:e}", sum - 1.0);
    for column in 0..3 {
        let sum = forward.dx_dx0.column(column).sum();
        println!("{:e}", sum - 1.0);
        assert!((sum - 1.0).abs() <= rounding, "x0[{column}]: {:e} {rounding:e}", sum - 1.0);
        // A step adds three products to an element, 4 ε/2 of terms that, times the parameter, are
        // 1/2 at most; in three rows.
        let sum = forward.dx_dp.column(column).sum() * [0.04, 3e7, 1e4][column];
        println!("{sum:e} {}", forward.dx_dp.column(column).amax());
        assert!(sum.abs() <= 3.0 * rounding, "p[{column}]: {sum:e} {rounding:e}");
    }
}
