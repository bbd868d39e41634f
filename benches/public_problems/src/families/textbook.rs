//! Small problems of textbooks, most with an optimum in closed form.

use super::{FREE, fix, intervals, line, made, over, rk4};
use crate::{Entry, Facts};
use casados::ocp::{Constraint, GeneralCost, Problem, WithIntegral};
use casados::{Quadrature, function, ode};
use core::f64::consts::PI;

/// A mass: position, velocity.
#[ode]
pub fn point_mass(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [x[1], u[0]]
}

#[function]
fn nearness(x: [f64; 2], _u: [f64; 1]) -> f64 {
    -x[0]
}

/// As far as possible in one second, from rest to rest with `|u| ≤ 1`.
fn distance() -> made!() {
    let n = intervals(40);
    let mut ocp =
        Problem::new(rk4::<PointMass>(1)?).terminal_cost(GeneralCost::<Nearness>::new()).on(over(n, 1.0))?;
    ocp.fix_initial_state(&[0.0, 0.0])?.bound("u", .., -1.0, 1.0)?.bound("x[1]", n.., 0.0, 0.0)?;
    line(&mut ocp, &[0.0, 0.0], &[0.25, 0.0], &[0.0])?;
    Ok(ocp)
}

/// Motion in a field with the acceleration one half: distance, height, speed; a direction.
#[ode]
pub fn range(x: [f64; 3], u: [f64; 2]) -> [f64; 3] {
    [x[2] * u[0], x[2] * u[1], 0.5 - u[1]]
}

#[function]
fn shortfall(x: [f64; 3], _u: [f64; 2]) -> f64 {
    -x[0]
}

#[function]
fn length_of_direction(_x: [f64; 3], u: [f64; 2]) -> f64 {
    u[0] * u[0] + u[1] * u[1]
}

/// Bryson's maximum range: the direction has length one.
fn maximum_range() -> made!() {
    let n = intervals(50);
    let mut ocp = Problem::new(rk4::<Range>(1)?)
        .terminal_cost(GeneralCost::<Shortfall>::new())
        .path_constraints(Constraint::<LengthOfDirection>::new([1.0], [1.0]))
        .on(over(n, 2.0))?;
    ocp.fix_initial_state(&[0.0; 3])?.bound("x[1]", n.., 0.1, 0.1)?.bound("u", .., -10.0, 10.0)?;
    line(&mut ocp, &[0.0; 3], &[1.0, 0.1, 1.0], &[1.0, 0.0])?;
    Ok(ocp)
}

/// Decays by its third power.
#[ode]
pub fn cubic(x: [f64; 1], u: [f64; 1]) -> [f64; 1] {
    [-x[0] * x[0] * x[0] + u[0]]
}

#[function]
fn cubic_cost(x: [f64; 1], u: [f64; 1]) -> f64 {
    0.5 * (x[0] * x[0] + u[0] * u[0])
}

/// Rao and Mease's hypersensitive problem over 50 s.
fn hypersensitive() -> made!() {
    let n = intervals(200);
    let dynamics = WithIntegral::new(rk4::<Cubic>(1)?, Quadrature::<CubicCost>::new());
    let mut ocp = Problem::new(dynamics).on(over(n, 50.0))?;
    ocp.fix_initial_state(&[1.5])?.bound("x[0]", n.., 1.0, 1.0)?.bound("u", .., -50.0, 50.0)?;
    ocp.guess(&[1.0], &[0.0])?;
    Ok(ocp)
}

/// A state, and the integral of the control's square.
#[ode]
pub fn isoperimetric(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [-x[0].sin() + u[0], u[0] * u[0]]
}

#[function]
fn first_state(x: [f64; 2], _u: [f64; 1]) -> f64 {
    x[0]
}

/// The least integral of the state with a given integral of the control's square.
fn integral_constraint() -> made!() {
    let n = intervals(50);
    let dynamics = WithIntegral::new(rk4::<Isoperimetric>(1)?, Quadrature::<FirstState>::new());
    let mut ocp = Problem::new(dynamics).on(over(n, 1.0))?;
    ocp.fix_initial_state(&[1.0, 0.0])?.bound("x[0]", .., -10.0, 10.0)?.bound("u", .., -4.0, 4.0)?;
    fix(&mut ocp, n, &[0.0, 10.0])?;
    line(&mut ocp, &[1.0, 0.0], &[0.0, 10.0], &[0.0])?;
    Ok(ocp)
}

/// An oscillator over `τ ∈ [0, 1]`: position, velocity, time.
#[ode]
pub fn spring(x: [f64; 3], u: [f64; 1]) -> [f64; 3] {
    [x[2] * x[1], x[2] * (u[0] - x[0]), 0.0]
}

#[function]
fn spring_time(x: [f64; 3], _u: [f64; 1]) -> f64 {
    x[2]
}

/// To rest from four units with `|u| ≤ 1`: two half circles about ±1, of which each takes π.
fn oscillator_time() -> made!() {
    let n = intervals(40);
    let mut ocp =
        Problem::new(rk4::<Spring>(2)?).terminal_cost(GeneralCost::<SpringTime>::new()).on(over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[2]", .., 0.1, 30.0)?.bound("u", .., -1.0, 1.0)?;
    fix(&mut ocp, 0, &[4.0, 0.0])?;
    fix(&mut ocp, n, &[0.0, 0.0])?;
    line(&mut ocp, &[4.0, 0.0, 5.0], &[0.0, 0.0, 5.0], &[0.0])?;
    Ok(ocp)
}

#[function]
fn squares(x: [f64; 2], _u: [f64; 1]) -> f64 {
    x[0] * x[0] + x[1] * x[1]
}

/// Aly's singular regulator: a bang, then a singular arc.
fn aly() -> made!() {
    let n = intervals(50);
    let dynamics = WithIntegral::new(rk4::<PointMass>(1)?, Quadrature::<Squares>::new());
    let mut ocp = Problem::new(dynamics).on(over(n, 5.0))?;
    ocp.fix_initial_state(&[0.0, 1.0])?.bound("u", .., -1.0, 1.0)?.guess(&[0.0, 1.0], &[0.0])?;
    Ok(ocp)
}

/// A car in a valley over `τ ∈ [0, 1]`: position, velocity, time; a push that is too weak.
#[ode]
pub fn valley(x: [f64; 3], u: [f64; 1]) -> [f64; 3] {
    [x[2] * x[1], x[2] * (0.001 * u[0] - 0.0025 * (3.0 * x[0]).cos()), 0.0]
}

#[function]
fn valley_time(x: [f64; 3], _u: [f64; 1]) -> f64 {
    x[2]
}

/// Out of the valley in the shortest time.
fn mountain_car() -> made!() {
    let n = intervals(60);
    let mut ocp =
        Problem::new(rk4::<Valley>(2)?).terminal_cost(GeneralCost::<ValleyTime>::new()).on(over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[0]", .., -1.2, 0.5)?.bound("x[1]", .., -0.07, 0.07)?.bound("x[2]", .., 0.05, 1e4)?;
    ocp.bound("u", .., -1.0, 1.0)?.bound("x[0]", n.., 0.5, 0.5)?.bound("x[1]", n.., 0.0, FREE)?;
    fix(&mut ocp, 0, &[-0.5, 0.0])?;
    line(&mut ocp, &[-0.5, 0.0, 500.0], &[0.5, 0.07, 500.0], &[0.0])?;
    Ok(ocp)
}

/// Decays or grows as a control says that is a parameter.
#[ode]
pub fn hull_dynamics(_x: [f64; 1], u: [f64; 1]) -> [f64; 1] {
    [u[0]]
}

#[function]
fn hull_running(_x: [f64; 1], u: [f64; 1]) -> f64 {
    0.5 * u[0] * u[0]
}

#[function]
fn hull_end(x: [f64; 1], _u: [f64; 1]) -> f64 {
    2.5 * x[0] * x[0]
}

/// Hull's problem with a constant control: `½ c x₀² / (1 + c T)` with c = 5, T = 5, x₀ = 1.5.
fn hull() -> made!() {
    let n = intervals(30);
    let dynamics = WithIntegral::new(rk4::<HullDynamics>(1)?, Quadrature::<HullRunning>::new());
    let mut ocp = Problem::new(dynamics).terminal_cost(GeneralCost::<HullEnd>::new()).on(over(n, 5.0))?;
    ocp.fix_initial_state(&[1.5])?.shared("u")?;
    line(&mut ocp, &[1.5], &[1.0], &[0.8])?;
    Ok(ocp)
}

/// Steering by a thrust of constant size over `τ ∈ [0, 1]`: position, height, their rates, time; a
/// direction.
#[ode]
pub fn thrust(x: [f64; 5], u: [f64; 1]) -> [f64; 5] {
    let (s, c) = u[0].sin_cos();
    let time = x[4];
    [time * x[2], time * x[3], time * 100.0 * c, time * 100.0 * s, 0.0]
}

#[function]
fn thrust_time(x: [f64; 5], _u: [f64; 1]) -> f64 {
    x[4]
}

/// Linear tangent steering to a height and a speed.
fn steering() -> made!() {
    let n = intervals(40);
    let mut ocp =
        Problem::new(rk4::<Thrust>(1)?).terminal_cost(GeneralCost::<ThrustTime>::new()).on(over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[4]", .., 0.01, 10.0)?.bound("u", .., -PI / 2.0, PI / 2.0)?;
    fix(&mut ocp, 0, &[0.0; 4])?;
    fix(&mut ocp, n, &[f64::NAN, 5.0, 45.0, 0.0])?;
    line(&mut ocp, &[0.0, 0.0, 0.0, 0.0, 1.0], &[0.0, 5.0, 45.0, 0.0, 1.0], &[0.0])?;
    Ok(ocp)
}

/// A bilinear model with its time.
#[ode]
pub fn bilinear(x: [f64; 3], u: [f64; 1], t: f64) -> [f64; 3] {
    [x[1], -x[2] * u[0] + 16.0 * t - 8.0, u[0]]
}

#[function]
fn bilinear_cost(x: [f64; 3], u: [f64; 1], t: f64) -> f64 {
    let rest = x[1] + 16.0 * t - 8.0 - 0.1 * x[2] * u[0] * u[0];
    x[0] * x[0] + x[1] * x[1] + 0.0005 * rest * rest
}

/// Luus' fifth singular problem.
fn singular_five() -> made!() {
    let n = intervals(60);
    let dynamics = WithIntegral::new(rk4::<Bilinear>(1)?, Quadrature::<BilinearCost>::new());
    let mut ocp = Problem::new(dynamics).on(over(n, 1.0))?;
    let start = [0.0, -1.0, -f64::sqrt(5.0)];
    ocp.fix_initial_state(&start)?.bound("u", .., 0.0, 10.0)?.guess(&start, &[0.0])?;
    Ok(ocp)
}

/// A mass with friction.
#[ode]
pub fn damped(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [x[1], u[0] - x[1]]
}

#[function]
fn damped_cost(x: [f64; 2], u: [f64; 1]) -> f64 {
    x[0] * x[0] + x[1] * x[1] + 0.005 * u[0] * u[0]
}

#[function]
fn above(x: [f64; 2], _u: [f64; 1], t: f64) -> f64 {
    x[1] - 8.0 * (t - 0.5) * (t - 0.5) + 0.5
}

/// Jacobson and Lele's: a bound of the velocity that moves.
fn state_constraint() -> made!() {
    let n = intervals(50);
    let dynamics = WithIntegral::new(rk4::<Damped>(1)?, Quadrature::<DampedCost>::new());
    let mut ocp =
        Problem::new(dynamics).path_constraints(Constraint::<Above>::new([-FREE], [0.0])).on(over(n, 1.0))?;
    ocp.fix_initial_state(&[0.0, -1.0])?.bound("u", .., -20.0, 20.0)?.guess(&[0.0, -1.0], &[0.0])?;
    Ok(ocp)
}

/// Four states, two of which oscillate.
#[ode]
pub fn alpine(x: [f64; 4], u: [f64; 2]) -> [f64; 4] {
    [
        -10.0 * x[0] + u[0] + u[1],
        -2.0 * x[1] + u[0] + 2.0 * u[1],
        -3.0 * x[2] + 5.0 * x[3] + u[0] - u[1],
        5.0 * x[2] - 3.0 * x[3] + u[0] + 3.0 * u[1],
    ]
}

#[function]
fn alpine_cost(x: [f64; 4], u: [f64; 2]) -> f64 {
    100.0 * (x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3]) + 0.01 * (u[0] * u[0] + u[1] * u[1])
}

/// The square of the norm above the mountains.
#[function]
fn mountains(x: [f64; 4], _u: [f64; 2], t: f64) -> f64 {
    let square = x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3];
    let (a, b, c, d) = (t - 3.0, t - 6.0, t - 10.0, t - 15.0);
    let low = 3.0 * ((-12.0 * a * a).exp() + (-10.0 * b * b).exp() + (-6.0 * c * c).exp());
    square - low - 8.0 * (-4.0 * d * d).exp() - 0.01
}

/// Betts' Alp rider: the norm of the state follows a profile.
fn alp_rider() -> made!() {
    let n = intervals(200);
    let dynamics = WithIntegral::new(rk4::<Alpine>(2)?, Quadrature::<AlpineCost>::new());
    let mut ocp = Problem::new(dynamics)
        .path_constraints(Constraint::<Mountains>::new([0.0], [FREE]))
        .on(over(n, 20.0))?;
    ocp.fix_initial_state(&[2.0, 1.0, 2.0, 1.0])?;
    fix(&mut ocp, n, &[2.0, 3.0, 1.0, -2.0])?;
    line(&mut ocp, &[2.0, 1.0, 2.0, 1.0], &[2.0, 3.0, 1.0, -2.0], &[0.0; 2])?;
    Ok(ocp)
}

/// All of them.
pub fn all() -> Vec<Entry> {
    let facts = Facts::new;
    vec![
        Entry::new(
            facts("distance", "dymos, examples/double_integrator", -0.25, 0.0, &["bang-bang", "linear"]),
            distance,
        ),
        Entry::new(
            facts("maximum_range", "PSOPT, bryson_max_range", -1.712314, 5e-7, &["path equality"]),
            maximum_range,
        ),
        Entry::new(
            facts("hypersensitive", "PSOPT, hypersensitive", 1.330826, 5e-7, &["boundary layers"]),
            hypersensitive,
        ),
        Entry::new(
            facts("isoperimetric", "PSOPT, isoperimetric", -0.3755057, 5e-8, &["integral constraint"]),
            integral_constraint,
        ),
        Entry::new(
            facts(
                "oscillator_time",
                "L. S. Pontryagin et al., The Mathematical Theory of Optimal Processes, 1962, §5",
                2.0 * PI,
                0.0,
                &["free time", "bang-bang"],
            ),
            oscillator_time,
        ),
        Entry::new(
            facts("aly", "G. M. Aly, Int. J. Control 28 (1978); PROPT", 0.753994, 5e-7, &["singular arc"]),
            aly,
        ),
        Entry::new(
            facts("mountain_car", "dymos, examples/mountain_car", 102.479, 5e-4, &["free time", "bang-bang"]),
            mountain_car,
        ),
        Entry::new(
            facts("hull", "dymos, examples/hull_problem: closed form", 5.625 / 26.0, 0.0, &["parameter"]),
            hull,
        ),
        Entry::new(facts("steering", "PSOPT, lts; COPS 3.0", 0.5545709, 5e-8, &["free time"]), steering),
        Entry::new(
            facts("singular_five", "PSOPT, singular5", 0.1192620, 5e-8, &["singular arc", "time-dependent"]),
            singular_five,
        ),
        Entry::new(
            facts(
                "state_constraint",
                "PSOPT, stc1",
                0.1698180,
                5e-8,
                &["state constraint", "time-dependent"],
            ),
            state_constraint,
        ),
        Entry::new(
            facts(
                "alp_rider",
                "J. T. Betts, Practical Methods for Optimal Control, 2010",
                2030.85609,
                5e-6,
                &["path constraint", "stiff", "time-dependent"],
            ),
            alp_rider,
        ),
    ]
}
