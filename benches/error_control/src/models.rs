//! Few models that hold many problems: which terms there are is said by parameters.

use casados::tables::Spline;
use casados::{dae, ode};

/// `ẋ_i = a_i + Σ_j A_ij x_j + Σ_(j≤k) Q_ijk x_j x_k`. p = [a, A, Q] row by row.
#[ode]
pub fn quadratic(x: [f64; 5], p: [f64; 105]) -> [f64; 5] {
    core::array::from_fn(|i| {
        let mut sum = p[i];
        let mut next = 30 + 15 * i;
        for j in 0..5 {
            sum += p[5 + 5 * i + j] * x[j];
            for k in j..5 {
                sum += p[next] * x[j] * x[k];
                next += 1;
            }
        }
        sum
    })
}

/// `ẍ = −p₀ x − p₁ ẋ − p₂ x³ + p₃ (1 − x²) ẋ + p₄ cos(p₅ t)`
#[ode]
pub fn cubic(x: [f64; 2], p: [f64; 6], t: f64) -> [f64; 2] {
    let square = x[0] * x[0];
    let own = p[0] * x[0] + p[1] * x[1] + p[2] * square * x[0];
    [x[1], p[3] * (1.0 - square) * x[1] - own + p[4] * (p[5] * t).cos()]
}

/// A mass in a plane: on a spring, attracted by the origin, and heavy. p = [spring, mass, weight].
#[ode]
pub fn central(x: [f64; 4], p: [f64; 3]) -> [f64; 4] {
    let square = x[0] * x[0] + x[1] * x[1];
    let radius = square.sqrt();
    let pull = p[0] * (radius - 1.0) / radius + p[1] / (square * radius);
    [x[2], x[3], -pull * x[0], -pull * x[1] - p[2]]
}

const KNOTS: [f64; 9] = [0.0, 1.0, 2.5, 4.0, 6.0, 7.0, 10.0, 14.0, 21.0];
const FORCE: Spline<9> = Spline::natural(KNOTS, [0.0, 1.0, -0.5, 0.7, 0.7, -1.0, 0.3, 0.0, 1.0]);

/// An oscillator under forces that are not smooth: `max(0, sin(p₂ t + p₃))` and its square and
/// cube, a push until `p₈`, a spline. p = [ω², damping, frequency, phase, of each power, push, its
/// end, spline, its rate].
#[ode]
pub fn forced(x: [f64; 2], p: [f64; 11], t: f64) -> [f64; 2] {
    let m = (p[2] * t + p[3]).sin().max(0.0);
    let push = if t <= p[8] { p[7] * t.sin() * t.sin() } else { 0.0 };
    let waves = p[4] * m + p[5] * m * m + p[6] * m * m * m;
    [x[1], -p[0] * x[0] - p[1] * x[1] + waves + push + p[9] * FORCE.value(p[10] * t)]
}

/// A mass that falls onto a spring, or a spring of two stiffnesses. p = [weight, spring at depth,
/// its damping, spring].
#[ode]
pub fn contact(x: [f64; 2], p: [f64; 4]) -> [f64; 2] {
    let depth = (-x[0]).max(0.0);
    [x[1], p[1] * depth - p[2] * depth * x[1] - p[0] - p[3] * x[0]]
}

/// An oscillator with dry friction. p = [friction].
#[ode]
pub fn rubbed(x: [f64; 2], p: f64) -> [f64; 2] {
    [x[1], -x[0] - p * if x[1] > 0.0 { 1.0 } else { -1.0 }]
}

/// `z` is 2 or 0.2, of a cubic.
#[dae(nominal(z = [1.0]))]
pub fn switched(xdot: [f64; 1], x: [f64; 1], z: [f64; 1], t: f64) -> [f64; 2] {
    let s = if (1.7 * t + 0.2).sin() > 0.0 { 2.0 } else { 0.2 };
    [xdot[0] - (z[0] - x[0]), z[0] + z[0] * z[0] * z[0] - (s + s * s * s)]
}

/// A converter whose switch is closed for a part of each period. p = [part, load].
#[ode]
pub fn converter(x: [f64; 2], p: [f64; 2], t: f64) -> [f64; 2] {
    let mut voltage = 0.0;
    for period in 0..20 {
        let since = t - period as f64;
        if since >= 0.0 {
            voltage = if since < p[0] { 12.0 } else { 0.0 };
        }
    }
    [(voltage - x[1]) / 2.0, (x[0] - x[1] / p[1]) / 3.0]
}

/// Where its force has knots.
pub fn knots() -> Vec<f64> {
    KNOTS.to_vec()
}
