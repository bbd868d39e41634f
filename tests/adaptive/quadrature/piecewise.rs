//! Integrals over piecewise constant controls.

use super::*;

/// Over several intervals with controls of their own: what the integrals are as states.
#[test]
fn integrals_over_piecewise_constant_controls() {
    let controls = [0.3, -0.7, 1.1].map(Vector1::new);
    let ends = [0.4, 0.9, 1.2];
    let nu = vector![0.9, -0.5];
    let options = AdaptiveOptions { rtol: 1e-11, atol: 1e-12, ..Default::default() };
    let mut horizon = Piecewise::new(Adaptive::<Swing, Radau>::new(options).unwrap());
    horizon.integrator().set_parameters(&P).unwrap();
    let mut states = Piecewise::new(Adaptive::<WithStates, Radau>::new(options).unwrap());
    states.integrator().set_parameters(&P).unwrap();
    let start = vector![X0[0], X0[1], 0.0, 0.0];
    let lambda = vector![LAMBDA[0], LAMBDA[1], nu[0], nu[1]];
    let expected = states.adjoint(&start, &controls, &ends, &lambda).unwrap();

    let mut integral = Quadrature::<Outputs>::new();
    integral.nu = nu;
    let end = horizon.with(&mut integral).solve(&X0, &controls, &ends).unwrap().x;
    let q = integral.q;
    let found = horizon.with(&mut integral).adjoint(&X0, &controls, &ends, &LAMBDA).unwrap();
    assert_eq!((found.nominal.x, integral.q), (end, q));
    // Two sequences of a dozen steps, each with an error of 1e-11 of numbers around one.
    let close = |a: f64, b: f64| assert!((a - b).abs() <= 1e-9 * b.abs().max(1.0), "{a} {b}");
    for i in 0..2 {
        close(q[i], expected.nominal.x[2 + i]);
        close(found.grad_x0[i], expected.grad_x0[i]);
        close(found.grad_p[i], expected.grad_p[i]);
    }
    for (found, expected) in found.grad_u.iter().zip(&expected.grad_u) {
        close(found[0], expected[0]);
    }
    // Of the same steps, exactly: the gradient is that of what is computed.
    horizon.freeze().unwrap();
    let mut value = |delta: f64| {
        let mut moved = controls;
        moved[1][0] += delta;
        let x = horizon.with(&mut integral).solve(&X0, &moved, &ends).unwrap().x;
        LAMBDA.dot(&x) + nu.dot(&integral.q)
    };
    let delta = 1e-3;
    let difference =
        (8.0 * (value(delta) - value(-delta)) - (value(2.0 * delta) - value(-2.0 * delta))) / (12.0 * delta);
    // Truncation δ⁴ f⁽⁵⁾/30, rounding ε/δ.
    assert!((difference - found.grad_u[1][0]).abs() <= 1e-11, "{difference} {}", found.grad_u[1][0]);
}

/// The same with all derivatives: those of the integrals as states, of the same tolerance.
#[test]
fn derivatives_of_integrals_over_piecewise_constant_controls() {
    let controls = [vector![0.3], vector![-0.8], vector![0.5]];
    let ends = [0.4, 0.9, 1.2];
    let options = AdaptiveOptions { rtol: 1e-11, atol: 1e-12, ..Default::default() };
    let mut horizon = Piecewise::new(Adaptive::<Swing, Radau>::new(options).unwrap());
    horizon.integrator().set_parameters(&P).unwrap();
    let mut states = Piecewise::new(Adaptive::<WithStates, Radau>::new(options).unwrap());
    states.integrator().set_parameters(&P).unwrap();
    let start = vector![X0[0], X0[1], 0.0, 0.0];
    let lambda = vector![LAMBDA[0], LAMBDA[1], NU[0], NU[1]];
    let expected = states.hessian(&start, &controls, &ends, &lambda).unwrap();
    // Two sequences of a dozen steps, each with an error of 1e-11 of numbers around one; of second
    // derivatives around ten.
    let close = |a: f64, b: f64| assert!((a - b).abs() <= 1e-8 * b.abs().max(1.0), "{a} {b}");

    let mut integral = Quadrature::<Outputs>::new();
    integral.nu = NU;
    let (forward, first) = horizon.with(&mut integral).forward(&X0, &controls, &ends).unwrap();
    let (found, second) = horizon.with(&mut integral).hessian(&X0, &controls, &ends, &LAMBDA).unwrap();
    assert_eq!((&found.forward, &second), (&forward, &first));
    assert_eq!(forward, horizon.forward(&X0, &controls, &ends).unwrap());
    assert_eq!(integral.dq_dx0, matrix![0.0, 0.0; 0.0, 0.0]);
    for i in 0..2 {
        close(integral.q[i], expected.forward.nominal.x[2 + i]);
        for j in 0..2 {
            close(first.dq_dx0[(i, j)], expected.forward.dx_dx0[(2 + i, j)]);
            close(first.dq_dp[(i, j)], expected.forward.dx_dp[(2 + i, j)]);
            close(found.h_xx[(i, j)], expected.h_xx[(i, j)]);
            close(found.h_xp[(i, j)], expected.h_xp[(i, j)]);
            close(found.h_pp[(i, j)], expected.h_pp[(i, j)]);
        }
        for k in 0..3 {
            close(first.dq_du[k][i], expected.forward.dx_du[k][2 + i]);
            close(found.h_xu[k][i], expected.h_xu[k][i]);
            close(found.h_up[k][i], expected.h_up[k][i]);
        }
        close(found.adjoint.grad_x0[i], expected.adjoint.grad_x0[i]);
        close(found.adjoint.grad_p[i], expected.adjoint.grad_p[i]);
    }
    for (found, expected) in found.h_uu.iter().zip(&expected.h_uu) {
        close(found[0], expected[0]);
    }
    for (found, expected) in found.adjoint.grad_u.iter().zip(&expected.adjoint.grad_u) {
        close(found[0], expected[0]);
    }
}
