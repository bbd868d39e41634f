//! Second derivatives over events, and steps and events that are kept.

use super::*;

/// Central differences of order eight.
fn difference<const N: usize>(h: f64, mut f: impl FnMut(f64) -> [f64; N]) -> [f64; N] {
    let mut sum = [0.0; N];
    for (k, weight) in [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0].into_iter().enumerate() {
        let step = (k + 1) as f64 * h;
        for (sum, (above, below)) in sum.iter_mut().zip(f(step).into_iter().zip(f(-step))) {
            *sum += weight * (above - below) / h;
        }
    }
    sum
}

/// All second derivatives over `(x₀, p)` as one matrix.
fn all(hessian: &HybridHessian<Ball>) -> [[f64; 4]; 4] {
    let (xx, xp, pp) = (&hessian.h_xx, &hessian.h_xp, &hessian.h_pp);
    core::array::from_fn(|i| {
        core::array::from_fn(|j| match (i < 2, j < 2) {
            (true, true) => xx[(i, j)],
            (true, false) => xp[(i, j - 2)],
            (false, true) => xp[(j, i - 2)],
            (false, false) => pp[(i - 2, j - 2)],
        })
    })
}

macro_rules! second_over_bounces {
    ($method:ty) => {{
        let event = Event::jump::<Height, Bounce>(Crossing::Falling);
        let adaptive = Adaptive::<Ball, $method>::new(options(1e-8)).unwrap();
        let mut hybrid = Hybrid::new(adaptive, &[event]).unwrap();
        let (x0, p, u) = (vector![1.3, 0.4], vector![9.81, 0.8], vector![]);
        hybrid.integrator().set_parameters(&p).unwrap();
        let (w, lambda) = ([x0[0], x0[1], p[0], p[1]], vector![0.7, -1.2]);
        for (n, t_end) in [(1, 0.9), (2, 1.8), (3, 2.4)] {
            let hessian = hybrid.hessian(&x0, &u, t_end, &lambda).unwrap();
            assert_eq!(hessian.forward, hybrid.forward(&x0, &u, t_end).unwrap());
            let adjoint = hybrid.adjoint(&x0, &u, t_end, &lambda).unwrap();
            assert_close(hessian.adjoint.grad_x0, adjoint.grad_x0, ROUNDING);
            assert_close(hessian.adjoint.grad_p, adjoint.grad_p, ROUNDING);
            for (direction, found) in all(&hessian).iter().enumerate() {
                // Of a gradient that is exact: h⁸ times a ninth derivative over 630, and ε/h, of
                // numbers up to a few hundred.
                let expected = difference(1e-2, |step| {
                    let mut w = w;
                    w[direction] += step;
                    let slopes = differentiate(w, |w| bouncing(w, n, t_end).1).1;
                    core::array::from_fn::<_, 4, _>(|i| lambda[0] * slopes[0][i] + lambda[1] * slopes[1][i])
                });
                assert_close(found, expected, 1e-9);
            }
        }
    }};
}

#[test]
fn hessian_of_a_bouncing_ball() {
    second_over_bounces!(Radau);
    second_over_bounces!(Gauss<2>);
    second_over_bounces!(DormandPrince5);
}

/// The ball, with its equations in another order and multiplied by numbers.
#[dae]
fn rearranged(xdot: [f64; 2], x: [f64; 2], p: [f64; 2]) -> [f64; 2] {
    [-2.0 * (xdot[1] + p[0]), 3.0 * xdot[0] - 3.0 * x[1]]
}

/// Explicit models are solved for their rates equation by equation, whatever the order.
#[test]
fn equations_in_any_order() {
    let (x0, p, lambda) = (vector![1.3, 0.4], vector![9.81, 0.8], vector![0.7, -1.2]);
    macro_rules! hessian {
        ($model:ty) => {{
            let event = Event::jump::<Height, Bounce>(Crossing::Falling);
            let adaptive = Adaptive::<$model, Radau>::new(options(1e-8)).unwrap();
            let mut hybrid = Hybrid::new(adaptive, &[event]).unwrap();
            hybrid.integrator().set_parameters(&p).unwrap();
            let hessian = hybrid.hessian(&x0, &vector![], 1.8, &lambda).unwrap();
            (hessian.forward.dx_dx0, hessian.h_xx, hessian.h_xp, hessian.h_pp)
        }};
    }
    let (found, expected) = (hessian!(Rearranged), hessian!(Ball));
    assert_close(found.0.as_slice(), expected.0.as_slice(), ROUNDING);
    assert_close(found.1.as_slice(), expected.1.as_slice(), ROUNDING);
    assert_close(found.2.as_slice(), expected.2.as_slice(), ROUNDING);
    assert_close(found.3.as_slice(), expected.3.as_slice(), ROUNDING);
}

/// Where it lands: the velocity `−√(v² + 2gh)`.
#[test]
fn hessian_up_to_an_event() {
    let event = Event::terminal::<Height>(Crossing::Falling);
    let mut hybrid = Hybrid::new(Adaptive::<Ball, Radau>::new(options(1e-8)).unwrap(), &[event]).unwrap();
    hybrid.integrator().set_parameters(&vector![9.81, 0.8]).unwrap();
    let (h, v, g) = (1.3, 0.4, 9.81_f64);
    let hessian = hybrid.hessian(&vector![h, v], &vector![], 9.0, &vector![0.5, 1.0]).unwrap();
    // s = √(v² + 2gh): s_hh = −g²/s³, s_hv = −gv/s³, s_vv = 2gh/s³, s_hg = 1/s − gh/s³, s_vg =
    // −vh/s³, s_gg = −h²/s³. The height is zero whatever happens.
    let s = (v * v + 2.0 * g * h).sqrt();
    let c = s.powi(3);
    let (hh, hv, vv) = (-g * g / c, -g * v / c, 2.0 * g * h / c);
    let (hg, vg, gg) = (1.0 / s - g * h / c, -v * h / c, -h * h / c);
    let expected = [[hh, hv, hg, 0.0], [hv, vv, vg, 0.0], [hg, vg, gg, 0.0], [0.0; 4]];
    for (found, expected) in all(&hessian).iter().zip(expected) {
        assert_close(found, expected.map(|s| -s), ROUNDING);
    }
}

/// A pendulum with friction and an algebraic state that is pushed, between walls that depend on
/// everything.
#[dae]
fn pushed(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
    [
        xdot[0] - x[1],
        xdot[1] + z + 0.1 * p[1] * x[1] * x[1] - u * x[0].cos(),
        z * (1.0 + 0.1 * u * x[1]) - p[0] * x[0].sin(),
    ]
}

#[function]
fn wall(x: [f64; 2], _z: f64, u: f64, p: [f64; 2]) -> f64 {
    0.4 + 0.1 * p[1] - x[0] - 0.1 * x[0] * x[1] * u + 0.05 * x[1] * x[1]
}

#[function]
fn rebound(x: [f64; 2], _z: f64, u: f64, p: [f64; 2]) -> [f64; 2] {
    [x[0] - 0.05 * u * x[1] * x[1], -0.8 * x[1] * p[1] + 0.1 * u * p[0] * x[0]]
}

fn between_walls(options: AdaptiveOptions) -> Hybrid<Pushed, Radau, f64> {
    let event = Event::jump::<Wall, Rebound>(Crossing::Falling);
    Hybrid::new(Adaptive::<Pushed, Radau>::new(options).unwrap(), &[event]).unwrap()
}

const W: [f64; 5] = [0.1, 1.1, 0.4, 2.1, 0.9];
const END: f64 = 4.0;

/// `(λᵀx, gradient)` over `(x₀, u, p)`.
fn gradient(hybrid: &mut Hybrid<Pushed, Radau, f64>, w: [f64; 5]) -> [f64; 6] {
    let lambda = vector![0.7, -1.2];
    hybrid.integrator().set_parameters(&vector![w[3], w[4]]).unwrap();
    let found = hybrid.adjoint(&vector![w[0], w[1]], &vector![w[2]], END, &lambda).unwrap();
    assert_eq!(found.solution.occurrences.len(), 2);
    let (x, u, p) = (found.grad_x0, found.grad_u, found.grad_p);
    [lambda.dot(&found.solution.nominal.x), x[0], x[1], u[0], p[0], p[1]]
}

/// Against differences of the gradient of order eight. Their errors are those of gradients, 1e-11
/// times the condition of two events over `h = 5e-3`, and a ninth derivative times `h⁸/630`.
#[test]
fn hessian_over_events_of_all_arguments() {
    let mut hybrid = between_walls(AdaptiveOptions { rtol: 1e-12, atol: 1e-13, ..Default::default() });
    hybrid.integrator().set_parameters(&vector![W[3], W[4]]).unwrap();
    let found = hybrid.hessian(&vector![W[0], W[1]], &vector![W[2]], END, &vector![0.7, -1.2]).unwrap();
    let (xx, xu, uu, xp, up, pp) = (found.h_xx, found.h_xu, found.h_uu, found.h_xp, found.h_up, found.h_pp);
    let rows = [
        [xx[(0, 0)], xx[(0, 1)], xu[0], xp[(0, 0)], xp[(0, 1)]],
        [xx[(1, 0)], xx[(1, 1)], xu[1], xp[(1, 0)], xp[(1, 1)]],
        [xu[0], xu[1], uu[0], up[0], up[1]],
        [xp[(0, 0)], xp[(1, 0)], up[0], pp[(0, 0)], pp[(0, 1)]],
        [xp[(0, 1)], xp[(1, 1)], up[1], pp[(1, 0)], pp[(1, 1)]],
    ];
    for (direction, row) in rows.iter().enumerate() {
        let expected = difference(5e-3, |step| {
            let mut w = W;
            w[direction] += step;
            gradient(&mut hybrid, w)
        });
        assert_close(row, &expected[1..], 1e-7);
    }
}

/// Nothing has second derivatives by the time.
#[test]
fn hessian_of_nonautonomous_events() {
    let (x0, u, p) = (Vector1::new(X0), Vector1::new(0.05), Vector1::new(P));
    let events = [Event::jump::<Clock, Refill>(Crossing::Any), Event::terminal::<Level>(Crossing::Falling)];
    for (list, function) in [(&events[..], Some("Clock")), (&events[1..], None)] {
        let mut hybrid = Hybrid::new(Adaptive::<Decay, Radau>::new(options(1e-8)).unwrap(), list).unwrap();
        hybrid.integrator().set_parameters(&p).unwrap();
        let found = hybrid.hessian(&x0, &u, 10.0, &vector![1.0]).map(|_| ()).err();
        assert_eq!(found, function.map(|function| Error::DependsOnTime { function }));
    }
}

/// Steps and events that are kept: polynomials are exact whatever the steps are, and the times of
/// events move as they should.
#[test]
fn frozen_events_of_a_bouncing_ball() {
    let event = Event::jump::<Height, Bounce>(Crossing::Falling);
    let mut hybrid = Hybrid::new(Adaptive::<Ball, Radau>::new(options(1e-8)).unwrap(), &[event]).unwrap();
    let (u, n, t_end) = (vector![], 2, 1.7);
    hybrid.integrator().set_parameters(&vector![9.81, 0.8]).unwrap();
    assert_eq!(hybrid.freeze(), Err(Error::NoResult));
    let steps = hybrid.solve(&vector![1.3, 0.4], &u, t_end).map(|_| ()).and_then(|()| hybrid.freeze());
    steps.unwrap();
    for w in [[1.3, 0.4, 9.81, 0.8], [1.5, 0.1, 10.3, 0.85], [1.2, 0.5, 9.5, 0.75], [1.3, 0.4, 9.81, 0.8]] {
        hybrid.integrator().set_parameters(&vector![w[2], w[3]]).unwrap();
        let x0 = vector![w[0], w[1]];
        let (value, derivative) = differentiate(w, |w| bouncing(w, n, t_end).1);
        let (times, _) = bouncing(w.map(|w| Complex::new(w, 0.0)), n, t_end);
        let solution = hybrid.solve(&x0, &u, t_end).unwrap();
        assert_eq!(solution.occurrences.len(), n);
        assert_close(solution.nominal.x, value, ROUNDING);
        for (occurrence, t) in solution.occurrences.iter().zip(times) {
            assert_close([occurrence.t], [t.re], ROUNDING);
        }
        assert_eq!(hybrid.statistics().steps, 0);
        let forward = hybrid.forward(&x0, &u, t_end).unwrap();
        for (row, expected) in derivative.iter().enumerate() {
            assert_close([forward.dx_dx0[(row, 0)], forward.dx_dx0[(row, 1)]], &expected[..2], ROUNDING);
            assert_close([forward.dx_dp[(row, 0)], forward.dx_dp[(row, 1)]], &expected[2..], ROUNDING);
        }
        let x = bouncing(w.map(|w| Complex::new(w, 0.0)), 2, 1.65).1;
        assert_close(hybrid.dense(1.65).unwrap().x, x.map(|x| x.re), ROUNDING);
    }
    let x0 = vector![1.3, 0.4];
    assert!(matches!(hybrid.solve(&x0, &u, 1.8), Err(Error::OutsideInterval { .. })));
    // Thrown down from below, the ball never comes by.
    assert!(hybrid.solve(&vector![-1.0, -1.0], &u, t_end).is_err());
    assert_eq!(hybrid.solve(&x0, &u, t_end).unwrap().occurrences.len(), n);
    hybrid.thaw();
    assert_eq!(hybrid.solve(&x0, &u, 1.8).unwrap().occurrences.len(), n);
    assert!(hybrid.statistics().steps > 0);
}

/// What is frozen is smooth at a coarse tolerance too: differences over different steps agree to
/// rounding, `ε/h` and `h⁸`, and gradients are theirs up to the errors of the steps.
#[test]
fn smoothness_of_frozen_events() {
    let tolerance = 1e-4;
    let mut hybrid = between_walls(options(tolerance));
    gradient(&mut hybrid, W);
    hybrid.freeze().unwrap();
    let expected = gradient(&mut hybrid, W);
    for direction in 0..5 {
        let [coarse, fine] = [1e-2, 5e-3].map(|h| {
            difference(h, |step| {
                let mut w = W;
                w[direction] += step;
                [gradient(&mut hybrid, w)[0]]
            })
        });
        assert_close(coarse, fine, 1e-9);
        assert_close(fine, [expected[1 + direction]], 30.0 * tolerance);
    }
}
