//! Electrical circuits with diodes and transistors.

use casados::{dae, ode};
use core::f64::consts::PI;

/// Mixes a low-frequency with a high-frequency signal. x = seven voltages, then eight currents.
#[ode]
pub fn ring_modulator(x: [f64; 15], t: f64) -> [f64; 15] {
    const C: f64 = 1.6e-8;
    const CS: f64 = 2e-12;
    const CP: f64 = 1e-8;
    const R: f64 = 25e3;
    const RP: f64 = 50.0;
    const LH: f64 = 4.45;
    const LS1: f64 = 2e-3;
    const LS2: f64 = 5e-4;
    const LS3: f64 = 5e-4;
    const RG1: f64 = 36.3;
    const RG2: f64 = 17.3;
    const RG3: f64 = 17.3;
    const RI: f64 = 50.0;
    const RC: f64 = 600.0;
    const DELTA: f64 = 17.7493332;
    const GAMMA: f64 = 40.67286402e-9;

    let [y1, y2, y3, y4, y5, y6, y7, y8, y9, y10, y11, y12, y13, y14, y15] = x;
    let low = 0.5 * (2e3 * PI * t).sin();
    let high = 2.0 * (2e4 * PI * t).sin();
    let diode = |voltage: f64| GAMMA * ((DELTA * voltage).exp() - 1.0);
    let d1 = diode(y3 - y5 - y7 - high);
    let d2 = diode(-y4 + y6 - y7 - high);
    let d3 = diode(y4 + y5 + y7 + high);
    let d4 = diode(-y3 - y6 + y7 + high);
    [
        (y8 - 0.5 * y10 + 0.5 * y11 + y14 - y1 / R) / C,
        (y9 - 0.5 * y12 + 0.5 * y13 + y15 - y2 / R) / C,
        (y10 - d1 + d4) / CS,
        (-y11 + d2 - d3) / CS,
        (y12 + d1 - d3) / CS,
        (-y13 - d2 + d4) / CS,
        (-y7 / RP + d1 + d2 - d3 - d4) / CP,
        -y1 / LH,
        -y2 / LH,
        (0.5 * y1 - y3 - RG2 * y10) / LS2,
        (-0.5 * y1 + y4 - RG3 * y11) / LS3,
        (0.5 * y2 - y5 - RG2 * y12) / LS2,
        (-0.5 * y2 + y6 - RG3 * y13) / LS3,
        (-y1 + low - (RI + RG1) * y14) / LS1,
        (-y2 - (RC + RG1) * y15) / LS1,
    ]
}

/// An amplifier with two transistors, by the voltages of its eight nodes. Five capacitors: the
/// matrix of `ẋ` has rank 5, and three equations are algebraic without any state being so.
#[dae]
pub fn transistor_amplifier(xdot: [f64; 8], x: [f64; 8], t: f64) -> [f64; 8] {
    const UB: f64 = 6.0;
    const UF: f64 = 0.026;
    const ALPHA: f64 = 0.99;
    const BETA: f64 = 1e-6;
    const R0: f64 = 1000.0;
    const R: f64 = 9000.0; // R1 to R9
    const C1: f64 = 1e-6;
    const C2: f64 = 2e-6;
    const C3: f64 = 3e-6;
    const C4: f64 = 4e-6;
    const C5: f64 = 5e-6;

    let [y1, y2, y3, y4, y5, y6, y7, y8] = x;
    let input = 0.1 * (200.0 * PI * t).sin();
    let transistor = |voltage: f64| BETA * ((voltage / UF).exp() - 1.0);
    let (first, second) = (transistor(y2 - y3), transistor(y5 - y6));
    [
        C1 * (xdot[1] - xdot[0]) - (y1 - input) / R0,
        C1 * (xdot[0] - xdot[1]) - (y2 / R + (y2 - UB) / R + (1.0 - ALPHA) * first),
        -C2 * xdot[2] - (y3 / R - first),
        C3 * (xdot[4] - xdot[3]) - ((y4 - UB) / R + ALPHA * first),
        C3 * (xdot[3] - xdot[4]) - (y5 / R + (y5 - UB) / R + (1.0 - ALPHA) * second),
        -C4 * xdot[5] - (y6 / R - second),
        C5 * (xdot[7] - xdot[6]) - ((y7 - UB) / R + ALPHA * second),
        C5 * (xdot[6] - xdot[7]) - y8 / R,
    ]
}

/// The same amplifier as an equation of index 1 with algebraic states: x = the voltages of the five
/// capacitors, [y2 − y1, y3, y5 − y4, y6, y8 − y7], z = the nodes [y1, y4, y7].
#[dae]
pub fn transistor_capacitors(xdot: [f64; 5], x: [f64; 5], z: [f64; 3], t: f64) -> [f64; 8] {
    const UB: f64 = 6.0;
    const UF: f64 = 0.026;
    const ALPHA: f64 = 0.99;
    const BETA: f64 = 1e-6;
    const R0: f64 = 1000.0;
    const R: f64 = 9000.0; // R1 to R9
    const C: [f64; 5] = [1e-6, 2e-6, 3e-6, 4e-6, 5e-6];

    let [y1, y4, y7] = z;
    let (y2, y3, y5, y6, y8) = (y1 + x[0], x[1], y4 + x[2], x[3], y7 + x[4]);
    let input = 0.1 * (200.0 * PI * t).sin();
    let transistor = |voltage: f64| BETA * ((voltage / UF).exp() - 1.0);
    let (first, second) = (transistor(y2 - y3), transistor(y5 - y6));
    let i1 = (y1 - input) / R0;
    let i4 = (y4 - UB) / R + ALPHA * first;
    let i7 = (y7 - UB) / R + ALPHA * second;
    [
        C[0] * xdot[0] - i1,
        i1 + y2 / R + (y2 - UB) / R + (1.0 - ALPHA) * first,
        -C[1] * xdot[1] - (y3 / R - first),
        C[2] * xdot[2] - i4,
        i4 + y5 / R + (y5 - UB) / R + (1.0 - ALPHA) * second,
        -C[3] * xdot[3] - (y6 / R - second),
        C[4] * xdot[4] - i7,
        i7 + y8 / R,
    ]
}
