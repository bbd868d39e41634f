//! Projection onto the invariants at the end of every step: they hold to rounding, and derivatives
//! of first and second order are those of the projected map.

use casados::error::Quantity;
use casados::prelude::*;
use casados::testing::check_sensitivities;
use casados::{Error, Integrator, Projected};
use nalgebra::{Vector4, vector};

/// A pendulum of length `p`.
#[dae(index_reduction(projection))]
fn circle(xdot: [f64; 4], x: [f64; 4], z: f64, p: f64) -> [f64; 5] {
    [
        xdot[0] - x[2],
        xdot[1] - x[3],
        xdot[2] + z * x[0],
        xdot[3] + z * x[1] + 9.81,
        x[0] * x[0] + x[1] * x[1] - p * p,
    ]
}

/// A bead on the wire `y = sin(a x) + 0.1 sin t` that a force pushes: no derivative of the
/// constraint vanishes, and it depends on the time and a parameter.
#[dae(index_reduction(projection))]
fn bead(xdot: [f64; 4], x: [f64; 4], u: f64, z: f64, p: f64, t: f64) -> [f64; 5] {
    [
        xdot[0] - x[2],
        xdot[1] - x[3],
        xdot[2] - z * p * (p * x[0]).cos() - u,
        xdot[3] + z + 9.81,
        x[1] - (p * x[0]).sin() - 0.1 * t.sin(),
    ]
}

/// What the constraint of the circle and its derivative are off by.
fn constraint_residuals(x: &Vector4<f64>, length: f64) -> [f64; 2] {
    [x[0] * x[0] + x[1] * x[1] - length * length, x[0] * x[2] + x[1] * x[3]]
}

/// A hundred thousand steps of order three, with errors of 1e-5 each that the projection takes.
#[test]
fn invariants_after_many_steps() {
    let length = 0.7;
    let mut irk = Projected::new(Irk::<Circle, RadauIIA<2>>::new(Options::default()).unwrap());
    irk.set_parameters(&vector![length]).unwrap();
    let mut x = vector![length, 0.0, 0.0, 0.0];
    for step in 0..100_000 {
        x = irk.solve(&x, &vector![], 0.02).unwrap().x;
        // Squares of lengths and products with velocities of up to four.
        assert!(
            constraint_residuals(&x, length).iter().all(|off| off.abs() < 16.0 * f64::EPSILON),
            "{step}: {x}"
        );
    }
    let mut plain = Irk::<Circle, RadauIIA<2>>::new(Options::default()).unwrap();
    plain.set_parameters(&vector![length]).unwrap();
    let mut x = vector![length, 0.0, 0.0, 0.0];
    for _ in 0..1000 {
        x = plain.solve(&x, &vector![], 0.02).unwrap().x;
    }
    assert!(
        constraint_residuals(&x, length).iter().any(|off| off.abs() > 1e-4),
        "without it they drift: {x}"
    );
}

/// A hundred thousand of the same steps with rates: what a step does is forgotten within seconds.
/// So the last thousand of them are off by as much as the first, and less with faster rates.
#[test]
fn constraint_errors_with_rates() {
    fn largest_constraint_error<M: Dae<Shape = <Circle as Dae>::Shape>>() -> [f64; 2] {
        let mut irk = Irk::<M, RadauIIA<2>>::new(Options::default()).unwrap();
        irk.set_parameters(&vector![0.7]).unwrap();
        let mut x = vector![0.7, 0.0, 0.0, 0.0];
        let [mut first, mut last] = [0.0f64; 2];
        for step in 0..100_000 {
            x = irk.solve(&x, &vector![], 0.02).unwrap().x;
            let off = constraint_residuals(&x, 0.7)[0].abs();
            if step < 1000 {
                first = first.max(off);
            } else if step >= 99_000 {
                last = last.max(off);
            }
        }
        [first, last]
    }
    let (slow, fast) = (largest_constraint_error::<Slow>(), largest_constraint_error::<Fast>());
    // The swings get smaller by the damping of the method, and with them its errors.
    assert!(slow[1] < slow[0] && slow[1] > 0.5 * slow[0], "{slow:?}");
    assert!(fast[1] < fast[0] && fast[0] < 0.5 * slow[0], "{fast:?} {slow:?}");
}

#[dae(index_reduction(baumgarte = 1.0))]
fn slow(xdot: [f64; 4], x: [f64; 4], z: f64, p: f64) -> [f64; 5] {
    [
        xdot[0] - x[2],
        xdot[1] - x[3],
        xdot[2] + z * x[0],
        xdot[3] + z * x[1] + 9.81,
        x[0] * x[0] + x[1] * x[1] - p * p,
    ]
}

#[dae(index_reduction(baumgarte = 10.0))]
fn fast(xdot: [f64; 4], x: [f64; 4], z: f64, p: f64) -> [f64; 5] {
    [
        xdot[0] - x[2],
        xdot[1] - x[3],
        xdot[2] + z * x[0],
        xdot[3] + z * x[1] + 9.81,
        x[0] * x[0] + x[1] * x[1] - p * p,
    ]
}

/// The projected state is the nearest: what it was moved by is in the row space of `G`.
#[test]
fn orthogonality_of_the_projection() {
    let (x0, length) = (vector![0.42, -0.56, 1.2, 0.9], 0.7);
    let mut plain = Irk::<Circle, RadauIIA<1>>::new(Options::default()).unwrap();
    plain.set_parameters(&vector![length]).unwrap();
    let given = plain.solve(&x0, &vector![], 0.1).unwrap().x;
    let mut projected = Projected::new(plain);
    projected.set_parameters(&vector![length]).unwrap();
    let x = projected.solve(&x0, &vector![], 0.1).unwrap().x;
    let moved = x - given;
    assert!(moved.norm() > 1e-3 && constraint_residuals(&x, length).iter().all(|off| off.abs() < 1e-15));
    let (first, second) = (vector![x[0], x[1], 0.0, 0.0], vector![x[2], x[3], x[0], x[1]]);
    // Tangents of the constraints: orthogonal to both rows.
    for tangent in [vector![-x[1], x[0], 0.0, 0.0], vector![0.0, 0.0, -x[1], x[0]]] {
        let mut tangent: Vector4<f64> = tangent;
        let basis =
            [first.normalize(), (second - first * (first.dot(&second) / first.norm_squared())).normalize()];
        for row in basis {
            tangent -= row * row.dot(&tangent);
        }
        assert!(moved.dot(&tangent).abs() < 1e-15 * 8.0, "{moved} {tangent}");
    }
}

/// Differences of high order of states and gradients; steps are coarse, so that the projection
/// moves by percents.
#[test]
fn derivatives_of_the_projection() {
    let mut coarse = Projected::new(Irk::<Bead, RadauIIA<1>>::new(Options::default()).unwrap());
    coarse.set_time(0.3).unwrap();
    let x0 = vector![0.4, (1.3f64 * 0.4).sin() + 0.1 * 0.3f64.sin(), 0.8, 0.7];
    let report = check_sensitivities(&mut coarse, &x0, &vector![0.6], &vector![1.3], 0.25).unwrap();
    report.assert();
    let mut gauss =
        Projected::new(Irk::<Circle, Gauss<2>>::new(Options { steps: 2, ..Default::default() }).unwrap());
    let x0 = vector![0.5, -0.5, 0.8, 0.7];
    let report = check_sensitivities(&mut gauss, &x0, &vector![], &vector![0.7], 0.3).unwrap();
    report.assert();
}

#[test]
fn failed_projections() {
    let mut irk = Projected::new(Irk::<Circle, RadauIIA<1>>::new(Options::default()).unwrap());
    irk.set_parameters(&vector![0.0]).unwrap();
    // A circle of radius zero has no derivative at its centre.
    let error = irk.solve(&vector![0.3, -0.1, 0.2, 0.4], &vector![], 0.01).unwrap_err();
    assert!(matches!(error, Error::NotProjected { equation: 4, .. }), "{error}");
    assert!(error.to_string().contains("the constraint of equation 4"), "{error}");
    // It is usable after that.
    irk.set_parameters(&vector![0.7]).unwrap();
    assert!(irk.solve(&vector![0.7, 0.0, 0.0, 0.0], &vector![], 0.01).is_ok());
}

/// A circle whose squared length has a value at `p = 0`, and no derivative.
#[dae(index_reduction(projection))]
fn edge(xdot: [f64; 4], x: [f64; 4], z: f64, p: f64) -> [f64; 5] {
    [
        xdot[0] - x[2],
        xdot[1] - x[3],
        xdot[2] + z * x[0],
        xdot[3] + z * x[1] + 9.81,
        x[0] * x[0] + x[1] * x[1] - 1.0 - p.sqrt(),
    ]
}

/// The same with a first derivative, and no second one.
#[dae(index_reduction(projection))]
fn corner(xdot: [f64; 4], x: [f64; 4], z: f64, p: f64) -> [f64; 5] {
    [
        xdot[0] - x[2],
        xdot[1] - x[3],
        xdot[2] + z * x[0],
        xdot[3] + z * x[1] + 9.81,
        x[0] * x[0] + x[1] * x[1] - 1.0 - p.powf(1.5),
    ]
}

#[test]
fn parameter_derivatives_of_the_projection() {
    let (x0, lambda) = (vector![1.0, 0.0, 0.0, 0.0], vector![1.0, 2.0, 3.0, 4.0]);
    let mut edge = Projected::new(Irk::<Edge, RadauIIA<2>>::new(Options::default()).unwrap());
    edge.set_parameters(&vector![0.0]).unwrap();
    assert!(edge.solve(&x0, &vector![], 0.1).is_ok());
    for error in [
        edge.forward(&x0, &vector![], 0.1).map(|_| ()),
        edge.adjoint(&x0, &vector![], 0.1, &lambda).map(|_| ()),
        edge.hessian(&x0, &vector![], 0.1, &lambda).map(|_| ()),
    ] {
        let Err(Error::NonFiniteModel { quantity, equation, value, .. }) = error else { panic!("{error:?}") };
        assert_eq!((quantity, equation, value), (Quantity::Jacobian, 4, f64::NEG_INFINITY));
    }
    let mut corner = Projected::new(Irk::<Corner, RadauIIA<2>>::new(Options::default()).unwrap());
    corner.set_parameters(&vector![0.0]).unwrap();
    assert_eq!(corner.forward(&x0, &vector![], 0.1).unwrap().dx_dp.amax(), 0.0);
    let error = corner.hessian(&x0, &vector![], 0.1, &lambda).map(|_| ()).unwrap_err();
    assert!(matches!(error, Error::Overflow { .. }), "{error}");
}

#[test]
fn parameters_and_time_of_the_projection() {
    let x0 = vector![0.4, (1.3f64 * 0.4).sin() + 0.1 * 0.3f64.sin(), 0.8, 0.7];
    let mut irk = Irk::<Bead, RadauIIA<1>>::new(Options::default()).unwrap();
    irk.set_parameters(&vector![1.3]).unwrap();
    irk.set_time(2.0).unwrap();
    // What the integrator was given before is not known here.
    let mut bead = Projected::new(irk);
    let u = vector![0.6];
    assert_eq!(bead.solve(&x0, &u, 0.25).unwrap_err(), Error::ParametersNotSet);
    assert_eq!(bead.forward(&x0, &u, 0.25).map(|_| ()), Err(Error::ParametersNotSet));
    bead.set_parameters(&vector![1.3]).unwrap();
    let begun = bead.solve(&x0, &u, 0.25).unwrap().x;
    bead.set_time(0.0).unwrap();
    assert_eq!(begun, bead.solve(&x0, &u, 0.25).unwrap().x);
    // Nor what it is given behind the projection.
    bead.integrator().set_parameters(&vector![2.0]).unwrap();
    bead.integrator().set_time(1.0).unwrap();
    assert_eq!(begun, bead.solve(&x0, &u, 0.25).unwrap().x);
}
