//! Curves: the fastest, the shortest, those around the largest area.

use super::{FREE, fix, intervals, line, made, over, rk4};
use crate::{Entry, Facts};
use casados::ocp::{Constraint, GeneralCost, Problem, WithIntegral};
use casados::{Quadrature, function, ode};
use core::f64::consts::PI;

/// A bead on a wire over `τ ∈ [0, 1]`: position, depth below the start, speed, time; the angle of
/// the wire.
#[ode]
pub fn bead(x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    let (s, c) = u[0].sin_cos();
    [x[3] * x[2] * s, x[3] * x[2] * c, x[3] * 9.80665 * c, 0.0]
}

#[function]
fn bead_time(x: [f64; 4], _u: [f64; 1]) -> f64 {
    x[3]
}

/// The brachistochrone: ten metres ahead, five down.
fn brachistochrone() -> made!() {
    let n = intervals(40);
    let mut ocp =
        Problem::new(rk4::<Bead>(1)?).terminal_cost(GeneralCost::<BeadTime>::new()).on(over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[3]", .., 0.1, 20.0)?.bound("u", .., 0.0, 3.2)?;
    fix(&mut ocp, 0, &[0.0, 0.0, 0.0])?;
    fix(&mut ocp, n, &[10.0, 5.0])?;
    line(&mut ocp, &[0.0, 0.0, 0.0, 2.0], &[10.0, 5.0, 10.0, 2.0], &[1.0])?;
    Ok(ocp)
}

/// Dubins' car over `τ ∈ [0, 1]`: position, heading, length of the path; the curvature.
#[ode]
pub fn dubins_car(x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    [x[3] * x[2].cos(), x[3] * x[2].sin(), x[3] * u[0], 0.0]
}

#[function]
fn dubins_length(x: [f64; 4], _u: [f64; 1]) -> f64 {
    x[3]
}

/// The shortest path to a pose with the same heading, curvature up to one: left, straight, right.
fn dubins() -> made!() {
    let n = intervals(40);
    let mut ocp = Problem::new(rk4::<DubinsCar>(1)?)
        .terminal_cost(GeneralCost::<DubinsLength>::new())
        .on(over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[3]", .., 0.1, 30.0)?.bound("u", .., -1.0, 1.0)?;
    fix(&mut ocp, 0, &[0.0; 3])?;
    fix(&mut ocp, n, &[4.0, 3.0, 0.0])?;
    line(&mut ocp, &[0.0, 0.0, 0.0, 5.0], &[4.0, 3.0, 0.0, 5.0], &[0.0])?;
    Ok(ocp)
}

/// A curve over its abscissa; the slope is the control.
#[ode]
pub fn curve(_x: [f64; 1], u: [f64; 1]) -> [f64; 1] {
    [u[0]]
}

#[function]
fn area_of_revolution(x: [f64; 1], u: [f64; 1]) -> f64 {
    x[0] * (1.0 + u[0] * u[0]).sqrt()
}

/// The catenoid between circles of radius one at a distance of one, its area over 2π:
/// `a (1/2 + a/2 sinh(1/a))` with `a cosh(1/(2 a)) = 1`.
fn minimal_surface() -> made!() {
    let n = intervals(40);
    let dynamics = WithIntegral::new(rk4::<Curve>(1)?, Quadrature::<AreaOfRevolution>::new());
    let mut ocp = Problem::new(dynamics).on(over(n, 1.0))?;
    ocp.fix_initial_state(&[1.0])?.bound("x[0]", n.., 1.0, 1.0)?.guess(&[1.0], &[0.0])?;
    Ok(ocp)
}

/// A ship in a current that grows with the latitude, over `τ ∈ [0, 1]`: position, time; a heading.
#[ode]
pub fn ship(x: [f64; 3], u: [f64; 1]) -> [f64; 3] {
    [x[2] * (u[0].cos() - x[1]), x[2] * u[0].sin(), 0.0]
}

#[function]
fn ship_time(x: [f64; 3], _u: [f64; 1]) -> f64 {
    x[2]
}

/// Zermelo's problem with a linear current, to the origin.
fn zermelo_shear() -> made!() {
    let n = intervals(40);
    let mut ocp =
        Problem::new(rk4::<Ship>(1)?).terminal_cost(GeneralCost::<ShipTime>::new()).on(over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[2]", .., 0.1, 30.0)?;
    fix(&mut ocp, 0, &[3.66, -1.86])?;
    fix(&mut ocp, n, &[0.0, 0.0])?;
    line(&mut ocp, &[3.66, -1.86, 4.0], &[0.0, 0.0, 4.0], &[PI])?;
    Ok(ocp)
}

/// Brockett's integrator: a point in a plane, and the area that it sweeps.
#[ode]
pub fn integrator(x: [f64; 3], u: [f64; 2]) -> [f64; 3] {
    [u[0], u[1], 0.5 * (x[0] * u[1] - x[1] * u[0])]
}

#[function]
fn push(_x: [f64; 3], u: [f64; 2]) -> f64 {
    0.5 * (u[0] * u[0] + u[1] * u[1])
}

/// An area of one around a loop with the least energy: a circle, 2π. Standing still is a saddle.
fn brockett() -> made!() {
    let n = intervals(40);
    let dynamics = WithIntegral::new(rk4::<Integrator>(1)?, Quadrature::<Push>::new());
    let mut ocp = Problem::new(dynamics).on(over(n, 1.0))?;
    ocp.fix_initial_state(&[0.0; 3])?;
    fix(&mut ocp, n, &[0.0, 0.0, 1.0])?;
    line(&mut ocp, &[0.0; 3], &[0.0, 0.0, 1.0], &[0.0, 0.0])?;
    Ok(ocp)
}

#[function]
fn less_area(x: [f64; 3], _u: [f64; 2]) -> f64 {
    -x[2]
}

#[function]
fn speed(_x: [f64; 3], u: [f64; 2]) -> f64 {
    u[0] * u[0] + u[1] * u[1]
}

/// Dido's problem: the largest area in a loop of length one, 1/(4π) and of a polygon with n sides
/// 1/(4 n tan(π/n)); from a square.
fn dido() -> made!() {
    let n = intervals(40);
    let mut ocp = Problem::new(rk4::<Integrator>(1)?)
        .terminal_cost(GeneralCost::<LessArea>::new())
        .path_constraints(Constraint::<Speed>::new([1.0], [1.0]))
        .on(over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.periodic("x[0]")?.periodic("x[1]")?.bound("x[2]", ..1, 0.0, 0.0)?;
    // Neither where the loop lies nor how it is turned matters: it begins at the origin.
    fix(&mut ocp, 0, &[0.0, 0.0])?;
    for k in 0..=n {
        let along = 4.0 * k as f64 / n as f64;
        let (side, part) = ((along as usize).min(3), along - (along as usize).min(3) as f64);
        let corners = [[0.0, 0.0], [0.25, 0.0], [0.25, 0.25], [0.0, 0.25]];
        let u = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]][side];
        let x = [0, 1].map(|i| corners[side][i] + 0.25 * part * u[i]);
        let area = 0.0625 * k as f64 / n as f64;
        ocp.guess_stage(k, &[x[0], x[1], area], if k < n { &u } else { &[] })?;
    }
    Ok(ocp)
}

/// A point at a constant speed; its heading.
#[ode]
pub fn heading(_x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    let (s, c) = u[0].sin_cos();
    [2.138 * c, 2.138 * s]
}

#[function]
fn squared_speed(_x: [f64; 2], u: [f64; 1]) -> f64 {
    let (s, c) = u[0].sin_cos();
    2.138 * 2.138 * (s * s + c * c)
}

/// Squares of the distances from two centres, less those of the radii.
#[function]
fn outside(x: [f64; 2], _u: [f64; 1]) -> [f64; 2] {
    let (a, b) = (x[0] - 0.4, x[1] - 0.5);
    let (c, d) = (x[0] - 0.8, x[1] - 1.5);
    [a * a + b * b - 0.1, c * c + d * d - 0.1]
}

/// Between two discs in a given time; the cost is the same everywhere: what counts is a feasible
/// point.
fn obstacle() -> made!() {
    let n = intervals(60);
    let dynamics = WithIntegral::new(rk4::<Heading>(1)?, Quadrature::<SquaredSpeed>::new());
    let mut ocp = Problem::new(dynamics)
        .path_constraints(Constraint::<Outside>::new([0.0; 2], [FREE; 2]))
        .on(over(n, 1.0))?;
    ocp.fix_initial_state(&[0.0, 0.0])?.bound("x", 1.., 0.0, 2.0)?.bound("u", .., -10.0, 10.0)?;
    fix(&mut ocp, n, &[1.2, 1.6])?;
    line(&mut ocp, &[0.0, 0.0], &[1.2, 1.6], &[0.0])?;
    Ok(ocp)
}

/// All of them.
pub fn all() -> Vec<Entry> {
    let bryson = "A. E. Bryson, Y.-C. Ho, Applied Optimal Control, 1975";
    let facts = Facts::new;
    vec![
        Entry::new(
            facts("brachistochrone", "dymos, examples/brachistochrone", 1.8016, 5e-5, &["free time"]),
            brachistochrone,
        ),
        Entry::new(
            facts(
                "dubins",
                "L. E. Dubins, Amer. J. Math. 79 (1957): the word LSR",
                5.108397888544718,
                0.0,
                &["free time", "bang-bang", "singular arc"],
            ),
            dubins,
        ),
        Entry::new(
            facts("minimal_surface", "closed form", 0.953624106702, 0.0, &["smooth"]),
            minimal_surface,
        ),
        Entry::new(facts("zermelo_shear", bryson, 5.46, 5e-3, &["free time"]), zermelo_shear),
        Entry::new(
            facts(
                "brockett",
                "R. W. Brockett, Control theory and singular Riemannian geometry, 1982",
                2.0 * PI,
                0.0,
                &["saddle at the guess", "not isolated"],
            ),
            brockett,
        ),
        Entry::new(
            facts(
                "dido",
                "closed form",
                -1.0 / (4.0 * PI),
                0.0,
                &["periodic", "path equality", "not isolated"],
            ),
            dido,
        ),
        Entry::new(
            facts("obstacle", "PSOPT, obstacle", 4.571044, 5e-7, &["feasibility", "path constraint"]),
            obstacle,
        ),
    ]
}
