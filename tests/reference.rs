//! Models, integrators and sensitivities against reference values of independent implementations:
//! `tests/data` says where each comes from.

#[path = "../examples/models/awe.rs"]
mod awe;
#[path = "../examples/models/chain.rs"]
mod chain;
mod data;
#[path = "../examples/models/pendulum.rs"]
mod pendulum;

use data::Record;
use nalgebra::{SMatrix, SVector};

type Test = Result<(), String>;

/// The largest error, relative to the largest element of the reference.
fn error<const R: usize, const C: usize>(a: &SMatrix<f64, R, C>, reference: &SMatrix<f64, R, C>) -> f64 {
    let error = (a - reference)
        .iter()
        .fold(0.0, |max: f64, e| if e.abs() > max || e.is_nan() { e.abs() } else { max });
    error / reference.amax()
}

/// The model as the plain Rust function that it is, at points that are not consistent.
/// Limited by the rounding of sums of forces that cancel, each scaled to order one.
#[test]
fn awe_residual() -> Test {
    for (i, point) in Record::load("awe/points.json")?.records("points")?.iter().enumerate() {
        let (xdot, x) = (point.array::<23>("xdot")?, point.array::<23>("x")?);
        let (u, z) = (point.array::<4>("u")?, point.array("z")?);
        let f = awe::awe::awe(xdot.into(), x.into(), u.into(), z);
        let error = error(&SVector::from(<[f64; 24]>::from(f)), &point.vector("residual")?);
        assert!(error < 1e-14, "point {i}: {error:e}");
    }
    Ok(())
}
