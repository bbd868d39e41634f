//! Derivatives: identities, independent ways to the same numbers, what cancels, and what an
//! iteration that stops early leaves.

use super::everything::Everything;
use crate::models::chemistry::{AkzoNobel, Robertson};
use crate::models::oscillators::VanDerPol;
use casados::options::Newton;
use casados::{
    Adaptive, AdaptiveOptions, DormandPrince8, Erk, Gauss, GraphDae, Irk, Method, Options, Radau, RadauIIA,
    Rk4, ode,
};
use nalgebra::{Complex, SVector, vector};
use reference_data::Record;

/// A pendulum with friction: g/l = p₀, friction p₁, pushed.
#[ode]
fn swing(x: [f64; 2], u: f64, p: [f64; 2]) -> [f64; 2] {
    [x[1], u - p[0] * x[0].sin() - p[1] * x[1] * x[1].abs()]
}

#[ode]
fn oscillator(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u - x[0]]
}

/// A number between −1 and 1, the next one of a sequence.
fn next(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// `λᵀ(S v)` of the forward derivatives is `(Sᵀλ)ᵀ v` of the adjoint, relative to the sizes of the
/// terms.
macro_rules! identity {
    ($integrator:expr, $x0:expr, $u:expr, $h:expr, $p:expr, $nx:literal, $nu:literal, $np:literal) => {{
        let (mut integrator, x0, u, h, mut seed) = ($integrator, $x0, $u, $h, 7);
        integrator.set_parameters(&$p).expect("finite");
        let mut worst = 0.0f64;
        for _ in 0..20 {
            let lambda = SVector::<f64, $nx>::from_fn(|_, _| next(&mut seed));
            let forward = *integrator.forward(&x0, &u, h).expect("derivatives");
            let adjoint = *integrator.adjoint(&x0, &u, h, &lambda).expect("a gradient");
            // Each parameter in its own unit.
            let vx = SVector::<f64, $nx>::from_fn(|_, _| next(&mut seed));
            let vu = SVector::<f64, $nu>::from_fn(|_, _| next(&mut seed));
            let vp = SVector::<f64, $np>::from_fn(|i, _| next(&mut seed) * $p[i]);
            let image = forward.dx_dx0 * vx + forward.dx_du * vu + forward.dx_dp * vp;
            let size = lambda.norm()
                * (forward.dx_dx0.abs() * vx.abs()
                    + forward.dx_du.abs() * vu.abs()
                    + forward.dx_dp.abs() * vp.abs())
                .norm();
            let other = adjoint.grad_x0.dot(&vx) + adjoint.grad_u.dot(&vu) + adjoint.grad_p.dot(&vp);
            worst = worst.max((lambda.dot(&image) - other).abs() / size);
        }
        println!("{worst:e}");
        assert!(worst <= 1e-14, "{worst:e}");
    }};
}

#[test]
fn t13_adjoint_and_forward() {
    let options = Options { steps: 4, ..Default::default() };
    let akzo = [18.7, 0.58, 0.09, 0.42, 34.4, 3.3, 115.83, 0.9, 737.0];
    let x0 = vector![0.444, 0.00123, 0.01, 0.007, 0.01];
    let none = SVector::<f64, 0>::zeros();
    identity!(
        Irk::<AkzoNobel, RadauIIA<3>>::new(options).expect("valid"),
        x0,
        none,
        0.04,
        SVector::from(akzo),
        5,
        0,
        9
    );
    identity!(
        Irk::<AkzoNobel, Gauss<4>>::new(options).expect("valid"),
        x0,
        none,
        0.04,
        SVector::from(akzo),
        5,
        0,
        9
    );
    let (x0, u, p) = (vector![0.4, -0.7], vector![0.6], vector![1.3, 2.1]);
    identity!(Irk::<Everything, Gauss<3>>::new(options).expect("valid"), x0, u, 0.3, p, 2, 1, 2);
    identity!(Irk::<Everything, RadauIIA<2>>::new(options).expect("valid"), x0, u, 0.3, p, 2, 1, 2);
    let p = vector![9.81, 0.1];
    identity!(Irk::<Swing, Gauss<5>>::new(options).expect("valid"), x0, u, 0.3, p, 2, 1, 2);
    identity!(Erk::<Swing, Rk4>::new(options).expect("valid"), x0, u, 0.3, p, 2, 1, 2);
    identity!(Erk::<Swing, DormandPrince8>::new(options).expect("valid"), x0, u, 0.3, p, 2, 1, 2);
}

/// One step in complex numbers, `x₀ + i 1e-200 e_j`: the stages by fixed-point iteration, until
/// only rounding is left. Nothing of Newton's method or of its derivatives is in it.
fn complex_step<const S: usize>(x0: [f64; 2], u: f64, p: [f64; 2], h: f64, direction: usize) -> [f64; 2]
where
    Gauss<S>: Method<S>,
{
    type C = Complex<f64>;
    let tableau = <Gauss<S> as Method<S>>::TABLEAU;
    let mut w = [x0[0], x0[1], u, p[0], p[1]].map(C::from);
    w[direction].im = 1e-200;
    let mut k = [[C::from(0.0); 2]; S];
    for _ in 0..60 {
        k = core::array::from_fn(|i| {
            let xi: [C; 2] =
                core::array::from_fn(|c| w[c] + (0..S).map(|j| k[j][c] * tableau.a()[i][j]).sum::<C>() * h);
            let (zero, mut f) = (C::from(0.0), [C::from(0.0); 2]);
            Swing::residual_of::<C>(&[zero, zero, xi[0], xi[1], w[2], w[3], w[4], zero], &mut f);
            [-f[0], -f[1]]
        });
    }
    core::array::from_fn(|c| {
        let end = w[c] + (0..S).map(|j| k[j][c] * tableau.b()[j]).sum::<C>() * h;
        end.im / 1e-200
    })
}

#[test]
fn t15_complex_step_and_differences() {
    let (x0, u, p, h) = ([0.4, -0.7], 0.6, [9.81, 0.1], 0.1);
    let mut irk = Irk::<Swing, Gauss<4>>::new(Options::default()).expect("valid");
    irk.set_parameters(&p.into()).expect("finite");
    let step = *irk.forward(&x0.into(), &vector![u], h).expect("derivatives");
    let column = |direction: usize| match direction {
        0 | 1 => step.dx_dx0.column(direction).into_owned(),
        2 => step.dx_du.column(0).into_owned(),
        _ => step.dx_dp.column(direction - 3).into_owned(),
    };
    for direction in 0..5 {
        let expected = SVector::from(complex_step::<4>(x0, u, p, h, direction));
        let error = (column(direction) - expected).amax() / expected.amax();
        println!("{error:e}");
        assert!(error <= 1e-14, "direction {direction}: {error:e}");
        // Central differences: δ² of a third derivative, and ε/δ.
        let mut at = |sign: f64| {
            let mut w = [x0[0], x0[1], u, p[0], p[1]];
            w[direction] += sign * 6e-6;
            irk.set_parameters(&vector![w[3], w[4]]).expect("finite");
            irk.solve(&vector![w[0], w[1]], &vector![w[2]], h).expect("a step").x
        };
        let difference = (at(1.0) - at(-1.0)) / 12e-6;
        let error = (difference - expected).amax();
        assert!(error <= 1e-9, "direction {direction}: {error:e}");
    }
}

/// Bit by bit.
#[test]
fn t16_symmetry_of_hessians() {
    let (x0, u, p, lambda) = (vector![0.4, -0.7], vector![0.6], vector![1.3, 2.1], vector![0.3, -1.7]);
    macro_rules! check {
        ($integrator:expr, $end:expr) => {
            let mut integrator = $integrator.expect("valid");
            integrator.set_parameters(&p).expect("finite");
            let hessian = *integrator.hessian(&x0, &u, $end, &lambda).expect("second derivatives");
            assert_eq!(hessian.h_xx, hessian.h_xx.transpose());
            assert_eq!(hessian.h_pp, hessian.h_pp.transpose());
            assert!(hessian.h_xx.amax() > 1e-3);
        };
    }
    let options = Options { steps: 3, ..Default::default() };
    check!(Irk::<Everything, Gauss<3>>::new(options), 0.3);
    check!(Irk::<Everything, RadauIIA<4>>::new(options), 0.3);
    check!(Irk::<Swing, RadauIIA<2>>::new(options), 0.3);
    check!(Erk::<Swing, Rk4>::new(options), 0.3);
    check!(Adaptive::<Everything, Radau>::new(AdaptiveOptions::default()), 0.3);
}

/// Solutions of linear equations have no second derivatives by `x₀` and `u`, not even rounding
/// errors.
#[test]
fn t17_hessians_of_linear_equations() {
    let (x0, u, lambda) = (vector![1.0, -0.5], vector![0.8], vector![0.7, 0.9]);
    macro_rules! check {
        ($integrator:expr) => {
            let mut integrator = $integrator.expect("valid");
            let hessian = *integrator.hessian(&x0, &u, 3.0, &lambda).expect("second derivatives");
            assert!(hessian.h_xx.iter().chain(&hessian.h_xu).chain(&hessian.h_uu).all(|h| *h == 0.0));
        };
    }
    let options = Options { steps: 8, ..Default::default() };
    check!(Irk::<Oscillator, Gauss<4>>::new(options));
    check!(Irk::<Oscillator, RadauIIA<3>>::new(options));
    check!(Erk::<Oscillator, DormandPrince8>::new(options));
    check!(Adaptive::<Oscillator, Radau>::new(AdaptiveOptions::default()));
}

/// Derivatives that decay over many decades keep their sign and six digits each, down to 1e-12 of
/// the largest.
#[test]
fn t18_cancellation() {
    macro_rules! check {
        ($model:ty, $name:literal, $nx:literal, $np:literal, $x0:expr, $p:expr, $atol:expr) => {
            let set = Record::load("ivp/sensitivities.json").expect("the reference is there");
            for reference in set.records("first").expect("references") {
                if reference.text("name") != Ok($name) {
                    continue;
                }
                let options = AdaptiveOptions { rtol: 1e-12, atol: $atol, ..Default::default() };
                let mut adaptive = Adaptive::<$model, Radau>::new(options).expect("valid");
                adaptive.set_parameters(&$p).expect("finite");
                let t = reference.number("t").expect("t");
                let found = *adaptive.forward(&$x0, &SVector::zeros(), t).expect("derivatives");
                let by_x0 = reference.matrix::<$nx, $nx>("dx_dx0").expect("a matrix");
                let by_p = reference.matrix::<$nx, $np>("dx_dp").expect("a matrix");
                let by_x0 = (found.dx_dx0.as_slice(), by_x0.as_slice(), by_x0.amax());
                for (found, expected, largest) in
                    [by_x0, (found.dx_dp.as_slice(), by_p.as_slice(), by_p.amax())]
                {
                    let pairs = found.iter().zip(expected);
                    for (found, expected) in pairs.filter(|(_, expected)| expected.abs() > 1e-12 * largest) {
                        let error = (found - expected).abs() / expected.abs();
                        assert!(
                            error <= 1e-6,
                            "{} at {t:e}: {found} instead of {expected}, {error:e}",
                            $name
                        );
                    }
                }
            }
        };
    }
    check!(Robertson, "robertson", 3, 3, vector![1.0, 0.0, 0.0], vector![0.04, 3e7, 1e4], 1e-20);
    check!(VanDerPol, "van_der_pol_1e3", 2, 1, vector![2.0, 0.0], vector![1e3], 1e-15);
}

/// Derivatives are those at the stages that the iteration found. If it stops short by `δ`, they are
/// off by the second derivatives times that.
#[test]
fn t19_derivatives_of_inexact_stages() {
    let (x0, u, p, h) = (vector![0.4, -0.7], vector![0.6], vector![9.81, 0.1], 0.2);
    let run = |fixed_iterations: Option<usize>| {
        let newton = Newton { fixed_iterations, ..Default::default() };
        let mut irk = Irk::<Swing, Gauss<3>>::new(Options { newton, ..Default::default() }).expect("valid");
        irk.set_parameters(&p).expect("finite");
        *irk.hessian(&x0, &u, h, &vector![1.0, 1.0]).expect("derivatives")
    };
    let converged = run(None);
    let mut before = f64::INFINITY;
    for iterations in 1..=4 {
        let found = run(Some(iterations));
        let left = (found.x - converged.x).amax();
        let error = (found.dx_dx0 - converged.dx_dx0).amax();
        println!("{iterations} iterations: x off by {left:e}, its derivatives by {error:e}");
        assert!(left < before || left <= 4.0 * f64::EPSILON);
        before = left;
        // x is the sum of h b k, and the derivative of f is Lipschitz with a constant of g/l =
        // 9.81: an error of the stages δ = left/h changes it by h p₀ δ h, and each solve of the
        // stages at most doubles that.
        assert!(error <= 2.0 * 9.81 * left + 16.0 * f64::EPSILON, "{iterations}: {error:e} {left:e}");
    }
    assert!(before <= 4.0 * f64::EPSILON);
}

/// Ten thousand steps turn the oscillator by ten thousand angles of `R(ih)`, and so are their
/// derivatives.
#[test]
fn derivatives_through_ten_thousand_steps() {
    const STEPS: usize = 10_000;
    let h = 0.1f64;
    let mut irk =
        Irk::<Oscillator, Gauss<2>>::new(Options { steps: STEPS, ..Default::default() }).expect("valid");
    let step = *irk.forward(&vector![1.0, 0.0], &vector![0.0], h * STEPS as f64).expect("derivatives");
    // R(z) = (1 + z/2 + z²/12)/(1 − z/2 + z²/12)
    let angle = 2.0 * (h / 2.0).atan2(1.0 - h * h / 12.0) * STEPS as f64;
    let (sin, cos) = angle.sin_cos();
    let expected = nalgebra::matrix![cos, sin; -sin, cos];
    let error = (step.dx_dx0 - expected).amax();
    println!("{error:e}");
    // Each step rounds twice or so; the angle is known to its own ε.
    assert!(error <= 2.0 * STEPS as f64 * f64::EPSILON, "{error:e}");
    let same = (step.x - step.dx_dx0.column(0)).amax();
    assert!(same <= 2.0 * STEPS as f64 * f64::EPSILON, "{same:e}");
    // By u: a circle around (u, 0).
    let expected = vector![1.0 - cos, sin];
    assert!((step.dx_du.column(0) - expected).amax() <= 4.0 * STEPS as f64 * f64::EPSILON);
}
