//! A model with many nonlinear states, each coupled to its neighbours alone: its second derivatives
//! are those of the adjoint in all directions.

use crate::interval::{check, options};
use casados::prelude::*;
use nalgebra::{SVector, vector};

const CELLS: usize = 60;

/// What diffuses along a tube and reacts there, with a supply at one end.
#[ode]
fn tube(x: [f64; 60], u: [f64; 1]) -> [f64; 60] {
    core::array::from_fn(|i| {
        let left = if i == 0 { u[0] } else { x[i - 1] };
        let right = if i == 59 { x[i] } else { x[i + 1] };
        40.0 * (left - 2.0 * x[i] + right) - x[i] * x[i] / (1.0 + x[i])
    })
}

fn start() -> SVector<f64, CELLS> {
    SVector::from_fn(|i, _| 1.0 + 0.5 * (0.2 * i as f64).cos())
}

/// The second rule has `A` without an inverse, and a first stage that is the start.
#[test]
fn sensitivities_of_many_cells() -> Result<(), Box<dyn std::error::Error>> {
    let p = SVector::zeros();
    check::<Tube, _, CELLS, 1, 0>(Irk::<Tube, Gauss<2>>::new(options(3))?, &start(), &vector![2.0], &p, 0.1);
    let trapezoid = Tableau::new([[0.0, 0.0], [0.5, 0.5]], [0.5, 0.5], [0.0, 1.0])?;
    let irk = Irk::<Tube, Custom<2>>::with_tableau(options(2), trapezoid)?;
    check::<Tube, _, CELLS, 1, 0>(irk, &start(), &vector![2.0], &p, 0.1);
    Ok(())
}

/// Over no time nothing changes, nor over one whose reciprocal is infinite.
#[test]
fn intervals_of_no_length() -> Result<(), Box<dyn std::error::Error>> {
    let lambda = SVector::from_fn(|i, _| 1.0 + (i as f64).sin());
    let mut irk = Irk::<Tube, Gauss<2>>::new(options(2))?;
    for h in [0.0, 1e-310, -1e-310] {
        let end = irk.hessian(&start(), &vector![2.0], h, &lambda)?;
        assert_eq!(end.x, start());
        assert_eq!(end.grad_x0, lambda);
        assert!(end.h_xx.iter().all(|entry| entry.abs() < 1e-300), "{h}");
    }
    Ok(())
}
