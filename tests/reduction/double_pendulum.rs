//! A double pendulum of two rods in Cartesian coordinates, against the form by its angles.

use casados::prelude::*;
use casados::{Constrained, Function};
use nalgebra::vector;

/// Positions of two masses, their velocities; the multipliers are forces over lengths.
#[dae(index_reduction)]
fn rods_in_a_row(xdot: [f64; 8], x: [f64; 8], z: [f64; 2]) -> [f64; 10] {
    let [x1, y1, x2, y2, ..] = x;
    let (m1, m2, l1, l2, g) = (1.3, 0.8, 0.9, 0.6, 9.81);
    let (dx, dy) = (x2 - x1, y2 - y1);
    [
        xdot[0] - x[4],
        xdot[1] - x[5],
        xdot[2] - x[6],
        xdot[3] - x[7],
        m1 * xdot[4] + z[0] * x1 - z[1] * dx,
        m1 * xdot[5] + z[0] * y1 - z[1] * dy + m1 * g,
        m2 * xdot[6] + z[1] * dx,
        m2 * xdot[7] + z[1] * dy + m2 * g,
        x1 * x1 + y1 * y1 - l1 * l1,
        dx * dx + dy * dy - l2 * l2,
    ]
}

/// The angles from below, and their rates.
#[dae]
fn angles(xdot: [f64; 4], x: [f64; 4]) -> [f64; 4] {
    let (m1, m2, l1, l2, g) = (1.3, 0.8, 0.9, 0.6, 9.81);
    let [a, b, va, vb] = x;
    let (s, c) = (a - b).sin_cos();
    [
        xdot[0] - va,
        xdot[1] - vb,
        (m1 + m2) * l1 * xdot[2] + m2 * l2 * (c * xdot[3] + s * vb * vb) + (m1 + m2) * g * a.sin(),
        l2 * xdot[3] + l1 * (c * xdot[2] - s * va * va) + g * b.sin(),
    ]
}

fn cartesian([a, b, va, vb]: [f64; 4]) -> [f64; 8] {
    let (l1, l2) = (0.9, 0.6);
    let (x1, y1) = (l1 * a.sin(), -l1 * a.cos());
    let (vx1, vy1) = (l1 * va * a.cos(), l1 * va * a.sin());
    let (vx2, vy2) = (vx1 + l2 * vb * b.cos(), vy1 + l2 * vb * b.sin());
    [x1, y1, x1 + l2 * b.sin(), y1 - l2 * b.cos(), vx1, vy1, vx2, vy2]
}

/// Both are of order eight; their difference is their error, and halves 256 times.
#[test]
fn angles_and_cartesian_coordinates() {
    let start = [1.2, -0.7, 0.4, 2.0];
    let apart = |steps: usize| {
        let options = Options { steps, ..Default::default() };
        let mut by_angles = Irk::<Angles, Gauss<4>>::new(options).unwrap();
        let mut by_positions = Irk::<RodsInARow, Gauss<4>>::new(options).unwrap();
        let end = by_angles.solve(&start.into(), &vector![], 1.5).unwrap().x;
        let found = by_positions.solve(&cartesian(start).into(), &vector![], 1.5).unwrap().x;
        (found - nalgebra::SVector::from(cartesian(end.into()))).amax()
    };
    let (coarse, fine) = (apart(30), apart(60));
    assert!(fine < coarse / 128.0, "{coarse} {fine}");
    assert!(apart(240) < 1e-12, "{}", apart(240));
}

/// What the constraints and their first derivatives are off by.
#[test]
fn drift_of_the_method() {
    type Invariants = <RodsInARow as Constrained>::Invariants;
    let mut v = [0.0; 19];
    let options = Options { steps: 2000, ..Default::default() };
    let mut irk = Irk::<RodsInARow, Gauss<4>>::new(options).unwrap();
    let x = irk.solve(&cartesian([1.2, -0.7, 0.4, 2.0]).into(), &vector![], 20.0).unwrap().x;
    v[8..16].copy_from_slice(x.as_slice());
    let mut y = [f64::NAN; 4];
    Invariants::value::<f64>(&v, &mut y);
    // A quadratic invariant would be kept; this one is a quadratic only in the velocities.
    assert!(y.iter().all(|y| y.abs() < 1e-9), "{y:?}");
}
