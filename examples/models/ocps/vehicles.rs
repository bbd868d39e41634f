//! Cars: against time, at the limits of tyres, between obstacles.

use super::{Failure, Grid, fix, line, rk4};
use casados::ocp::{Constraint, Formulation, GeneralCost, HeapOcp, Problem, SecondOrder};
use casados::{function, ode};

const FREE: f64 = f64::INFINITY;

/// A kinematic car over `τ ∈ [0, 1]`: position, heading, speed, steering angle, acceleration, and
/// the time that everything takes; controls are the rates of steering and acceleration.
#[ode]
pub fn kinematic_car(x: [f64; 7], u: [f64; 2]) -> [f64; 7] {
    const WHEELBASE: f64 = 2.7; // m

    let [_, _, heading, speed, steering, acceleration, time] = x;
    [
        time * speed * heading.cos(),
        time * speed * heading.sin(),
        time * speed * steering.tan() / WHEELBASE,
        time * acceleration,
        time * u[0],
        time * u[1],
        0.0,
    ]
}

#[function]
fn car_time(x: [f64; 7], _u: [f64; 2]) -> f64 {
    x[6]
}

#[function]
fn car_effort(_x: [f64; 7], u: [f64; 2]) -> f64 {
    1e-3 * (u[0] * u[0] + u[1] * u[1])
}

/// From rest to rest, 50 m ahead and 20 m to the left.
pub fn car(grid: Grid) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    car_within(50.0, grid)
}

/// [`car`] in not more than some time.
pub fn car_within(
    most: f64,
    grid: Grid,
) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(40);
    let mut ocp = Problem::new(rk4::<KinematicCar>(1)?)
        .running_cost(GeneralCost::<CarEffort>::new())
        .terminal_cost(GeneralCost::<CarTime>::new())
        .on(grid.over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[3]", .., -1.0, 20.0)?.bound("x[4]", .., -0.6, 0.6)?.bound("x[5]", .., -5.0, 3.0)?;
    ocp.bound("x[6]", .., 0.1, most)?;
    ocp.bound("u[0]", .., -1.0, 1.0)?.bound("u[1]", .., -10.0, 10.0)?;
    fix(&mut ocp, 0, &[0.0; 6])?;
    fix(&mut ocp, n, &[50.0, 20.0, 0.0, 0.0, 0.0, 0.0])?;
    let time = f64::min(10.0, most);
    line(
        &mut ocp,
        &[0.0, 0.0, 0.0, 5.0, 0.0, 0.0, time],
        &[50.0, 20.0, 0.0, 5.0, 0.0, 0.0, time],
        &[0.0; 2],
    )?;
    Ok(ocp)
}

/// A single-track car on tyres by Pacejka's formula: position, heading, velocity along and across,
/// yaw rate, steering angle; controls are the rate of steering and the acceleration.
#[ode]
pub fn single_track(x: [f64; 7], u: [f64; 2]) -> [f64; 7] {
    const MASS: f64 = 1500.0; // kg
    const INERTIA: f64 = 2500.0; // kg m²
    const FRONT: f64 = 1.2; // m
    const REAR: f64 = 1.4; // m
    const LOAD: f64 = MASS * 9.81 / 2.0; // N, of each axle

    let [_, _, heading, along, across, rate, steering] = x;
    let front = steering - ((across + FRONT * rate) / along).atan();
    let rear = -((across - REAR * rate) / along).atan();
    let front = LOAD * (1.4 * (10.0 * front).atan()).sin();
    let rear = LOAD * (1.4 * (10.0 * rear).atan()).sin();
    [
        along * heading.cos() - across * heading.sin(),
        along * heading.sin() + across * heading.cos(),
        rate,
        u[1] - front * steering.sin() / MASS + across * rate,
        (front * steering.cos() + rear) / MASS - along * rate,
        (FRONT * front * steering.cos() - REAR * rear) / INERTIA,
        u[0],
    ]
}

#[function]
fn handling(x: [f64; 7], u: [f64; 2]) -> f64 {
    u[0] * u[0] + 0.01 * u[1] * u[1] + 0.1 * x[5] * x[5]
}

/// A double lane change in four seconds at 20 m/s.
pub fn tyres(grid: Grid) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(40);
    let mut ocp = Problem::new(rk4::<SingleTrack>(2)?)
        .running_cost(GeneralCost::<Handling>::new())
        .on(grid.over(n, 4.0))?;
    ocp.fix_initial_state(&[0.0, 0.0, 0.0, 20.0, 0.0, 0.0, 0.0])?;
    ocp.bound("x[1]", .., -4.0, 4.0)?.bound("x[1]", 3 * n / 8..11 * n / 20, 2.5, 4.0)?.bound(
        "x[1]",
        7 * n / 10..,
        -0.5,
        0.5,
    )?;
    ocp.bound("x[2]", .., -1.5, 1.5)?.bound("x[3]", .., 3.0, 40.0)?.bound("x[6]", .., -0.5, 0.5)?;
    ocp.bound("x[0]", n..=n, 70.0, FREE)?.bound("x[1]", n..=n, 0.0, 0.0)?.bound("x[2]", n..=n, 0.0, 0.0)?;
    ocp.bound("u[0]", .., -1.0, 1.0)?.bound("u[1]", .., -8.0, 4.0)?;
    line(&mut ocp, &[0.0, 0.0, 0.0, 20.0, 0.0, 0.0, 0.0], &[80.0, 0.0, 0.0, 20.0, 0.0, 0.0, 0.0], &[0.0; 2])?;
    Ok(ocp)
}

/// A car that turns and accelerates: position, heading, speed.
#[ode]
pub fn unicycle(x: [f64; 4], u: [f64; 2]) -> [f64; 4] {
    [x[3] * x[2].cos(), x[3] * x[2].sin(), u[0], u[1]]
}

#[function]
fn unicycle_effort(_x: [f64; 4], u: [f64; 2]) -> f64 {
    0.5 * (u[0] * u[0] + u[1] * u[1])
}

/// Squares of distances from the centres of three discs, less those of their radii.
#[function]
fn discs(x: [f64; 4], _u: [f64; 2]) -> [f64; 3] {
    const DISCS: [[f64; 3]; 3] = [[3.0, 0.3, 1.0], [6.0, -0.5, 1.2], [8.0, 1.0, 0.8]];

    DISCS.map(|[a, b, r]| (x[0] - a) * (x[0] - a) + (x[1] - b) * (x[1] - b) - r * r)
}

/// Ten metres ahead in ten seconds between three discs, of which the line goes through two.
pub fn obstacles(grid: Grid) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(40);
    let mut ocp = Problem::new(rk4::<Unicycle>(1)?)
        .running_cost(GeneralCost::<UnicycleEffort>::new())
        .path_constraints(Constraint::<Discs>::new([0.0; 3], [FREE; 3]))
        .on(grid.over(n, 10.0))?;
    let (start, end) = ([0.0, 0.0, 0.0, 1.0], [10.0, 0.0, 0.0, 1.0]);
    ocp.fix_initial_state(&start)?.bound("u[0]", .., -2.0, 2.0)?.bound("u[1]", .., -1.0, 1.0)?;
    fix(&mut ocp, n, &end)?;
    line(&mut ocp, &start, &end, &[0.0; 2])?;
    Ok(ocp)
}

/// Walls on opposite sides, three stages or 0.75 s apart: 3 m at a speed of 2 m/s at most.
pub fn walls(grid: Grid) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(40);
    let mut ocp = Problem::new(rk4::<Unicycle>(1)?)
        .running_cost(GeneralCost::<UnicycleEffort>::new())
        .on(grid.over(n, 10.0))?;
    ocp.fix_initial_state(&[0.0, 0.0, 0.0, 1.0])?;
    ocp.bound("x[3]", .., 0.0, 2.0)?.bound("u[0]", .., -2.0, 2.0)?.bound("u[1]", .., -1.0, 1.0)?;
    ocp.bound("x[1]", n / 2..=n / 2, 1.5, 1e2)?.bound("x[1]", n / 2 + 3..=n / 2 + 3, -1e2, -1.5)?;
    ocp.bound("x[0]", n..=n, 10.0, 10.0)?.bound("x[1]", n..=n, 0.0, 0.0)?;
    line(&mut ocp, &[0.0, 0.0, 0.0, 1.0], &[10.0, 0.0, 0.0, 1.0], &[0.0; 2])?;
    Ok(ocp)
}
