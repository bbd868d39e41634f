//! Least squares along the solution: values, gradients, the matrix of Gauss and Newton.

use super::*;

#[function]
fn residuals(x: f64, u: f64, p: f64) -> [f64; 2] {
    [x - 0.3, 0.5 * u + p]
}

const DURATION: f64 = 1.3;

/// With `u = 0`, `x = x₀ e^{−pt}` and `r = (x − 0.3, p)`:
///
/// ```text
/// ∫ r₀ r₀ = x₀² e₂ − 0.6 x₀ e₁ + 0.09 T        e_k = (1 − e^{−kpT})/(kp)
/// dr₀/dx₀ = e^{−pt}, dr₀/du = (1 − e^{−pt})/p, dr₀/dp = −t x₀ e^{−pt}
/// ```
struct ExactLeastSquares {
    value: f64,
    grad: [f64; 3],
    hessian: [[f64; 3]; 3],
}

fn exact_least_squares(x0: f64, p: f64, w: [[f64; 2]; 2]) -> ExactLeastSquares {
    let n = 400;
    let mut exact = ExactLeastSquares { value: 0.0, grad: [0.0; 3], hessian: [[0.0; 3]; 3] };
    // Boole's rule on 400 pieces of length 0.003: an error of (0.003)^6.
    let boole = [7.0, 32.0, 12.0, 32.0, 7.0];
    for piece in 0..n {
        for (node, weight) in boole.iter().enumerate() {
            let h = DURATION / f64::from(n);
            let t = h * (f64::from(piece) + node as f64 / 4.0);
            let weight = weight * h / 90.0;
            let e = (-p * t).exp();
            let r = [x0 * e - 0.3, p];
            let d = [[e, 0.0], [(1.0 - e) / p, 0.5], [-t * x0 * e, 1.0]];
            for k in 0..2 {
                for l in 0..2 {
                    exact.value += 0.5 * weight * r[k] * w[k][l] * r[l];
                    for i in 0..3 {
                        exact.grad[i] += weight * d[i][k] * w[k][l] * r[l];
                        for j in 0..3 {
                            exact.hessian[i][j] += weight * d[i][k] * w[k][l] * d[j][l];
                        }
                    }
                }
            }
        }
    }
    exact
}

fn assert_least_squares(found: &LeastSquares<Residuals>, exact: &ExactLeastSquares, tolerance: f64) {
    assert_close([found.value], [exact.value], tolerance);
    assert_close([found.grad_x0[0], found.grad_u[0], found.grad_p[0]], exact.grad, tolerance);
    assert_close(
        [found.h_xx[0], found.h_xu[0], found.h_uu[0], found.h_xp[0], found.h_up[0], found.h_pp[0]],
        [
            exact.hessian[0][0],
            exact.hessian[0][1],
            exact.hessian[1][1],
            exact.hessian[0][2],
            exact.hessian[1][2],
            exact.hessian[2][2],
        ],
        tolerance,
    );
}

#[test]
fn closed_form_of_least_squares() {
    let (x0, u, p) = (vector![1.4], vector![0.0], vector![0.9]);
    let w = [[2.0, 0.5], [0.5, 3.0]];
    let weights = matrix![2.0, 0.5; 0.5, 3.0];
    let exact = exact_least_squares(x0[0], p[0], w);

    let mut fit = LeastSquares::<Residuals>::new(&weights);
    let mut irk = Irk::<Decay, Gauss<4>>::new(Options { steps: 6, ..Default::default() }).unwrap();
    irk.set_parameters(&p).unwrap();
    irk.with(&mut fit).forward(&x0, &u, DURATION).unwrap();
    // Order eight with steps of 0.2: 1e-12.
    assert_least_squares(&fit, &exact, 1e-11);

    let mut fit = LeastSquares::<Residuals>::new(&weights);
    let mut erk = Erk::<Decay, DormandPrince8>::new(Options { steps: 12, ..Default::default() }).unwrap();
    erk.set_parameters(&p).unwrap();
    erk.with(&mut fit).forward(&x0, &u, DURATION).unwrap();
    assert_least_squares(&fit, &exact, 1e-11);

    let options = AdaptiveOptions { rtol: 1e-11, atol: 1e-12, ..Default::default() };
    let mut fit = LeastSquares::<Residuals>::new(&weights);
    let mut radau = Adaptive::<Decay, Radau>::new(options).unwrap();
    radau.set_parameters(&p).unwrap();
    radau.with(&mut fit).forward(&x0, &u, DURATION).unwrap();
    assert_least_squares(&fit, &exact, 1e-9);
    let mut fit = LeastSquares::<Residuals>::new(&weights);
    let mut pair = Adaptive::<Decay, DormandPrince8>::new(options).unwrap();
    pair.set_parameters(&p).unwrap();
    pair.with(&mut fit).forward(&x0, &u, DURATION).unwrap();
    assert_least_squares(&fit, &exact, 1e-9);
}

/// Of a linear model and residual the matrix of Gauss and Newton is the exact Hessian.
#[ode]
fn linear(x: [f64; 2], u: f64, t: f64) -> [f64; 2] {
    [x[1] * (1.0 + t), -2.0 * x[0] - 0.3 * x[1] + u]
}

#[function]
fn tracking(x: [f64; 2], u: f64) -> [f64; 3] {
    [x[0] - 1.0, 0.4 * x[1] + 0.2 * u, 0.1 * u]
}

#[test]
fn gauss_newton_of_linear_problems() {
    let weights = matrix![2.0, 0.5, 0.0; 0.5, 3.0, -0.1; 0.0, -0.1, 1.0];
    let (x0, u, zero) = (vector![0.4, -0.2], vector![0.7], vector![0.0, 0.0]);
    let mut fit = LeastSquares::<Tracking>::new(&weights);
    let mut irk = Irk::<Linear, RadauIIA<3>>::new(Options { steps: 3, ..Default::default() }).unwrap();
    let hessian = *irk.with(&mut fit).hessian(&x0, &u, 0.9, &zero).unwrap();
    assert_close(hessian.h_xx, fit.h_xx, ROUNDING);
    assert_close(hessian.h_xu, fit.h_xu, ROUNDING);
    assert_close(hessian.h_uu, fit.h_uu, ROUNDING);
    assert_close(hessian.grad_x0, fit.grad_x0, ROUNDING);
    assert_close(hessian.grad_u, fit.grad_u, ROUNDING);
    assert!(fit.h_xx.determinant() > 0.1);
    // φ is quadratic: φ(w + d) = φ(w) + gᵀd + dᵀHd/2.
    let d = vector![0.5, -1.5];
    let mut moved = LeastSquares::<Tracking>::new(&weights);
    irk.with(&mut moved).solve(&(x0 + d), &u, 0.9).unwrap();
    let expected = fit.value + fit.grad_x0.dot(&d) + 0.5 * (d.transpose() * fit.h_xx * d)[0];
    assert_close([moved.value], [expected], ROUNDING);

    let mut erk = Erk::<Linear, Rk4>::new(Options { steps: 3, ..Default::default() }).unwrap();
    let hessian = *erk.with(&mut fit).hessian(&x0, &u, 0.9, &zero).unwrap();
    assert_close(hessian.h_xx, fit.h_xx, ROUNDING);
    assert_close(hessian.h_xu, fit.h_xu, ROUNDING);
    assert_close(hessian.h_uu, fit.h_uu, ROUNDING);
}

/// Least squares over several intervals: gradients and exact second derivatives against differences
/// of the same steps.
#[test]
fn least_squares_over_piecewise_constant_controls() {
    let controls = [vector![0.3], vector![-0.8], vector![0.5]];
    let ends = [0.4, 0.9, 1.2];
    let mut fit = LeastSquares::<Outputs>::new(&matrix![1.5, 0.2; 0.2, 0.7]);
    let mut horizon = Piecewise::new(Adaptive::<Swing, Gauss<3>>::new(AdaptiveOptions::default()).unwrap());
    horizon.integrator().set_parameters(&P).unwrap();
    horizon.solve(&X0, &controls, &ends).unwrap();
    horizon.freeze().unwrap();
    let (found, integral) = horizon.with(&mut fit).hessian(&X0, &controls, &ends, &LAMBDA).unwrap();
    let adjoint = horizon.with(&mut fit).adjoint(&X0, &controls, &ends, &LAMBDA).unwrap();
    let forward = &found.forward;
    assert_close(found.adjoint.grad_x0, adjoint.grad_x0, ROUNDING);
    assert_close(found.adjoint.grad_p, adjoint.grad_p, ROUNDING);
    assert_close(forward.dx_dx0.transpose() * LAMBDA + integral.grad_x0, adjoint.grad_x0, ROUNDING);
    assert_close(forward.dx_dp.transpose() * LAMBDA + integral.grad_p, adjoint.grad_p, ROUNDING);
    for k in 0..3 {
        assert_close(forward.dx_du[k].transpose() * LAMBDA + integral.grad_u[k], adjoint.grad_u[k], ROUNDING);
        let mut moved = |delta: f64| {
            let mut controls = controls;
            controls[k][0] += delta;
            let adjoint = horizon.with(&mut fit).adjoint(&X0, &controls, &ends, &LAMBDA).unwrap();
            let u = adjoint.grad_u;
            [
                adjoint.grad_x0[0],
                adjoint.grad_x0[1],
                u[0][0],
                u[1][0],
                u[2][0],
                adjoint.grad_p[0],
                adjoint.grad_p[1],
            ]
        };
        // Order four with steps of 1e-3: errors of 1e-12 of the value, and as much by rounding.
        let e = 1e-3;
        let values = [-2.0, -1.0, 1.0, 2.0].map(|s| moved(s * e));
        let difference: [f64; 7] = core::array::from_fn(|i| {
            (values[0][i] - 8.0 * values[1][i] + 8.0 * values[2][i] - values[3][i]) / (12.0 * e)
        });
        let uu = |j: usize| found.h_uu[3 * j + k][0];
        let (xu, up) = (found.h_xu[k], found.h_up[k]);
        assert_close(difference, [xu[0], xu[1], uu(0), uu(1), uu(2), up[0], up[1]], 1e-9);
    }
}

#[function]
fn deviation(x: f64, u: f64, _p: f64) -> [f64; 2] {
    [x, 0.5 * u - x]
}

/// Where nothing is curved, the matrix of Gauss and Newton is the Hessian: to rounding, of sums of
/// a few dozen terms. The product `p x` is curved, so that only `x₀` and the controls count.
#[test]
fn gauss_newton_matrix_over_piecewise_constant_controls() {
    let mut fit = LeastSquares::<Deviation>::new(&matrix![1.0, 0.1; 0.1, 0.4]);
    let mut horizon = Piecewise::new(Adaptive::<Decay, Radau>::new(AdaptiveOptions::default()).unwrap());
    horizon.integrator().set_parameters(&vector![0.7]).unwrap();
    let (controls, ends) = ([vector![0.3], vector![-0.2]], [0.5, 1.3]);
    let (exact, integral) =
        horizon.with(&mut fit).hessian(&vector![1.2], &controls, &ends, &vector![0.0]).unwrap();
    assert_close(integral.h_xx, exact.h_xx, ROUNDING);
    for k in 0..2 {
        assert!(exact.h_xu[k][0].abs() > 1e-3);
        assert_close(integral.h_xu[k], exact.h_xu[k], ROUNDING);
    }
    for k in 0..4 {
        assert_close(integral.h_uu[k], exact.h_uu[k], ROUNDING);
    }
    let (_, again) = horizon.with(&mut fit).forward(&vector![1.2], &controls, &ends).unwrap();
    assert_eq!(again, integral);
}
