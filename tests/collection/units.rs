//! Problems in units of engineers: states are millions, and small numbers beside them.

use super::ocps::line;
use super::{Test, solve};
use casados::ocp::{Formulation, GeneralCost, HeapIpm, HeapOcp, Horizon, Problem, SecondOrder};
use casados::prelude::*;
use casados::{Erk, Rk4};
use std::f64::consts::PI;

/// Components of the state at a stage.
pub fn fix<P: Formulation<f64>>(ocp: &mut HeapOcp<P>, stage: usize, values: &[(usize, f64)]) -> Test {
    for &(i, value) in values {
        ocp.bound(&format!("x[{i}]"), stage..=stage, value, value)?;
    }
    Ok(())
}

/// Converged in at most so many iterations, at a minimum of IPOPT's (CasADi 3.8.2, the same
/// discretisation and guess, a tolerance of 1e-6). IPOPT relaxes bounds by 1e-8 of their size,
/// which changes objectives by as much, times ratios of sizes and differences of up to ten.
pub fn assert_solved<P: Formulation<f64, Dynamics: casados::ocp::SecondOrder<f64>>>(
    ocp: &mut HeapOcp<P>,
    minimum: f64,
    iterations: usize,
) -> Test {
    let (outcome, _) = solve(ocp)?;
    assert!(outcome.is_converged() && outcome.iterations <= iterations, "{outcome}");
    assert!((outcome.objective - minimum).abs() <= 1e-7 * minimum.abs(), "{outcome}");
    Ok(())
}

/// The re-entry of a space shuttle over `τ ∈ [0, 1]`: altitude in feet, longitude, latitude, speed
/// in feet per second, flight path angle, azimuth, and the time that everything takes; the angle of
/// attack in degrees and the bank angle. J. T. Betts, "Practical methods for optimal control and
/// estimation using nonlinear programming", 2010, example 6.1.
#[ode]
fn shuttle(x: [f64; 7], u: [f64; 2]) -> [f64; 7] {
    let [h, _, latitude, v, path, azimuth, t] = x;
    let r = 20902900.0 + h;
    let pressure = 0.5 * 0.002378 * (-h / 23800.0).exp() * v * v * 2690.0;
    let lift = pressure * (-0.20704 + 0.029244 * u[0]);
    let drag = pressure * (0.07854 - 0.61592e-2 * u[0] + 0.621408e-3 * u[0] * u[0]);
    let (mass, gravity) = (203000.0 / 32.174, 0.14076539e17 / (r * r));
    let ((sb, cb), (sp, cp), (sa, ca)) = (u[1].sin_cos(), path.sin_cos(), azimuth.sin_cos());
    [
        t * v * sp,
        t * v / r * cp * sa / latitude.cos(),
        t * v / r * cp * ca,
        t * (-drag / mass - gravity * sp),
        t * (lift / (mass * v) * cb + cp * (v / r - gravity / v)),
        t * (lift * sb / (mass * v * cp) + v / (r * latitude.cos()) * cp * sa * latitude.sin()),
        0.0,
    ]
}

#[function]
fn south(x: [f64; 7], _u: [f64; 2]) -> f64 {
    -x[2]
}

/// As far north as possible. IPOPT takes 49 iterations.
#[test]
fn shuttle_in_feet() -> Test {
    let (n, degree) = (60, PI / 180.0);
    let erk = Erk::<Shuttle, Rk4>::new(Options { steps: 2, ..Options::default() })?;
    let mut ocp = Problem::new(erk)
        .terminal_cost(GeneralCost::<South>::new())
        .on(Horizon::uniform(n, 1.0 / n as f64))?;
    ocp.free_initial_state();
    for (name, lower, upper) in [
        ("x[0]", 0.0, 3e5),
        ("x[2]", -89.0 * degree, 89.0 * degree),
        ("x[3]", 1e3, 3e4),
        ("x[4]", -89.0 * degree, 89.0 * degree),
        ("x[6]", 500.0, 4000.0),
        ("u[0]", -10.0, 50.0),
        ("u[1]", -89.0 * degree, degree),
    ] {
        ocp.bound(name, .., lower, upper)?;
    }
    let start = [260000.0, 0.0, 0.0, 25600.0, -degree, 90.0 * degree, 2000.0];
    let values: Vec<_> = start.into_iter().enumerate().take(6).collect();
    fix(&mut ocp, 0, &values)?;
    fix(&mut ocp, n, &[(0, 80000.0), (3, 2500.0), (4, -5.0 * degree)])?;
    let end = [80000.0, 1.0, 0.5, 2500.0, -5.0 * degree, 0.1, 2000.0];
    line(&mut ocp, &start, &end, &[17.0, -0.7])?;
    assert_solved(&mut ocp, -0.5958546686713527, 25)
}

/// A satellite of a tonne over `τ ∈ [0, 1]`, pushed by 100 N: radius in metres, radial and
/// tangential speed, mass, and the time that everything takes; the direction of the thrust.
#[ode]
fn satellite(x: [f64; 5], u: [f64; 1]) -> [f64; 5] {
    let ([r, radial, along, mass, t], (s, c)) = (x, u[0].sin_cos());
    [
        t * radial,
        t * (along * along / r - 3.986004418e14 / (r * r) + 100.0 / mass * s),
        t * (-radial * along / r + 100.0 / mass * c),
        -t * 100.0 / (300.0 * 9.80665),
        0.0,
    ]
}

#[function]
fn duration(x: [f64; 5], _u: [f64; 1]) -> f64 {
    x[4]
}

/// From a circular orbit to one that is 1000 km higher, in the shortest time.
fn transfer() -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Box<dyn std::error::Error>>
{
    let n = 60;
    let erk = Erk::<Satellite, Rk4>::new(Options { steps: 2, ..Options::default() })?;
    let mut ocp = Problem::new(erk)
        .terminal_cost(GeneralCost::<Duration>::new())
        .on(Horizon::uniform(n, 1.0 / n as f64))?;
    ocp.free_initial_state();
    ocp.bound("x[4]", .., 100.0, 20000.0)?.bound("u", .., -3.2, 3.2)?;
    let [(low, fast), (high, slow)] = [7e6, 8e6].map(|r: f64| (r, (3.986004418e14 / r).sqrt()));
    fix(&mut ocp, 0, &[(0, low), (1, 0.0), (2, fast), (3, 1000.0)])?;
    fix(&mut ocp, n, &[(0, high), (1, 0.0), (2, slow)])?;
    line(&mut ocp, &[low, 0.0, fast, 1000.0, 5000.0], &[high, 0.0, slow, 850.0, 5000.0], &[0.0])?;
    Ok(ocp)
}

/// IPOPT takes 273 iterations.
#[test]
fn satellite_in_metres() -> Test {
    assert_solved(&mut transfer()?, 5158.556192072234, 25)
}

/// What makes Newton's equations convex is measured in units: in that of the angle of the thrust
/// alone it would hold the radius where it is.
#[test]
fn satellite_by_interior_point() -> Test {
    let mut ocp = transfer()?;
    let outcome = HeapIpm::new(&ocp)?.solve(&mut ocp)?;
    assert!(outcome.is_converged() && outcome.iterations <= 20, "{outcome}");
    assert!((outcome.objective - 5158.556192072234).abs() <= 1e-7 * 5158.6, "{outcome}");
    Ok(())
}

/// A cart whose jerk is the control, in millimetres: it comes back in a second, with a wall after
/// 40 mm. With zero as the guess bounds alone, which are not active, say that the acceleration is
/// 1e4, the control 1e5, and forces 1e6.
#[ode]
fn jerked(x: [f64; 3], u: [f64; 1]) -> [f64; 3] {
    [x[1], x[2], u[0]]
}

#[function]
fn square(_x: [f64; 3], u: [f64; 1]) -> f64 {
    u[0] * u[0]
}

/// No QP can be solved to more digits than its forces have. IPOPT takes 235 iterations.
#[test]
fn cart_in_millimetres() -> Test {
    let n = 60;
    let mut ocp = Problem::new(Erk::<Jerked, Rk4>::new(Options::default())?)
        .running_cost(GeneralCost::<Square>::new())
        .on(Horizon::uniform(n, 1.0 / n as f64))?;
    ocp.free_initial_state();
    ocp.bound("x[0]", .., f64::NEG_INFINITY, 40.0)?.bound("u", .., -2e6, 2e6)?;
    ocp.bound("x[2]", .., -1e5, 1e5)?;
    let ends = [[0.0, 1000.0, 0.0], [0.0, -1000.0, 0.0]];
    for (stage, state) in [0, n].into_iter().zip(ends) {
        fix(&mut ocp, stage, &[(0, state[0]), (1, state[1]), (2, state[2])])?;
    }
    line(&mut ocp, &ends[0], &ends[1], &[0.0])?;
    assert_solved(&mut ocp, 27303029807.437916, 30)
}
