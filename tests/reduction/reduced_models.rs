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
fn batches_of_reduced_models() {
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
fn inline_memory_and_single_precision() {
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
fn derivatives_of_adaptive_runs() {
    fn second_derivatives<M: Dae<Shape = <Damped as Dae>::Shape>>(x0: Vector4<f64>) -> Hessian<M> {
        let options = AdaptiveOptions { rtol: 1e-9, atol: 1e-9, ..Default::default() };
        let mut radau = Adaptive::<M, Radau>::new(options).unwrap();
        radau.set_parameters(&P).unwrap();
        *radau.hessian(&x0, &vector![], 1.5, &vector![0.7, -0.4, 0.9, 1.1]).unwrap()
    }
    let (found, expected) =
        (second_derivatives::<Damped>(start(1.2)), second_derivatives::<ByHand>(start(1.2)));
    // The same steps, but for rounding in the estimates that they follow from.
    assert!((found.x - expected.x).amax() < 1e-8, "{} {}", found.x, expected.x);
    let size = expected.h_xx.amax();
    assert!((found.dx_dx0 - expected.dx_dx0).amax() < 1e-7 * expected.dx_dx0.amax());
    assert!((found.h_xx - expected.h_xx).amax() < 1e-6 * size, "{} {}", found.h_xx, expected.h_xx);
}

/// What adaptive steps return is projected as anything else.
#[test]
fn projection_of_adaptive_steps() {
    let options = AdaptiveOptions { rtol: 1e-4, atol: 1e-4, ..Default::default() };
    let mut plain = Adaptive::<Circle, Radau>::new(options).unwrap();
    let off = |x: &Vector4<f64>| (x[0].hypot(x[1]) - 0.7).abs();
    let x0 = start(1.2);
    let end = plain.solve(&x0, &vector![], 5.0).unwrap().x;
    assert!(off(&end) > 1e-6, "{}", off(&end));
    let mut projected = Projected::new(plain);
    let end = projected.solve(&x0, &vector![], 5.0).unwrap().x;
    assert!(off(&end) < 2e-16, "{}", off(&end));
}

/// Links in a row, each of length and mass one: one text for any number.
#[dae(N = [2, 4], index_reduction(projection))]
fn links<const N: usize>(
    xdot: ([[f64; 2]; N], [[f64; 2]; N]),
    x: ([[f64; 2]; N], [[f64; 2]; N]),
    z: [f64; N],
) -> ([[f64; 2]; N], [[f64; 2]; N], [f64; N]) {
    let along: [[f64; 2]; N] = core::array::from_fn(|i| {
        let before = if i == 0 { [0.0, 0.0] } else { x.0[i - 1] };
        [x.0[i][0] - before[0], x.0[i][1] - before[1]]
    });
    let pull = |i: usize, c: usize| if i < N { z[i] * along[i][c] } else { 0.0 };
    (
        core::array::from_fn(|i| [xdot.0[i][0] - x.1[i][0], xdot.0[i][1] - x.1[i][1]]),
        core::array::from_fn(|i| {
            [xdot.1[i][0] + pull(i, 0) - pull(i + 1, 0), xdot.1[i][1] + pull(i, 1) - pull(i + 1, 1) + 9.81]
        }),
        along.map(|a| a[0] * a[0] + a[1] * a[1] - 1.0),
    )
}

/// Energy and lengths of a chain of four links that falls from a horizontal line.
#[test]
fn chains_of_links() {
    let of = |reduction: Option<&casados::__private::Reduction>| reduction.unwrap().differentiated;
    assert_eq!(of(Links::<2>::STRUCTURE.reduction), [(8, 2), (9, 2)]);
    assert_eq!(of(Links::<4>::STRUCTURE.reduction), [(16, 2), (17, 2), (18, 2), (19, 2)]);
    let mut irk = Projected::new(Irk::<Links<4>, Gauss<4>>::new(Options::default()).unwrap());
    let mut x = nalgebra::SVector::<f64, 16>::zeros();
    (0..4).for_each(|i| x[2 * i] = 1.0 + i as f64);
    for _ in 0..200 {
        x = irk.solve(&x, &vector![], 0.005).unwrap().x;
        let energy: f64 =
            (0..4).map(|i| 0.5 * (x[8 + 2 * i].powi(2) + x[9 + 2 * i].powi(2)) + 9.81 * x[2 * i + 1]).sum();
        // Rates of up to thirty in a second, steps of 5 ms: (0.15)⁸ of energies of a hundred.
        assert!(energy.abs() < 3e-5, "{energy}");
        assert!((x[0].hypot(x[1]) - 1.0).abs() < 4e-16);
        assert!(((x[6] - x[4]).hypot(x[7] - x[5]) - 1.0).abs() < 2e-15);
    }
}

/// The pendulum passes the bottom.
#[function]
fn sideways(x: [f64; 4], _z: f64, _p: [f64; 2]) -> f64 {
    x[0]
}

/// From rest a quarter of the period passes before the bottom is reached: by an event of the
/// Cartesian form, against the elliptic integral.
#[test]
fn events_of_reduced_models() {
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
