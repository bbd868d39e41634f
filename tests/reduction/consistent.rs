//! States that satisfy the invariants, nearest to given ones.

use super::mechanisms::{CarAxis, Pendulum};
use bytemuck::Zeroable;
use casados::__private::function::ArrayV;
use casados::error::Argument;
use casados::{Consistent, Constrained, Dae, Function, Inconsistent, Shape, dae};
use nalgebra::{DMatrix, DVector, Vector4, vector};

const LENGTH: f64 = 0.7;

/// The pendulum's invariants and their derivatives, written down.
fn invariants(x: &Vector4<f64>) -> ([f64; 2], DMatrix<f64>) {
    let [a, b, c, d] = (*x).into();
    let values = [a * a + b * b - LENGTH * LENGTH, 2.0 * (a * c + b * d)];
    let rows = [2.0 * a, 2.0 * b, 0.0, 0.0, 2.0 * c, 2.0 * d, 2.0 * a, 2.0 * b];
    (values, DMatrix::from_row_slice(2, 4, &rows))
}

#[test]
fn nearest_consistent_states() {
    for (guess, held) in [
        (vector![0.4, -0.7, 0.3, 0.2], &[][..]),
        (vector![0.4, -0.7, 0.3, 0.2], &["x[0]"][..]),
        (vector![0.4, -0.7, 0.3, 0.2], &["x[0]", "x[2]"][..]),
        (vector![0.0, -0.71, 1.0, 0.0], &[][..]),
    ] {
        let mut consistent = Consistent::<Pendulum>::new();
        for name in held {
            consistent = consistent.hold(name).unwrap();
        }
        let x = consistent.solve(&guess, &vector![9.81, LENGTH], 0.0).unwrap();
        let (values, rows) = invariants(&x);
        assert!(values.iter().all(|value| value.abs() < 8.0 * f64::EPSILON), "{values:?}");
        // What moved is a combination of the rows of the derivatives where states are free.
        let free: Vec<usize> =
            (0..4).filter(|state| !held.contains(&format!("x[{state}]").as_str())).collect();
        let moved = DVector::from_iterator(free.len(), free.iter().map(|&state| x[state] - guess[state]));
        let rows = rows.select_columns(&free).transpose();
        let multipliers = rows.clone().svd(true, true).solve(&moved, 1e-12).unwrap();
        assert!((&rows * multipliers - &moved).amax() < 1e-13, "{held:?}");
        assert!((0..4).filter(|state| !free.contains(state)).all(|state| x[state] == guess[state]));
    }
}

#[test]
fn consistent_states_in_single_precision() {
    let guess = vector![0.4f32, -0.7, 0.3, 0.2];
    let x = Consistent::<Pendulum>::new().solve(&guess, &vector![9.81, LENGTH as f32], 0.0).unwrap();
    let (values, _) = invariants(&x.map(f64::from));
    assert!(values.iter().all(|value| value.abs() < 8.0 * f64::from(f32::EPSILON)), "{values:?}");
}

/// `y_b(0) = 0`, by which others divide.
#[test]
fn initial_states_of_the_car_axis() {
    let start = vector![0.0, 0.5, 1.0, 0.5, -0.5, 0.0, -0.5, 0.0];
    let mut v = ArrayV::<<CarAxis as Constrained>::Invariants, f64>::zeroed();
    v[8..16].copy_from_slice(start.as_slice());
    let mut y = [f64::NAN; 4];
    <CarAxis as Constrained>::Invariants::value::<f64>(&v, &mut y);
    assert!(y.iter().all(|y| y.abs() < 1e-15), "{y:?}");
    let off = start.add_scalar(1e-3);
    let found = Consistent::<CarAxis>::new().solve(&off, &vector![], 0.0).unwrap();
    v[8..16].copy_from_slice(found.as_slice());
    <CarAxis as Constrained>::Invariants::value::<f64>(&v, &mut y);
    assert!(y.iter().all(|y| y.abs() < 1e-15), "{y:?}");
    assert!((found - off).norm() <= (start - off).norm());
}

#[test]
fn inconsistent_constraints() {
    let solve = |consistent: Consistent<Pendulum>, x: Vector4<f64>, length: f64| {
        consistent.solve(&x, &vector![9.81, length], 0.0)
    };
    let all = Consistent::<Pendulum>::new();
    assert_eq!(all.hold("y").unwrap_err(), Inconsistent::NoSuchState { name: "y" });
    let near = vector![0.4, -0.7, 0.3, 0.2];
    let held = solve(all.hold("x").unwrap(), near, LENGTH).unwrap_err();
    assert!(matches!(held, Inconsistent::Dependent { equation: 4, derivative: 0, .. }), "{held}");
    // The centre of the circle has no direction.
    let centre = solve(all, Vector4::zeros(), LENGTH).unwrap_err();
    assert!(matches!(centre, Inconsistent::Dependent { equation: 4, derivative: 0, .. }), "{centre}");
    // The velocities alone cannot correct the position.
    let held = solve(all.hold("x[0]").unwrap().hold("x[1]").unwrap(), near, LENGTH).unwrap_err();
    assert!(held.to_string().contains("the constraint of equation 4"), "{held}");
    // Unless the position has nothing to correct.
    let on_circle = vector![0.0, -LENGTH, 1.0, 0.3];
    let held = all.hold("x[0]").unwrap().hold("x[1]").unwrap();
    assert_eq!(solve(held, on_circle, LENGTH).unwrap(), vector![0.0, -LENGTH, 1.0, 0.0]);
    // A pendulum that is shorter than the position that is held.
    let short = solve(all.hold("x[0]").unwrap(), near, 0.3).unwrap_err();
    assert!(
        matches!(
            short,
            Inconsistent::NotConverged { equation: 4, .. } | Inconsistent::Dependent { equation: 4, .. }
        ),
        "{short}"
    );
    let nan = solve(all, vector![0.4, f64::NAN, 0.3, 0.2], LENGTH).unwrap_err();
    assert!(matches!(nan, Inconsistent::NonFiniteInput { argument: Argument::X0, index: 1, .. }), "{nan}");
    assert_eq!(<Pendulum as Dae>::Shape::NX, 4);
}

/// A point on a rail whose place is `10¹⁰ p`.
#[dae(index_reduction)]
fn rail(xdot: [f64; 2], x: [f64; 2], z: f64, p: f64) -> [f64; 3] {
    [xdot[0] - x[1], xdot[1] - z, 1e-10 * x[0] - p]
}

#[test]
fn overflow_of_states() {
    let solve = |p: f64| Consistent::<Rail>::new().solve(&vector![1.0, 1.0], &vector![p], 0.0);
    assert!((solve(2.0).unwrap() - vector![2e10, 0.0]).amax() < 1e-5);
    let error = solve(1e300).unwrap_err();
    assert!(matches!(error, Inconsistent::NonFinite { .. }), "{error}");
}
