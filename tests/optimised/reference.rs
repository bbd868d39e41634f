//! Models, integrators and sensitivities against reference values of independent implementations:
//! `tests/data` says where each comes from.
//!
//! Errors are relative to the largest element of the reference. Both sides solve the same stages to
//! rounding and differentiate them exactly; what is left is rounding, of the size ε times the
//! condition of the Newton matrix (ε = 2.2e-16), in the integrator and in the reference alike.

use crate::models::awe::Awe;
use crate::models::chain::Chain;
use crate::models::pendulum::Pendulum;
use casados::Method;
use casados::prelude::*;
use nalgebra::{SMatrix, SVector};
use reference_data::Record;
use std::error::Error;

type Test = Result<(), Box<dyn Error>>;

/// The largest error, relative to the largest element of the reference.
fn error<const R: usize, const C: usize>(a: &SMatrix<f64, R, C>, reference: &SMatrix<f64, R, C>) -> f64 {
    let largest = |max: f64, e: f64| if max.is_nan() || max > e { max } else { e };
    (a - reference).iter().map(|e| e.abs()).fold(0.0, largest) / reference.amax()
}

/// `[d/dx0, d/du]` side by side.
fn beside<const R: usize, const X: usize, const U: usize, const W: usize>(
    x: &SMatrix<f64, R, X>,
    u: &SMatrix<f64, R, U>,
) -> SMatrix<f64, R, W> {
    SMatrix::from_fn(|i, j| if j < X { x[(i, j)] } else { u[(i, j - X)] })
}

/// `d/dx0` above `d/du`.
fn above<const X: usize, const U: usize, const W: usize>(
    x: &SVector<f64, X>,
    u: &SVector<f64, U>,
) -> SVector<f64, W> {
    SVector::from_fn(|i, _| if i < X { x[i] } else { u[i - X] })
}

/// The Hessian over `(x0, u)` from its blocks.
fn blocks<const X: usize, const U: usize, const W: usize>(
    xx: &SMatrix<f64, X, X>,
    xu: &SMatrix<f64, X, U>,
    uu: &SMatrix<f64, U, U>,
) -> SMatrix<f64, W, W> {
    SMatrix::from_fn(|i, j| match (i < X, j < X) {
        (true, true) => xx[(i, j)],
        (true, false) => xu[(i, j - X)],
        (false, true) => xu[(j, i - X)],
        (false, false) => uu[(i - X, j - X)],
    })
}

/// Every call against a reference: the largest errors must be below the bound, those of the end
/// state, the Jacobian, the adjoint and the Hessian.
macro_rules! check {
    ($irk:expr, $reference:expr, $lambda:expr, $h:expr, $nx:literal, $nu:literal, $nw:literal, $bound:expr) => {{
        let (irk, reference) = (&mut $irk, &$reference);
        let x0 = reference.vector::<$nx>("x0")?;
        let u = reference.vector::<$nu>("u")?;
        let x = reference.vector::<$nx>("x_next")?;
        let jacobian = reference.matrix::<$nx, $nw>("forward")?;
        let adjoint = reference.vector::<$nw>("adjoint")?;
        let hessian = reference.symmetric::<$nw>("hessian")?;
        let (lambda, h) = ($lambda, $h);

        let mut errors = [error(&irk.solve(&x0, &u, h)?.x, &x), 0.0, 0.0, 0.0];
        let step = irk.forward(&x0, &u, h)?;
        errors[0] = errors[0].max(error(&step.x, &x));
        errors[1] = error(&beside::<$nx, $nx, $nu, $nw>(&step.dx_dx0, &step.dx_du), &jacobian);
        let step = irk.adjoint(&x0, &u, h, &lambda)?;
        errors[2] = error(&above::<$nx, $nu, $nw>(&step.grad_x0, &step.grad_u), &adjoint);
        let step = irk.hessian(&x0, &u, h, &lambda)?;
        errors[0] = errors[0].max(error(&step.x, &x));
        errors[1] = errors[1].max(error(&beside::<$nx, $nx, $nu, $nw>(&step.dx_dx0, &step.dx_du), &jacobian));
        errors[2] = errors[2].max(error(&above::<$nx, $nu, $nw>(&step.grad_x0, &step.grad_u), &adjoint));
        errors[3] = error(&blocks::<$nx, $nu, $nw>(&step.h_xx, &step.h_xu, &step.h_uu), &hessian);
        for (name, error) in ["x", "Jacobian", "adjoint", "Hessian"].iter().zip(errors) {
            assert!(error < $bound, "{name}: {error:e}");
        }
    }};
}

/// One file of a one-interval case.
macro_rules! case {
    ($model:ty, $method:ty, $file:literal, $nx:literal, $nu:literal, $nw:literal, $bound:expr) => {{
        let reference = Record::load($file)?;
        let steps = reference.number("steps")? as usize;
        for start in [Start::Zero, Start::Warm] {
            let mut irk = Irk::<$model, $method>::new(Options { steps, start, ..Default::default() })?;
            check!(
                irk,
                reference,
                reference.vector("lambda")?,
                reference.number("T")?,
                $nx,
                $nu,
                $nw,
                $bound
            );
        }
    }};
}

/// The model as the plain Rust function that it is, at points that are not consistent.
/// Limited by the rounding of sums of forces that cancel, each scaled to order one.
#[test]
fn awe_residual() -> Test {
    for (i, point) in Record::load("awe/points.json")?.records("points")?.iter().enumerate() {
        let (xdot, x) = (point.vector::<23>("xdot")?, point.vector::<23>("x")?);
        let (u, z) = (point.vector::<4>("u")?, point.vector::<1>("z")?);
        let f = crate::models::awe::awe::awe(xdot.into(), x.into(), u.into(), z.into());
        let error = error(&SVector::from(f), &point.vector("residual")?);
        assert!(error < 1e-14, "point {i}: {error:e}");
    }
    Ok(())
}

/// The residual of the graph is that of the function to the last bit, and the Jacobian has every
/// non-zero of the reference. Limited as the residual itself.
#[test]
fn awe_jacobian() -> Test {
    let structure = <Awe as Dae>::STRUCTURE;
    for (i, point) in Record::load("awe/points.json")?.records("points")?.iter().enumerate() {
        let (xdot, x) = (point.vector::<23>("xdot")?, point.vector::<23>("x")?);
        let (u, z) = (point.vector::<4>("u")?, point.vector::<1>("z")?);
        let plain = SVector::from(crate::models::awe::awe::awe(xdot.into(), x.into(), u.into(), z.into()));

        let mut v = [0.0; 52];
        for (v, value) in v.iter_mut().zip(xdot.iter().chain(&x).chain(&z).chain(&u)) {
            *v = *value;
        }
        let mut f = [0.0; 24];
        Awe::residual::<f64>(&v, &mut f);
        assert_eq!(f.map(f64::to_bits), <[f64; 24]>::from(plain).map(f64::to_bits), "point {i}");

        let mut values = [f64::NAN; 302];
        Awe::jacobian_constants::<f64>(&mut values);
        Awe::residual_jacobian::<f64>(&v, &mut f, &mut values);
        assert_eq!(f.map(f64::to_bits), <[f64; 24]>::from(plain).map(f64::to_bits), "point {i}");
        let mut jacobian = SMatrix::<f64, 24, 51>::zeros();
        for entry in 0..structure.jacobian.len() {
            jacobian[structure.jacobian.at(entry)] = values[entry];
        }
        let error = error(&jacobian, &point.matrix("jacobian")?);
        assert!(error < 1e-14, "point {i}: {error:e}");
    }
    // The numbers of the published benchmark: 56 + 235 + 3 + 8.
    assert_eq!(structure.blocks, [0, 56, 291, 294, 302, 302]);
    assert_eq!(structure.hessian.len(), 222);
    Ok(())
}

/// Pendulum and chain: in one step `h ∂f/∂x` is of order one, and the condition of the Newton
/// matrix of order ten; four steps add up.
const ORDINARY_TOLERANCE: f64 = 100.0 * f64::EPSILON;

/// Aircraft: the Newton matrix of the reference has the condition 6e3.
const AIRCRAFT_TOLERANCE: f64 = 6e3 * f64::EPSILON;

#[test]
fn pendulum_gauss() -> Test {
    case!(Pendulum, Gauss<2>, "pendulum/pendulum_T005_irk_s2n1.json", 4, 1, 5, ORDINARY_TOLERANCE);
    case!(Pendulum, Gauss<4>, "pendulum/pendulum_T01_irk_s4n4.json", 4, 1, 5, ORDINARY_TOLERANCE);
    Ok(())
}

#[test]
fn chain_gauss() -> Test {
    case!(Chain<9>, Gauss<2>, "chain/chain_3_irk_s2n1.json", 9, 3, 12, ORDINARY_TOLERANCE);
    case!(Chain<9>, Gauss<4>, "chain/chain_3_irk_s4n4.json", 9, 3, 12, ORDINARY_TOLERANCE);
    case!(Chain<21>, Gauss<2>, "chain/chain_5_irk_s2n1.json", 21, 3, 24, ORDINARY_TOLERANCE);
    case!(Chain<33>, Gauss<2>, "chain/chain_7_irk_s2n1.json", 33, 3, 36, ORDINARY_TOLERANCE);
    case!(Chain<33>, Gauss<4>, "chain/chain_7_irk_s4n4.json", 33, 3, 36, ORDINARY_TOLERANCE);
    case!(Chain<69>, Gauss<2>, "chain/chain_13_irk_s2n1.json", 69, 3, 72, ORDINARY_TOLERANCE);
    Ok(())
}

#[test]
fn awe_orbit() -> Test {
    let reference = Record::load("awe/intervals.json")?;
    let (lambda, h) = (reference.vector("lambda")?, reference.number("T")?);
    let mut irk = Irk::<Awe, RadauIIA<4>>::new(Options { start: Start::Zero, ..Default::default() })?;
    for interval in reference.records("intervals")? {
        check!(irk, interval, lambda, h, 23, 4, 27, AIRCRAFT_TOLERANCE);
    }
    Ok(())
}

/// Stages: the collocation polynomial passes through `x0 + h Σ aᵢⱼ kⱼ` and `zᵢ` at the nodes, and
/// Radau IIA has its last node at the end.
#[test]
fn stages_of_awe() -> Test {
    let reference = Record::load("awe/intervals.json")?;
    let h = reference.number("T")?;
    let tableau = <RadauIIA<4> as Method<4>>::TABLEAU;
    let mut irk = Irk::<Awe, RadauIIA<4>>::new(Options { start: Start::Zero, ..Default::default() })?;
    for interval in reference.records("intervals")? {
        let (x0, u) = (interval.vector::<23>("x0")?, interval.vector("u")?);
        let (k, z) = (interval.matrix::<4, 23>("k")?, interval.vector::<4>("z")?);
        let end = irk.solve(&x0, &u, h)?;
        assert!(error(&end.z, &SVector::from([z[3]])) < AIRCRAFT_TOLERANCE);
        for stage in 0..4 {
            let increment = SVector::<f64, 4>::from(tableau.a()[stage]);
            let x = x0 + k.transpose() * increment * h;
            let dense = irk.dense(tableau.c()[stage] * h)?;
            assert!(error(&dense.x, &x) < AIRCRAFT_TOLERANCE);
            assert!(error(&dense.z, &SVector::from([z[stage]])) < AIRCRAFT_TOLERANCE);
        }
    }
    Ok(())
}
