//! Rotors and rockets.

use super::{Failure, Grid, fix, line, rk4};
use casados::ocp::{Constraint, Formulation, GeneralCost, HeapOcp, Problem, SecondOrder};
use casados::{function, ode};

const FREE: f64 = f64::INFINITY;
const HOVER: f64 = 9.81 / 4.0; // N, of each rotor

/// A quadrotor over `τ ∈ [0, 1]`: position, quaternion, velocity, rates, and the time that
/// everything takes; four thrusts.
#[ode]
pub fn quaternion_quadrotor(x: [f64; 14], u: [f64; 4]) -> [f64; 14] {
    let (w, a, b, c) = (x[3], x[4], x[5], x[6]);
    let (p, q, r, time) = (x[10], x[11], x[12], x[13]);
    let thrust = u[0] + u[1] + u[2] + u[3];
    [
        time * x[7],
        time * x[8],
        time * x[9],
        -0.5 * time * (a * p + b * q + c * r),
        0.5 * time * (w * p + b * r - c * q),
        0.5 * time * (w * q + c * p - a * r),
        0.5 * time * (w * r + a * q - b * p),
        2.0 * time * (a * c + w * b) * thrust,
        2.0 * time * (b * c - w * a) * thrust,
        time * ((w * w - a * a - b * b + c * c) * thrust - 9.81),
        time * (0.2 * (u[1] - u[3]) - 0.01 * q * r) / 0.01,
        time * (0.2 * (u[2] - u[0]) + 0.01 * p * r) / 0.01,
        time * 0.02 * (u[0] - u[1] + u[2] - u[3]) / 0.02,
        0.0,
    ]
}

#[function]
fn quadrotor_time(x: [f64; 14], _u: [f64; 4]) -> f64 {
    x[13]
}

#[function]
fn quadrotor_effort(x: [f64; 14], u: [f64; 4]) -> f64 {
    let (a, b, c, d) = (u[0] - HOVER, u[1] - HOVER, u[2] - HOVER, u[3] - HOVER);
    1e-2 * (a * a + b * b + c * c + d * d + x[10] * x[10] + x[11] * x[11] + x[12] * x[12])
}

/// Squares of distances from the axes of two cylinders, less those of their radii.
#[function]
fn cylinders(x: [f64; 14], _u: [f64; 4]) -> [f64; 2] {
    let (a, b) = (x[0] - 2.0, x[1] - 0.2);
    let (c, d) = (x[0] - 4.0, x[1] + 0.3);
    [a * a + b * b - 0.64, c * c + d * d - 0.64]
}

/// Six metres ahead between two soft cylinders in the shortest time.
pub fn quadrotor(grid: Grid) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(30);
    let mut ocp = Problem::new(rk4::<QuaternionQuadrotor>(1)?)
        .running_cost(GeneralCost::<QuadrotorEffort>::new())
        .terminal_cost(GeneralCost::<QuadrotorTime>::new())
        .path_constraints(Constraint::<Cylinders>::new([0.0; 2], [FREE; 2]).soft(100.0, 0.0))
        .on(grid.over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[1]", .., -1.5, 1.5)?.bound("x[13]", .., 0.3, 20.0)?.bound("u", .., 0.0, 6.0)?;
    let start = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    fix(&mut ocp, 0, &start)?;
    let end = [6.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    fix(&mut ocp, n, &end)?;
    // The norm of the quaternion is what the others leave.
    ocp.bound("x[3]", n..=n, -FREE, FREE)?;
    let from = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0];
    let to = [6.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0];
    line(&mut ocp, &from, &to, &[HOVER; 4])?;
    Ok(ocp)
}

/// A rocket in a plane over `τ ∈ [0, 1]`: position, tilt, velocity, rate, mass, and the time that
/// everything takes; thrust and gimbal angle.
#[ode]
pub fn rocket(x: [f64; 8], u: [f64; 2]) -> [f64; 8] {
    let [_, _, tilt, v, w, rate, mass, time] = x;
    let (s, c) = (tilt + u[1]).sin_cos();
    [
        time * v,
        time * w,
        time * rate,
        -time * u[0] * s / mass,
        time * (u[0] * c / mass - 9.81),
        -time * u[0] * u[1].sin() * 2.0 / (mass * 3.0),
        -time * u[0] / 300.0,
        0.0,
    ]
}

#[function]
fn spent(x: [f64; 8], _u: [f64; 2]) -> f64 {
    -x[6]
}

/// From 100 m down to rest with as little fuel as possible.
pub fn landing(grid: Grid) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(40);
    let mut ocp =
        Problem::new(rk4::<Rocket>(1)?).terminal_cost(GeneralCost::<Spent>::new()).on(grid.over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[1]", .., 0.0, FREE)?.bound("x[2]", .., -1.0, 1.0)?.bound("x[5]", .., -1.0, 1.0)?;
    ocp.bound("x[6]", .., 1.0, 10.0)?.bound("x[7]", .., 1.0, 30.0)?;
    ocp.bound("u[0]", .., 30.0, 200.0)?.bound("u[1]", .., -0.2, 0.2)?;
    fix(&mut ocp, 0, &[20.0, 100.0, 0.3, -5.0, -15.0, 0.0, 10.0])?;
    fix(&mut ocp, n, &[0.0; 6])?;
    let (from, to) =
        ([20.0, 100.0, 0.3, -5.0, -15.0, 0.0, 10.0, 8.0], [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 9.0, 8.0]);
    line(&mut ocp, &from, &to, &[100.0, 0.0])?;
    Ok(ocp)
}

/// Goddard's rocket over `τ ∈ [0, 1]`: height, velocity, mass, and the time that everything takes;
/// thrust. E. D. Dolan, J. J. Moré, T. S. Munson, "Benchmarking optimization software with COPS
/// 3.0", 2004.
#[ode]
pub fn goddard_rocket(x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    let [h, v, mass, time] = x;
    let drag = 310.0 * v * v * (-500.0 * (h - 1.0)).exp();
    [time * v, time * ((u[0] - drag) / mass - 1.0 / (h * h)), -time * u[0] / 0.5, 0.0]
}

#[function]
fn depth(x: [f64; 4], _u: [f64; 1]) -> f64 {
    -x[0]
}

/// As high as possible.
pub fn goddard(grid: Grid) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(50);
    let mut ocp = Problem::new(rk4::<GoddardRocket>(1)?)
        .terminal_cost(GeneralCost::<Depth>::new())
        .on(grid.over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[0]", .., 1.0, FREE)?.bound("x[1]", .., 0.0, FREE)?.bound("x[2]", .., 0.6, 1.0)?;
    ocp.bound("x[3]", .., 0.01, 1.0)?.bound("u", .., 0.0, 3.5)?;
    fix(&mut ocp, 0, &[1.0, 0.0, 1.0])?;
    ocp.bound("x[2]", n..=n, 0.6, 0.6)?;
    line(&mut ocp, &[1.0, 0.0, 1.0, 0.2], &[1.01, 0.0, 0.6, 0.2], &[1.75])?;
    Ok(ocp)
}
