//! Cranes, arms, pendulums, a motor.

use super::{Failure, Grid, fix, line, rk4};
use casados::ocp::{Formulation, GeneralCost, HeapOcp, Problem, SecondOrder};
use casados::{Gauss, Irk, Options, dae, function, ode};
use core::f64::consts::PI;

/// A pendulum on a cart: position, angle from above, their velocities; a force.
#[ode]
pub fn cart_and_pole(x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    const CART: f64 = 1.0; // kg
    const BOB: f64 = 0.1; // kg
    const LENGTH: f64 = 0.8; // m
    const G: f64 = 9.81; // m/s²

    let [_, angle, v, rate] = x;
    let (s, c) = angle.sin_cos();
    let d = CART + BOB - BOB * c * c;
    [
        v,
        rate,
        (-BOB * LENGTH * s * rate * rate + BOB * G * c * s + u[0]) / d,
        (-BOB * LENGTH * c * s * rate * rate + u[0] * c + (CART + BOB) * G * s) / (LENGTH * d),
    ]
}

#[function]
fn swing(x: [f64; 4], u: [f64; 1]) -> f64 {
    5e-3 * (x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3] + u[0] * u[0])
}

/// Swinging up in two seconds.
pub fn cart_pole(grid: Grid) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(40);
    let mut ocp = Problem::new(rk4::<CartAndPole>(2)?)
        .running_cost(GeneralCost::<Swing>::new())
        .on(grid.over(n, 2.0))?;
    ocp.fix_initial_state(&[0.0, PI, 0.0, 0.0])?;
    ocp.bound("x[0]", .., -2.0, 2.0)?.bound("u", .., -20.0, 20.0)?;
    fix(&mut ocp, n, &[0.0; 4])?;
    line(&mut ocp, &[0.0, PI, 0.0, 0.0], &[0.0; 4], &[0.0])?;
    Ok(ocp)
}

/// A crane over `τ ∈ [0, 1]`: position and velocity of the trolley, angle and rate of the rope, its
/// length and how fast it grows, and the time that everything takes; accelerations of trolley and
/// winch.
#[ode]
pub fn overhead_crane(x: [f64; 7], u: [f64; 2]) -> [f64; 7] {
    let [_, v, angle, rate, length, growth, time] = x;
    [
        time * v,
        time * u[0],
        time * rate,
        -time * (u[0] * angle.cos() + 9.81 * angle.sin() + 2.0 * growth * rate) / length,
        time * growth,
        time * u[1],
        0.0,
    ]
}

#[function]
fn crane_time(x: [f64; 7], _u: [f64; 2]) -> f64 {
    x[6]
}

#[function]
fn crane_effort(_x: [f64; 7], u: [f64; 2]) -> f64 {
    1e-3 * (u[0] * u[0] + u[1] * u[1])
}

/// Ten metres from rest to rest, lifting by two, in the shortest time.
pub fn crane(grid: Grid) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(40);
    let mut ocp = Problem::new(rk4::<OverheadCrane>(1)?)
        .running_cost(GeneralCost::<CraneEffort>::new())
        .terminal_cost(GeneralCost::<CraneTime>::new())
        .on(grid.over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[1]", .., -4.0, 4.0)?.bound("x[2]", .., -0.5, 0.5)?.bound("x[4]", .., 1.0, 10.0)?;
    ocp.bound("x[5]", .., -2.0, 2.0)?.bound("x[6]", .., 0.5, 30.0)?;
    ocp.bound("u[0]", .., -2.0, 2.0)?.bound("u[1]", .., -1.0, 1.0)?;
    let (start, end) = ([0.0, 0.0, 0.0, 0.0, 5.0, 0.0, 6.0], [10.0, 0.0, 0.0, 0.0, 3.0, 0.0, 6.0]);
    fix(&mut ocp, 0, start.get(..6).unwrap_or_default())?;
    fix(&mut ocp, n, end.get(..6).unwrap_or_default())?;
    line(&mut ocp, &start, &end, &[0.0; 2])?;
    Ok(ocp)
}

/// An arm of two equal bars over `τ ∈ [0, 1]`: angles, rates, and the time that everything takes;
/// two torques.
#[ode]
pub fn two_bars(x: [f64; 5], u: [f64; 2]) -> [f64; 5] {
    let [_, elbow, first, second, time] = x;
    let (s, c) = elbow.sin_cos();
    let (m11, m12, m22) = (1.0 / 3.0 + 1.0 + 1.0 / 3.0 + c, 1.0 / 3.0 + 0.5 * c, 1.0 / 3.0);
    let r1 = u[0] + 0.5 * s * (2.0 * first * second + second * second);
    let r2 = u[1] - 0.5 * s * first * first;
    let d = m11 * m22 - m12 * m12;
    [time * first, time * second, time * (m22 * r1 - m12 * r2) / d, time * (m11 * r2 - m12 * r1) / d, 0.0]
}

#[function]
fn arm_time(x: [f64; 5], _u: [f64; 2]) -> f64 {
    x[4]
}

/// From rest to rest in the shortest time.
pub fn arm(grid: Grid) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(40);
    let mut ocp =
        Problem::new(rk4::<TwoBars>(1)?).terminal_cost(GeneralCost::<ArmTime>::new()).on(grid.over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[4]", .., 0.1, 20.0)?.bound("u[0]", .., -5.0, 5.0)?.bound("u[1]", .., -3.0, 3.0)?;
    fix(&mut ocp, 0, &[0.0; 4])?;
    fix(&mut ocp, n, &[2.0, 1.5, 0.0, 0.0])?;
    line(&mut ocp, &[0.0, 0.0, 0.0, 0.0, 2.0], &[2.0, 1.5, 0.0, 0.0, 2.0], &[0.0; 2])?;
    Ok(ocp)
}

/// A pendulum of one metre: angle from below, rate; an acceleration.
#[ode]
pub fn driven_pendulum(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [x[1], -9.81 * x[0].sin() + u[0]]
}

#[function]
fn pendulum_effort(_x: [f64; 2], u: [f64; 1]) -> f64 {
    0.5 * u[0] * u[0]
}

/// Swinging up in four seconds by less than a third of what would hold it.
pub fn pendulum(grid: Grid) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(50);
    let mut ocp = Problem::new(rk4::<DrivenPendulum>(2)?)
        .running_cost(GeneralCost::<PendulumEffort>::new())
        .on(grid.over(n, 4.0))?;
    ocp.fix_initial_state(&[0.0, 0.0])?.bound("u", .., -3.0, 3.0)?;
    fix(&mut ocp, n, &[PI, 0.0])?;
    line(&mut ocp, &[0.0, 0.0], &[PI, 0.0], &[0.0])?;
    Ok(ocp)
}

/// A robot that floats: position, angle, their velocities; four thrusters that push only, in pairs
/// at a distance of 0.2 from its centre. Y. Sakawa, "Trajectory planning of a free-flying robot by
/// using the optimal control", Optim. Control Appl. Meth. 20 (1999).
#[ode]
pub fn floating_robot(x: [f64; 6], u: [f64; 4]) -> [f64; 6] {
    let (s, c) = x[2].sin_cos();
    let force = u[0] - u[1] + u[2] - u[3];
    [x[3], x[4], x[5], force * c, force * s, 0.2 * (u[0] - u[1]) - 0.2 * (u[2] - u[3])]
}

#[function]
fn fuel(_x: [f64; 6], u: [f64; 4]) -> f64 {
    u[0] + u[1] + u[2] + u[3]
}

/// From rest to rest in twelve seconds with as little fuel as possible.
pub fn robot(grid: Grid) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(40);
    let mut ocp = Problem::new(rk4::<FloatingRobot>(1)?)
        .running_cost(GeneralCost::<Fuel>::new())
        .on(grid.over(n, 12.0))?;
    let start = [-10.0, -10.0, PI / 2.0, 0.0, 0.0, 0.0];
    ocp.fix_initial_state(&start)?.bound("u", .., 0.0, 1.0)?;
    fix(&mut ocp, n, &[0.0; 6])?;
    line(&mut ocp, &start, &[0.0; 6], &[0.0; 4])?;
    Ok(ocp)
}

/// A motor that lifts an arm: angle, rate; the current is algebraic, as coils are nonlinear; a
/// voltage.
#[dae]
pub fn lifting_motor(xdot: [f64; 2], x: [f64; 2], z: [f64; 1], u: [f64; 1]) -> [f64; 3] {
    [xdot[0] - x[1], xdot[1] + x[0].sin() + 0.1 * x[1] - z[0], z[0] + 0.2 * z[0].powi(3) + 0.5 * x[1] - u[0]]
}

#[function]
fn voltage(_x: [f64; 2], _z: [f64; 1], u: [f64; 1]) -> f64 {
    u[0] * u[0]
}

/// Half a turn upwards in three seconds.
pub fn motor(grid: Grid) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(30);
    let mut ocp = Problem::new(Irk::<LiftingMotor, Gauss<2>>::new(Options::default())?)
        .running_cost(GeneralCost::<Voltage>::new())
        .on(grid.over(n, 3.0))?;
    ocp.fix_initial_state(&[0.0, 0.0])?.bound("x[1]", .., -2.0, 2.0)?.bound("u", .., -4.0, 4.0)?;
    fix(&mut ocp, n, &[PI, 0.0])?;
    line(&mut ocp, &[0.0, 0.0], &[PI, 0.0], &[0.0])?;
    Ok(ocp)
}
