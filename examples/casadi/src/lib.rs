//! A pendulum on a cart as a function of CasADi: upright at angle zero, pushed by a force.

use casados::prelude::*;

/// x = [position m, angle rad, velocity m/s, rate rad/s], u = [force N].
#[dae]
fn pendulum(xdot: [f64; 4], x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    let [_, angle, velocity, rate] = x;
    let (s, c) = angle.sin_cos();
    let mass = 1.0 + 0.1 - 0.1 * c * c;
    let acceleration = (u[0] - 0.08 * s * rate * rate + 0.981 * c * s) / mass;
    let angular = (u[0] * c - 0.08 * c * s * rate * rate + 10.791 * s) / (0.8 * mass);
    [xdot[0] - velocity, xdot[1] - rate, xdot[2] - acceleration, xdot[3] - angular]
}

casados::casadi::export! {
    pendulum = Irk<Pendulum, Gauss<2>>, interval = 0.05, options = Options { steps: 2, ..Default::default() }
}
