//! Models, integrators and sensitivities against reference values of independent implementations:
//! `tests/data` says where each comes from.

#[path = "../examples/models/awe.rs"]
mod awe;
#[path = "../examples/models/chain.rs"]
mod chain;
mod data;
#[path = "../examples/models/pendulum.rs"]
mod pendulum;

use awe::awe::{Control, Residual, State};
use data::Record;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

type Test = Result<(), String>;

/// The largest error, relative to the largest element of the reference.
fn error<const R: usize, const C: usize>(a: &SMatrix<f64, R, C>, reference: &SMatrix<f64, R, C>) -> f64 {
    let error = (a - reference)
        .iter()
        .fold(0.0, |max: f64, e| if e.abs() > max || e.is_nan() { e.abs() } else { max });
    error / reference.amax()
}

fn state(v: &SVector<f64, 23>) -> State {
    State {
        q: v.fixed_rows::<3>(0).into(),
        dq: v.fixed_rows::<3>(3).into(),
        omega: v.fixed_rows::<3>(6).into(),
        r: Matrix3::from_column_slice(&v.as_slice()[9..18]),
        delta: v.fixed_rows::<3>(18).into(),
        kappa: v[21],
        cost: v[22],
    }
}

fn control(v: &SVector<f64, 4>) -> Control {
    Control { delta: v.fixed_rows::<3>(0).into(), kappa: v[3] }
}

fn flat(f: &Residual) -> SVector<f64, 24> {
    let mut flat = Vec::new();
    let mut vector = |v: &Vector3<f64>| flat.extend(v.iter());
    vector(&f.force);
    vector(&f.moment);
    f.rotation.column_iter().for_each(|c| vector(&c.into_owned()));
    vector(&f.delta);
    flat.push(f.kappa);
    flat.extend(f.velocity.iter());
    flat.extend([f.tether, f.cost]);
    SVector::from_column_slice(&flat)
}

/// The model as the plain Rust function that it is, at points that are not consistent.
/// Limited by the rounding of sums of forces that cancel, each scaled to order one.
#[test]
fn awe_residual() -> Test {
    for (i, point) in Record::load("awe/points.json")?.records("points")?.iter().enumerate() {
        let f = awe::awe::awe(
            state(&point.vector("xdot")?),
            state(&point.vector("x")?),
            control(&point.vector("u")?),
            point.vector::<1>("z")?.into(),
        );
        let error = error(&flat(&f), &point.vector("residual")?);
        assert!(error < 1e-14, "point {i}: {error:e}");
    }
    Ok(())
}
