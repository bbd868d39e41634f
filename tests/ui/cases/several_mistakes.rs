use casados::{dae, ode};

#[dae]
fn arguments(xdot: [f64; 2], velocity: [f64; 2], u: &[f64], x: [f64; 2]) -> [f64; 2] {
    [xdot[0] - velocity[0], xdot[1] - u[0]]
}

const LENGTH: usize = 1;

#[ode]
fn types(x: [f32; 2], u: [f64; LENGTH]) -> [f64; 2] {
    [f64::from(x[1]), u[0]]
}

#[ode(N = 2, N = 3, crate = ::casados, crate = ::casados)]
fn attribute<const N: usize>(x: [f64; N]) -> [f64; N] {
    x
}

fn main() {}
