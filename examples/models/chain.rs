//! A chain of masses on springs: the first hangs at the wall, the velocity of the last is
//! controlled.

use casados::dae;
use nalgebra::{SVector, Vector3};

/// The chain with `(NX - 3) / 6` free masses between the wall and the controlled end.
///
/// x = [positions of the free masses and of the end m, velocities of the free masses m/s],
/// u = [velocity of the end m/s].
#[dae(NX = [9, 15, 21, 27, 33, 45, 69])]
pub fn chain<const NX: usize>(xdot: [f64; NX], x: [f64; NX], u: [f64; 3]) -> [f64; NX] {
    const MASS: f64 = 0.033; // kg
    const STIFFNESS: f64 = 1.0; // N/m
    const LENGTH: f64 = 0.033; // of a spring at rest, m
    const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81); // m/s²

    let free = (NX - 3) / 6;
    let end = 3 * free;
    let velocities = end + 3;
    let position = |i: usize| Vector3::new(x[3 * i], x[3 * i + 1], x[3 * i + 2]);
    // Pull of the spring before mass i on that mass, as an acceleration.
    let pull = |i: usize| {
        let spring = if i == 0 { position(0) } else { position(i) - position(i - 1) };
        spring * (STIFFNESS / MASS * (LENGTH / spring.norm() - 1.0))
    };

    let mut residual = xdot;
    for i in 0..free {
        let acceleration = pull(i) - pull(i + 1) + GRAVITY;
        for axis in 0..3 {
            residual[3 * i + axis] -= x[velocities + 3 * i + axis];
            residual[velocities + 3 * i + axis] -= acceleration[axis];
        }
    }
    for axis in 0..3 {
        residual[end + axis] -= u[axis];
    }
    residual
}

/// A chain stretched to one metre and a little disturbed: where examples and benchmarks start.
pub fn stretched<const NX: usize>() -> SVector<f64, NX> {
    let free = (NX - 3) / 6;
    SVector::from_fn(|i, _| {
        let (mass, axis) = (i / 3, i % 3);
        if mass > free {
            return 0.1 * ((i - 3 * free - 2) as f64).sin();
        }
        let along = if axis == 0 { (mass + 1) as f64 / (free + 1) as f64 } else { 0.0 };
        along + 0.01 * ((i + 1) as f64).cos()
    })
}
