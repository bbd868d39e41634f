//! A mass that is pushed, in discrete time, and what its cost weighs.

use casados::prelude::*;

/// Exact for a control that is constant over an interval of 0.1.
#[function]
pub fn push(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [x[0] + 0.1 * x[1] + 0.005 * u[0], x[1] + 0.1 * u[0]]
}

#[function]
pub fn both(x: [f64; 2], u: [f64; 1]) -> [f64; 3] {
    [x[0], x[1], u[0]]
}
