//! Identities that hold to rounding whatever the model: adjoint and forward sensitivities are
//! transposes of each other, Hessians are symmetric and derivatives of gradients, calls repeat
//! their bits, Gauss methods keep quadratic invariants.

use super::everything::Everything;
use super::interval::{check_interval, options};
use casados::{Erk, Gauss, Heap, Integrator, Irk, RadauIIA, Rk4, ode};
use nalgebra::SVector;

#[test]
fn implicit_model_with_everything() {
    let (x0, u, p) = (SVector::from([0.4, -0.7]), SVector::from([0.6]), SVector::from([1.3, 2.1]));
    check_interval::<Everything, _, 2, 1, 2>(
        Irk::<Everything, Gauss<3>>::new(options(2)).expect("valid"),
        &x0,
        &u,
        &p,
        0.3,
    );
    check_interval::<Everything, _, 2, 1, 2>(
        Irk::<Everything, Gauss<1>>::new(options(1)).expect("valid"),
        &x0,
        &u,
        &p,
        0.3,
    );
    check_interval::<Everything, _, 2, 1, 2>(
        Irk::<Everything, RadauIIA<1>>::new(options(3)).expect("valid"),
        &x0,
        &u,
        &p,
        0.3,
    );
    check_interval::<Everything, _, 2, 1, 2>(
        Irk::<Everything, RadauIIA<5>>::new(options(1)).expect("valid"),
        &x0,
        &u,
        &p,
        0.3,
    );
}

/// A rigid body without torque (Euler): kinetic energy and the square of the angular momentum are
/// quadratic invariants.
#[ode]
fn rigid_body(x: [f64; 3]) -> [f64; 3] {
    const INERTIA: [f64; 3] = [1.0, 2.0, 3.5];
    let [a, b, c] = INERTIA;
    let [p, q, r] = x;
    [(b - c) / a * q * r, (c - a) / b * r * p, (a - b) / c * p * q]
}

fn invariants(x: &SVector<f64, 3>) -> [f64; 2] {
    let inertia = SVector::from([1.0, 2.0, 3.5]);
    let momentum = x.component_mul(&inertia);
    [x.dot(&momentum), momentum.norm_squared()]
}

/// The largest relative drift of the invariants over many steps.
fn drift<I>(mut integrator: I, intervals: usize) -> f64
where
    I: Integrator<Model = RigidBody, Number = f64, Memory = Heap>,
{
    let mut x = SVector::from([0.9, 0.4, -1.1]);
    let start = invariants(&x);
    let mut worst = 0.0_f64;
    for _ in 0..intervals {
        x = integrator.solve(&x, &SVector::zeros(), 0.5).expect("the body can be integrated").x;
        for (now, start) in invariants(&x).iter().zip(start) {
            worst = worst.max(((now - start) / start).abs());
        }
    }
    worst
}

/// Gauss methods keep quadratic invariants (Cooper 1987), with steps that are far from accurate
/// too. Each step rounds the update of a state and the residual of its stages: a few epsilon of the
/// invariant, with random sign; here all of them are granted the same sign.
#[test]
fn quadratic_invariants_of_gauss_methods() {
    const INTERVALS: usize = 200;
    let bound = 8.0 * f64::EPSILON * INTERVALS as f64;
    assert!(drift(Irk::<RigidBody, Gauss<1>>::new(options(1)).expect("valid"), INTERVALS) <= bound);
    assert!(drift(Irk::<RigidBody, Gauss<2>>::new(options(1)).expect("valid"), INTERVALS) <= bound);
    assert!(drift(Irk::<RigidBody, Gauss<4>>::new(options(1)).expect("valid"), INTERVALS) <= bound);
    // Other methods do not, or the test would say nothing.
    assert!(drift(Irk::<RigidBody, RadauIIA<2>>::new(options(1)).expect("valid"), INTERVALS) > 1e6 * bound);
    assert!(drift(Erk::<RigidBody, Rk4>::new(options(1)).expect("valid"), INTERVALS) > 1e6 * bound);
}
