//! Derivatives of a model whose directions fill many panels, and whose kinematic states are in
//! another order than their velocities. The model is linear, so that a step of the method is its
//! stability function of the matrix.

use casados::prelude::*;
use nalgebra::{DMatrix, SVector};

const MASSES: usize = 40;
const NX: usize = 2 * MASSES;
/// States and the control.
const DIRECTIONS: usize = NX + 1;

/// The mass that has the velocity `i`.
const fn mass_of_velocity(i: usize) -> usize {
    (7 * i + 3) % MASSES
}

/// A chain of masses on springs between two walls; the control pushes one of them.
#[ode]
fn springs(x: [f64; 80], u: [f64; 1]) -> [f64; 80] {
    let mut derivative = [0.0; 80];
    for i in 0..40 {
        let mass = (7 * i + 3) % 40;
        derivative[mass] = x[40 + i];
        let left = if mass > 0 { x[mass - 1] } else { 0.0 };
        let right = if mass < 39 { x[mass + 1] } else { 0.0 };
        derivative[40 + i] = left - 2.0 * x[mass] + right - 0.1 * x[40 + i];
        if mass == 20 {
            derivative[40 + i] += u[0];
        }
    }
    derivative
}

/// `ẋ` of states and control, which is constant.
fn system_matrix() -> DMatrix<f64> {
    let mut a = DMatrix::zeros(DIRECTIONS, DIRECTIONS);
    for i in 0..MASSES {
        let (mass, velocity) = (mass_of_velocity(i), MASSES + i);
        a[(mass, velocity)] = 1.0;
        a[(velocity, mass)] = -2.0;
        a[(velocity, velocity)] = -0.1;
        if mass > 0 {
            a[(velocity, mass - 1)] = 1.0;
        }
        if mass + 1 < MASSES {
            a[(velocity, mass + 1)] = 1.0;
        }
        if mass == 20 {
            a[(velocity, NX)] = 1.0;
        }
    }
    a
}

/// `R(z) = (1 + z/2 + z²/12) / (1 − z/2 + z²/12)`, of two Gauss stages (Hairer and Wanner II,
/// IV.3), of `hA`.
fn exact_step(h: f64) -> Option<DMatrix<f64>> {
    let z = system_matrix() * h;
    let even = DMatrix::identity(DIRECTIONS, DIRECTIONS) + &z * &z / 12.0;
    (&even - &z * 0.5).lu().solve(&(even + z * 0.5))
}

#[test]
fn derivatives_in_many_panels() -> Result<(), Box<dyn std::error::Error>> {
    const STEP_SIZE: f64 = 0.3;
    let mut irk = Irk::<Springs, Gauss<2>>::new(Options { steps: 2, ..Default::default() })?;
    let x = SVector::<f64, NX>::from_fn(|i, _| (0.3 * i as f64).sin());
    let found = irk.forward(&x, &SVector::from([0.7]), 2.0 * STEP_SIZE)?;
    let step = exact_step(STEP_SIZE).ok_or("the matrix is singular")?;
    let expected = &step * &step;
    // Condition of `1 − z/2 + z²/12`, below four where `|z| ≤ 0.6`, of two steps; rows of five.
    let tolerance = 4.0 * 2.0 * 5.0 * f64::EPSILON * expected.amax();
    for row in 0..NX {
        for column in 0..DIRECTIONS {
            let found = if column < NX { found.dx_dx0[(row, column)] } else { found.dx_du[(row, 0)] };
            let expected = expected[(row, column)];
            assert!((found - expected).abs() <= tolerance, "({row}, {column}): {found}, not {expected}");
        }
    }
    Ok(())
}
