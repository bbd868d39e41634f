//! Random models, written by `tests/generator`: not to be edited by hand.

use casados::{dae, ode};

#[ode]
pub fn random0(x: [f64; 1], u: [f64; 1], p: [f64; 1]) -> [f64; 1] {
    let inner = -(x[0]);
    let a0 = (inner) * (x[0]);
    let inner = (0.5 + (p[0]) * (p[0])).sqrt();
    let a1 = (inner) - (a0);
    let inner = (1.3 + (x[0]).sin()).cbrt();
    let a2 = (inner) + (a1);
    let inner = (-1.3 + (u[0]).cos()).cbrt();
    let a3 = (inner) * (a2);
    let inner = (a1).sin().exp();
    let a4 = (inner) - (a3);
    let inner = (a4).tanh().exp2();
    let a5 = (inner) - (p[0]);
    let inner = (a4).cos().exp_m1();
    let a6 = (inner) / (1.0 + (a4) * (a4));
    let inner = (1.5 + (u[0]).sin()).ln();
    let a7 = (inner) * (a6);
    let inner = ((x[0]) * (x[0])).ln_1p();
    let a8 = (inner) * (a5);
    [((a0 + a1 + a2 + a3 + a4 + a5 + a6 + a7 + a8) - (a1))]
}

#[dae]
pub fn random1(xdot: [f64; 1], x: [f64; 1], z: [f64; 2], u: [f64; 1], p: [f64; 1], t: f64) -> [f64; 3] {
    let inner = (0.7 + (z[0]) * (z[0])).log2();
    let a0 = (inner) * (z[1]);
    let inner = (2.0 + (p[0]).cos()).log10();
    let a1 = (inner) * (t);
    let inner = (a0).sin();
    let a2 = (inner) * (a0);
    let inner = (p[0]).cos();
    let a3 = (inner) * (z[1]);
    let inner = (0.6 * (a2).sin()).tan();
    let a4 = (inner) / (1.0 + (p[0]) * (p[0]));
    let inner = (0.8 * (a3).sin()).asin();
    let a5 = (inner) * (a3);
    let inner = (0.7 * (z[1]).cos()).acos();
    let a6 = (inner) - (a4);
    let inner = (a6).atan();
    let a7 = (inner) + (a6);
    let inner = (p[0]).sin().sinh();
    let a8 = (inner) / (1.5 + (u[0]).sin());
    [
        (1.5 + x[0].sin()) * xdot[0] + ((a0 + a3 + a6) * (t)),
        z[0] + z[0].powi(3) - 0.1 * ((a1 + a4 + a7) * (p[0])),
        z[1] + z[1].powi(3) - 0.1 * ((a2 + a5 + a8) + (a1)),
    ]
}

#[dae]
pub fn random2(xdot: [f64; 2], x: [f64; 2], z: [f64; 1], u: [f64; 2], p: [f64; 2]) -> [f64; 3] {
    let inner = (u[0]).cos().cosh();
    let a0 = (inner) / (1.0 + (p[1]) * (p[1]));
    let inner = (u[0]).tanh();
    let a1 = (inner) - (a0);
    let inner = (p[0]).asinh();
    let a2 = (inner) + (xdot[1]);
    let inner = (1.4 + (p[1]) * (p[1])).acosh();
    let a3 = (inner) * (a1);
    let inner = (0.9 * (p[0]).tanh()).atanh();
    let a4 = (inner) * (p[1]);
    let inner = (a4).abs();
    let a5 = (inner) + (x[0]);
    let inner = (x[0]) * (x[0]).signum();
    let a6 = (inner) * (a3);
    let inner = (1.2 + (a4) * (a4)).recip();
    let a7 = (inner) * (a6);
    let inner = (x[1]).to_radians();
    let a8 = (inner) * (z[0]);
    [
        xdot[0] - ((a0 + a3 + a6) * (p[0])),
        xdot[1] - ((a1 + a4 + a7) * (a5)),
        z[0] + z[0].powi(3) - 0.1 * ((a2 + a5 + a8) / (1.0 + (a2) * (a2))),
    ]
}

#[ode]
pub fn random3(x: [f64; 1], u: [f64; 1], p: [f64; 2]) -> [f64; 1] {
    let inner = (x[0]).sin().powi(2);
    let a0 = (inner) / (1.0 + (p[0]) * (p[0]));
    let inner = (1.1 + (p[0]).cos()).powi(-3);
    let a1 = (inner) * (p[0]);
    let inner = (p[1]).tanh().powi(5);
    let a2 = (inner) - (u[0]);
    let inner = (1.1 + (a2).sin()).powf(1.7);
    let a3 = (inner) / (1.5 + (p[1]).sin());
    let inner = (1.6 + (a3).cos()).powf(-0.4);
    let a4 = (inner) / (1.5 + (u[0]).sin());
    let inner = (u[0]).clamp(-0.6, 0.8);
    let a5 = (inner) + (a4);
    let inner = {
        let (s, c) = (a5).sin_cos();
        s - 0.5 * c
    };
    let a6 = (inner) - (p[1]);
    let inner = (a6) + (a6);
    let a7 = (inner) - (x[0]);
    let inner = (a6) - (a5);
    let a8 = (inner) - (x[0]);
    [((a0 + a1 + a2 + a3 + a4 + a5 + a6 + a7 + a8) + (a2))]
}

#[dae]
pub fn random4(xdot: [f64; 3], x: [f64; 3], z: [f64; 1], u: [f64; 1]) -> [f64; 4] {
    let inner = (xdot[0]) * (x[0]);
    let a0 = (inner) * (xdot[1]);
    let inner = (a0) * (u[0]);
    let a1 = (inner) / (1.5 + (a0).sin());
    let inner = (a0) / (1.5 + (a0).sin());
    let a2 = (inner) * (z[0]);
    let inner = (a2) / (1.0 + (a1) * (a1));
    let a3 = (inner) / (1.0 + (x[1]) * (x[1]));
    let inner = (x[2]).atan2(x[2]);
    let a4 = (inner) + (z[0]);
    let inner = (a4).hypot(xdot[1]);
    let a5 = (inner) + (x[0]);
    let inner = (xdot[2]).hypot(1.0 + (a4) * (a4));
    let a6 = (inner) / (1.5 + (a3).sin());
    let inner = (1.2 + (a4).sin()).powf((a6).cos());
    let a7 = (inner) - (a4);
    let inner = (x[2]).mul_add(a7, 0.5);
    let a8 = (inner) / (1.0 + (xdot[0]) * (xdot[0]));
    [
        xdot[0] - ((a0 + a4 + a8) - (xdot[0])),
        xdot[1] - ((a1 + a5) + (xdot[0])),
        xdot[2] - ((a2 + a6) * (x[2])),
        z[0] + z[0].powi(3) - 0.1 * ((a3 + a7) * (a5)),
    ]
}

#[dae]
pub fn random5(xdot: [f64; 4], x: [f64; 4], u: [f64; 1], p: [f64; 2], t: f64) -> [f64; 4] {
    let inner = (x[2]).min(x[1]);
    let a0 = (inner) / (1.0 + (xdot[3]) * (xdot[3]));
    let inner = (a0).max(a0);
    let a1 = (inner) / (1.0 + (a0) * (a0));
    let inner = if a1 < x[1] { (a1) * (x[1]) } else { (a1).sin() + (x[1]) };
    let a2 = (inner) + (xdot[1]);
    let inner = if (a1) >= 0.2 && (a0) < 0.5 { (a1) - (a0) * (a0) } else { (a0).cos() };
    let a3 = (inner) / (1.5 + (x[1]).sin());
    let inner = if (a3) <= -0.3 || !((u[0]) > 0.1) { (u[0]) * (u[0]) } else { (a3) + 1.5 * (u[0]) };
    let a4 = (inner) / (1.0 + (a2) * (a2));
    let inner = -(a4);
    let a5 = (inner) / (1.0 + (x[3]) * (x[3]));
    let inner = (0.5 + (a4) * (a4)).sqrt();
    let a6 = (inner) / (1.5 + (a5).sin());
    let inner = (1.3 + (x[2]).sin()).cbrt();
    let a7 = (inner) * (xdot[0]);
    let inner = (-1.3 + (a6).cos()).cbrt();
    let a8 = (inner) / (1.5 + (xdot[2]).sin());
    [
        (1.5 + x[0].sin()) * xdot[0] + ((a0 + a4 + a8) / (1.0 + (a3) * (a3))),
        (1.5 + x[1].sin()) * xdot[1] + ((a1 + a5) + (u[0])),
        (1.5 + x[2].sin()) * xdot[2] + ((a2 + a6) / (1.5 + (a3).sin())),
        (1.5 + x[3].sin()) * xdot[3] + ((a3 + a7) - (a0)),
    ]
}

#[ode]
pub fn random6(x: [f64; 2], u: [f64; 2], p: [f64; 1]) -> [f64; 2] {
    let inner = (x[0]).sin().exp();
    let a0 = (inner) / (1.0 + (p[0]) * (p[0]));
    let inner = (a0).tanh().exp2();
    let a1 = (inner) * (a0);
    let inner = (u[0]).cos().exp_m1();
    let a2 = (inner) / (1.5 + (a1).sin());
    let inner = (1.5 + (a1).sin()).ln();
    let a3 = (inner) * (p[0]);
    let inner = ((a1) * (a1)).ln_1p();
    let a4 = (inner) - (u[0]);
    let inner = (0.7 + (a4) * (a4)).log2();
    let a5 = (inner) - (x[1]);
    let inner = (2.0 + (a4).cos()).log10();
    let a6 = (inner) / (1.0 + (a3) * (a3));
    let inner = (a4).sin();
    let a7 = (inner) * (u[0]);
    let inner = (u[0]).cos();
    let a8 = (inner) * (a7);
    [((a0 + a2 + a4 + a6 + a8) / (1.0 + (u[1]) * (u[1]))), ((a1 + a3 + a5 + a7) / (1.0 + (a3) * (a3)))]
}

#[dae]
pub fn random7(xdot: [f64; 2], x: [f64; 2], z: [f64; 1], p: [f64; 2]) -> [f64; 3] {
    let inner = (0.6 * (x[0]).sin()).tan();
    let a0 = (inner) / (1.5 + (p[1]).sin());
    let inner = (0.8 * (a0).sin()).asin();
    let a1 = (inner) - (a0);
    let inner = (0.7 * (a0).cos()).acos();
    let a2 = (inner) / (1.0 + (xdot[1]) * (xdot[1]));
    let inner = (p[1]).atan();
    let a3 = (inner) / (1.0 + (a1) * (a1));
    let inner = (a1).sin().sinh();
    let a4 = (inner) / (1.5 + (a3).sin());
    let inner = (xdot[1]).cos().cosh();
    let a5 = (inner) / (1.5 + (p[1]).sin());
    let inner = (xdot[1]).tanh();
    let a6 = (inner) * (x[1]);
    let inner = (a5).asinh();
    let a7 = (inner) / (1.5 + (a5).sin());
    let inner = (1.4 + (xdot[0]) * (xdot[0])).acosh();
    let a8 = (inner) - (a7);
    [
        (1.5 + x[0].sin()) * xdot[0] + ((a0 + a3 + a6) * (a2)),
        (1.5 + x[1].sin()) * xdot[1] + ((a1 + a4 + a7) * (a1)),
        z[0] + z[0].powi(3) - 0.1 * ((a2 + a5 + a8) * (a2)),
    ]
}

#[dae]
pub fn random8(xdot: [f64; 1], x: [f64; 1], z: [f64; 1]) -> [f64; 2] {
    let inner = (0.9 * (x[0]).tanh()).atanh();
    let a0 = (inner) * (xdot[0]);
    let inner = (a0).abs();
    let a1 = (inner) / (1.5 + (a0).sin());
    let inner = (a1) * (a1).signum();
    let a2 = (inner) * (xdot[0]);
    let inner = (1.2 + (a0) * (a0)).recip();
    let a3 = (inner) / (1.5 + (x[0]).sin());
    let inner = (xdot[0]).to_radians();
    let a4 = (inner) + (x[0]);
    let inner = (z[0]).sin().powi(2);
    let a5 = (inner) * (x[0]);
    let inner = (1.1 + (x[0]).cos()).powi(-3);
    let a6 = (inner) - (a4);
    let inner = (x[0]).tanh().powi(5);
    let a7 = (inner) * (xdot[0]);
    let inner = (1.1 + (a5).sin()).powf(1.7);
    let a8 = (inner) * (xdot[0]);
    [
        xdot[0] - ((a0 + a2 + a4 + a6 + a8) * (a1)),
        z[0] + z[0].powi(3) - 0.1 * ((a1 + a3 + a5 + a7) / (1.0 + (z[0]) * (z[0]))),
    ]
}

#[ode]
pub fn random9(x: [f64; 3], u: [f64; 1], t: f64) -> [f64; 3] {
    let inner = (1.6 + (x[1]).cos()).powf(-0.4);
    let a0 = (inner) / (1.0 + (x[1]) * (x[1]));
    let inner = (a0).clamp(-0.6, 0.8);
    let a1 = (inner) - (x[2]);
    let inner = {
        let (s, c) = (a0).sin_cos();
        s - 0.5 * c
    };
    let a2 = (inner) / (1.5 + (x[1]).sin());
    let inner = (t) + (a2);
    let a3 = (inner) + (a1);
    let inner = (a1) - (x[1]);
    let a4 = (inner) / (1.5 + (t).sin());
    let inner = (a4) * (a2);
    let a5 = (inner) / (1.5 + (x[1]).sin());
    let inner = (a5) * (a5);
    let a6 = (inner) * (x[2]);
    let inner = (a6) / (1.5 + (a4).sin());
    let a7 = (inner) + (x[2]);
    let inner = (x[1]) / (1.0 + (a5) * (a5));
    let a8 = (inner) - (a6);
    [((a0 + a3 + a6) / (1.0 + (t) * (t))), ((a1 + a4 + a7) + (a5)), ((a2 + a5 + a8) / (1.0 + (a4) * (a4)))]
}

#[dae]
pub fn random10(xdot: [f64; 2], x: [f64; 2], p: [f64; 2]) -> [f64; 2] {
    let inner = (p[0]).atan2(xdot[1]);
    let a0 = (inner) / (1.0 + (p[0]) * (p[0]));
    let inner = (a0).hypot(a0);
    let a1 = (inner) * (a0);
    let inner = (a1).hypot(1.0 + (a1) * (a1));
    let a2 = (inner) / (1.5 + (a1).sin());
    let inner = (1.2 + (a2).sin()).powf((a1).cos());
    let a3 = (inner) + (a2);
    let inner = (p[1]).mul_add(a2, 0.5);
    let a4 = (inner) / (1.0 + (x[1]) * (x[1]));
    let inner = (a4).min(a4);
    let a5 = (inner) - (p[0]);
    let inner = (a5).max(p[0]);
    let a6 = (inner) * (a5);
    let inner = if a6 < p[1] { (a6) * (p[1]) } else { (a6).sin() + (p[1]) };
    let a7 = (inner) / (1.5 + (a4).sin());
    let inner = if (x[0]) >= 0.2 && (a6) < 0.5 { (x[0]) - (a6) * (a6) } else { (a6).cos() };
    let a8 = (inner) - (a6);
    [
        xdot[0] - ((a0 + a2 + a4 + a6 + a8) / (1.0 + (a1) * (a1))),
        xdot[1] - ((a1 + a3 + a5 + a7) / (1.0 + (a0) * (a0))),
    ]
}

#[dae]
pub fn random11(xdot: [f64; 3], x: [f64; 3], z: [f64; 2], u: [f64; 2], p: [f64; 2]) -> [f64; 5] {
    let inner = if (xdot[2]) <= -0.3 || !((xdot[2]) > 0.1) {
        (xdot[2]) * (xdot[2])
    } else {
        (xdot[2]) + 1.5 * (xdot[2])
    };
    let a0 = (inner) / (1.0 + (z[1]) * (z[1]));
    let inner = -(a0);
    let a1 = (inner) / (1.5 + (a0).sin());
    let inner = (0.5 + (a0) * (a0)).sqrt();
    let a2 = (inner) + (a1);
    let inner = (1.3 + (a0).sin()).cbrt();
    let a3 = (inner) * (a2);
    let inner = (-1.3 + (a3).cos()).cbrt();
    let a4 = (inner) * (xdot[1]);
    let inner = (a4).sin().exp();
    let a5 = (inner) / (1.0 + (p[1]) * (p[1]));
    let inner = (a4).tanh().exp2();
    let a6 = (inner) - (a3);
    let inner = (a6).cos().exp_m1();
    let a7 = (inner) * (a5);
    let inner = (1.5 + (z[0]).sin()).ln();
    let a8 = (inner) / (1.5 + (x[2]).sin());
    [
        (1.5 + x[0].sin()) * xdot[0] + ((a0 + a5) / (1.0 + (x[2]) * (x[2]))),
        (1.5 + x[1].sin()) * xdot[1] + ((a1 + a6) * (a1)),
        (1.5 + x[2].sin()) * xdot[2] + ((a2 + a7) * (a2)),
        z[0] + z[0].powi(3) - 0.1 * ((a3 + a8) * (a5)),
        z[1] + z[1].powi(3) - 0.1 * ((a4) + (a2)),
    ]
}
