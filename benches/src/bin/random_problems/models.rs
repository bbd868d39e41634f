//! Equations of the random problems.

use casados::{dae, ode};

/// Masses on springs in a row, the first on a wall. x = [positions, velocities],
/// p = [masses, stiffnesses, damping, cubic stiffness].
#[ode]
pub fn springs(x: [f64; 20], p: [f64; 22]) -> [f64; 20] {
    let mut force = [0.0; 11];
    for i in 0..10 {
        let stretch = if i == 0 { x[0] } else { x[i] - x[i - 1] };
        let rate = if i == 0 { x[10] } else { x[10 + i] - x[9 + i] };
        force[i] = p[10 + i] * (stretch + p[20] * rate + p[21] * stretch * stretch * stretch);
    }
    core::array::from_fn(|i| if i < 10 { x[10 + i] } else { (force[i - 9] - force[i - 10]) / p[i - 10] })
}

/// `ẋ = A (x − w sin t) + w cos t`, p = [A, w].
#[ode]
pub fn linear(x: [f64; 6], p: [f64; 42], t: f64) -> [f64; 6] {
    let (sin, cos) = t.sin_cos();
    core::array::from_fn(|i| {
        let mut sum = p[36 + i] * cos;
        for j in 0..6 {
            sum += p[6 * i + j] * (x[j] - p[36 + j] * sin);
        }
        sum
    })
}

/// An orbit in a plane.
#[ode]
pub fn orbit(x: [f64; 4]) -> [f64; 4] {
    let [x1, x2, v1, v2] = x;
    let square = x1 * x1 + x2 * x2;
    let cube = square * square.sqrt();
    [v1, v2, -x1 / cube, -x2 / cube]
}

/// Two masses on rods, one below the other, with both constraints differentiated twice.
/// x = [x₁, y₁, x₂, y₂, velocities], z = tensions by length, p = [masses].
#[dae]
pub fn rods(xdot: [f64; 8], x: [f64; 8], z: [f64; 2], p: [f64; 2]) -> [f64; 10] {
    let (dx, dy) = (x[2] - x[0], x[3] - x[1]);
    let (dvx, dvy) = (x[6] - x[4], x[7] - x[5]);
    let a1 = [(-z[0] * x[0] + z[1] * dx) / p[0], (-z[0] * x[1] + z[1] * dy) / p[0] - 9.81];
    let a2 = [-z[1] * dx / p[1], -z[1] * dy / p[1] - 9.81];
    [
        xdot[0] - x[4],
        xdot[1] - x[5],
        xdot[2] - x[6],
        xdot[3] - x[7],
        xdot[4] - a1[0],
        xdot[5] - a1[1],
        xdot[6] - a2[0],
        xdot[7] - a2[1],
        x[4] * x[4] + x[5] * x[5] + x[0] * a1[0] + x[1] * a1[1],
        dvx * dvx + dvy * dvy + dx * (a2[0] - a1[0]) + dy * (a2[1] - a1[1]),
    ]
}

/// Five species: A → B ⇌ C, B + C → D, D ⇌ E, 2 E → A. p = [rates].
#[ode]
pub fn kinetics(x: [f64; 5], p: [f64; 8]) -> [f64; 5] {
    let [a, b, c, d, e] = x;
    let r = [p[0] * a, p[1] * b, p[2] * c, p[3] * b * c, p[4] * d, p[5] * e, p[6] * e * e, p[7] * a * d];
    [
        -r[0] + r[6] - r[7],
        r[0] - r[1] + r[2] - r[3],
        r[1] - r[2] - r[3] + r[7],
        r[3] - r[4] + r[5] - r[7],
        r[4] - r[5] - 2.0 * r[6] + r[7],
    ]
}

/// Van der Pol's oscillator.
#[ode]
pub fn relaxation(x: [f64; 2], p: f64) -> [f64; 2] {
    [x[1], p * (1.0 - x[0] * x[0]) * x[1] - x[0]]
}

/// Duffing's oscillator, p = [damping, linear, cubic, force, frequency].
#[ode]
pub fn forced(x: [f64; 2], p: [f64; 5], t: f64) -> [f64; 2] {
    [x[1], -p[0] * x[1] - p[1] * x[0] - p[2] * x[0] * x[0] * x[0] + p[3] * (p[4] * t).cos()]
}

/// Predators and prey, p = [rates].
#[ode]
pub fn prey(x: [f64; 2], p: [f64; 2]) -> [f64; 2] {
    [p[0] * x[0] * (1.0 - x[1]), p[1] * x[1] * (x[0] - 1.0)]
}

/// A rigid body, p = [(I₂ − I₃)/I₁, …].
#[ode]
pub fn body(x: [f64; 3], p: [f64; 3]) -> [f64; 3] {
    [p[0] * x[1] * x[2], p[1] * x[2] * x[0], p[2] * x[0] * x[1]]
}

/// An oscillator that is pushed until a time, p = [ω, damping, push, end].
#[ode]
pub fn pushed(x: [f64; 2], p: [f64; 4], t: f64) -> [f64; 2] {
    let push = if t <= p[3] { p[2] * t.sin() * t.sin() } else { 0.0 };
    [x[1], -p[0] * p[0] * x[0] - 2.0 * p[1] * p[0] * x[1] + push]
}

/// An oscillator under a force whose derivative jumps, p = [ω², damping, frequency, phase, and what
/// max(0, sin), its square and its cube count].
#[ode]
pub fn kinked(x: [f64; 2], p: [f64; 7], t: f64) -> [f64; 2] {
    let m = (p[2] * t + p[3]).sin().max(0.0);
    [x[1], -p[0] * x[0] - p[1] * x[1] + p[4] * m + p[5] * m * m + p[6] * m * m * m]
}

/// A mass that falls onto a spring, p = [weight, stiffness, damping of the spring].
#[ode]
pub fn contact(x: [f64; 2], p: [f64; 3]) -> [f64; 2] {
    let depth = (-x[0]).max(0.0);
    [x[1], p[1] * depth - p[2] * depth * x[1] - p[0]]
}
