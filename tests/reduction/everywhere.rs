//! A model whose index was reduced is a model as any other: in batches, without a heap, in single
//! precision, with events and piecewise constant controls, for the conditions of a projection.

use super::mechanisms::{ByHand, Damped, Pendulum};
use casados::prelude::*;
use casados::result::Hessian;
use casados::{Consistent, Divided, Integrator, Projected, mode};
use nalgebra::{Vector2, Vector4, vector};

const P: Vector2<f64> = Vector2::new(9.81, 0.7);

fn start(angle: f64) -> Vector4<f64> {
    let guess = vector![0.7 * angle.sin(), -0.7 * angle.cos(), 0.3, 0.1];
    Consistent::<Damped>::new().hold("x[2]").unwrap().solve(&guess, &P, 0.0).unwrap()
}

#[test]
fn batches_of_it_are_single_calls() {
    let options = Options { steps: 2, ..Default::default() };
    let count = 11;
    let x0: Vec<Vector4<f64>> = (0..count).map(|k| start(0.2 * k as f64)).collect();
    let u = vec![vector![]; count];
    let p = vec![P; count];
    let lambda = vec![vector![0.7, -0.4, 0.9, 1.1]; count];
    let mut batch = Batch::<Damped, Gauss<3>>::new(options).unwrap();
    let mut irk = Irk::<Damped, Gauss<3>>::new(options).unwrap();
    irk.set_parameters(&P).unwrap();
    let intervals = Intervals { x0: &x0, u: &u, p: &p, h: &vec![0.1; count], t0: &[] };
    let mut found = vec![Hessian::<Damped>::default(); count];
    batch.hessian(&intervals, &lambda, &mut found).unwrap();
    for (k, found) in found.iter().enumerate() {
        irk.reset();
        let expected = irk.hessian(&x0[k], &u[k], 0.1, &lambda[k]).unwrap();
        assert!((found.x - expected.x).amax() < 1e-14, "{k}");
        assert!((found.dx_dx0 - expected.dx_dx0).amax() < 1e-13, "{k}");
        assert!((found.h_xx - expected.h_xx).amax() < 1e-12, "{k}");
        assert!((found.h_pp - expected.h_pp).amax() < 1e-12, "{k}");
    }
}

/// Memory inside of the integrators, as firmware has them, and numbers of half the digits.
#[test]
fn without_a_heap_and_in_single_precision() {
    let x0 = start(1.0);
    let mut whole = Irk::<Circle, RadauIIA<3>>::new(Options { steps: 40, ..Default::default() }).unwrap();
    let expected = whole.solve(&x0, &vector![], 0.4).unwrap().x;
    let irk = Irk::<Circle, RadauIIA<3>, f32, Inline<mode::Hessian, 1>>::inline(Options::default()).unwrap();
    let mut small = Divided::<_, 4>::new(Projected::new(irk));
    let x = small.solve(&x0.cast(), &vector![], 0.4).unwrap().x;
    assert!((x.cast::<f64>() - expected).amax() < 1e-5, "{x} {expected}");
    assert!((x[0].hypot(x[1]) - 0.7).abs() < 4.0 * f32::EPSILON);
    let lambda = vector![0.7, -0.4, 0.9, 1.1];
    let found = *small.hessian(&x0.cast(), &vector![], 0.4, &lambda).unwrap();
    let mut double = Divided::<_, 4>::new(Projected::new(
        Irk::<Circle, RadauIIA<3>, f64, Inline<mode::Hessian, 1>>::inline(Options::default()).unwrap(),
    ));
    let expected = *double.hessian(&x0, &vector![], 0.4, &lambda.cast()).unwrap();
    // Elements of the Hessian are below a hundred.
    assert!((found.h_xx.cast::<f64>() - expected.h_xx).amax() < 2e-3, "{} {}", found.h_xx, expected.h_xx);
}

/// The pendulum of fixed length, to be projected.
#[dae(index_reduction(projection))]
fn circle(xdot: [f64; 4], x: [f64; 4], z: f64) -> [f64; 5] {
    let [px, py, vx, vy] = x;
    [xdot[0] - vx, xdot[1] - vy, xdot[2] + z * px, xdot[3] + z * py + 9.81, px * px + py * py - 0.49]
}

/// Steps of variable size with derivatives: against the form that was reduced by hand.
#[test]
fn adaptive_derivatives_are_those_of_the_form_by_hand() {
    fn second<M: Dae<Shape = <Damped as Dae>::Shape>>(x0: Vector4<f64>) -> Hessian<M> {
        let options = AdaptiveOptions { rtol: 1e-9, atol: 1e-9, ..Default::default() };
        let mut radau = Adaptive::<M, Radau>::new(options).unwrap();
        radau.set_parameters(&P).unwrap();
        *radau.hessian(&x0, &vector![], 1.5, &vector![0.7, -0.4, 0.9, 1.1]).unwrap()
    }
    let (found, expected) = (second::<Damped>(start(1.2)), second::<ByHand>(start(1.2)));
    // The same steps, but for rounding in the estimates that they follow from.
    assert!((found.x - expected.x).amax() < 1e-8, "{} {}", found.x, expected.x);
    let size = expected.h_xx.amax();
    assert!((found.dx_dx0 - expected.dx_dx0).amax() < 1e-7 * expected.dx_dx0.amax());
    assert!((found.h_xx - expected.h_xx).amax() < 1e-6 * size, "{} {}", found.h_xx, expected.h_xx);
}

/// The pendulum passes the bottom.
#[function]
fn sideways(x: [f64; 4], _z: f64, _p: [f64; 2]) -> f64 {
    x[0]
}

/// From rest a quarter of the period passes before the bottom is reached: by an event of the
/// Cartesian form, against the elliptic integral.
#[test]
fn events_happen_on_it() {
    let (angle, options) = (1.2f64, AdaptiveOptions { rtol: 1e-12, atol: 1e-12, ..Default::default() });
    let (mut a, mut b) = (1.0, (angle / 2.0).cos());
    for _ in 0..8 {
        (a, b) = ((a + b) / 2.0, (a * b).sqrt());
    }
    let quarter = 0.5 * core::f64::consts::PI * (0.7f64 / 9.81).sqrt() / a;
    let event = Event::terminal::<Sideways>(Crossing::Falling);
    let mut hybrid = Hybrid::new(Adaptive::<Pendulum, Radau>::new(options).unwrap(), &[event]).unwrap();
    hybrid.integrator().set_parameters(&P).unwrap();
    let x0 = vector![0.7 * angle.sin(), -0.7 * angle.cos(), 0.0, 0.0];
    let end = hybrid.solve(&x0, &vector![], 1.2 * quarter).unwrap();
    assert_eq!(end.occurrences.len(), 1);
    assert!((end.occurrences[0].t - quarter).abs() < 1e-10, "{} {quarter}", end.occurrences[0].t);
}
