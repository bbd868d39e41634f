//! A pendulum on a cart, pushed by a force.

use casados::dae;

/// Angle zero is upright. The ball is at (position − length sin(angle), length cos(angle)).
///
/// x = [position m, angle rad, velocity m/s, angular velocity rad/s], u = [force N].
#[dae]
pub fn pendulum(xdot: [f64; 4], x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    const CART: f64 = 1.0; // kg
    const BALL: f64 = 0.1; // kg
    const LENGTH: f64 = 0.8; // m
    const G: f64 = 9.81; // m/s²

    let [_, angle, velocity, omega] = x;
    let [force] = u;
    let (sin, cos) = angle.sin_cos();
    let mass = CART + BALL - BALL * cos * cos;
    let centrifugal = BALL * LENGTH * sin * omega * omega;

    let acceleration = (force - centrifugal + BALL * G * cos * sin) / mass;
    let angular = (force * cos - centrifugal * cos + (CART + BALL) * G * sin) / (LENGTH * mass);
    [xdot[0] - velocity, xdot[1] - omega, xdot[2] - acceleration, xdot[3] - angular]
}
