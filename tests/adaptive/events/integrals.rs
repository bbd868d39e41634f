//! Integrals over events, with their derivatives.

use super::*;

/// Potential and kinetic energy, of which the second jumps.
#[function]
fn energies(x: [f64; 2], p: [f64; 2]) -> [f64; 2] {
    [p[0] * x[0], x[1] * x[1]]
}

#[function]
fn speed(x: [f64; 2], _p: [f64; 2]) -> f64 {
    x[1]
}

/// The parts between bounces: height and velocity at the start of each, and its start and end.
fn bounce_segments(w: [Complex<f64>; 4], n: usize, t: f64) -> Vec<[Complex<f64>; 4]> {
    let [height, velocity, gravity, restitution] = w;
    let (mut times, _) = bouncing(w, n, t);
    times.push(Complex::new(t, 0.0));
    let mut list = vec![[height, velocity, Complex::new(0.0, 0.0), times[0]]];
    let mut up = (velocity * velocity + gravity * height * 2.0).sqrt();
    for k in 1..=n {
        up *= restitution;
        list.push([Complex::new(0.0, 0.0), up, times[k - 1], times[k]]);
    }
    list
}

/// The integrals of `energies`.
fn integrals(w: [Complex<f64>; 4], n: usize, t: f64) -> [Complex<f64>; 2] {
    let g = w[2];
    bounce_segments(w, n, t).into_iter().fold([Complex::new(0.0, 0.0); 2], |[a, b], [h, v, start, end]| {
        let d = end - start;
        let height = h * d + v * d * d * 0.5 - g * d * d * d / 6.0;
        [a + g * height, b + v * v * d - v * g * d * d + g * g * d * d * d / 3.0]
    })
}

/// `∫ (dv/dw)ᵀ (dv/dw) dt`, where the velocity is linear in time on each part.
fn squares(w: [f64; 4], n: usize, t: f64) -> [[f64; 4]; 4] {
    let mut h = [[0.0; 4]; 4];
    for k in 0..=n {
        // v = v_a − g (t − t_a)
        let (part, slopes) = differentiate(w, |w| bounce_segments(w, n, t)[k]);
        let a: [f64; 4] = core::array::from_fn(|i| slopes[1][i] + w[2] * slopes[2][i]);
        let (b, d) = ([0.0, 0.0, -1.0, 0.0], part[3] - part[2]);
        for i in 0..4 {
            for j in 0..4 {
                let mixed = a[i] * b[j] + b[i] * a[j];
                h[i][j] += a[i] * a[j] * d + mixed * d * d / 2.0 + b[i] * b[j] * d.powi(3) / 3.0;
            }
        }
    }
    h
}

macro_rules! integrals_over_bounces {
    ($method:ty) => {{
        let event = Event::jump::<Height, Bounce>(Crossing::Falling);
        let adaptive = Adaptive::<Ball, $method>::new(options(1e-8)).unwrap();
        let mut hybrid = Hybrid::new(adaptive, &[event]).unwrap();
        let (x0, p, u) = (vector![1.3, 0.4], vector![9.81, 0.8], vector![]);
        hybrid.integrator().set_parameters(&p).unwrap();
        let w = [x0[0], x0[1], p[0], p[1]];
        let (lambda, nu) = (vector![0.7, -1.2], vector![0.3, -0.2]);
        for (n, t_end) in [(1, 0.9), (3, 2.4)] {
            let (value, derivative) = differentiate(w, |w| integrals(w, n, t_end));
            let mut integral = Quadrature::<Energies>::new();
            integral.nu = nu;
            assert_eq!(hybrid.with(&mut integral).solve(&x0, &u, t_end).unwrap().occurrences.len(), n);
            assert_close(integral.q, value, ROUNDING);
            let forward = hybrid.with(&mut integral).forward(&x0, &u, t_end).unwrap();
            assert_close(integral.q, value, ROUNDING);
            for (row, expected) in derivative.iter().enumerate() {
                let x = [integral.dq_dx0[(row, 0)], integral.dq_dx0[(row, 1)]];
                assert_close(x, &expected[..2], 10.0 * ROUNDING);
                assert_close(
                    [integral.dq_dp[(row, 0)], integral.dq_dp[(row, 1)]],
                    &expected[2..],
                    10.0 * ROUNDING,
                );
            }
            let expected_x = forward.dx_dx0.transpose() * lambda + integral.dq_dx0.transpose() * nu;
            let expected_p = forward.dx_dp.transpose() * lambda + integral.dq_dp.transpose() * nu;
            let adjoint = hybrid.with(&mut integral).adjoint(&x0, &u, t_end, &lambda).unwrap();
            assert_close(adjoint.grad_x0, expected_x, 10.0 * ROUNDING);
            assert_close(adjoint.grad_p, expected_p, 10.0 * ROUNDING);
            assert_close(integral.q, value, ROUNDING);

            let mut fit = LeastSquares::<Speed>::new(&matrix![3.0]);
            hybrid.with(&mut fit).forward(&x0, &u, t_end).unwrap();
            assert_close([fit.value], [1.5 * value[1]], ROUNDING);
            let gradient = derivative[1].map(|d| 1.5 * d);
            assert_close(fit.grad_x0, &gradient[..2], 10.0 * ROUNDING);
            assert_close(fit.grad_p, &gradient[2..], 10.0 * ROUNDING);
            let h = squares(w, n, t_end);
            for i in 0..2 {
                for j in 0..2 {
                    let found = [fit.h_xx[(i, j)], fit.h_xp[(i, j)], fit.h_pp[(i, j)]];
                    let expected = [h[i][j], h[i][2 + j], h[2 + i][2 + j]];
                    assert_close(found, expected.map(|h| 3.0 * h), 10.0 * ROUNDING);
                }
            }
            let adjoint = hybrid.with(&mut fit).adjoint(&x0, &u, t_end, &vector![0.0, 0.0]).unwrap();
            assert_close(adjoint.grad_x0, &gradient[..2], 10.0 * ROUNDING);
            assert_close(adjoint.grad_p, &gradient[2..], 10.0 * ROUNDING);
        }
    }};
}

#[test]
fn integrals_over_a_bouncing_ball() {
    integrals_over_bounces!(Radau);
    integrals_over_bounces!(Gauss<2>);
    integrals_over_bounces!(DormandPrince8);
}

/// Up to where the ball lands, the kinetic energy: the gradient has the upper limit.
#[test]
fn integrals_up_to_an_event() {
    let event = Event::terminal::<Height>(Crossing::Falling);
    let mut hybrid = Hybrid::new(Adaptive::<Ball, Radau>::new(options(1e-8)).unwrap(), &[event]).unwrap();
    hybrid.integrator().set_parameters(&vector![9.81, 0.8]).unwrap();
    let (value, derivative) = differentiate([1.3, 0.4, 9.81, 0.8], |w| {
        let [h, v, start, end] = bounce_segments(w, 1, 9.0)[0];
        let (d, g) = (end - start, w[2]);
        [v * v * d - v * g * d * d + g * g * d * d * d / 3.0 + h * 0.0]
    });
    let mut fit = LeastSquares::<Speed>::new(&matrix![2.0]);
    let solution = hybrid.with(&mut fit).forward(&vector![1.3, 0.4], &vector![], 9.0).unwrap().solution;
    assert!(solution.terminal);
    assert_close([fit.value], value, ROUNDING);
    assert_close(fit.grad_x0, &derivative[0][..2], 10.0 * ROUNDING);
    assert_close(fit.grad_p, &derivative[0][2..], 10.0 * ROUNDING);
    let adjoint =
        hybrid.with(&mut fit).adjoint(&vector![1.3, 0.4], &vector![], 9.0, &vector![0.0, 0.0]).unwrap();
    assert_close(adjoint.grad_x0, &derivative[0][..2], 10.0 * ROUNDING);
    assert_close(adjoint.grad_p, &derivative[0][2..], 10.0 * ROUNDING);
}
