//! The pendulum on a cart against an independent implementation.

use super::pendulum_reference::{Reference, S2_N1, S4_N4};
use crate::models::pendulum::Pendulum;
use casados_core::{Gauss, Irk, Method, Options};
use nalgebra::{SMatrix, SVector, vector};

/// The reference solves a linear system for its tableau, which is off by up to 1e-13 for s = 2 and
/// 1e-12 for s = 4 (`tests/data` has its coefficients); two builds of it agree to 1e-12.
const TOLERANCE: f64 = 2e-12;

fn assert_near(actual: &[f64], expected: &[f64]) {
    assert_eq!(actual.len(), expected.len());
    let size = expected.iter().fold(1.0, |m: f64, a| m.max(a.abs()));
    for (a, e) in actual.iter().zip(expected) {
        assert!((a - e).abs() < TOLERANCE * size, "{actual:?}\n{expected:?}");
    }
}

fn check<const S: usize>(steps: usize, reference: &Reference)
where
    Gauss<S>: Method<S>,
{
    let mut irk = Irk::<Pendulum, Gauss<S>>::new(Options { steps, ..Default::default() }).unwrap();
    let (x0, u) = (SVector::from(reference.x0), vector![reference.u[0]]);
    let r = irk.hessian(&x0, &u, reference.h, &SVector::from(reference.lambda)).unwrap();
    assert_near(r.x.as_slice(), &reference.x);
    let forward = [r.dx_dx0.as_slice(), r.dx_du.as_slice()].concat();
    assert_near(&forward, &reference.forward);
    let adjoint = [r.grad_x0.as_slice(), r.grad_u.as_slice()].concat();
    assert_near(&adjoint, &reference.adjoint);
    let mut hessian = SMatrix::<f64, 5, 5>::zeros();
    hessian.fixed_view_mut::<4, 4>(0, 0).copy_from(&r.h_xx);
    hessian.fixed_view_mut::<4, 1>(0, 4).copy_from(&r.h_xu);
    hessian.fixed_view_mut::<1, 4>(4, 0).copy_from(&r.h_xu.transpose());
    hessian[(4, 4)] = r.h_uu[0];
    assert_near(hessian.as_slice(), &reference.hessian);
}

#[test]
fn agreement_with_acados() {
    check::<2>(1, &S2_N1);
    check::<4>(4, &S4_N4);
}
