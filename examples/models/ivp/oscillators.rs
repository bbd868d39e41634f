//! The oscillator of Van der Pol: slow branches with jumps between them.

use casados::ode;

/// In its own time. p = [mu].
#[ode]
pub fn van_der_pol(x: [f64; 2], p: f64) -> [f64; 2] {
    let [y1, y2] = x;
    [y2, p * (1.0 - y1 * y1) * y2 - y1]
}

/// In the time of the slow branches. p = [1/ε].
#[ode]
pub fn van_der_pol_scaled(x: [f64; 2], p: f64) -> [f64; 2] {
    let [y1, y2] = x;
    [y2, p * ((1.0 - y1 * y1) * y2 - y1)]
}
