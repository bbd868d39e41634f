//! Second derivatives of a model with many directions, where the adjoint goes backwards in all of
//! them: held against differences of gradients, and against a batch, whose registers take products
//! of all directions with each other.

use casados::irk::Integrator;
use casados::prelude::*;
use casados::result::Hessian;
use casados::{Custom, Method, Tableau};
use nalgebra::{SVector, vector};

const NX: usize = 43;

/// A substance in a tube: it diffuses, grows, and heat and what it is stored in depend on it; its
/// ends are a control and a function of algebraic states, whose pivot vanishes with `p[1]`. The
/// last state measures, and nobody depends on it. With a `MASS` of its own each equation has the
/// derivatives of two states.
#[dae(MASS = [0, 1])]
fn tube<const MASS: usize>(
    xdot: [f64; 44],
    x: [f64; 44],
    z: [f64; 2],
    u: [f64; 2],
    p: [f64; 2],
) -> [f64; 46] {
    let neighbour = if MASS == 1 { 0.1 } else { 0.0 };
    let mut f = [0.0; 46];
    for i in 0..43 {
        let before = if i == 0 { u[0] } else { x[i - 1] };
        let after = if i == 42 { z[0] * x[41] } else { x[i + 1] };
        f[i] = (1.0 + 0.1 * x[i] * x[i]) * xdot[i] + neighbour * xdot[(i + 1) % 43]
            - 4.0 * (before - 2.0 * x[i] + after)
            - p[0] * x[i] * (1.0 - x[i])
            - u[1] * x[i] * before;
    }
    f[43] = xdot[43] - x[0] * z[1];
    f[44] = p[1] * z[0] + p[0] * z[1] - x[42] * x[42];
    f[45] = p[0] * z[0] - p[1] * z[1] - x[41].sin() + 0.1 * u[1] * u[1];
    f
}

type X = SVector<f64, 44>;
type Test = Result<(), Box<dyn std::error::Error>>;

/// The smooth part of a state, with something for each element.
fn profile(shift: f64) -> X {
    X::from_fn(|i, _| 0.5 + 0.3 * (0.2 * i as f64 + shift).sin())
}

/// Where the interval begins, and what it is asked for.
struct IntervalData {
    x: X,
    u: SVector<f64, 2>,
    p: SVector<f64, 2>,
}

impl IntervalData {
    fn perturbed(&self, by: &Self, length: f64) -> Self {
        Self { x: self.x + by.x * length, u: self.u + by.u * length, p: self.p + by.p * length }
    }
}

const LENGTH: f64 = 0.1;

/// Stages are solved to rounding, and the condition of the Newton matrix is of order ten, over a
/// few steps.
const ROUNDING: f64 = 40.0 * f64::EPSILON;

type Steps<M, B, const S: usize> = Integrator<M, B, S, f64, Heap>;

/// An integrator of so many steps.
fn steps<M: Dae, B: Method<S>, const S: usize>(steps: usize) -> Result<Steps<M, B, S>, casados::Error> {
    Integrator::new(Options { steps, ..Default::default() })
}

/// The Hessian in a few directions is the derivative of the gradient: differences of order eight.
fn check_against_differences<M, B, const S: usize>(
    mut irk: Steps<M, B, S>,
    p: SVector<f64, 2>,
    dense: bool,
) -> Test
where
    M: Dae<Shape = <Tube<0> as Dae>::Shape>,
{
    let at = IntervalData { x: profile(0.0), u: vector![0.7, 0.4], p };
    let lambda = X::from_fn(|i, _| (0.7 * i as f64).cos());
    irk.set_parameters(&at.p)?;
    let hessian = *irk.hessian(&at.x, &at.u, LENGTH, &lambda)?;
    assert_eq!(irk.statistics().dense > 0, dense, "{:?}", irk.statistics());
    let step = 0.01;
    for seed in 0..4 {
        let s = f64::from(seed);
        let by = IntervalData {
            x: X::from_fn(|i, _| (1.3 * i as f64 + s).sin()),
            u: vector![(s + 0.3).cos(), (2.0 * s).cos()],
            p: vector![0.5 * s.cos(), 0.2 * (s + 0.5).sin()],
        };
        let mut gradient = |length: f64| -> Result<_, casados::Error> {
            let at = at.perturbed(&by, length);
            irk.set_parameters(&at.p)?;
            let adjoint = irk.adjoint(&at.x, &at.u, LENGTH, &lambda)?;
            Ok((adjoint.grad_x0, adjoint.grad_u, adjoint.grad_p))
        };
        let (mut x, mut u, mut p) = (X::zeros(), SVector::zeros(), SVector::zeros());
        for (k, weight) in [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0].into_iter().enumerate() {
            let length = step * (k + 1) as f64;
            let (forth, back) = (gradient(length)?, gradient(-length)?);
            x += (forth.0 - back.0) * (weight / step);
            u += (forth.1 - back.1) * (weight / step);
            p += (forth.2 - back.2) * (weight / step);
        }
        let size = hessian.grad_x0.amax().max(hessian.grad_u.amax()).max(hessian.grad_p.amax());
        // The weights add up to 2.1; what is truncated, `step⁸/630` of the ninth derivative, is
        // less.
        let tolerance = 2.1 * ROUNDING * size / step;
        let error_x = hessian.h_xx * by.x + hessian.h_xu * by.u + hessian.h_xp * by.p - x;
        let error_u = hessian.h_xu.transpose() * by.x + hessian.h_uu * by.u + hessian.h_up * by.p - u;
        let error_p =
            hessian.h_xp.transpose() * by.x + hessian.h_up.transpose() * by.u + hessian.h_pp * by.p - p;
        let worst = error_x.amax().max(error_u.amax()).max(error_p.amax());
        assert!(worst <= tolerance, "{worst:e} is more than {tolerance:e}");
    }
    Ok(())
}

#[test]
fn hessian_is_the_derivative_of_the_gradient() -> Test {
    let p = vector![1.2, 0.4];
    check_against_differences(steps::<Tube<0>, Gauss<2>, 2>(3)?, p, false)?;
    check_against_differences(steps::<Tube<0>, RadauIIA<3>, 3>(1)?, p, false)?;
    check_against_differences(steps::<Tube<1>, Gauss<2>, 2>(2)?, p, false)?;
    // The trapezoidal rule, whose matrix has no inverse.
    let tableau = Tableau::new([[0.0, 0.0], [0.5, 0.5]], [0.5, 0.5], [0.0, 1.0])?;
    let options = Options { steps: 2, ..Default::default() };
    check_against_differences(Steps::<Tube<0>, Custom<2>, 2>::with_tableau(options, tableau)?, p, false)
}

/// The whole matrix pivoted.
#[test]
fn dense_fallback() -> Test {
    check_against_differences(steps::<Tube<0>, Gauss<2>, 2>(2)?, vector![1.2, 0.0], true)
}

/// Intervals side by side in registers.
#[test]
fn products_of_all_directions() -> Test {
    let structure = <Tube<0> as Dae>::STRUCTURE;
    assert_eq!((structure.directions.len(), structure.quadratures), (NX + 4, &[43][..]));
    let options = Options { steps: 3, ..Default::default() };
    let mut single = Irk::<Tube<0>, Gauss<2>>::new(options)?;
    let mut batch = Batch::<Tube<0>, Gauss<2>>::new(options)?;
    let x0: Vec<X> = (0..8).map(|k| profile(f64::from(k))).collect();
    let (u, p) = (vec![vector![0.7, 0.4]; 8], vec![vector![1.2, 0.4]; 8]);
    let lambda: Vec<X> = (0..8).map(|k| X::from_fn(|i, _| ((i + k) as f64).cos())).collect();
    let mut found = vec![Hessian::default(); 8];
    let intervals = Intervals { x0: &x0, u: &u, p: &p, h: &[LENGTH], ..Default::default() };
    batch.hessian(&intervals, &lambda, &mut found)?;
    for k in 0..8 {
        single.set_parameters(&p[k])?;
        let expected = single.hessian(&x0[k], &u[k], LENGTH, &lambda[k])?;
        let close = |found: &[f64], expected: &[f64]| {
            let size = expected.iter().fold(0.0, |size: f64, value| size.max(value.abs()));
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() <= ROUNDING * size, "{found:e} instead of {expected:e}");
            }
        };
        close(found[k].h_xx.as_slice(), expected.h_xx.as_slice());
        close(found[k].h_xu.as_slice(), expected.h_xu.as_slice());
        close(found[k].h_xp.as_slice(), expected.h_xp.as_slice());
        close(found[k].h_uu.as_slice(), expected.h_uu.as_slice());
        close(found[k].h_up.as_slice(), expected.h_up.as_slice());
        close(found[k].h_pp.as_slice(), expected.h_pp.as_slice());
    }
    Ok(())
}
