//! A planet around a sun, and how much a method changes what the planet keeps.

use casados::{Heap, Integrator, ode};
use nalgebra::{SVector, vector};

/// `q̈ = −q/|q|³`
#[ode]
pub fn kepler(x: [f64; 4]) -> [f64; 4] {
    let [x, y, vx, vy] = x;
    let square = x * x + y * y;
    let cube = square * square.sqrt();
    [vx, vy, -x / cube, -y / cube]
}

/// The length of a step: 80 in an orbit.
pub const STEP: f64 = core::f64::consts::TAU / 80.0;

/// At the perihelion, with the axis turned; semi-major axis one, period 2π.
pub fn perihelion(eccentricity: f64, angle: f64) -> SVector<f64, 4> {
    let ((sin, cos), r) = (angle.sin_cos(), 1.0 - eccentricity);
    let v = ((1.0 + eccentricity) / r).sqrt();
    vector![r * cos, r * sin, -v * sin, v * cos]
}

fn angular_momentum(x: &SVector<f64, 4>) -> f64 {
    x[0] * x[3] - x[1] * x[2]
}

fn energy(x: &SVector<f64, 4>) -> f64 {
    (x[2] * x[2] + x[3] * x[3]) / 2.0 - 1.0 / x[0].hypot(x[1])
}

/// The largest relative changes of angular momentum and energy, looked at after each of so many
/// intervals.
pub fn changes(
    integrator: &mut impl Integrator<Model = Kepler, Number = f64, Memory = Heap>,
    mut x: SVector<f64, 4>,
    intervals: usize,
    h: f64,
) -> [f64; 2] {
    let start = [angular_momentum(&x), energy(&x)];
    let mut worst = [0.0f64; 2];
    for _ in 0..intervals {
        x = integrator.solve(&x, &SVector::zeros(), h).expect("an orbit").x;
        for (worst, (now, start)) in
            worst.iter_mut().zip([angular_momentum(&x), energy(&x)].iter().zip(start))
        {
            *worst = worst.max((now / start - 1.0).abs());
        }
    }
    worst
}
