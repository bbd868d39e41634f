//! Where constraints lose rank, or where the index depends on a parameter.

use super::mechanisms::LoopOfCapacitors;
use casados::prelude::*;
use casados::{Consistent, Inconsistent};
use nalgebra::{Vector2, Vector3, vector};

/// A four-bar linkage that is a parallelogram: angles of the crank, the coupler and the rocker from
/// the line of the pivots, and their rates. On that line the bars can leave the parallelogram: the
/// derivatives of the first constraint vanish, though its structure has all of them.
#[dae(index_reduction)]
mod parallelogram {
    const BAR: f64 = 0.4; // crank and rocker, m
    const COUPLER: f64 = 1.1; // and the distance of the pivots, m
    const BAR_MASS: f64 = 0.7; // kg
    const COUPLER_MASS: f64 = 1.6; // kg
    const G: f64 = 9.81;

    pub fn parallelogram(xdot: [f64; 6], x: [f64; 6], z: [f64; 2]) -> [f64; 8] {
        let [a, b, c, va, vb, vc] = x;
        let [_, _, _, aa, ab, ac] = xdot;
        let inertia = BAR_MASS * BAR * BAR / 3.0;
        let coupled = 0.5 * COUPLER_MASS * BAR * COUPLER;
        let (s, co) = (a - b).sin_cos();
        let pull = |length: f64, angle: f64| length * (z[1] * angle.cos() - z[0] * angle.sin());
        [
            xdot[0] - va,
            xdot[1] - vb,
            xdot[2] - vc,
            (inertia + COUPLER_MASS * BAR * BAR) * aa
                + coupled * (co * ab + s * vb * vb)
                + (0.5 * BAR_MASS + COUPLER_MASS) * G * BAR * a.cos()
                + pull(BAR, a),
            COUPLER_MASS * COUPLER * COUPLER / 3.0 * ab
                + coupled * (co * aa - s * va * va)
                + 0.5 * COUPLER_MASS * G * COUPLER * b.cos()
                + pull(COUPLER, b),
            inertia * ac + 0.5 * BAR_MASS * G * BAR * c.cos() - pull(BAR, c),
            BAR * a.cos() + COUPLER * b.cos() - BAR * c.cos() - COUPLER,
            BAR * a.sin() + COUPLER * b.sin() - BAR * c.sin(),
        ]
    }
}

/// The coupler stays level: a pendulum with the inertia of all bars.
#[ode]
fn level(x: [f64; 2]) -> [f64; 2] {
    let (bar, bar_mass, coupler_mass) = (0.4, 0.7, 1.6);
    let inertia = (2.0 / 3.0 * bar_mass + coupler_mass) * bar * bar;
    [x[1], -(bar_mass + coupler_mass) * 9.81 * bar * x[0].cos() / inertia]
}

#[test]
fn swing_of_a_parallelogram() {
    let (angle, rate) = (-2.0, 1.3);
    let options = Options { steps: 200, ..Default::default() };
    let mut irk = Irk::<Parallelogram, Gauss<4>>::new(options).unwrap();
    let start = vector![angle, 0.0, angle, rate, 0.0, rate];
    let end = irk.solve(&start, &vector![], 2.0).unwrap().x;
    let mut pendulum = Irk::<Level, Gauss<4>>::new(options).unwrap();
    let expected = pendulum.solve(&vector![angle, rate], &vector![], 2.0).unwrap().x;
    // Both have errors of order eight of steps of a hundredth; what grows in both is rounding.
    assert!((Vector2::new(end[0], end[3]) - expected).amax() < 1e-11, "{end} {expected}");
    assert!((Vector3::new(end[1], end[4], end[0] - end[2])).amax() < 1e-11, "{end}");
}

#[test]
fn singular_configuration_of_a_linkage() {
    let flat = vector![0.0, 0.0, 0.0, 1.0, 0.0, 1.0];
    let mut irk = Irk::<Parallelogram, Gauss<2>>::new(Options::default()).unwrap();
    // Its stages are beside it; where they would have to start is in the line.
    let mut radau = Adaptive::<Parallelogram, Radau>::new(AdaptiveOptions::default()).unwrap();
    let error = radau.solve(&flat, &vector![], 0.1).unwrap_err();
    assert!(
        matches!(error, Error::InconsistentStart { singular: true, .. } | Error::Singular { .. }),
        "{error}"
    );
    let error = Consistent::<Parallelogram>::new().solve(&flat, &vector![], 0.0).unwrap_err();
    assert!(matches!(error, Inconsistent::Dependent { equation: 6, derivative: 0, .. }), "{error}");
    // It is usable elsewhere.
    assert!(irk.solve(&vector![-2.0, 0.0, -2.0, 0.0, 0.0, 0.0], &vector![], 0.01).is_ok());
}

/// One of two capacitors may be missing: the matrix stays regular, and the index is what it was.
/// Without both there is nothing that the derivatives of the voltages follow from.
#[test]
fn parameter_dependent_index() {
    let mut irk =
        Irk::<LoopOfCapacitors, RadauIIA<5>>::new(Options { steps: 8, ..Default::default() }).unwrap();
    let (c, r) = (1.9, 0.4);
    irk.set_parameters(&vector![0.0, c, r]).unwrap();
    let end = irk.solve(&vector![-0.3, 0.3], &vector![], 2.0).unwrap();
    // Nothing flows but from the second one: v₂ decays.
    let voltage = 0.3 * (-2.0 / (r * c)).exp();
    assert!((end.x[1] - voltage).abs() < 1e-11 && end.z[0].abs() < 1e-11, "{} {}", end.x, end.z);
    let mut radau = Adaptive::<LoopOfCapacitors, Radau>::new(AdaptiveOptions::default()).unwrap();
    radau.set_parameters(&vector![0.0, 0.0, r]).unwrap();
    let error = radau.solve(&vector![0.0, 0.0], &vector![], 2.0).unwrap_err();
    assert!(matches!(error, Error::InconsistentStart { singular: true, .. }), "{error}");
}

/// The ring modulator of the Test Set for IVP Solvers without its parasitic capacitances: the
/// currents into its diodes add up to zero, which no single equation shows. That sum stands in the
/// place of the last of the four. Ranges: volts and amperes.
#[dae(index_reduction, range(x = -1.0..=1.0, z = -0.3..=0.3, t = 0.0..=1e-3))]
fn ring(xdot: [f64; 11], x: [f64; 11], z: [f64; 4], t: f64) -> [f64; 15] {
    let [u1, u2, u7, i1, i2, i3, i4, i5, i6, i7, i8] = x;
    let [u3, u4, u5, u6] = z;
    let (c, cp, r, rp, lh) = (1.6e-8, 1e-8, 25e3, 50.0, 4.45);
    let (ls1, ls2, ls3, rg1, rg2, rg3) = (2e-3, 5e-4, 5e-4, 36.3, 17.3, 17.3);
    let (ri, rc) = (50.0, 600.0);
    let diode = |u: f64| 40.672_864_02e-9 * (17.749_333_2 * u).exp_m1();
    let pi = core::f64::consts::PI;
    let (in1, in2) = (0.5 * (2000.0 * pi * t).sin(), 2.0 * (20_000.0 * pi * t).sin());
    let q1 = diode(u3 - u5 - u7 - in2);
    let q2 = diode(-u4 + u6 - u7 - in2);
    let q3 = diode(u4 + u5 + u7 + in2);
    let q4 = diode(-u3 - u6 + u7 + in2);
    [
        c * xdot[0] - (i1 - 0.5 * i3 + 0.5 * i4 + i7 - u1 / r),
        c * xdot[1] - (i2 - 0.5 * i5 + 0.5 * i6 + i8 - u2 / r),
        cp * xdot[2] - (-u7 / rp + q1 + q2 - q3 - q4),
        lh * xdot[3] + u1,
        lh * xdot[4] + u2,
        ls2 * xdot[5] - (0.5 * u1 - u3 - rg2 * i3),
        ls3 * xdot[6] - (-0.5 * u1 + u4 - rg3 * i4),
        ls2 * xdot[7] - (0.5 * u2 - u5 - rg2 * i5),
        ls3 * xdot[8] - (-0.5 * u2 + u6 - rg3 * i6),
        ls1 * xdot[9] - (-u1 + in1 - (ri + rg1) * i7),
        ls1 * xdot[10] - (-u2 - (rc + rg1) * i8),
        i3 - q1 + q4,
        -i4 + q2 - q3,
        i5 + q1 - q3,
        i3 + i4 + i5 + i6,
    ]
}

/// The same without the sixth current, which is what the others leave: of index 1.
#[dae(range(x = -1.0..=1.0, z = -0.3..=0.3, t = 0.0..=1e-3))]
fn ring_without_a_current(xdot: [f64; 10], x: [f64; 10], z: [f64; 4], t: f64) -> [f64; 14] {
    let [u1, u2, u7, i1, i2, i3, i4, i5, i7, i8] = x;
    let [u3, u4, u5, u6] = z;
    let (c, cp, r, rp, lh) = (1.6e-8, 1e-8, 25e3, 50.0, 4.45);
    let (ls1, ls, rg1, rg) = (2e-3, 5e-4, 36.3, 17.3);
    let (ri, rc) = (50.0, 600.0);
    let diode = |u: f64| 40.672_864_02e-9 * (17.749_333_2 * u).exp_m1();
    let pi = core::f64::consts::PI;
    let (in1, in2) = (0.5 * (2000.0 * pi * t).sin(), 2.0 * (20_000.0 * pi * t).sin());
    let q1 = diode(u3 - u5 - u7 - in2);
    let q2 = diode(-u4 + u6 - u7 - in2);
    let q3 = diode(u4 + u5 + u7 + in2);
    let q4 = diode(-u3 - u6 + u7 + in2);
    [
        c * xdot[0] - (i1 - 0.5 * i3 + 0.5 * i4 + i7 - u1 / r),
        c * xdot[1] - (i2 - 0.5 * i5 - 0.5 * (i3 + i4 + i5) + i8 - u2 / r),
        cp * xdot[2] - (-u7 / rp + q1 + q2 - q3 - q4),
        lh * xdot[3] + u1,
        lh * xdot[4] + u2,
        ls * xdot[5] - (0.5 * u1 - u3 - rg * i3),
        ls * xdot[6] - (-0.5 * u1 + u4 - rg * i4),
        ls * xdot[7] - (0.5 * u2 - u5 - rg * i5),
        ls1 * xdot[8] - (-u1 + in1 - (ri + rg1) * i7),
        ls1 * xdot[9] - (-u2 - (rc + rg1) * i8),
        i3 - q1 + q4,
        -i4 + q2 - q3,
        i5 + q1 - q3,
        // The derivatives of the four currents, which are equal inductances times them.
        -u3 + u4 - u5 + u6,
    ]
}

#[test]
fn circuit_with_explicit_hidden_constraint() {
    assert_eq!(Ring::STRUCTURE.reduction.map(|reduction| reduction.differentiated), Some(&[(14, 1)][..]));
    let options = Options { steps: 2000, ..Default::default() };
    let mut ring = Irk::<Ring, RadauIIA<3>>::new(options).unwrap();
    let mut without = Irk::<RingWithoutACurrent, RadauIIA<3>>::new(options).unwrap();
    let end = *ring.solve(&Default::default(), &Default::default(), 1e-3).unwrap();
    let expected = *without.solve(&Default::default(), &Default::default(), 1e-3).unwrap();
    let currents = end.x[5] + end.x[6] + end.x[7] + end.x[8];
    assert!(currents.abs() < 1e-15, "{currents}");
    for (index, other) in [0, 1, 2, 3, 4, 5, 6, 7, 9, 10].into_iter().enumerate() {
        assert!((end.x[other] - expected.x[index]).abs() < 1e-10, "{} {}", end.x, expected.x);
    }
    assert!((end.z - expected.z).amax() < 1e-9, "{} {}", end.z, expected.z);
    assert!(end.x[0].abs() > 1e-3, "something happens: {}", end.x);
}
