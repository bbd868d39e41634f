//! The plant: a pendulum that a motor holds upright.

use casados::prelude::*;

/// x = [angle from the upright rad, rate rad/s], u = torque per inertia 1/s².
#[ode]
pub fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u + 9.81 * x[0].sin() - 0.1 * x[1]]
}

/// Residuals of the running cost.
#[function]
pub fn deviation(x: [f64; 2], u: f64) -> [f64; 3] {
    [x[0], x[1], u]
}

/// Residuals of the terminal cost.
#[function]
pub fn terminal_deviation(x: [f64; 2], _u: f64) -> [f64; 2] {
    x
}
