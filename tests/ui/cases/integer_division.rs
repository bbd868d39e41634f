#![deny(deprecated)]

use casados::prelude::*;

#[ode]
fn kinetic(x: [f64; 2]) -> [f64; 2] {
    let energy = (1 / 2) as f64 * x[1] * x[1];
    [x[1], -energy]
}

fn main() {}
