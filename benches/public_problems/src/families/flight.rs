//! Aircraft, rockets, spacecraft; most in the units of engineers.

use super::{FREE, fix, intervals, line, made, over, rk4};
use crate::{Entry, Facts};
use casados::ocp::{Constraint, GeneralCost, Problem, WithIntegral};
use casados::{Quadrature, function, ode};
use core::f64::consts::PI;

/// An F-8 over `τ ∈ [0, 1]`: angle of attack, pitch, pitch rate, time; the deflection of the tail.
#[ode]
pub fn f8_aircraft(x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    let [a, pitch, q, time] = x;
    let w = u[0];
    [
        time * (-0.877 * a + q - 0.088 * a * q + 0.47 * a * a - 0.019 * pitch * pitch - a * a * q
            + 3.846 * a * a * a
            - 0.215 * w
            + 0.28 * a * a * w
            + 0.47 * a * w * w
            + 0.63 * w * w * w),
        time * q,
        time * (-4.208 * a - 0.396 * q - 0.47 * a * a - 3.564 * a * a * a - 20.967 * w
            + 6.265 * a * a * w
            + 46.0 * a * w * w
            + 61.4 * w * w * w),
        0.0,
    ]
}

#[function]
fn f8_time(x: [f64; 4], _u: [f64; 1]) -> f64 {
    x[3]
}

/// Back to level flight in the shortest time; the control is bang-bang.
fn f8() -> made!() {
    let n = intervals(100);
    let mut ocp =
        Problem::new(rk4::<F8Aircraft>(2)?).terminal_cost(GeneralCost::<F8Time>::new()).on(over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[3]", .., 0.1, 20.0)?.bound("u", .., -0.05236, 0.05236)?;
    fix(&mut ocp, 0, &[0.4655, 0.0, 0.0])?;
    fix(&mut ocp, n, &[0.0; 3])?;
    line(&mut ocp, &[0.4655, 0.0, 0.0, 5.0], &[0.0, 0.0, 0.0, 5.0], &[0.0])?;
    Ok(ocp)
}

const MISSILE_MASS: f64 = 1005.0;
const MISSILE_AREA: f64 = 0.3376;

/// A missile over `τ ∈ [0, 1]`: flight path angle, speed, distance, height, time; thrust and angle
/// of attack.
#[ode]
pub fn missile_flight(x: [f64; 5], u: [f64; 2]) -> [f64; 5] {
    let [gamma, v, _, h, time] = x;
    let [thrust, alpha] = u;
    let density = 3.312e-9 * h * h - 1.142e-4 * h + 1.224;
    let pressure = 0.5 * density * v * v * MISSILE_AREA;
    let drag = (-1.9431 * alpha * alpha - 0.1499 * alpha + 0.2359) * pressure;
    let lift = 21.9 * alpha * pressure;
    let (sa, ca) = alpha.sin_cos();
    let (sg, cg) = gamma.sin_cos();
    [
        time * ((thrust - drag) * sa + lift * ca) / (MISSILE_MASS * v) - time * 9.81 * cg / v,
        time * ((thrust - drag) * ca - lift * sa) / MISSILE_MASS - time * 9.81 * sg,
        time * v * cg,
        time * v * sg,
        0.0,
    ]
}

#[function]
fn missile_time(x: [f64; 5], _u: [f64; 2]) -> f64 {
    x[4]
}

/// The load factor, and the height above 30 m until 7500 m, above the ground from there on.
#[function]
fn missile_limits(x: [f64; 5], u: [f64; 2]) -> [f64; 2] {
    let density = 3.312e-9 * x[3] * x[3] - 1.142e-4 * x[3] + 1.224;
    let load = 0.5 * 21.9 * u[1] * density * x[1] * x[1] * MISSILE_AREA / (MISSILE_MASS * 9.81);
    let early = 0.5 * (1.0 + ((7500.0 - x[2]) / 10.0).tanh());
    [load, x[3] - 30.0 * early]
}

/// Subchan and Żbikowski's missile: onto its target from above in the shortest time.
fn missile() -> made!() {
    let n = intervals(80);
    let mut ocp = Problem::new(rk4::<MissileFlight>(1)?)
        .terminal_cost(GeneralCost::<MissileTime>::new())
        .path_constraints(Constraint::<MissileLimits>::new([-4.0, 0.0], [4.0, FREE]))
        .on(over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[0]", .., -PI / 2.0, PI / 2.0)?.bound("x[1]", .., 200.0, 310.0)?;
    ocp.bound("x[3]", .., 0.0, 1900.0)?.bound("x[4]", .., 10.0, 100.0)?;
    ocp.bound("u[0]", .., 1000.0, 6000.0)?.bound("u[1]", .., -0.3, 0.3)?;
    fix(&mut ocp, 0, &[0.0, 272.0, 0.0, 30.0])?;
    fix(&mut ocp, n, &[-PI / 2.0, 310.0, 10000.0, 0.0])?;
    let (from, to) = ([0.0, 272.0, 0.0, 30.0, 50.0], [-PI / 2.0, 310.0, 10000.0, 0.0, 50.0]);
    line(&mut ocp, &from, &to, &[6000.0, 0.0])?;
    Ok(ocp)
}

/// The shuttle over `τ ∈ [0, 1]`: height in 1e5 ft, latitude, speed in 1e4 ft/s, flight path angle,
/// azimuth, time in 1e3 s; angle of attack in degrees, bank angle.
#[ode]
pub fn shuttle(x: [f64; 6], u: [f64; 2]) -> [f64; 6] {
    const MASS: f64 = 203000.0 / 32.174; // slug
    const RADIUS: f64 = 20902900.0; // ft
    const MU: f64 = 0.14076539e17; // ft³/s²
    let [_, latitude, _, gamma, psi, _] = x;
    let (h, v, time) = (1e5 * x[0], 1e4 * x[2], 1e3 * x[5]);
    let (a, bank) = (u[0], u[1]);
    let pressure = 0.5 * 0.002378 * (-h / 23800.0).exp() * v * v * 2690.0;
    let lift = (-0.20704 + 0.029244 * a) * pressure / MASS;
    let drag = (0.07854 - 0.61592e-2 * a + 0.621408e-3 * a * a) * pressure / MASS;
    let r = RADIUS + h;
    let gravity = MU / (r * r);
    let (sg, cg) = gamma.sin_cos();
    let (sp, cp) = psi.sin_cos();
    let (sb, cb) = bank.sin_cos();
    [
        time * v * sg / 1e5,
        time * v / r * cg * cp,
        time * (-drag - gravity * sg) / 1e4,
        time * (lift / v * cb + cg * (v / r - gravity / v)),
        time * (lift * sb / (v * cg) + v / r * cg * sp * latitude.tan()),
        0.0,
    ]
}

#[function]
fn less_cross_range(x: [f64; 6], _u: [f64; 2]) -> f64 {
    -x[1]
}

/// Betts' reentry of the shuttle: the largest cross-range, in radians.
fn shuttle_reentry() -> made!() {
    let n = intervals(100);
    let mut ocp = Problem::new(rk4::<Shuttle>(2)?)
        .terminal_cost(GeneralCost::<LessCrossRange>::new())
        .on(over(n, 1.0))?;
    let degree = PI / 180.0;
    ocp.free_initial_state();
    ocp.bound("x[0]", .., 0.0, 3.0)?.bound("x[1]", .., -89.0 * degree, 89.0 * degree)?;
    ocp.bound("x[2]", .., 0.01, 4.0)?.bound("x[3]", .., -89.0 * degree, 89.0 * degree)?;
    ocp.bound("x[5]", .., 0.5, 4.0)?;
    ocp.bound("u[0]", .., -90.0, 90.0)?.bound("u[1]", .., -89.0 * degree, degree)?;
    fix(&mut ocp, 0, &[2.6, 0.0, 2.56, -degree, 90.0 * degree])?;
    fix(&mut ocp, n, &[0.8, f64::NAN, 0.25, -5.0 * degree])?;
    let from = [2.6, 0.0, 2.56, -degree, 90.0 * degree, 2.0];
    let to = [0.8, 0.0, 0.25, -5.0 * degree, 90.0 * degree, 2.0];
    line(&mut ocp, &from, &to, &[10.0, -0.5])?;
    Ok(ocp)
}

/// A hang glider over a thermal, over `τ ∈ [0, 1]`: position, velocity, time; the lift coefficient.
#[ode]
pub fn glider_flight(x: [f64; 5], u: [f64; 1]) -> [f64; 5] {
    let [along, _, vx, vy, time] = x;
    let r = (along / 100.0 - 2.5) * (along / 100.0 - 2.5);
    let w = vy - 2.5 * (1.0 - r) * (-r).exp();
    let v = (vx * vx + w * w).sqrt();
    let force = 0.5 * 1.13 * 14.0 * v / 100.0;
    let (drag, lift) = ((0.034 + 0.069662 * u[0] * u[0]) * force, u[0] * force);
    [time * vx, time * vy, time * (-lift * w - drag * vx), time * (lift * vx - drag * w - 9.81), 0.0]
}

#[function]
fn less_range(x: [f64; 5], _u: [f64; 1]) -> f64 {
    -x[0]
}

/// As far as possible while 100 m are lost.
fn glider() -> made!() {
    let n = intervals(100);
    let mut ocp = Problem::new(rk4::<GliderFlight>(1)?)
        .terminal_cost(GeneralCost::<LessRange>::new())
        .on(over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[0]", .., 0.0, FREE)?.bound("x[2]", .., 0.0, FREE)?.bound("x[4]", .., 0.1, 300.0)?;
    ocp.bound("u", .., 0.0, 1.4)?;
    fix(&mut ocp, 0, &[0.0, 1000.0, 13.23, -1.288])?;
    fix(&mut ocp, n, &[f64::NAN, 900.0, 13.23, -1.288])?;
    line(&mut ocp, &[0.0, 1000.0, 13.23, -1.288, 100.0], &[1323.0, 900.0, 13.23, -1.288, 100.0], &[0.7])?;
    Ok(ocp)
}

/// Goddard's rocket over `τ ∈ [0, 1]`: height ft, velocity ft/s, mass, time s; thrust.
#[ode]
pub fn sounding_rocket(x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    let [h, v, mass, time] = x;
    let drag = 5.4915348492e-5 * v * v * (-h / 23800.0).exp();
    [time * v, time * ((u[0] - drag) / mass - 32.174), -time * u[0] / 1580.942579, 0.0]
}

#[function]
fn less_height(x: [f64; 4], _u: [f64; 1]) -> f64 {
    -x[0]
}

/// As high as possible, in feet.
fn goddard_in_feet() -> made!() {
    let n = intervals(60);
    let mut ocp = Problem::new(rk4::<SoundingRocket>(1)?)
        .terminal_cost(GeneralCost::<LessHeight>::new())
        .on(over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[0]", .., 0.0, FREE)?.bound("x[1]", .., 0.0, FREE)?.bound("x[2]", .., 1.0, 3.0)?;
    ocp.bound("x[3]", .., 1.0, 100.0)?.bound("u", .., 0.0, 193.044)?;
    fix(&mut ocp, 0, &[0.0, 0.0, 3.0])?;
    fix(&mut ocp, n, &[f64::NAN, 0.0, 1.0])?;
    line(&mut ocp, &[0.0, 0.0, 3.0, 40.0], &[20000.0, 0.0, 1.0, 40.0], &[100.0])?;
    Ok(ocp)
}

/// A launch over `τ ∈ [0, 1]`: height m, velocity m/s along and up, mass kg, time s; the pitch.
#[ode]
pub fn launch(x: [f64; 5], u: [f64; 1]) -> [f64; 5] {
    let [h, vx, vy, mass, time] = x;
    let drag = 0.5 * 0.5 * 7.069 * 1.225 * (-h / 8440.0).exp();
    let (s, c) = u[0].sin_cos();
    [
        time * vy,
        time * (2.1e6 * c - drag * vx * vx) / mass,
        time * (2.1e6 * s - drag * vy * vy) / mass - time * 9.80665,
        -time * 2.1e6 / (9.80665 * 265.2),
        0.0,
    ]
}

#[function]
fn launch_time(x: [f64; 5], _u: [f64; 1]) -> f64 {
    x[4]
}

/// A single stage to orbit of the earth in the shortest time.
fn single_stage() -> made!() {
    let n = intervals(60);
    let mut ocp =
        Problem::new(rk4::<Launch>(2)?).terminal_cost(GeneralCost::<LaunchTime>::new()).on(over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[3]", .., 100.0, 1.2e5)?.bound("x[4]", .., 10.0, 500.0)?.bound("u", .., -1.57, 1.57)?;
    fix(&mut ocp, 0, &[0.0, 0.0, 0.0, 117000.0])?;
    fix(&mut ocp, n, &[1.85e5, 7796.6961, 0.0])?;
    let (from, to) = ([0.0, 0.0, 0.0, 117000.0, 150.0], [1.85e5, 7796.6961, 0.0, 1163.0, 150.0]);
    line(&mut ocp, &from, &to, &[0.4])?;
    Ok(ocp)
}

/// A lander over `τ ∈ [0, 1]`: height, velocity, mass, time; thrust.
#[ode]
pub fn lander(x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    [x[3] * x[1], x[3] * (u[0] / x[2] - 1.0), -x[3] * u[0] / 2.349, 0.0]
}

#[function]
fn impulse(x: [f64; 4], u: [f64; 1]) -> f64 {
    x[3] * u[0]
}

/// A soft landing on the moon with the least impulse.
fn moon_lander() -> made!() {
    let n = intervals(60);
    let dynamics = WithIntegral::new(rk4::<Lander>(1)?, Quadrature::<Impulse>::new());
    let mut ocp = Problem::new(dynamics).on(over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[2]", .., 0.01, 1.0)?.bound("x[3]", .., 0.1, 100.0)?.bound("u", .., 0.0, 1.227)?;
    fix(&mut ocp, 0, &[1.0, -0.783, 1.0])?;
    fix(&mut ocp, n, &[0.0, 0.0])?;
    line(&mut ocp, &[1.0, -0.783, 1.0, 1.5], &[0.0, 0.0, 0.5, 1.5], &[0.6])?;
    Ok(ocp)
}

/// Low thrust: radius, velocities radially and around; the direction of the thrust.
#[ode]
pub fn low_thrust(x: [f64; 3], u: [f64; 1], t: f64) -> [f64; 3] {
    let [r, v, w] = x;
    let thrust = 0.1405 / (1.0 - 0.07489 * t);
    let (s, c) = u[0].sin_cos();
    [v, w * w / r - 1.0 / (r * r) + thrust * s, -v * w / r + thrust * c]
}

#[function]
fn less_radius(x: [f64; 3], _u: [f64; 1]) -> f64 {
    -x[0]
}

#[function]
fn excess_speed(x: [f64; 3], _u: [f64; 1]) -> f64 {
    x[2] * x[2] * x[0] - 1.0
}

/// From one circular orbit to the largest in a given time.
fn orbit_transfer() -> made!() {
    let n = intervals(60);
    let mut ocp = Problem::new(rk4::<LowThrust>(1)?)
        .terminal_cost(GeneralCost::<LessRadius>::new())
        .terminal_constraints(Constraint::<ExcessSpeed>::new([0.0], [0.0]))
        .on(over(n, 3.32))?;
    ocp.fix_initial_state(&[1.0, 0.0, 1.0])?.bound("x[1]", n.., 0.0, 0.0)?.bound("u", .., -10.0, 10.0)?;
    line(&mut ocp, &[1.0, 0.0, 1.0], &[1.5, 0.0, 0.8], &[0.0])?;
    Ok(ocp)
}

/// All of them.
pub fn all() -> Vec<Entry> {
    let facts = Facts::new;
    let betts = "J. T. Betts, Practical Methods for Optimal Control, 2010";
    vec![
        Entry::new(
            facts(
                "f8",
                "PSOPT, f8; C. Y. Kaya, J. L. Noakes 1996",
                3.780858,
                5e-7,
                &["free time", "bang-bang"],
            ),
            f8,
        ),
        Entry::new(
            facts(
                "missile",
                "PSOPT, missile; S. Subchan, R. Żbikowski 2009",
                40.91755,
                5e-6,
                &["free time", "units", "path constraint", "steep"],
            ),
            missile,
        ),
        Entry::new(
            facts("shuttle_reentry", betts, -34.1412 * PI / 180.0, 1e-6, &["free time", "units"]),
            shuttle_reentry,
        ),
        Entry::new(
            facts("glider", "COPS 3.0", -1248.03, 5e-3, &["free time", "units", "singular arc"]),
            glider,
        ),
        Entry::new(
            facts("goddard_in_feet", betts, -18550.872, 5e-4, &["free time", "units", "singular arc"]),
            goddard_in_feet,
        ),
        Entry::new(
            facts("single_stage", "dymos, ssto_earth", 143.0, 1.0, &["free time", "units"]),
            single_stage,
        ),
        Entry::new(
            facts("moon_lander", "PSOPT, moon", 1.4204, 5e-6, &["free time", "bang-bang"]),
            moon_lander,
        ),
        Entry::new(
            facts(
                "orbit_transfer",
                "A. E. Bryson, Y.-C. Ho, Applied Optimal Control, 1975, p. 66",
                -1.525,
                5e-4,
                &["terminal constraint", "time-dependent"],
            ),
            orbit_transfer,
        ),
    ]
}
