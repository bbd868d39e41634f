//! A pendulum in Cartesian coordinates: against elliptic integrals, its hand-reduced form, and the
//! decay that its rates predict.

use super::mechanisms::{ByHand, Damped, Pendulum};
use bytemuck::Zeroable;
use casados::__private::{ArrayK, ArrayV};
use casados::prelude::*;
use casados::result::Hessian;
use nalgebra::{SVector, Vector4, vector};
use std::f64::consts::PI;

const GRAVITY: f64 = 9.81;
const LENGTH: f64 = 0.7;

/// The mean of arithmetic and geometric means.
fn arithmetic_geometric_mean(mut a: f64, mut b: f64) -> f64 {
    for _ in 0..8 {
        (a, b) = ((a + b) / 2.0, (a * b).sqrt());
    }
    a
}

/// Tolerances of 1e-11.
fn options() -> AdaptiveOptions {
    AdaptiveOptions { rtol: 1e-11, atol: 1e-11, ..Default::default() }
}

/// Where the pendulum is after a time, and how far errors on the way grow at least.
fn state_after(x0: Vector4<f64>, time: f64) -> (Vector4<f64>, f64) {
    let options = Options { steps: 400, ..Default::default() };
    let mut irk = Irk::<Pendulum, Gauss<5>>::new(options).unwrap();
    irk.set_parameters(&vector![GRAVITY, LENGTH]).unwrap();
    let end = irk.forward(&x0, &vector![], time).unwrap();
    (end.x, end.dx_dx0.abs().column_sum().amax())
}

/// The period is `4 √(l/g) K(sin(θ/2)) = 2π √(l/g) / arithmetic_geometric_mean(1, cos(θ/2))`, from
/// rest at the angle `θ` and from the bottom, where one coordinate of the constraint's derivative
/// vanishes.
#[test]
fn period_of_swings() {
    for angle in [PI / 2.0, 0.3, 2.5] {
        let period =
            2.0 * PI * (LENGTH / GRAVITY).sqrt() / arithmetic_geometric_mean(1.0, (angle / 2.0).cos());
        let speed = (2.0 * GRAVITY * LENGTH * (1.0 - angle.cos())).sqrt();
        for x0 in [
            vector![LENGTH * angle.sin(), -LENGTH * angle.cos(), 0.0, 0.0],
            vector![0.0, -LENGTH, speed, 0.0],
        ] {
            let (end, growth) = state_after(x0, period);
            // Rounding of 400 steps.
            assert!((end - x0).amax() < 1e-13 * growth, "{angle}: {end}");
        }
    }
}

/// From the top with the angular speed `ω` a turn takes
/// `2π / arithmetic_geometric_mean(ω, √(ω² + 4g/l))`.
#[test]
fn period_of_turns() {
    for omega in [0.5f64, 4.0] {
        let turn =
            2.0 * PI / arithmetic_geometric_mean(omega, (omega * omega + 4.0 * GRAVITY / LENGTH).sqrt());
        let x0 = vector![0.0, LENGTH, omega * LENGTH, 0.0];
        let (end, growth) = state_after(x0, turn);
        // Rounding of 400 steps.
        assert!((end - x0).amax() < 1e-13 * growth, "{omega}: {end}");
    }
}

#[test]
fn reduction_by_hand() {
    let mut v = ArrayV::<Damped, f64>::zeroed();
    let (mut reduced, mut by_hand) = (ArrayK::<Damped, f64>::zeroed(), ArrayK::<ByHand, f64>::zeroed());
    for point in 0..100 {
        for (index, v) in v.iter_mut().enumerate() {
            *v = (1.3 * (point * 12 + index) as f64).sin();
        }
        Damped::residual::<f64>(&v, &mut reduced);
        ByHand::residual::<f64>(&v, &mut by_hand);
        // Terms are at most 16.
        let apart = SVector::from(reduced) - SVector::from(by_hand);
        assert!(apart.amax() <= 16.0 * 4.0 * f64::EPSILON, "{apart}");
    }
}

#[test]
fn derivatives_of_the_reduction_by_hand() {
    fn hessian<M: Dae<Shape = <Damped as Dae>::Shape>>() -> Hessian<M> {
        let options = Options { steps: 3, ..Default::default() };
        let mut irk = Irk::<M, Gauss<3>>::new(options).unwrap();
        irk.set_parameters(&vector![GRAVITY, LENGTH]).unwrap();
        *irk.hessian(&vector![0.5, -0.4, 0.3, 0.5], &vector![], 0.3, &vector![0.7, -0.4, 0.9, 1.1]).unwrap()
    }
    let (reduced, by_hand) = (hessian::<Damped>(), hessian::<ByHand>());
    assert!((reduced.x - by_hand.x).amax() < 1e-14);
    assert!((reduced.dx_dx0 - by_hand.dx_dx0).amax() < 1e-13);
    assert!((reduced.dx_dp - by_hand.dx_dp).amax() < 1e-13);
    assert!((reduced.h_xx - by_hand.h_xx).amax() < 1e-12);
    assert!((reduced.h_pp - by_hand.h_pp).amax() < 1e-12);
}

/// `(d/dt + 3)(d/dt + 2) g = 0` from errors at the start, whatever the motion is.
#[test]
fn decay_of_constraint_errors() {
    let x0 = vector![0.5, -0.6, 0.4, 0.2];
    let error = |x: &Vector4<f64>| x[0] * x[0] + x[1] * x[1] - LENGTH * LENGTH;
    let rate = |x: &Vector4<f64>| 2.0 * (x[0] * x[2] + x[1] * x[3]);
    let mut radau = Adaptive::<Damped, Radau>::new(options()).unwrap();
    radau.set_parameters(&vector![GRAVITY, LENGTH]).unwrap();
    // g = a exp(−2t) + b exp(−3t)
    let (g, dg) = (error(&x0), rate(&x0));
    let (a, b) = (3.0 * g + dg, -2.0 * g - dg);
    for t in [0.3, 1.0, 3.0] {
        let x = radau.solve(&x0, &vector![], t).unwrap().x;
        let (slow, fast) = (a * (-2.0 * t).exp(), b * (-3.0 * t).exp());
        assert!((error(&x) - slow - fast).abs() < 30.0 * 1e-11 * 2.0, "{t}");
        assert!((rate(&x) + 2.0 * slow + 3.0 * fast).abs() < 30.0 * 1e-11 * 8.0, "{t}");
    }
}
