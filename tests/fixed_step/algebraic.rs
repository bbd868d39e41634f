//! Second derivatives of algebraic states at the start of an interval, `∇²(λᵀx₊ + νᵀz₀)`.
//!
//! References are differences of order eight of exact gradients of the same discrete map, which
//! other tests compare with independent ones, and a closed form.

use casados::batch::Slice;
use casados::error::Argument;
use casados::prelude::*;
use casados::result::Hessian;
use casados::{Error, Heap, Method, batch, irk};
use nalgebra::{SMatrix, SVector, vector};

type Test = Result<(), Box<dyn std::error::Error>>;

/// A cart with friction: `z₀` is a force, explicit but nonlinear in everything; `z₁` is given by an
/// equation without a solution in elementary functions.
#[dae]
fn cart(xdot: [f64; 2], x: [f64; 2], z: [f64; 2], u: [f64; 1], p: [f64; 1], t: f64) -> [f64; 4] {
    [
        xdot[0] - x[1] - 0.1 * z[1] * z[1],
        (1.0 + 0.2 * x[0] * x[0]) * xdot[1] + x[0].sin() - z[0] - u[0] * z[1],
        z[0] - (x[0] * u[0]).sin() - p[0] * x[1] * x[1] - 0.2 * t * z[1],
        z[1] + 0.3 * z[1].tanh() - x[1] * u[0] - p[0] * z[0].cos(),
    ]
}

/// What is integrated beside it.
#[function]
fn effort(x: [f64; 2], z: [f64; 2], u: [f64; 1], p: [f64; 1], _t: f64) -> f64 {
    z[0] * z[0] * x[1] + u[0] * z[1] * p[0]
}

/// `(x₀, u, p)`
type W = SVector<f64, 4>;
type Matrix4 = SMatrix<f64, 4, 4>;
type Integrator<B, const S: usize> = irk::Integrator<Cart, B, S, f64, Heap>;

const LAMBDA: SVector<f64, 2> = vector![0.8, -1.1];
const NU: SVector<f64, 2> = vector![1.3, 0.7];
const H: f64 = 0.4;

/// Where the intervals of a batch begin; nothing is zero.
fn start(k: usize) -> W {
    let wave = |i: usize| 0.1 * (1.7 * (k * i) as f64).sin();
    vector![0.6 + wave(1), -0.4 + wave(2), 0.9 + wave(3), 0.5 + wave(4)]
}

fn options(steps: usize) -> Options {
    Options { steps, ..Default::default() }
}

fn prepare_integrator<B: Method<S>, const S: usize>(irk: &mut Integrator<B, S>, w: &W) -> Result<(), Error> {
    irk.set_parameters(&vector![w[3]])?;
    irk.set_time(0.3)
}

fn split_arguments(w: &W) -> (SVector<f64, 2>, SVector<f64, 1>) {
    (vector![w[0], w[1]], vector![w[2]])
}

/// The gradient over `(x₀, u, p)` from derivatives of first order.
fn gradient<B: Method<S>, const S: usize>(irk: &mut Integrator<B, S>, w: &W) -> Result<W, Error> {
    prepare_integrator(irk, w)?;
    let (x0, u) = split_arguments(w);
    let step = irk.forward(&x0, &u, H)?;
    let x = step.dx_dx0.tr_mul(&LAMBDA) + step.dz0_dx0.tr_mul(&NU);
    let u = step.dx_du.tr_mul(&LAMBDA) + step.dz0_du.tr_mul(&NU);
    let p = step.dx_dp.tr_mul(&LAMBDA) + step.dz0_dp.tr_mul(&NU);
    Ok(vector![x[0], x[1], u[0], p[0]])
}

/// Its differences of order eight.
fn differences(mut gradient: impl FnMut(&W) -> Result<W, Error>, w: &W) -> Result<Matrix4, Error> {
    const STEP: f64 = 0.01;
    const WEIGHTS: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
    let mut hessian = Matrix4::zeros();
    for j in 0..4 {
        let mut at = |steps: f64| {
            let mut w = *w;
            w[j] += steps * STEP;
            gradient(&w)
        };
        let mut column = W::zeros();
        for (i, weight) in WEIGHTS.into_iter().enumerate() {
            let steps = (i + 1) as f64;
            column += (at(steps)? - at(-steps)?) * (weight / STEP);
        }
        hessian.set_column(j, &column);
    }
    Ok(hessian)
}

fn matrix(step: &Hessian<Cart>) -> Matrix4 {
    let mut hessian = Matrix4::zeros();
    hessian.fixed_view_mut::<2, 2>(0, 0).copy_from(&step.h_xx);
    hessian.fixed_view_mut::<2, 1>(0, 2).copy_from(&step.h_xu);
    hessian.fixed_view_mut::<2, 1>(0, 3).copy_from(&step.h_xp);
    (hessian[(2, 2)], hessian[(2, 3)], hessian[(3, 3)]) = (step.h_uu[0], step.h_up[0], step.h_pp[0]);
    hessian.fill_lower_triangle_with_upper_triangle();
    hessian
}

fn sensitivities_of_algebraic_states(step: &Hessian<Cart>) -> W {
    vector![step.grad_x0[0], step.grad_x0[1], step.grad_u[0], step.grad_p[0]]
}

/// Gradients and Hessians are sums of some dozen products of order one.
const ROUNDING: f64 = 1e-14;
/// The weights of differences add up to `2.1 / STEP`; ninth derivatives count with
/// `STEP⁸/630 = 2e-19`.
const DIFFERENCE: f64 = 210.0 * ROUNDING;

/// One interval alone and any number of them in lanes.
fn check<B: Method<S>, const S: usize>() -> Test {
    for steps in [1, 3] {
        let mut single = Integrator::<B, S>::new(options(steps))?;
        let mut group = batch::Integrator::<Integrator<B, S>>::new(options(steps))?;
        for count in [1, 5, 40] {
            let starts: Vec<W> = (0..count).map(start).collect();
            let (x0, u): (Vec<_>, Vec<_>) = starts.iter().map(split_arguments).unzip();
            let p: Vec<_> = starts.iter().map(|w| vector![w[3]]).collect();
            let intervals = Intervals { x0: &x0, u: &u, p: &p, h: &[H], t0: &[0.3] };
            let mut results = vec![Hessian::default(); count];
            group.hessian_with_z0(&intervals, &[LAMBDA], &[NU], &mut results)?;
            let statistics = group.statistics();
            assert_eq!(statistics.redone, 0);
            #[cfg(target_arch = "x86_64")]
            if std::is_x86_feature_detected!("avx2") && std::is_x86_feature_detected!("fma") && count > 1 {
                assert!(statistics.groups > 0 && statistics.alone <= 1, "{statistics:?}");
            }
            for (k, (w, result)) in starts.iter().zip(&results).enumerate() {
                prepare_integrator(&mut single, w)?;
                let alone = *single.hessian_with_z0(&x0[k], &u[k], H, &LAMBDA, &NU)?;
                assert!(
                    (sensitivities_of_algebraic_states(&alone) - sensitivities_of_algebraic_states(result))
                        .amax()
                        < ROUNDING
                );
                assert!((matrix(&alone) - matrix(result)).amax() < ROUNDING);
                assert!(
                    (sensitivities_of_algebraic_states(&alone) - gradient(&mut single, w)?).amax() < ROUNDING
                );
                if k < 5 {
                    let expected = differences(|w| gradient(&mut single, w), w)?;
                    for found in [&alone, result] {
                        let error = (matrix(found) - expected).amax();
                        assert!(error < DIFFERENCE, "{steps} {count} {k}: {error:e}");
                    }
                    // The weights are felt.
                    prepare_integrator(&mut single, w)?;
                    let without = *single.hessian(&x0[k], &u[k], H, &LAMBDA)?;
                    assert!((matrix(&alone) - matrix(&without)).amax() > 0.1);
                }
            }
        }
    }
    Ok(())
}

#[test]
fn gauss_methods() -> Test {
    check::<Gauss<1>, 1>()?;
    check::<Gauss<2>, 2>()?;
    check::<Gauss<4>, 4>()
}

#[test]
fn radau_methods() -> Test {
    check::<RadauIIA<1>, 1>()?;
    check::<RadauIIA<3>, 3>()
}

/// With an integral of the algebraic states along.
#[test]
fn integral_of_algebraic_states() -> Test {
    for steps in [1, 3] {
        let mut irk = Integrator::<Gauss<2>, 2>::new(options(steps))?;
        let mut integral = Quadrature::<Effort>::new();
        integral.nu = vector![0.9];
        let w = start(1);
        let (x0, u) = split_arguments(&w);
        prepare_integrator(&mut irk, &w)?;
        let found = *irk.with(&mut integral).hessian_with_z0(&x0, &u, H, &LAMBDA, &NU)?;
        let all = |w: &W| -> Result<W, Error> {
            let others = gradient(&mut irk, w)?;
            let (x0, u) = split_arguments(w);
            irk.with(&mut integral).forward(&x0, &u, H)?;
            let Quadrature { dq_dx0, dq_du, dq_dp, .. } = &integral;
            Ok(others + 0.9 * vector![dq_dx0[0], dq_dx0[1], dq_du[0], dq_dp[0]])
        };
        let expected = differences(all, &w)?;
        let error = (matrix(&found) - expected).amax();
        assert!(error < DIFFERENCE, "{steps}: {error:e}");
    }
    Ok(())
}

/// `ẋ = u − x`, `z = sin(x u) + p x³`: the states of the stages are linear in `(x₀, u)`,
/// `ξ = (I + hA)⁻¹ (x₀ + hA u)`.
#[dae]
fn decay(xdot: [f64; 1], x: [f64; 1], z: [f64; 1], u: [f64; 1], p: [f64; 1]) -> [f64; 2] {
    [xdot[0] + x[0] - u[0], z[0] - (x[0] * u[0]).sin() - p[0] * x[0].powi(3)]
}

/// `ν Σ_i ℓ_i(0) ∇²ζ(ξ_i, u, p)` by the chain rule, with `A` and `ℓ(0)` of a tableau.
fn check_closed_form<B>(
    mut irk: irk::Integrator<Decay, B, 2, f64, Heap>,
    a: nalgebra::Matrix2<f64>,
    weights: SVector<f64, 2>,
) -> Test {
    let (x0, u, p, nu) = (0.7, 1.2, -0.4, 1.6);
    irk.set_parameters(&vector![p])?;
    let step = *irk.hessian_with_z0(&vector![x0], &vector![u], H, &vector![0.0], &vector![nu])?;
    let inverse = (nalgebra::Matrix2::identity() + H * a).try_inverse().ok_or("singular")?;
    let of_x = inverse * vector![1.0, 1.0];
    let of_u = inverse * H * a * vector![1.0, 1.0];
    let mut expected = [0.0; 6];
    for ((weight, a), b) in weights.iter().zip(of_x.iter()).zip(of_u.iter()) {
        let xi = a * x0 + b * u;
        let (sine, cosine) = (xi * u).sin_cos();
        // Derivatives of ζ over (ξ, u, p).
        let (zeta_xx, zeta_uu) = (-u * u * sine + 6.0 * p * xi, -xi * xi * sine);
        let (zeta_xu, zeta_xp) = (cosine - xi * u * sine, 3.0 * xi * xi);
        let terms = [
            zeta_xx * a * a,
            zeta_xx * a * b + zeta_xu * a,
            zeta_xx * b * b + 2.0 * zeta_xu * b + zeta_uu,
            zeta_xp * a,
            zeta_xp * b,
            0.0,
        ];
        expected.iter_mut().zip(terms).for_each(|(sum, term)| *sum += nu * weight * term);
    }
    let found = [step.h_xx[0], step.h_xu[0], step.h_uu[0], step.h_xp[0], step.h_up[0], step.h_pp[0]];
    for (found, expected) in found.into_iter().zip(expected) {
        // A dozen roundings of terms of order ten.
        assert!((found - expected).abs() < 3e-14, "{found} {expected}");
    }
    Ok(())
}

#[test]
fn closed_form_of_second_derivatives() -> Test {
    let root = 3f64.sqrt();
    let a = nalgebra::matrix![0.25, 0.25 - root / 6.0; 0.25 + root / 6.0, 0.25];
    let gauss = irk::Integrator::<Decay, Gauss<2>, 2, f64, Heap>::new(Options::default())?;
    check_closed_form(gauss, a, vector![1.0 + root, 1.0 - root] / 2.0)?;
    // The trapezoidal rule: its first stage is the start itself.
    let tableau = Tableau::new([[0.0, 0.0], [0.5, 0.5]], [0.5, 0.5], [0.0, 1.0])?;
    let trapezoidal =
        irk::Integrator::<Decay, Custom<2>, 2, f64, Heap>::with_tableau(Options::default(), tableau)?;
    check_closed_form(trapezoidal, nalgebra::matrix![0.0, 0.0; 0.5, 0.5], vector![1.0, 0.0])
}

/// `P z = (x³, x u²)` with a state that stays as it is: of two permutations one has a pivot of zero
/// in any static order.
#[dae]
fn permuted(xdot: [f64; 1], x: [f64; 1], z: [f64; 2], u: [f64; 1], p: [f64; 4]) -> [f64; 3] {
    [xdot[0], p[0] * z[0] + p[1] * z[1] - x[0].powi(3), p[2] * z[0] + p[3] * z[1] - x[0] * u[0] * u[0]]
}

/// Where the whole matrix is pivoted, alone and beside intervals that need no such thing:
/// `νᵀ∂²(P⁻¹ r)` in closed form.
#[test]
fn dense_fallback() -> Test {
    let permutations = [vector![1.0, 0.0, 0.0, 1.0], vector![0.0, 1.0, 1.0, 0.0]];
    let (x, u) = (1.3, 0.7);
    let check = |k: usize, step: &Hessian<Permuted>| {
        // Both permutations are their own inverses.
        let swap = |[a, b]: [f64; 2]| if k.is_multiple_of(2) { [a, b] } else { [b, a] };
        let nu = swap([NU[0], NU[1]]);
        let by_x = swap([3.0 * x * x, u * u]);
        let by_u = swap([0.0, 2.0 * x * u]);
        let mut pairs = vec![
            (step.h_xx[0], nu[0] * 6.0 * x),
            (step.h_xu[0], nu[1] * 2.0 * u),
            (step.h_uu[0], nu[1] * 2.0 * x),
        ];
        // ∂P⁻¹/∂p_ab = −P⁻¹ E_ab P⁻¹
        for (a, b) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            pairs.push((step.h_xp[2 * a + b], -nu[a] * by_x[b]));
            pairs.push((step.h_up[2 * a + b], -nu[a] * by_u[b]));
        }
        for (found, expected) in pairs {
            // A matrix of condition one, some ten roundings of terms of order ten.
            assert!((found - expected).abs() < 100.0 * f64::EPSILON, "{k}: {found} {expected}");
        }
    };
    let mut dense = 0;
    let mut irk = Irk::<Permuted, RadauIIA<2>>::new(Options::default())?;
    let (x0, u, lambda) = (vector![x], vector![u], vector![0.0]);
    for (k, p) in permutations.iter().enumerate() {
        irk.set_parameters(p)?;
        check(k, irk.hessian_with_z0(&x0, &u, H, &lambda, &NU)?);
        dense += irk.statistics().dense;
    }
    assert!(dense > 0, "no static order is right for both");
    let mut batch = Batch::<Permuted, RadauIIA<2>>::new(Options::default())?;
    let p: Vec<_> = permutations.into_iter().cycle().take(9).collect();
    let intervals = Intervals { x0: &[x0; 9], u: &[u], p: &p, h: &[H], t0: &[] };
    let mut results = vec![Hessian::default(); 9];
    batch.hessian_with_z0(&intervals, &[lambda], &[NU], &mut results)?;
    results.iter().enumerate().for_each(|(k, result)| check(k, result));
    let statistics = batch.statistics();
    assert!(statistics.groups == 0 || statistics.redone > 0, "{statistics:?}");
    Ok(())
}

/// Calls without weights know nothing of those before them.
#[test]
fn calls_without_weights() -> Test {
    let (x0, u) = split_arguments(&start(3));
    let mut used = Integrator::<Gauss<2>, 2>::new(options(3))?;
    let mut fresh = Integrator::<Gauss<2>, 2>::new(options(3))?;
    for irk in [&mut used, &mut fresh] {
        irk.set_parameters(&vector![0.5])?;
    }
    used.hessian_with_z0(&x0, &u, H, &LAMBDA, &NU)?;
    assert_eq!(used.hessian(&x0, &u, H, &LAMBDA)?, fresh.hessian(&x0, &u, H, &LAMBDA)?);
    used.hessian_with_z0(&x0, &u, H, &LAMBDA, &NU)?;
    assert_eq!(used.adjoint(&x0, &u, H, &LAMBDA)?, fresh.adjoint(&x0, &u, H, &LAMBDA)?);

    let mut used = Batch::<Cart, Gauss<2>>::new(options(3))?;
    let mut fresh = Batch::<Cart, Gauss<2>>::new(options(3))?;
    let x0: Vec<_> = (0..7).map(|k| split_arguments(&start(k)).0).collect();
    let intervals = Intervals { x0: &x0, u: &[u], p: &[vector![0.5]], h: &[H], t0: &[] };
    let [mut found, mut expected] = [(); 2].map(|()| vec![Hessian::default(); x0.len()]);
    used.hessian_with_z0(&intervals, &[LAMBDA], &[NU], &mut found)?;
    used.hessian(&intervals, &[LAMBDA], &mut found)?;
    fresh.hessian(&intervals, &[LAMBDA], &mut expected)?;
    assert_eq!(found, expected);
    Ok(())
}

/// Weights that are not finite, too few, or too many.
#[test]
fn invalid_weights() -> Test {
    let (x0, u) = split_arguments(&start(0));
    let bad = vector![1.0, f64::NAN];
    let mut irk = Integrator::<Gauss<2>, 2>::new(options(1))?;
    irk.set_parameters(&vector![0.5])?;
    let Err(error) = irk.hessian_with_z0(&x0, &u, H, &LAMBDA, &bad).map(|_| ()) else {
        return Err("no error".into());
    };
    assert!(matches!(error, Error::NonFiniteInput { argument: Argument::Nu, index: 1, .. }));
    assert_eq!(error.to_string(), "`z[1]` of nu is NaN: it must be finite");

    let mut batch = Batch::<Cart, Gauss<2>>::new(options(1))?;
    let (starts, p) = ([x0; 3], [vector![0.5]]);
    let intervals = Intervals { x0: &starts, u: &[u], p: &p, h: &[H], t0: &[] };
    let mut results = vec![Hessian::default(); 3];
    for length in [0, 2, 4] {
        let error = batch.hessian_with_z0(&intervals, &[LAMBDA], &vec![NU; length], &mut results);
        let slice = Slice::Argument(Argument::Nu);
        assert_eq!(error, Err(BatchError::Length { slice, length, intervals: 3 }));
    }
    let outcome = batch.hessian_with_z0(&intervals, &[LAMBDA], &[NU, bad, NU], &mut results);
    assert!(matches!(outcome, Err(BatchError::Intervals { failed: 1, first: 1, .. })));
    assert!(matches!(batch.status(1), Err(Error::NonFiniteInput { argument: Argument::Nu, index: 1, .. })));
    assert_eq!(batch.status(2), Ok(()));
    Ok(())
}
