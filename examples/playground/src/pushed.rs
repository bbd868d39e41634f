//! A pendulum on a cart, driven by a force and pushed by a visitor.

use casados::dae;

/// Angle zero is upright. The ball is at (position − length sin(angle), length cos(angle)).
///
/// x = [position m, angle rad, velocity m/s, rate rad/s], u = [force N]; p are pushes: of the cart,
/// of the ball to the right and upwards, N.
#[dae]
pub fn pendulum(xdot: [f64; 4], x: [f64; 4], u: [f64; 1], p: [f64; 3]) -> [f64; 4] {
    const CART: f64 = 1.0; // kg
    const BALL: f64 = 0.1; // kg
    const LENGTH: f64 = 0.8; // m
    const G: f64 = 9.81; // m/s²

    let [_, angle, velocity, rate] = x;
    let [_, _, acceleration, angular] = xdot;
    let [cart, right, up] = p;
    let (sin, cos) = angle.sin_cos();
    let centrifugal = BALL * LENGTH * sin * rate * rate;
    [
        xdot[0] - velocity,
        xdot[1] - rate,
        (CART + BALL) * acceleration - BALL * LENGTH * cos * angular + centrifugal - u[0] - cart - right,
        LENGTH * angular - cos * acceleration - G * sin + (right * cos + up * sin) / BALL,
    ]
}
