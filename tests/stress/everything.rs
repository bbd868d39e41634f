//! A model with everything that a model may have.

use casados::dae;

/// A fully implicit model with every kind of variable: `z` and parameters that enter nonlinearly,
/// time, a state-dependent mass matrix.
#[dae]
pub fn everything(xdot: [f64; 2], x: [f64; 2], z: [f64; 1], u: [f64; 1], p: [f64; 2], t: f64) -> [f64; 3] {
    let [stiffness, mass] = p;
    [
        (mass + x[0] * x[0]) * xdot[0] + 0.1 * xdot[1].sin() - x[1] * z[0],
        xdot[1] + stiffness * x[0].sinh() - u[0] * (1.0 + 0.2 * t).ln() * z[0],
        z[0] + 0.3 * z[0].powi(3) - (x[0] - 0.4 * xdot[0] * u[0]).cos() - p[1] * t,
    ]
}
