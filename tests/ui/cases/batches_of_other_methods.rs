use casados::Radau;
use casados::prelude::*;

#[ode]
fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u - x[0].sin()]
}

#[dae]
fn implicit(xdot: [f64; 2], x: [f64; 2]) -> [f64; 2] {
    [xdot[0] - x[1], xdot[0] * xdot[1] + x[0]]
}

fn main() {
    // Steps of variable size.
    let _: Option<Batch<Pendulum, Radau>> = None;
    // An explicit method for a model that is not.
    let _: Option<Batch<Implicit, Rk4>> = None;
}
