//! The degree of a control that the model does not have, and one that is no number.

use casados::prelude::*;

#[ode(degree(u.pull = 1))]
mod cart {
    pub struct Push {
        pub push: f64,
    }
    pub fn cart(_x: f64, u: &Push) -> f64 {
        u.push
    }
}

#[ode(degree(u = linear))]
fn slider(_x: f64, u: f64) -> f64 {
    u
}

fn main() {}
