//! Models with many nonlinear states, each coupled to its neighbours alone: their second
//! derivatives are summed by the matrix adjoint.

use crate::interval::{check_interval, options};
use casados::prelude::*;
use nalgebra::{SVector, vector};

type Test = Result<(), Box<dyn std::error::Error>>;

/// What diffuses along a tube and reacts there, with a supply at one end: concentrations in cells.
#[ode]
fn tube(x: [f64; 60], u: [f64; 1]) -> [f64; 60] {
    core::array::from_fn(|i| {
        let left = if i == 0 { u[0] } else { x[i - 1] };
        let right = if i == 59 { x[i] } else { x[i + 1] };
        40.0 * (left - 2.0 * x[i] + right) - x[i] * x[i] / (1.0 + x[i])
    })
}

fn concentrations() -> SVector<f64, 60> {
    SVector::from_fn(|i, _| 1.0 + 0.5 * (0.2 * i as f64).cos())
}

/// Masses between hardening springs, the first of which is pulled: positions, which are kinematic
/// states, and velocities.
#[ode]
fn springs(x: [f64; 120], u: [f64; 1]) -> [f64; 120] {
    core::array::from_fn(|i| {
        if i < 60 {
            x[60 + i]
        } else {
            let q = i - 60;
            let left = x[q] - if q == 0 { u[0] } else { x[q - 1] };
            let right = if q == 59 { 0.0 } else { x[q + 1] } - x[q];
            30.0 * (right - left) + 10.0 * (right * right * right - left * left * left)
        }
    })
}

#[test]
fn gauss_methods() -> Test {
    let irk = Irk::<Tube, Gauss<2>>::new(options(3))?;
    check_interval::<Tube, _, 60, 1, 0>(irk, &concentrations(), &vector![2.0], &SVector::zeros(), 0.1);
    Ok(())
}

/// The trapezoidal rule, whose `A` has no inverse.
#[test]
fn singular_tableau() -> Test {
    let trapezoidal = Tableau::new([[0.0, 0.0], [0.5, 0.5]], [0.5, 0.5], [0.0, 1.0])?;
    let irk = Irk::<Tube, Custom<2>>::with_tableau(options(2), trapezoidal)?;
    check_interval::<Tube, _, 60, 1, 0>(irk, &concentrations(), &vector![2.0], &SVector::zeros(), 0.1);
    Ok(())
}

#[test]
fn kinematic_states() -> Test {
    let x0 = SVector::from_fn(|i, _| 0.3 * (0.5 * i as f64).sin());
    let irk = Irk::<Springs, Gauss<2>>::new(options(2))?;
    check_interval::<Springs, _, 120, 1, 0>(irk, &x0, &vector![0.2], &SVector::zeros(), 0.1);
    Ok(())
}

/// Over no time nothing changes, nor over one whose reciprocal is infinite.
#[test]
fn intervals_of_zero_length() -> Test {
    let lambda = SVector::from_fn(|i, _| 1.0 + (i as f64).sin());
    let mut irk = Irk::<Tube, Gauss<2>>::new(options(2))?;
    for h in [0.0, 1e-310, -1e-310] {
        let end = irk.hessian(&concentrations(), &vector![2.0], h, &lambda)?;
        assert_eq!(end.x, concentrations());
        assert_eq!(end.grad_x0, lambda);
        assert!(end.h_xx.iter().all(|entry| entry.abs() < 1e-300), "{h}");
    }
    Ok(())
}
