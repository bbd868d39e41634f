//! Implicit integrators on closed forms, and on models at the edge: very large, and without states.

use crate::models::{Algebraic, Linear, N, Nonlinear, Rod};
use casados_core::options::Newton;
use casados_core::{Error, Gauss, Inline, Irk, Options, RadauIIA, mode};
use nalgebra::{SVector, vector};

/// `ẋ = p x + u` has `x(h) = e^{ph} x₀ + (e^{ph} − 1)/p u`. The error of Gauss with 8 stages is
/// `(ph)¹⁷ (8!)²/((16!)² 17)·…` < 1e-19 at |ph| ≤ 1, and its second derivative in p below 1e-16.
#[test]
fn closed_form_of_a_linear_model() {
    let mut irk = Irk::<Linear, Gauss<8>>::new(Options::default()).unwrap();
    for (p, x0, u, h) in [(-1.0, 2.0, 0.3, 0.5), (0.7, -1.0, 0.5, -1.0), (1.0, 3.0, 0.0, 0.9)] {
        irk.set_parameters(&vector![p]).unwrap();
        let r = irk.hessian(&vector![x0], &vector![u], h, &vector![1.0]).unwrap();
        let e = f64::exp(p * h);
        // g = (e^{ph} − 1)/p and its derivatives in p.
        let g = (e - 1.0) / p;
        let g1 = (h * e - g) / p;
        let g2 = (h * h * e - 2.0 * g1) / p;
        let x = e * x0 + g * u;
        let near = |a: f64, b: f64| assert!((a - b).abs() < 40.0 * f64::EPSILON * (1.0 + b.abs()), "{a} {b}");
        near(r.x[0], x);
        // z is a polynomial of degree 7 at both ends: its error is x⁽⁸⁾ Π(1 − c_i)/8! h⁸ with Π(1 −
        // c_i) = 8!²/16!.
        let bound = (p * h).abs().powi(8) * 40320.0 / 20_922_789_888_000.0 * e.max(1.0) * 1.01;
        let near_z = |a: f64, b: f64, scale: f64| assert!((a - b).abs() < bound * scale + 1e-14, "{a} {b}");
        near_z(r.z[0], x, (x0 + u / p).abs());
        near_z(r.z0[0], x0, (x0 + u / p).abs());
        near(r.dx_dx0[0], e);
        near(r.dx_du[0], g);
        near(r.dx_dp[0], h * e * x0 + g1 * u);
        near_z(r.dz_dx0[0], e, 1.0);
        near_z(r.dz_du[0], g, 1.0 / p.abs());
        near_z(r.dz0_dx0[0], 1.0, 1.0);
        near_z(r.dz0_du[0], 0.0, 1.0 / p.abs());
        near(r.h_xp[0], h * e);
        near(r.h_up[0], g1);
        near(r.h_pp[0], h * h * e * x0 + g2 * u);
        assert_eq!((r.h_xx[0], r.h_xu[0], r.h_uu[0]), (0.0, 0.0, 0.0));
        // Linear in the unknowns: one iteration, and the residual says that it was enough.
        assert_eq!(irk.statistics().iterations, 1);
    }
}

/// The last stage of Radau IIA is the end of the step, also for z.
#[test]
fn algebraic_states_at_the_end() {
    let mut irk = Irk::<Linear, RadauIIA<3>>::new(Options { steps: 3, ..Default::default() }).unwrap();
    irk.set_parameters(&vector![-20.0]).unwrap();
    let r = irk.forward(&vector![2.0], &vector![3.0], 0.5).unwrap();
    // x is a sum with b_i and z one with a_si, which is the same number: a few roundings apart.
    assert!((r.z[0] - r.x[0]).abs() < 8.0 * f64::EPSILON);
    assert!((r.dz_dx0[0] - r.dx_dx0[0]).abs() < 8.0 * f64::EPSILON);
    assert!((r.dz_dp[0] - r.dx_dp[0]).abs() < 8.0 * f64::EPSILON);
}

/// From x = 1 to the equilibrium −u/p within a step of 10⁴ … 10¹² time constants.
#[test]
fn iterations_of_stiff_models() {
    let mut irk = Irk::<Linear, RadauIIA<3>>::new(Options::default()).unwrap();
    for p in [-1e4, -1e6, -1e8, -1e10, -1e12] {
        irk.set_parameters(&vector![p]).unwrap();
        let r = irk.forward(&vector![1.0], &vector![-p], 1.0).unwrap();
        // At the equilibrium; rounding errors of k are ε|p|, and h b_i k_i is of order one.
        assert!((r.x[0] - 1.0).abs() < 10.0 * f64::EPSILON);
        // The Padé approximant (2, 3) of the exponential function.
        let stability = (1.0 + p * (0.4 + p / 20.0)) / (1.0 - p * (0.6 - p * (0.15 - p / 60.0)));
        assert!((r.dx_dx0[0] - stability).abs() < 10.0 * f64::EPSILON);
        assert!(irk.statistics().iterations <= 2, "{p} {:?}", irk.statistics());
        irk.solve(&vector![2.0], &vector![-p], 1.0).unwrap();
        assert!(irk.statistics().iterations <= 2, "{p} {:?}", irk.statistics());
    }
}

/// Scaling a linear problem by a power of two scales every result, to the last bit.
#[test]
fn scaling_by_powers_of_two() {
    let mut irk = Irk::<Linear, RadauIIA<3>>::new(Options { steps: 2, ..Default::default() }).unwrap();
    irk.set_parameters(&vector![-3.0]).unwrap();
    let expected = *irk.forward(&vector![1.3], &vector![0.4], 0.7).unwrap();
    for exponent in [-900, -300, 300, 900] {
        let scale = 2f64.powi(exponent);
        let scaled = irk.forward(&vector![1.3 * scale], &vector![0.4 * scale], 0.7).unwrap();
        assert_eq!(scaled.x, expected.x * scale);
        assert_eq!(scaled.z, expected.z * scale);
        assert_eq!(scaled.dx_dx0, expected.dx_dx0);
        assert_eq!(scaled.dx_dp, expected.dx_dp * scale);
    }
}

#[test]
fn no_differential_states() {
    let options =
        Options { newton: Newton { max_iterations: 100, ..Default::default() }, ..Default::default() };
    let mut irk = Irk::<Algebraic, Gauss<2>>::new(options).unwrap();
    let none = SVector::<f64, 0>::zeros();
    // The derivative of z³ is zero where the iteration starts.
    assert!(matches!(irk.solve(&none, &vector![8.0], 0.1), Err(Error::Singular { unknown: "z", .. })));
    let options = Options { start: casados_core::options::Start::Given, ..options };
    let mut irk = Irk::<Algebraic, Gauss<2>>::new(options).unwrap();
    irk.set_start(&none, &vector![1.0]).unwrap();
    let r = irk.hessian(&none, &vector![8.0], 0.1, &none).unwrap();
    assert!((r.z[0] - 2.0).abs() < 10.0 * f64::EPSILON && (r.z0[0] - 2.0).abs() < 10.0 * f64::EPSILON);
    // dz/du = 1/(3 z²)
    assert!((r.dz_du[0] - 1.0 / 12.0).abs() < 10.0 * f64::EPSILON);
    assert_eq!(r.h_uu[0], 0.0);
    irk.adjoint(&none, &vector![8.0], 0.0, &none).unwrap();
}

/// A matrix of 450 unknowns (1.6 MB) and three of them in the record, on a thread with 2 MB of
/// stack.
#[test]
fn stack_of_large_models() {
    let run = || {
        let mut irk = Irk::<Rod, Gauss<3>>::new(Options { steps: 2, ..Default::default() }).unwrap();
        let x0 = Box::new(SVector::<f64, N>::from_fn(|i, _| (i as f64 / 10.0).sin()));
        let lambda = Box::new(SVector::<f64, N>::from_fn(|i, _| (i as f64 / 7.0).cos()));
        let u = vector![0.5];
        let (mut gradient, mut product) =
            (Box::new(SVector::<f64, N>::zeros()), Box::new(SVector::<f64, N>::zeros()));
        gradient.copy_from(&irk.adjoint(&x0, &u, 0.1, &lambda).unwrap().grad_x0);
        let h = irk.hessian(&x0, &u, 0.1, &lambda).unwrap();
        h.dx_dx0.tr_mul_to(&*lambda, &mut *product);
        // Sums of 150 products, seeds and derivatives of order one.
        let rounding = 150.0 * f64::EPSILON;
        assert!((*gradient - *product).amax() < rounding);
        assert!((h.grad_x0 - *product).amax() < rounding);
        assert!((0..N).all(|r| (0..r).all(|c| h.h_xx[(r, c)] == h.h_xx[(c, r)])));
        assert!(h.h_xx.amax() > 0.01);
    };
    std::thread::Builder::new().stack_size(2 << 20).spawn(run).unwrap().join().unwrap();
}

#[test]
fn inline_memory() {
    let options = Options { steps: 2, ..Default::default() };
    let (x0, u, p, lambda) = (vector![0.4, -0.7], vector![0.9], vector![1.3], vector![0.3, 1.7]);
    let mut heap = Irk::<Nonlinear, Gauss<2>>::new(options).unwrap();
    heap.set_parameters(&p).unwrap();
    let expected = *heap.hessian(&x0, &u, 0.2, &lambda).unwrap();
    let adjoint = *heap.adjoint(&x0, &u, 0.2, &lambda).unwrap();

    type InlineIrk<Mode, const STEPS: usize> = Irk<Nonlinear, Gauss<2>, f64, Inline<Mode, STEPS>>;
    let mut irk = InlineIrk::<mode::Hessian, 2>::inline(options).unwrap();
    irk.set_parameters(&p).unwrap();
    assert_eq!(irk.hessian(&x0, &u, 0.2, &lambda).unwrap(), &expected);
    assert_eq!(irk.forward(&x0, &u, 0.2).unwrap(), &expected.forward);
    let mut irk = InlineIrk::<mode::Adjoint, 3>::inline(options).unwrap();
    irk.set_parameters(&p).unwrap();
    assert_eq!(irk.adjoint(&x0, &u, 0.2, &lambda).unwrap(), &adjoint);
    let mut irk = InlineIrk::<mode::Nominal, 2>::inline(options).unwrap();
    irk.set_parameters(&p).unwrap();
    assert_eq!(irk.solve(&x0, &u, 0.2).unwrap(), &expected.nominal);

    let error = InlineIrk::<mode::Nominal, 1>::inline(options).err();
    assert!(matches!(error, Some(Error::InvalidOption { option: "steps", .. })));
    const { assert!(InlineIrk::<mode::Nominal, 1>::SIZE < InlineIrk::<mode::Forward, 1>::SIZE) };
}

#[test]
fn integrators_on_other_threads() {
    fn check<T: Send>(_: &T) {}
    check(&Irk::<Nonlinear, Gauss<2>>::new(Options::default()).unwrap());
}

/// What the models of these tests say about themselves is true.
#[test]
fn declared_structures() {
    use casados_core::testing::{Points, check_pattern};
    check_pattern::<Nonlinear>(&Points::random(4)).assert();
    check_pattern::<Linear>(&Points::random(4)).assert();
    check_pattern::<crate::models::Fragile>(&Points::random(4).all(0.1..=0.5)).assert();
    check_pattern::<Algebraic>(&Points::random(4)).assert();
    check_pattern::<crate::models::pendulum::Pendulum>(&Points::random(4)).assert();
}
