//! Implicit integrators on small models: derivatives against differences and against each other,
//! identities, repeated calls.

use crate::models::Nonlinear;
use casados_core::options::{Jacobian, Newton, Start};
use casados_core::result::Seeds;
use casados_core::{Error, Gauss, Irk, Options, RadauIIA};
use nalgebra::{SMatrix, SVector, matrix, vector};

type V4 = SVector<f64, 4>;

const STEPS: usize = 3;
const H: f64 = 0.3;

/// `w = (x₀, u, p)` at which everything is tested.
fn point() -> V4 {
    vector![0.4, -0.7, 0.9, 1.3]
}

fn options() -> Options {
    Options { steps: STEPS, ..Default::default() }
}

/// The integrator after `set_parameters` and `set_time`, and the arguments, at `w`.
macro_rules! at {
    ($irk:ident, $w:expr) => {{
        let w: V4 = $w;
        $irk.set_parameters(&vector![w[3]]).unwrap();
        $irk.set_time(0.2).unwrap();
        (vector![w[0], w[1]], vector![w[2]])
    }};
}

/// `dφ/dw` by the central difference of order 6 with step `d`: truncation error `d⁶ φ⁽⁷⁾/140`,
/// rounding error `≈ 2 ε |φ| / d`; with `d = 2e-3` and derivatives of order one both are below
/// 2e-13.
fn difference<const R: usize>(mut f: impl FnMut(V4) -> SVector<f64, R>, w: V4) -> SMatrix<f64, R, 4> {
    let d = 2e-3;
    SMatrix::from_columns(&core::array::from_fn::<_, 4, _>(|c| {
        let mut at = |steps: f64| {
            let mut w = w;
            w[c] += steps * d;
            f(w)
        };
        ((at(1.0) - at(-1.0)) * 45.0 - (at(2.0) - at(-2.0)) * 9.0 + (at(3.0) - at(-3.0))) / (60.0 * d)
    }))
}
const DIFFERENCE: f64 = 2e-11;

/// Columns beside each other.
fn join_columns<const R: usize>(
    x: &SMatrix<f64, R, 2>,
    u: &SVector<f64, R>,
    p: &SVector<f64, R>,
) -> SMatrix<f64, R, 4> {
    SMatrix::from_columns(&[x.column(0), x.column(1), u.column(0), p.column(0)])
}

macro_rules! for_methods {
    ($name:ident, $method:ident, $body:block) => {
        #[test]
        fn $name() {
            {
                type $method = Gauss<3>;
                $body
            }
            {
                type $method = RadauIIA<3>;
                $body
            }
            {
                type $method = Gauss<1>;
                $body
            }
        }
    };
}

for_methods!(forward_sensitivities_are_derivatives, B, {
    let mut irk = Irk::<Nonlinear, B>::new(options()).unwrap();
    let mut other = Irk::<Nonlinear, B>::new(options()).unwrap();
    let (x0, u) = at!(irk, point());
    let step = irk.forward(&x0, &u, H).unwrap();
    let expected = difference(
        |w| {
            let (x0, u) = at!(other, w);
            let step = other.solve(&x0, &u, H).unwrap();
            vector![step.x[0], step.x[1], step.z[0], step.z0[0]]
        },
        point(),
    );
    let x = join_columns(&step.dx_dx0, &step.dx_du, &step.dx_dp);
    let z = join_columns(&step.dz_dx0, &step.dz_du, &step.dz_dp);
    let z0 = join_columns(&step.dz0_dx0, &step.dz0_du, &step.dz0_dp);
    assert!((x - expected.fixed_rows::<2>(0)).amax() < DIFFERENCE, "{x} {expected}");
    assert!((z - expected.fixed_rows::<1>(2)).amax() < DIFFERENCE, "{z} {expected}");
    assert!((z0 - expected.fixed_rows::<1>(3)).amax() < DIFFERENCE, "{z0} {expected}");
});

for_methods!(adjoints_and_directions_agree_with_forward_sensitivities, B, {
    let mut irk = Irk::<Nonlinear, B>::new(options()).unwrap();
    let (x0, u) = at!(irk, point());
    let s = *irk.forward(&x0, &u, H).unwrap();
    let full = join_columns(&s.dx_dx0, &s.dx_du, &s.dx_dp);
    // Each is a sum of a few dozen products of numbers of order one.
    let rounding = 50.0 * f64::EPSILON;

    let lambdas = matrix![0.3, 1.0, -2.0; 1.7, 0.0, 0.6];
    let expected = full.transpose() * lambdas;
    let many = irk.adjoint_many(&x0, &u, H, &lambdas).unwrap();
    assert_eq!(many.nominal, s.nominal);
    let mut actual = SMatrix::<f64, 4, 3>::zeros();
    actual.fixed_rows_mut::<2>(0).copy_from(&many.grad_x0);
    actual.fixed_rows_mut::<1>(2).copy_from(&many.grad_u);
    actual.fixed_rows_mut::<1>(3).copy_from(&many.grad_p);
    assert!((actual - expected).amax() < rounding, "{actual} {expected}");

    let lambda = lambdas.column(0).into_owned();
    let one = *irk.adjoint(&x0, &u, H, &lambda).unwrap();
    let both = *irk.forward_adjoint(&x0, &u, H, &lambda).unwrap();
    for gradient in [
        vector![one.grad_x0[0], one.grad_x0[1], one.grad_u[0], one.grad_p[0]],
        vector![both.grad_x0[0], both.grad_x0[1], both.grad_u[0], both.grad_p[0]],
    ] {
        assert!((gradient - expected.column(0)).amax() < rounding);
    }

    let w = matrix![0.1, -1.0; 2.0, 0.5; 0.7, 0.0; -0.4, 3.0];
    let seeds = Seeds {
        x0: w.fixed_rows::<2>(0).into_owned(),
        u: w.fixed_rows::<1>(2).into_owned(),
        p: w.fixed_rows::<1>(3).into_owned(),
    };
    let directional = irk.directional(&x0, &u, H, &seeds).unwrap();
    assert!((directional.dx - full * w).amax() < rounding);
    assert!((directional.dz - join_columns(&s.dz_dx0, &s.dz_du, &s.dz_dp) * w).amax() < rounding);
    assert!((directional.dz0 - join_columns(&s.dz0_dx0, &s.dz0_du, &s.dz0_dp) * w).amax() < rounding);
});

for_methods!(hessians_are_derivatives_of_adjoints, B, {
    let mut irk = Irk::<Nonlinear, B>::new(options()).unwrap();
    let mut other = Irk::<Nonlinear, B>::new(options()).unwrap();
    let (x0, u) = at!(irk, point());
    let lambda = vector![0.3, 1.7];
    let forward = *irk.forward(&x0, &u, H).unwrap();
    let adjoint = *irk.adjoint(&x0, &u, H, &lambda).unwrap();
    let h = *irk.hessian(&x0, &u, H, &lambda).unwrap();
    let expected = difference(
        |w| {
            let (x0, u) = at!(other, w);
            let step = other.adjoint(&x0, &u, H, &lambda).unwrap();
            vector![step.grad_x0[0], step.grad_x0[1], step.grad_u[0], step.grad_p[0]]
        },
        point(),
    );
    let mut actual = SMatrix::<f64, 4, 4>::zeros();
    actual.fixed_view_mut::<2, 2>(0, 0).copy_from(&h.h_xx);
    actual.fixed_view_mut::<2, 1>(0, 2).copy_from(&h.h_xu);
    actual.fixed_view_mut::<2, 1>(0, 3).copy_from(&h.h_xp);
    (actual[(2, 2)], actual[(2, 3)], actual[(3, 3)]) = (h.h_uu[0], h.h_up[0], h.h_pp[0]);
    actual.fill_lower_triangle_with_upper_triangle();
    assert!((actual - expected).amax() < DIFFERENCE, "{actual} {expected}");
    assert_eq!(h.h_xx[(0, 1)].to_bits(), h.h_xx[(1, 0)].to_bits());
    assert_eq!(h.forward, forward);
    assert_eq!((h.grad_x0, h.grad_u, h.grad_p), (adjoint.grad_x0, adjoint.grad_u, adjoint.grad_p));
});

for_methods!(dense_output_is_the_collocation_polynomial, B, {
    let mut irk = Irk::<Nonlinear, B>::new(options()).unwrap();
    let mut other = Irk::<Nonlinear, B>::new(options()).unwrap();
    let (x0, u) = at!(irk, point());
    assert_eq!(irk.dense(0.2).unwrap_err(), Error::NoResult);
    for h in [H, -H] {
        let end = *irk.forward(&x0, &u, h).unwrap();
        let rounding = 20.0 * f64::EPSILON;
        let dense = *irk.dense_forward(0.2 + h).unwrap();
        assert!((dense.x - end.x).amax() < rounding && (dense.z - end.z).amax() < rounding);
        assert!((dense.dx_dx0 - end.dx_dx0).amax() < rounding);
        assert!((dense.dz_dp - end.dz_dp).amax() < rounding);
        let dense = *irk.dense_forward(0.2).unwrap();
        assert!((dense.x - x0).amax() < rounding && (dense.z - end.z0).amax() < rounding);
        assert!((dense.dx_dx0 - SMatrix::<f64, 2, 2>::identity()).amax() < rounding);
        assert!((dense.dz_du - end.dz0_du).amax() < rounding);
        // In each step, and from a call that computed no derivatives.
        for position in [0.1, 0.45, 0.8] {
            let t = 0.2 + h * position;
            irk.solve(&x0, &u, h).unwrap();
            let statistics = *irk.statistics();
            let dense = *irk.dense_forward(t).unwrap();
            assert_eq!(*irk.statistics(), statistics);
            assert_eq!(irk.dense(t).unwrap(), &dense.dense);
            let expected = difference(
                |w| {
                    let (x0, u) = at!(other, w);
                    other.solve(&x0, &u, h).unwrap();
                    let dense = other.dense(t).unwrap();
                    vector![dense.x[0], dense.x[1], dense.z[0]]
                },
                point(),
            );
            let x = join_columns(&dense.dx_dx0, &dense.dx_du, &dense.dx_dp);
            let z = join_columns(&dense.dz_dx0, &dense.dz_du, &dense.dz_dp);
            assert!((x - expected.fixed_rows::<2>(0)).amax() < DIFFERENCE);
            assert!((z - expected.fixed_rows::<1>(2)).amax() < DIFFERENCE);
        }
        let outside = irk.dense(0.2 - 0.01 * h).unwrap_err();
        assert!(matches!(outside, Error::OutsideInterval { .. }));
    }
});

#[test]
fn newton_variants() {
    let mut irk = Irk::<Nonlinear, Gauss<3>>::new(options()).unwrap();
    let (x0, u) = at!(irk, point());
    let lambda = vector![0.3, 1.7];
    let expected = *irk.hessian(&x0, &u, H, &lambda).unwrap();
    let frozen = Newton { jacobian: Jacobian::Frozen, ..Default::default() };
    let fixed = Newton { fixed_iterations: Some(12), ..Default::default() };
    let fixed_frozen = Newton { fixed_iterations: Some(40), ..frozen };
    for (newton, start) in [
        (Newton::default(), Start::Given),
        (fixed, Start::Zero),
        (fixed_frozen, Start::Given),
        (frozen, Start::Warm),
        (frozen, Start::Given),
    ] {
        let mut irk = Irk::<Nonlinear, Gauss<3>>::new(Options { newton, start, ..options() }).unwrap();
        let (x0, u) = at!(irk, point());
        // From z = 0 a frozen Jacobian of z + z³ does not contract at z = 1.
        irk.set_start(&vector![0.1, 0.2], &vector![1.0]).unwrap();
        for _ in 0..3 {
            let h = irk.hessian(&x0, &u, H, &lambda).unwrap();
            // Stages agree to the tolerance of a few ε; second derivatives amplify this by their
            // size.
            assert!((h.x - expected.x).amax() < 10.0 * f64::EPSILON);
            assert!((h.dx_dx0 - expected.dx_dx0).amax() < 50.0 * f64::EPSILON);
            assert!((h.h_xx - expected.h_xx).amax() < 1e-13);
            let statistics = irk.statistics();
            assert_eq!(statistics.steps, STEPS);
            if let Some(iterations) = newton.fixed_iterations {
                assert_eq!(statistics.iterations, iterations * STEPS);
            }
            if newton == fixed_frozen {
                // One for Newton's method and one at the solution, in each step.
                assert_eq!(statistics.factorizations, 2 * STEPS);
            }
        }
    }
}

#[test]
fn newton_iterations() {
    let start = |start| {
        let mut irk = Irk::<Nonlinear, Gauss<3>>::new(Options { start, ..Default::default() }).unwrap();
        irk.set_start(&vector![0.1, 0.2], &vector![1.0]).unwrap();
        irk
    };
    let mut irk = start(Start::Given);
    let (x0, u) = at!(irk, point());
    irk.solve(&x0, &u, 0.1).unwrap();
    // Quadratic convergence from an error of order 1e-1: 1e-2, 1e-4, 1e-8, 1e-16.
    assert!(irk.statistics().iterations <= 4, "{:?}", irk.statistics());
    let mut warm = start(Start::Warm);
    let (x0, u) = at!(warm, point());
    warm.solve(&x0, &u, 0.1).unwrap();
    assert_eq!(warm.statistics(), irk.statistics());
    warm.solve(&x0, &u, 0.1).unwrap();
    assert!(warm.statistics().iterations <= 1, "{:?}", warm.statistics());
    warm.reset();
    warm.solve(&x0, &u, 0.1).unwrap();
    assert_eq!(warm.statistics(), irk.statistics());
}

#[test]
fn repeated_calls() {
    let lambda = vector![0.3, 1.7];
    let mut irk = Irk::<Nonlinear, RadauIIA<4>>::new(options()).unwrap();
    let (x0, u) = at!(irk, point());
    let first = *irk.hessian(&x0, &u, H, &lambda).unwrap();
    irk.forward(&(x0 * 2.0), &u, 0.1).unwrap();
    irk.adjoint(&x0, &(u * 3.0), -0.1, &lambda).unwrap();
    assert_eq!(irk.hessian(&x0, &u, H, &lambda).unwrap(), &first);
    assert_eq!(irk.solve(&x0, &u, H).unwrap(), &first.nominal);
}

#[test]
fn intervals_of_no_length() {
    let mut irk = Irk::<Nonlinear, Gauss<2>>::new(options()).unwrap();
    let (x0, u) = at!(irk, point());
    let h = irk.hessian(&x0, &u, 0.0, &vector![1.0, 1.0]).unwrap();
    assert_eq!(h.x, x0);
    assert_eq!(h.dx_dx0, SMatrix::<f64, 2, 2>::identity());
    for zero in [h.dx_du.amax(), h.dx_dp.amax(), h.h_xx.amax()] {
        assert_eq!(zero, 0.0);
    }
    assert_eq!(h.grad_x0, vector![1.0, 1.0]);
    // z solves its equation at x0.
    let z = h.z[0];
    let f = z + z * z * z - x0[0] * x0[1] - u[0] * u[0] - point()[3];
    assert!(f.abs() < 10.0 * f64::EPSILON, "{f}");
    assert_eq!(irk.dense(0.2).unwrap().x, x0);
}

#[test]
fn single_precision() {
    let mut double = Irk::<Nonlinear, Gauss<2>>::new(options()).unwrap();
    let (x0, u) = at!(double, point());
    let expected = *double.hessian(&x0, &u, H, &vector![0.3, 1.7]).unwrap();
    let mut irk = Irk::<Nonlinear, Gauss<2>, f32>::new(options()).unwrap();
    irk.set_parameters(&vector![1.3]).unwrap();
    irk.set_time(0.2).unwrap();
    let h = irk.hessian(&x0.map(|a| a as f32), &u.map(|a| a as f32), H as f32, &vector![0.3, 1.7]).unwrap();
    // Condition numbers of order ten.
    let rounding = 50.0 * f64::from(f32::EPSILON);
    assert!((h.x.map(f64::from) - expected.x).amax() < rounding);
    assert!((h.dx_dx0.map(f64::from) - expected.dx_dx0).amax() < rounding);
    assert!((h.h_xx.map(f64::from) - expected.h_xx).amax() < rounding);
}
