//! Oscillations that are not damped, or hardly: where errors stay.

use casados::{dae, ode};

/// An elastic beam, clamped at one end, that is pulled at the other until `t = π`: pieces of
/// constant length turn by the angles `θ`. x = [θ, θ̇], z = [u], with `NZ` pieces, `NX = 2 NZ`.
///
/// E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, section IV.1, equations (1.10)
/// to (1.18); "beam" of the Test Set for IVP Solvers.
#[dae((NX, NZ, NK) = [(20, 10, 30)])]
pub fn beam<const NX: usize, const NZ: usize, const NK: usize>(
    xdot: [f64; NX],
    x: [f64; NX],
    z: [f64; NZ],
    t: f64,
) -> [f64; NK] {
    let n = NZ;
    let (n2, n4) = ((n * n) as f64, (n * n * n * n) as f64);
    let pull = if t <= core::f64::consts::PI { 1.5 * t.sin() * t.sin() } else { 0.0 };
    let angle = |i: usize| x[i];
    let moment = |i: usize| {
        let before = if i == 0 { -angle(0) } else { angle(i - 1) };
        let after = if i + 1 == n { angle(i) } else { angle(i + 1) };
        n4 * (before - 2.0 * angle(i) + after) + n2 * pull * (angle(i).cos() + angle(i).sin())
    };
    let diagonal = |i: usize| {
        if i == 0 {
            1.0
        } else if i + 1 == n {
            3.0
        } else {
            2.0
        }
    };
    // θ̈ = C v + D u, C u = D v + θ̇², with C and D real and imaginary part of one Hermitian matrix
    // of three diagonals.
    let mut residual = [0.0; NK];
    for i in 0..n {
        let mut acceleration = diagonal(i) * moment(i);
        let mut equation = diagonal(i) * z[i] - x[n + i] * x[n + i];
        if i > 0 {
            let (sin, cos) = (angle(i) - angle(i - 1)).sin_cos();
            acceleration = acceleration - cos * moment(i - 1) - sin * z[i - 1];
            equation = equation - cos * z[i - 1] + sin * moment(i - 1);
        }
        if i + 1 < n {
            let (sin, cos) = (angle(i) - angle(i + 1)).sin_cos();
            acceleration = acceleration - cos * moment(i + 1) - sin * z[i + 1];
            equation = equation - cos * z[i + 1] + sin * moment(i + 1);
        }
        residual[i] = xdot[i] - x[n + i];
        residual[n + i] = xdot[n + i] - acceleration;
        residual[2 * n + i] = equation;
    }
    residual
}

/// The same with `u` found by elimination: x = [θ, θ̇].
#[ode(N = [20, 80])]
pub fn explicit_beam<const N: usize>(x: [f64; N], t: f64) -> [f64; N] {
    let n = N / 2;
    let (n2, n4) = ((n * n) as f64, (n * n * n * n) as f64);
    let pull = if t <= core::f64::consts::PI { 1.5 * t.sin() * t.sin() } else { 0.0 };
    let mut moment = [0.0; N];
    let mut pivot = [0.0; N];
    let mut u = [0.0; N];
    for i in 0..n {
        let before = if i == 0 { -x[0] } else { x[i - 1] };
        let after = if i + 1 == n { x[i] } else { x[i + 1] };
        moment[i] = n4 * (before - 2.0 * x[i] + after) + n2 * pull * (x[i].cos() + x[i].sin());
    }
    for i in 0..n {
        pivot[i] = if i == 0 {
            1.0
        } else if i + 1 == n {
            3.0
        } else {
            2.0
        };
        u[i] = x[n + i] * x[n + i];
        if i > 0 {
            u[i] -= (x[i] - x[i - 1]).sin() * moment[i - 1];
        }
        if i + 1 < n {
            u[i] -= (x[i] - x[i + 1]).sin() * moment[i + 1];
        }
        if i > 0 {
            let cos = (x[i] - x[i - 1]).cos();
            let factor = cos / pivot[i - 1];
            pivot[i] -= factor * cos;
            u[i] += factor * u[i - 1];
        }
    }
    for step in 0..n {
        let i = n - 1 - step;
        if i + 1 < n {
            u[i] += (x[i] - x[i + 1]).cos() * u[i + 1];
        }
        u[i] /= pivot[i];
    }
    let mut derivative = [0.0; N];
    for i in 0..n {
        derivative[i] = x[n + i];
        derivative[n + i] = if i == 0 {
            moment[i]
        } else if i + 1 == n {
            3.0 * moment[i]
        } else {
            2.0 * moment[i]
        };
        if i > 0 {
            let (sin, cos) = (x[i] - x[i - 1]).sin_cos();
            derivative[n + i] = derivative[n + i] - cos * moment[i - 1] - sin * u[i - 1];
        }
        if i + 1 < n {
            let (sin, cos) = (x[i] - x[i + 1]).sin_cos();
            derivative[n + i] = derivative[n + i] - cos * moment[i + 1] - sin * u[i + 1];
        }
    }
    derivative
}

/// Six oscillators with `ω = 1, 4, 16, 64, 256, 1024` around `sin t`, damped by `2ζω`, seen from a
/// basis in which all are mixed. x = [positions, velocities], p = [ζ].
#[ode]
pub fn modes(x: [f64; 12], p: f64, t: f64) -> [f64; 12] {
    // I − 2vvᵀ
    const V: [f64; 6] = [0.1, 0.7, 0.3, 0.5, 0.1, 0.3872983346207417];
    let mut positions = 0.0;
    let mut velocities = 0.0;
    for i in 0..6 {
        positions += V[i] * (x[i] - t.sin());
        velocities += V[i] * x[6 + i];
    }
    let mut force = [0.0; 6];
    let mut along = 0.0;
    for i in 0..6 {
        let omega = (1 << (2 * i)) as f64;
        let position = x[i] - t.sin() - 2.0 * V[i] * positions;
        let velocity = x[6 + i] - 2.0 * V[i] * velocities;
        force[i] = -omega * (omega * position + 2.0 * p * velocity);
        along += V[i] * force[i];
    }
    core::array::from_fn(|i| if i < 6 { x[6 + i] } else { force[i - 6] - 2.0 * V[i - 6] * along })
}

/// Masses on stiff springs in a plane swing as a rope, from the horizontal. x = [x, y, ẋ, ẏ] of
/// five, p = [stiffness].
#[ode]
pub fn rope(x: [f64; 20], p: f64) -> [f64; 20] {
    let mut force = [[0.0; 2]; 6];
    for i in 0..5 {
        let (dx, dy) = if i == 0 { (x[0], x[5]) } else { (x[i] - x[i - 1], x[5 + i] - x[4 + i]) };
        let length = (dx * dx + dy * dy).sqrt();
        let pull = p * (length - 0.2) / length;
        force[i] = [pull * dx, pull * dy];
    }
    core::array::from_fn(|i| match i / 5 {
        0 | 1 => x[10 + i],
        2 => 5.0 * (force[i - 9][0] - force[i - 10][0]),
        _ => 5.0 * (force[i - 14][1] - force[i - 15][1]) - 9.81,
    })
}

/// A mass on a stiff spring, swinging. x = [x, y, ẋ, ẏ], p = [stiffness].
#[ode]
pub fn spring_pendulum(x: [f64; 4], p: f64) -> [f64; 4] {
    let [x1, x2, v1, v2] = x;
    let length = (x1 * x1 + x2 * x2).sqrt();
    let pull = p * (length - 1.0) / length;
    [v1, v2, -pull * x1, -pull * x2 - 9.81]
}

/// A mass on a rod, with the constraint differentiated twice. x = [x, y, ẋ, ẏ], z = [tension].
#[dae]
pub fn rod_pendulum(xdot: [f64; 4], x: [f64; 4], z: f64) -> [f64; 5] {
    let [x1, x2, v1, v2] = x;
    [
        xdot[0] - v1,
        xdot[1] - v2,
        xdot[2] + x1 * z,
        xdot[3] + x2 * z + 9.81,
        v1 * v1 + v2 * v2 - z * (x1 * x1 + x2 * x2) - 9.81 * x2,
    ]
}

/// `(sin t, cos t)`, with the eigenvalues `p₁ ± i p₂`.
#[ode]
pub fn turning(x: [f64; 2], p: [f64; 2], t: f64) -> [f64; 2] {
    let (sin, cos) = t.sin_cos();
    let (a, b) = (x[0] - sin, x[1] - cos);
    [p[0] * a - p[1] * b + cos, p[1] * a + p[0] * b - sin]
}

/// The ellipse of Kepler. x = [x, y, ẋ, ẏ].
#[ode]
pub fn kepler(x: [f64; 4]) -> [f64; 4] {
    let [x1, x2, v1, v2] = x;
    let square = x1 * x1 + x2 * x2;
    let cube = square * square.sqrt();
    [v1, v2, -x1 / cube, -x2 / cube]
}
