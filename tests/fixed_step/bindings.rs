//! Kernels that are bound to the model when they run (`Shared`), beside those that are compiled for
//! it (`Heap`): the same identities, values that differ by rounding, the same errors.

use crate::interval::{check_interval, options};
use crate::lost::Lost;
use crate::models::awe::Awe;
use crate::models::chain::{Chain, stretched};
use crate::models::pendulum::Pendulum;
use casados::memory::Shared;
use casados::options::Jacobian;
use casados::prelude::*;
use nalgebra::{SMatrix, SVector, vector};
use reference_data::Record;

type Test = Result<(), Box<dyn std::error::Error>>;

/// Values differ by rounding errors of sums in another order, times the condition of the Newton
/// matrices, which is below a hundred.
const ROUNDING: f64 = 450.0 * f64::EPSILON;

fn close(found: &[f64], expected: &[f64]) {
    let size = expected.iter().fold(f64::MIN_POSITIVE, |size, value| size.max(value.abs()));
    assert_eq!(found.len(), expected.len());
    for (index, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!((found - expected).abs() <= ROUNDING * size, "{index}: {found:e}, not {expected:e}");
    }
}

/// All modes of both, beside each other.
macro_rules! agree {
    ($M:ty, $B:ty, $options:expr, $x0:expr, $u:expr, $h:expr) => {{
        let mut known = Irk::<$M, $B>::new($options)?;
        let mut shared = Irk::<$M, $B, f64, Shared>::new($options)?;
        let (x0, u, h) = ($x0, $u, $h);
        let lambda = x0.map(|x: f64| 1.0 + 0.1 * x.sin());
        close(shared.solve(&x0, &u, h)?.x.as_slice(), known.solve(&x0, &u, h)?.x.as_slice());
        assert_eq!(shared.statistics(), known.statistics());
        let (found, expected) = (shared.forward(&x0, &u, h)?, known.forward(&x0, &u, h)?);
        close(found.dx_dx0.as_slice(), expected.dx_dx0.as_slice());
        close(found.dx_du.as_slice(), expected.dx_du.as_slice());
        close(found.dz0_dx0.as_slice(), expected.dz0_dx0.as_slice());
        let t = 0.4 * h;
        let (found, expected) = (shared.dense_forward(t)?, known.dense_forward(t)?);
        close(found.dx_dx0.as_slice(), expected.dx_dx0.as_slice());
        let (found, expected) = (shared.adjoint(&x0, &u, h, &lambda)?, known.adjoint(&x0, &u, h, &lambda)?);
        close(found.grad_x0.as_slice(), expected.grad_x0.as_slice());
        close(found.grad_u.as_slice(), expected.grad_u.as_slice());
        let (found, expected) = (shared.hessian(&x0, &u, h, &lambda)?, known.hessian(&x0, &u, h, &lambda)?);
        close(found.h_xx.as_slice(), expected.h_xx.as_slice());
        close(found.h_xu.as_slice(), expected.h_xu.as_slice());
        close(found.h_uu.as_slice(), expected.h_uu.as_slice());
        let seeds = Seeds { x0: SMatrix::from_columns(&[lambda, x0]), ..Default::default() };
        let (found, expected) =
            (shared.directional::<2>(&x0, &u, h, &seeds)?, known.directional::<2>(&x0, &u, h, &seeds)?);
        close(found.dx.as_slice(), expected.dx.as_slice());
    }};
}

#[test]
fn values_of_shared_kernels() -> Test {
    let (x0, u) = (vector![0.1, 2.4, -0.3, 1.2], vector![0.7]);
    agree!(Pendulum, Gauss<2>, options(1), x0, u, 0.05);
    agree!(Pendulum, Gauss<4>, options(4), x0, u, 0.1);
    let fixed = casados::options::Newton {
        fixed_iterations: Some(3),
        jacobian: Jacobian::Frozen,
        ..Default::default()
    };
    agree!(Pendulum, RadauIIA<3>, Options { newton: fixed, ..options(2) }, x0, u, 0.1);
    agree!(Lost<Pendulum>, Gauss<2>, options(2), x0, u, 0.1);
    let compensated = Options { compensated: true, ..options(3) };
    agree!(Chain<9>, Gauss<2>, compensated, stretched::<9>(), vector![-1.0, 1.0, 1.0], 0.2);
    agree!(Chain<21>, Gauss<3>, options(1), stretched::<21>(), vector![-1.0, 1.0, 1.0], 0.2);
    Ok(())
}

/// Kinematic states, an algebraic state, four stages that share a Jacobian; against references and
/// differences.
#[test]
fn identities_of_sensitivities() -> Test {
    let (x0, u) = (vector![0.1, 2.4, -0.3, 1.2], vector![0.7]);
    let pendulum = Irk::<Pendulum, RadauIIA<3>, f64, Shared>::new(options(2))?;
    check_interval::<Pendulum, _, 4, 1, 0>(pendulum, &x0, &u, &SVector::zeros(), 0.1);
    let chain = Irk::<Chain<9>, Gauss<2>, f64, Shared>::new(options(1))?;
    check_interval::<Chain<9>, _, 9, 3, 0>(
        chain,
        &stretched(),
        &vector![-1.0, 1.0, 1.0],
        &SVector::zeros(),
        0.2,
    );
    let record = Record::load("awe/intervals.json").map_err(|error| error.to_string())?;
    let interval = record.records("intervals").expect("intervals").remove(7);
    let x0: SVector<f64, 23> = interval.vector("x0").expect("x0");
    let u: SVector<f64, 4> = interval.vector("u").expect("u");
    let h = record.number("T").expect("T");
    let aircraft = Irk::<Awe, RadauIIA<4>, f64, Shared>::new(options(1))?;
    check_interval::<Awe, _, 23, 4, 0>(aircraft, &x0, &u, &SVector::zeros(), h);
    Ok(())
}

/// A batch takes its intervals one after the other: each has the bits of a single call, and one
/// that fails does so alone.
#[test]
fn batches_of_shared_kernels() -> Test {
    let mut irk = Irk::<Chain<9>, Gauss<2>, f64, Shared>::new(options(2))?;
    let mut batch = casados::batch::Integrator::<Irk<Chain<9>, Gauss<2>, f64, Shared>>::new(options(2))?;
    let (u, lambda) = (vector![-1.0, 1.0, 1.0], SVector::from_fn(|i, _| 1.0 - 0.1 * i as f64));
    let mut x0: Vec<_> = (0..9).map(|k| stretched::<9>() * (1.0 + 0.01 * k as f64)).collect();
    let intervals = Intervals { x0: &x0, u: &[u], h: &[0.2], ..Default::default() };
    let mut found = vec![casados::result::Hessian::default(); x0.len()];
    batch.hessian(&intervals, &[lambda], &mut found)?;
    for (x0, found) in x0.iter().zip(&found) {
        let expected = irk.hessian(x0, &u, 0.2, &lambda)?;
        assert_eq!((found.x, found.dx_dx0, found.h_xx), (expected.x, expected.dx_dx0, expected.h_xx));
    }
    assert_eq!(batch.statistics().groups, 0);
    x0[4][0] = f64::NAN;
    let intervals = Intervals { x0: &x0, u: &[u], h: &[0.2], ..Default::default() };
    let mut found = vec![casados::result::Forward::default(); x0.len()];
    assert!(matches!(batch.forward(&intervals, &mut found), Err(BatchError::Intervals { .. })));
    for (k, (x0, found)) in x0.iter().zip(&found).enumerate() {
        match irk.forward(x0, &u, 0.2) {
            Ok(expected) => assert_eq!(found.dx_dx0, expected.dx_dx0),
            Err(_) => assert!(k == 4 && batch.status(4).is_err()),
        }
    }
    Ok(())
}

/// A root that is lost for `p = (0, ·)`, and a logarithm.
#[dae]
fn fragile(xdot: [f64; 1], x: [f64; 1], z: [f64; 1], u: [f64; 1], p: [f64; 2]) -> [f64; 2] {
    [xdot[0] + x[0].ln() - u[0], p[0] * z[0] + p[1] * z[0] * z[0] - x[0]]
}

/// An error without its numbers.
fn message_without_numbers(error: &casados::Error) -> String {
    error.to_string().chars().filter(|c| !(c.is_ascii_digit() || ".-e".contains(*c))).collect()
}

#[test]
fn errors_of_shared_kernels() -> Test {
    let mut known = Irk::<Fragile, Gauss<2>>::new(Options::default())?;
    let mut shared = Irk::<Fragile, Gauss<2>, f64, Shared>::new(Options::default())?;
    for (x0, u, p, h) in [
        (1.0, 0.0, [0.0, 0.0], 0.1),   // singular
        (1.0, 0.0, [0.0, -1.0], 0.1),  // no root
        (-1.0, 0.0, [1.0, 0.0], 0.1),  // no value
        (1.0, -40.0, [1.0, 0.0], 0.1), // no value on the way
        (f64::NAN, 0.0, [1.0, 0.0], 0.1),
    ] {
        let (x0, u, p) = (vector![x0], vector![u], SVector::from(p));
        known.set_parameters(&p)?;
        shared.set_parameters(&p)?;
        let expected = known.forward(&x0, &u, h).expect_err("there is no solution");
        let found = shared.forward(&x0, &u, h).expect_err("there is no solution");
        assert_eq!(
            message_without_numbers(&found),
            message_without_numbers(&expected),
            "{found}, not {expected}"
        );
    }
    Ok(())
}
