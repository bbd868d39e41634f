//! Problems of textbooks and collections.

use super::{Failure, Grid, fix, line, rk4};
use casados::ocp::{Constraint, Formulation, GeneralCost, HeapOcp, Problem, SecondOrder};
use casados::{function, ode};
use core::f64::consts::PI;

const FREE: f64 = f64::INFINITY;

/// A mass over `τ ∈ [0, 1]`: position, velocity, and the time that everything takes.
#[ode]
pub fn hurried_mass(x: [f64; 3], u: [f64; 1]) -> [f64; 3] {
    [x[2] * x[1], x[2] * u[0], 0.0]
}

#[function]
fn duration(x: [f64; 3], _u: [f64; 1]) -> f64 {
    x[2]
}

/// From rest to rest over a distance of four with `|u| ≤ 1`: the shortest time is four.
pub fn bang_bang(grid: Grid) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(30);
    let mut ocp = Problem::new(rk4::<HurriedMass>(1)?)
        .terminal_cost(GeneralCost::<Duration>::new())
        .on(grid.over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[2]", .., 0.1, 20.0)?.bound("u", .., -1.0, 1.0)?;
    fix(&mut ocp, 0, &[0.0, 0.0])?;
    fix(&mut ocp, n, &[4.0, 0.0])?;
    ocp.guess(&[2.0, 1.0, 5.0], &[0.0])?;
    Ok(ocp)
}

/// Van der Pol's oscillator.
#[ode]
pub fn oscillator(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [(1.0 - x[1] * x[1]) * x[0] - x[1] + u[0], x[0]]
}

#[function]
fn squares(x: [f64; 2], u: [f64; 1]) -> f64 {
    x[0] * x[0] + x[1] * x[1] + u[0] * u[0]
}

/// To rest, with a bound on the velocity.
pub fn van_der_pol(
    grid: Grid,
) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(40);
    let mut ocp = Problem::new(rk4::<Oscillator>(1)?)
        .running_cost(GeneralCost::<Squares>::new())
        .on(grid.over(n, 10.0))?;
    ocp.fix_initial_state(&[0.0, 1.0])?;
    ocp.bound("x[0]", .., -0.25, FREE)?.bound("u", .., -1.0, 1.0)?;
    ocp.guess(&[0.0, 0.0], &[0.0])?;
    Ok(ocp)
}

/// A mass: position, velocity.
#[ode]
pub fn mass(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [x[1], u[0]]
}

#[function]
fn energy(_x: [f64; 2], u: [f64; 1]) -> f64 {
    0.5 * u[0] * u[0]
}

/// Bryson and Denham's: thrown back below a ceiling. A. E. Bryson, W. F. Denham, S. E. Dreyfus,
/// "Optimal programming problems with inequality constraints I", AIAA J. 1 (1963).
pub fn bryson_denham(
    grid: Grid,
) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(50);
    let mut ocp =
        Problem::new(rk4::<Mass>(1)?).running_cost(GeneralCost::<Energy>::new()).on(grid.over(n, 1.0))?;
    ocp.fix_initial_state(&[0.0, 1.0])?.bound("x[0]", .., -FREE, 1.0 / 9.0)?;
    fix(&mut ocp, n, &[0.0, -1.0])?;
    line(&mut ocp, &[0.0, 1.0], &[0.0, -1.0], &[0.0])?;
    Ok(ocp)
}

/// Rayleigh's oscillator with a generator. H. Maurer, D. Augustin, "Sensitivity analysis and
/// real-time control of parametric optimal control problems using boundary value methods", 2001.
#[ode]
pub fn generator(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [x[1], -x[0] + x[1] * (1.4 - 0.14 * x[1] * x[1]) + 4.0 * u[0]]
}

#[function]
fn deviation(x: [f64; 2], u: [f64; 1]) -> f64 {
    u[0] * u[0] + x[0] * x[0]
}

#[function]
fn mixed(x: [f64; 2], u: [f64; 1]) -> f64 {
    u[0] + x[0] / 6.0
}

/// To rest with a constraint of states and controls together.
pub fn rayleigh(grid: Grid) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(45);
    let mut ocp = Problem::new(rk4::<Generator>(1)?)
        .running_cost(GeneralCost::<Deviation>::new())
        .path_constraints(Constraint::<Mixed>::new([-1.0], [0.0]))
        .on(grid.over(n, 4.5))?;
    ocp.fix_initial_state(&[-5.0, -5.0])?;
    ocp.guess(&[-5.0, -5.0], &[0.0])?;
    Ok(ocp)
}

/// A boat in a stream over `τ ∈ [0, 1]`: position, and the time that everything takes; a heading.
#[ode]
pub fn boat(x: [f64; 3], u: [f64; 1]) -> [f64; 3] {
    let (s, c) = u[0].sin_cos();
    [x[2] * (c + 0.5 * (PI * x[1]).sin()), x[2] * (s - 0.3 * x[0]), 0.0]
}

/// Zermelo's: across in the shortest time.
pub fn zermelo(grid: Grid) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(40);
    let mut ocp =
        Problem::new(rk4::<Boat>(1)?).terminal_cost(GeneralCost::<Duration>::new()).on(grid.over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[2]", .., 0.1, 20.0)?;
    fix(&mut ocp, 0, &[0.0, 0.0])?;
    fix(&mut ocp, n, &[3.0, 1.0])?;
    line(&mut ocp, &[0.0, 0.0, 3.0], &[3.0, 1.0, 3.0], &[0.0])?;
    Ok(ocp)
}

/// A chain along a line: height, potential energy, length; the slope is the control.
#[ode]
pub fn suspended(x: [f64; 3], u: [f64; 1]) -> [f64; 3] {
    let length = (1.0 + u[0] * u[0]).sqrt();
    [u[0], x[0] * length, length]
}

#[function]
fn potential(x: [f64; 3], _u: [f64; 1]) -> f64 {
    x[1]
}

/// The hanging chain of COPS 3.0 (Dolan, Moré, Munson 2004): of length four between heights of one
/// and three.
pub fn hanging_chain(
    grid: Grid,
) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(50);
    let mut ocp = Problem::new(rk4::<Suspended>(1)?)
        .terminal_cost(GeneralCost::<Potential>::new())
        .on(grid.over(n, 1.0))?;
    ocp.fix_initial_state(&[1.0, 0.0, 0.0])?;
    ocp.bound("x[0]", n..=n, 3.0, 3.0)?.bound("x[2]", n..=n, 4.0, 4.0)?;
    line(&mut ocp, &[1.0, 0.0, 0.0], &[3.0, 6.0, 4.0], &[2.0])?;
    Ok(ocp)
}
