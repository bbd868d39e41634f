//! Arms, cranes, bodies that turn, and what is connected by joints and springs.

use super::{fix, intervals, line, made, over, rk4};
use crate::{Entry, Facts};
use casados::ocp::{GeneralCost, Problem, WithIntegral};
use casados::{Gauss, Irk, Options, Quadrature, dae, function, ode};
use core::f64::consts::PI;

/// An arm in spherical coordinates over `τ ∈ [0, 1]`: length, azimuth, elevation, rates, time;
/// three forces.
#[ode]
pub fn spherical_arm(x: [f64; 7], u: [f64; 3]) -> [f64; 7] {
    const LENGTH: f64 = 5.0;
    let [rho, _, phi, rho_rate, theta_rate, phi_rate, time] = x;
    let rest = LENGTH - rho;
    let inertia = (rest * rest * rest + rho * rho * rho) / 3.0;
    let s = phi.sin();
    [
        time * rho_rate,
        time * theta_rate,
        time * phi_rate,
        time * u[0] / LENGTH,
        time * u[1] / (inertia * s * s),
        time * u[2] / inertia,
        0.0,
    ]
}

#[function]
fn spherical_time(x: [f64; 7], _u: [f64; 3]) -> f64 {
    x[6]
}

/// From rest to rest, 120° to the side.
fn robot_arm() -> made!() {
    let n = intervals(60);
    let mut ocp = Problem::new(rk4::<SphericalArm>(1)?)
        .terminal_cost(GeneralCost::<SphericalTime>::new())
        .on(over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[0]", .., 0.0, 5.0)?.bound("x[1]", .., -PI, PI)?.bound("x[2]", .., 0.0, PI)?;
    ocp.bound("x[6]", .., 0.1, 100.0)?.bound("u", .., -1.0, 1.0)?;
    let (quarter, third) = (PI / 4.0, 2.0 * PI / 3.0);
    fix(&mut ocp, 0, &[4.5, 0.0, quarter, 0.0, 0.0, 0.0])?;
    fix(&mut ocp, n, &[4.5, third, quarter, 0.0, 0.0, 0.0])?;
    let (from, to) = ([4.5, 0.0, quarter, 0.0, 0.0, 0.0, 5.0], [4.5, third, quarter, 0.0, 0.0, 0.0, 5.0]);
    line(&mut ocp, &from, &to, &[0.0; 3])?;
    Ok(ocp)
}

/// An arm of two links over `τ ∈ [0, 1]`: rates, angle between the links, angle of the first, time;
/// two torques.
#[ode]
pub fn two_links(x: [f64; 5], u: [f64; 2]) -> [f64; 5] {
    let [a, b, angle, _, time] = x;
    let (s, c) = angle.sin_cos();
    let d = 31.0 / 36.0 + 9.0 / 4.0 * s * s;
    let first = s * (2.25 * c * a * a + 2.0 * b * b) + 4.0 / 3.0 * (u[0] - u[1]) - 1.5 * c * u[1];
    let second = s * (3.5 * a * a + 2.25 * c * b * b) - 7.0 / 3.0 * u[1] + 1.5 * c * (u[0] - u[1]);
    [time * first / d, -time * second / d, time * (b - a), time * a, 0.0]
}

#[function]
fn links_time(x: [f64; 5], _u: [f64; 2]) -> f64 {
    x[4]
}

/// Luus' arm: half a radian in the shortest time.
fn two_link_arm() -> made!() {
    let n = intervals(60);
    let mut ocp =
        Problem::new(rk4::<TwoLinks>(1)?).terminal_cost(GeneralCost::<LinksTime>::new()).on(over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[4]", .., 1.0, 10.0)?.bound("u", .., -1.0, 1.0)?;
    fix(&mut ocp, 0, &[0.0, 0.0, 0.5, 0.0])?;
    fix(&mut ocp, n, &[0.0, 0.0, 0.5, 0.522])?;
    line(&mut ocp, &[0.0, 0.0, 0.5, 0.0, 3.0], &[0.0, 0.0, 0.5, 0.522, 3.0], &[0.0; 2])?;
    Ok(ocp)
}

/// Sakawa and Shindo's container crane: position, rope, swing, their rates; accelerations.
#[ode]
pub fn container(x: [f64; 6], u: [f64; 2]) -> [f64; 6] {
    [
        9.0 * x[3],
        9.0 * x[4],
        9.0 * x[5],
        9.0 * (u[0] + 17.2656 * x[2]),
        9.0 * u[1],
        -9.0 / x[1] * (u[0] + 27.0756 * x[2] + 2.0 * x[4] * x[5]),
    ]
}

#[function]
fn swing(x: [f64; 6], _u: [f64; 2]) -> f64 {
    4.5 * (x[2] * x[2] + x[5] * x[5])
}

/// The least swing on the way from the ship to the truck.
fn container_crane() -> made!() {
    let n = intervals(60);
    let dynamics = WithIntegral::new(rk4::<Container>(1)?, Quadrature::<Swing>::new());
    let mut ocp = Problem::new(dynamics).on(over(n, 1.0))?;
    let (start, end) = ([0.0, 22.0, 0.0, 0.0, -1.0, 0.0], [10.0, 14.0, 0.0, 2.5, 0.0, 0.0]);
    ocp.fix_initial_state(&start)?.bound("x[3]", .., -2.5, 2.5)?.bound("x[4]", .., -1.0, 1.0)?;
    ocp.bound("u[0]", .., -2.83374, 2.83374)?.bound("u[1]", .., -0.80865, 0.71265)?;
    fix(&mut ocp, n, &end)?;
    line(&mut ocp, &start, &end, &[0.0; 2])?;
    Ok(ocp)
}

/// A rigid body over `τ ∈ [0, 1]`: quaternion, rates, time; three torques.
#[ode]
pub fn rigid_body(x: [f64; 8], u: [f64; 3]) -> [f64; 8] {
    const INERTIA: [f64; 3] = [5621.0, 4547.0, 2364.0]; // kg m²
    let [a, b, c, w, p, q, r, time] = x;
    [
        0.5 * time * (p * w - q * c + r * b),
        0.5 * time * (p * c + q * w - r * a),
        0.5 * time * (-p * b + q * a + r * w),
        -0.5 * time * (p * a + q * b + r * c),
        time * (u[0] - (INERTIA[2] - INERTIA[1]) * q * r) / INERTIA[0],
        time * (u[1] - (INERTIA[0] - INERTIA[2]) * p * r) / INERTIA[1],
        time * (u[2] - (INERTIA[1] - INERTIA[0]) * p * q) / INERTIA[2],
        0.0,
    ]
}

#[function]
fn body_time(x: [f64; 8], _u: [f64; 3]) -> f64 {
    x[7]
}

/// A turn by 150° in the shortest time, from rest to rest.
fn reorientation() -> made!() {
    let n = intervals(60);
    let mut ocp =
        Problem::new(rk4::<RigidBody>(1)?).terminal_cost(GeneralCost::<BodyTime>::new()).on(over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[7]", .., 1.0, 100.0)?.bound("u", .., -50.0, 50.0)?;
    let (s, c) = (75.0 * PI / 180.0).sin_cos();
    fix(&mut ocp, 0, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])?;
    // The norm of the quaternion is what the others leave.
    fix(&mut ocp, n, &[s, 0.0, 0.0, f64::NAN, 0.0, 0.0, 0.0])?;
    ocp.bound("x[3]", n.., 0.0, 1.0)?;
    let (from, to) = ([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 30.0], [s, 0.0, 0.0, c, 0.0, 0.0, 0.0, 30.0]);
    line(&mut ocp, &from, &to, &[0.0; 3])?;
    Ok(ocp)
}

/// A pole on a cart: position, angle from below, their rates; a force.
#[ode]
pub fn hanging_pole(x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    let [_, angle, v, rate] = x;
    let (s, c) = angle.sin_cos();
    let d = 1.0 + 0.3 * s * s;
    [
        v,
        rate,
        (0.5 * 0.3 * s * rate * rate + u[0] + 0.3 * 9.81 * c * s) / d,
        -(0.5 * 0.3 * c * s * rate * rate + u[0] * c + 1.3 * 9.81 * s) / (0.5 * d),
    ]
}

#[function]
fn squared_force(_x: [f64; 4], u: [f64; 1]) -> f64 {
    u[0] * u[0]
}

/// Kelly's cart: swings its pole up on a metre in two seconds.
fn swing_up() -> made!() {
    let n = intervals(50);
    let dynamics = WithIntegral::new(rk4::<HangingPole>(2)?, Quadrature::<SquaredForce>::new());
    let mut ocp = Problem::new(dynamics).on(over(n, 2.0))?;
    ocp.fix_initial_state(&[0.0; 4])?.bound("x[0]", .., -2.0, 2.0)?.bound("u", .., -20.0, 20.0)?;
    fix(&mut ocp, n, &[1.0, PI, 0.0, 0.0])?;
    line(&mut ocp, &[0.0; 4], &[1.0, PI, 0.0, 0.0], &[0.0])?;
    Ok(ocp)
}

/// Two masses with springs and dry friction over `τ ∈ [0, 1]`: positions and velocities, time; two
/// forces.
#[ode]
pub fn friction(x: [f64; 5], u: [f64; 2]) -> [f64; 5] {
    let [a, v, b, w, time] = x;
    [
        time * v,
        time * (-1.8 * a + 0.85 * b - (v / 0.01).tanh() + u[0]) / 1.1,
        time * w,
        time * (0.85 * a - 0.85 * b - (w / 0.01).tanh() + u[1]) / 1.2,
        0.0,
    ]
}

#[function]
fn friction_time(x: [f64; 5], _u: [f64; 2]) -> f64 {
    x[4]
}

/// To rest in the shortest time against Coulomb's friction, which is smoothed.
fn coulomb() -> made!() {
    let n = intervals(60);
    let mut ocp = Problem::new(rk4::<Friction>(4)?)
        .terminal_cost(GeneralCost::<FrictionTime>::new())
        .on(over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[4]", .., 1.8, 4.0)?.bound("u", .., -4.0, 4.0)?;
    fix(&mut ocp, 0, &[0.0, -1.0, 0.0, -2.0])?;
    fix(&mut ocp, n, &[1.0, 0.0, 2.0, 0.0])?;
    line(&mut ocp, &[0.0, -1.0, 0.0, -2.0, 3.0], &[1.0, 0.0, 2.0, 0.0, 3.0], &[0.0; 2])?;
    Ok(ocp)
}

/// A pendulum in Cartesian coordinates: position, velocity; the force of the rod is algebraic; a
/// force across it.
#[dae]
pub fn reduced_pendulum(xdot: [f64; 4], x: [f64; 4], z: [f64; 1], u: [f64; 1]) -> [f64; 5] {
    [
        xdot[0] - x[2],
        xdot[1] - x[3],
        xdot[2] + 2.0 * z[0] * x[0] - u[0] * x[1],
        xdot[3] + 9.81 + 2.0 * z[0] * x[1] + u[0] * x[0],
        x[2] * x[2] + x[3] * x[3] - 2.0 * z[0] - 9.81 * x[1],
    ]
}

#[function]
fn across(_x: [f64; 4], _z: [f64; 1], u: [f64; 1]) -> f64 {
    u[0] * u[0]
}

/// From the side to rest below in three seconds.
fn pendulum_dae() -> made!() {
    let n = intervals(60);
    let dynamics = WithIntegral::new(
        Irk::<ReducedPendulum, Gauss<2>>::new(Options::default())?,
        Quadrature::<Across>::new(),
    );
    let mut ocp = Problem::new(dynamics).on(over(n, 3.0))?;
    ocp.fix_initial_state(&[1.0, 0.0, 0.0, 0.0])?.bound("x", 1.., -5.0, 5.0)?;
    ocp.bound("x[0]", n.., 0.0, 0.0)?.bound("x[2]", n.., 0.0, 0.0)?;
    line(&mut ocp, &[1.0, 0.0, 0.0, 0.0], &[0.0, -1.0, 0.0, 0.0], &[0.0])?;
    Ok(ocp)
}

/// A spacecraft that tumbles: rates; torques.
#[ode]
pub fn tumbling(x: [f64; 3], u: [f64; 3]) -> [f64; 3] {
    const INERTIA: [f64; 3] = [86.24, 85.07, 113.59];
    [
        ((INERTIA[1] - INERTIA[2]) * x[1] * x[2] + u[0]) / INERTIA[0],
        ((INERTIA[2] - INERTIA[0]) * x[0] * x[2] + u[1]) / INERTIA[1],
        ((INERTIA[0] - INERTIA[1]) * x[0] * x[1] + u[2]) / INERTIA[2],
    ]
}

#[function]
fn torques(_x: [f64; 3], u: [f64; 3]) -> f64 {
    0.5 * (u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
}

/// Junkins and Turner's spacecraft: to rest in 100 s with the least torques.
fn detumbling() -> made!() {
    let n = intervals(50);
    let dynamics = WithIntegral::new(rk4::<Tumbling>(1)?, Quadrature::<Torques>::new());
    let mut ocp = Problem::new(dynamics).on(over(n, 100.0))?;
    ocp.fix_initial_state(&[0.01, 0.005, 0.001])?;
    fix(&mut ocp, n, &[0.0; 3])?;
    line(&mut ocp, &[0.01, 0.005, 0.001], &[0.0; 3], &[0.0; 3])?;
    Ok(ocp)
}

/// All of them.
pub fn all() -> Vec<Entry> {
    let facts = Facts::new;
    let betts = "J. T. Betts, Practical Methods for Optimal Control, 2010";
    vec![
        Entry::new(facts("robot_arm", "COPS 3.0", 9.14093, 5e-6, &["free time", "bang-bang"]), robot_arm),
        Entry::new(
            facts("two_link_arm", "PSOPT, twolinkarm", 2.988662, 1e-2, &["free time", "bang-bang"]),
            two_link_arm,
        ),
        Entry::new(
            facts("container_crane", "PSOPT, crane", 5.1513e-3, 5e-8, &["state constraint", "units"]),
            container_crane,
        ),
        Entry::new(
            facts("reorientation", betts, 28.630410, 5e-7, &["free time", "bang-bang"]),
            reorientation,
        ),
        Entry::new(
            facts("swing_up", "dymos, cart_pole; M. Kelly 2017", 58.8839489745, 5e-11, &["smooth"]),
            swing_up,
        ),
        Entry::new(
            facts("coulomb", "PSOPT, coulomb", 2.104992, 1e-2, &["free time", "bang-bang", "steep"]),
            coulomb,
        ),
        Entry::new(facts("pendulum_dae", betts, 12.8738850, 5e-8, &["DAE", "smooth"]), pendulum_dae),
        Entry::new(
            facts("detumbling", "J. L. Junkins, J. D. Turner 1986", 4.6878e-3, 5e-8, &["units", "smooth"]),
            detumbling,
        ),
    ]
}
