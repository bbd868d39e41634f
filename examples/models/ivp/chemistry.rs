//! Chemical kinetics: rates over many orders of magnitude.

use casados::{dae, ode};

/// Robertson's three reactions. p = [k1, k2, k3], nominally [0.04, 3e7, 1e4].
#[ode]
pub fn robertson(x: [f64; 3], p: [f64; 3]) -> [f64; 3] {
    let [y1, y2, y3] = x;
    let [k1, k2, k3] = p;
    let (first, second, third) = (k1 * y1, k2 * y2 * y2, k3 * y2 * y3);
    [third - first, first - third - second, second]
}

/// The same with conservation of mass instead of the third equation.
#[dae]
pub fn robertson_conserved(xdot: [f64; 2], x: [f64; 2], z: f64, p: [f64; 3]) -> [f64; 3] {
    let [y1, y2] = x;
    let [k1, k2, k3] = p;
    let (first, second, third) = (k1 * y1, k2 * y2 * y2, k3 * y2 * z);
    [xdot[0] - (third - first), xdot[1] - (first - third - second), y1 + y2 + z - 1.0]
}

/// High irradiance responses of photomorphogenesis (Schäfer): eight reactants.
#[ode]
pub fn hires(x: [f64; 8]) -> [f64; 8] {
    let [y1, y2, y3, y4, y5, y6, y7, y8] = x;
    let bound = 280.0 * y6 * y8;
    [
        -1.71 * y1 + 0.43 * y2 + 8.32 * y3 + 0.0007,
        1.71 * y1 - 8.75 * y2,
        -10.03 * y3 + 0.43 * y4 + 0.035 * y5,
        8.32 * y2 + 1.71 * y3 - 1.12 * y4,
        -1.745 * y5 + 0.43 * (y6 + y7),
        -bound + 0.69 * y4 + 1.71 * y5 - 0.43 * y6 + 0.69 * y7,
        bound - 1.81 * y7,
        -bound + 1.81 * y7,
    ]
}

/// The Belousov-Zhabotinskii reaction. p = [s, q, s, w], nominally [77.27, 8.375e-6, 77.27, 0.161].
#[ode]
pub fn oregonator(x: [f64; 3], p: [f64; 4]) -> [f64; 3] {
    let [y1, y2, y3] = x;
    let [s, q, s2, w] = p;
    [s * (y2 + y1 * (1.0 - q * y1 - y2)), (y3 - (1.0 + y1) * y2) / s2, w * (y1 - y3)]
}

/// A pyrolysis with concentrations below 1e-20.
#[ode]
pub fn e5(x: [f64; 4]) -> [f64; 4] {
    const A: f64 = 7.89e-10;
    const B: f64 = 1.1e7;
    const C: f64 = 1.13e3;
    const M: f64 = 1e6;
    let [y1, y2, y3, y4] = x;
    let (first, second, third) = (A * y1, B * y1 * y3, M * C * y2 * y3);
    [-first - second, first - third, first - second - third + C * y4, second - C * y4]
}

/// The same with its invariant y2 − y3 − y4 = 0 as an equation: rounding errors of the rates, far
/// above y4, do not add up in it. x = [y1, y2, y4], z = y3.
#[dae]
pub fn e5_conserved(xdot: [f64; 3], x: [f64; 3], z: f64) -> [f64; 4] {
    const A: f64 = 7.89e-10;
    const B: f64 = 1.1e7;
    const C: f64 = 1.13e3;
    const M: f64 = 1e6;
    let [y1, y2, y4] = x;
    let (first, second, third) = (A * y1, B * y1 * z, M * C * y2 * z);
    [xdot[0] + first + second, xdot[1] - (first - third), xdot[2] - (second - C * y4), y2 - z - y4]
}

/// Two species that react while carbon dioxide is added. x = the first five concentrations, z = the
/// sixth; p = [k1, k2, k3, k4, K, klA, Ks, pCO2, H], nominally [18.7, 0.58, 0.09, 0.42, 34.4, 3.3,
/// 115.83, 0.9, 737].
#[dae]
pub fn akzo_nobel(xdot: [f64; 5], x: [f64; 5], z: f64, p: [f64; 9]) -> [f64; 6] {
    let [y1, y2, y3, y4, y5] = x;
    let [k1, k2, k3, k4, equilibrium, transfer, solubility, pressure, henry] = p;
    let root = y2.sqrt();
    let r1 = k1 * y1 * y1 * y1 * y1 * root;
    let r2 = k2 * y3 * y4;
    let r3 = k2 / equilibrium * y1 * y5;
    let r4 = k3 * y1 * y4 * y4;
    let r5 = k4 * z * z * root;
    let inflow = transfer * (pressure / henry - y2);
    [
        xdot[0] - (-2.0 * r1 + r2 - r3 - r4),
        xdot[1] - (-0.5 * r1 - r4 - 0.5 * r5 + inflow),
        xdot[2] - (r1 - r2 + r3),
        xdot[3] - (-r2 + r3 - 2.0 * r4),
        xdot[4] - (r2 - r3 + r5),
        solubility * y1 * y4 - z,
    ]
}
