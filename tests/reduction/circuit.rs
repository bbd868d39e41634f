//! A source on a loop of two capacitors, of index 2, against its exact solution.

use super::mechanisms::LoopOfCapacitors;
use casados::prelude::*;
use nalgebra::vector;

/// With `v₁ = sin t − v₂`: `(c₁ + c₂) v̇₂ + v₂/r = c₁ cos t`, and `i = c₁ (cos t − v̇₂)`.
fn exact(t: f64, v2: f64, [c1, c2, r]: [f64; 3]) -> (f64, f64) {
    let (c, g) = (c1 + c2, 1.0 / r);
    // v₂ = a cos t + b sin t + d exp(−g t/c)
    let (a, b) = (c1 * g / (g * g + c * c), c1 * c / (g * g + c * c));
    let d = v2 - a;
    let decay = d * (-g * t / c).exp();
    let v = a * t.cos() + b * t.sin() + decay;
    let rate = -a * t.sin() + b * t.cos() - g / c * decay;
    (v, c1 * (t.cos() - rate))
}

#[test]
fn exact_voltages_and_current() {
    let p = [0.7, 1.9, 0.4];
    let mut irk =
        Irk::<LoopOfCapacitors, RadauIIA<5>>::new(Options { steps: 8, ..Default::default() }).unwrap();
    irk.set_parameters(&p.into()).unwrap();
    let (t, v2) = (2.0, 0.3);
    let end = irk.solve(&vector![-v2, v2], &vector![], t).unwrap();
    let (voltage, current) = exact(t, v2, p);
    // Steps of a quarter: (1/4)⁹ / 9! for states of order 9; z of order s with Radau IIA at the end
    // is that of the states.
    assert!((end.x[1] - voltage).abs() < 1e-11, "{}", end.x[1] - voltage);
    assert!((end.x[0] + end.x[1] - t.sin()).abs() < 1e-11, "{}", end.x[0] + end.x[1] - t.sin());
    assert!((end.z[0] - current).abs() < 1e-10, "{}", end.z[0] - current);
}
