//! Parameters that are estimated from measurements, and doses of medicine.

use super::{FREE, intervals, line, made, over, rk4};
use crate::{Entry, Facts};
use casados::ocp::{GeneralCost, Problem, WithIntegral};
use casados::{Quadrature, function, ode};
use core::f64::consts::PI;

/// An unstable model whose parameter is to be found.
#[ode]
pub fn unstable(x: [f64; 2], u: [f64; 1], t: f64) -> [f64; 2] {
    const RATE: f64 = 60.0;
    [x[1], RATE * RATE * x[0] - (RATE * RATE + u[0] * u[0]) * (u[0] * t).sin()]
}

#[function]
fn unstable_misfit(x: [f64; 2], _u: [f64; 1], t: f64) -> f64 {
    let (s, c) = (PI * t).sin_cos();
    (x[0] - s) * (x[0] - s) + (x[1] - PI * c) * (x[1] - PI * c)
}

/// Bock's notorious problem with exact measurements: the parameter is π, and nothing is left.
fn bock() -> made!() {
    let n = intervals(50);
    let dynamics = WithIntegral::new(rk4::<Unstable>(4)?, Quadrature::<UnstableMisfit>::new());
    let mut ocp = Problem::new(dynamics).on(over(n, 1.0))?;
    ocp.fix_initial_state(&[0.0, PI])?.shared("u")?.bound("u", ..1, -10.0, 10.0)?;
    ocp.guess(&[0.0, 0.0], &[1.0])?;
    Ok(ocp)
}

/// Schittkowski's linear model with two parameters, whose solution is eᵗ for (19, 1).
#[ode]
pub fn rotating(x: [f64; 3], u: [f64; 2], t: f64) -> [f64; 3] {
    let [a, b] = u;
    let (s, c) = (b * t).sin_cos();
    let (st, ct) = t.sin_cos();
    let e = t.exp();
    [
        (b - a * c) * x[0] + (b + a * s) * x[2] + e * (-1.0 + 19.0 * (ct - st)),
        a * x[1] - 18.0 * e,
        (-b + a * s) * x[0] + (b + a * c) * x[2] + e * (1.0 - 19.0 * (ct + st)),
    ]
}

#[function]
fn rotating_misfit(x: [f64; 3], _u: [f64; 2], t: f64) -> f64 {
    let e = t.exp();
    (x[0] - e) * (x[0] - e) + (x[1] - e) * (x[1] - e) + (x[2] - e) * (x[2] - e)
}

/// Two parameters from exact measurements.
fn two_parameters() -> made!() {
    let n = intervals(80);
    let dynamics = WithIntegral::new(rk4::<Rotating>(4)?, Quadrature::<RotatingMisfit>::new());
    let mut ocp = Problem::new(dynamics).on(over(n, PI))?;
    ocp.free_initial_state().shared("u")?.bound("u", ..1, 0.0, 30.0)?;
    line(&mut ocp, &[1.0; 3], &[PI.exp(); 3], &[28.5, 1.5])?;
    Ok(ocp)
}

/// Gas oil that cracks; three rates; measurements and whether there are some.
#[ode]
pub fn cracking(x: [f64; 2], u: [f64; 3], _p: [f64; 3]) -> [f64; 2] {
    [-(u[0] + u[2]) * x[0] * x[0], u[0] * x[0] * x[0] - u[1] * x[1]]
}

#[function]
fn cracking_misfit(x: [f64; 2], _u: [f64; 3], p: [f64; 3]) -> f64 {
    p[2] * ((x[0] - p[0]) * (x[0] - p[0]) + (x[1] - p[1]) * (x[1] - p[1]))
}

/// Times in 1/40, and measurements of Tjoa and Biegler.
const CRACKING: [(usize, f64, f64); 21] = [
    (0, 1.0, 0.0),
    (1, 0.8105, 0.2),
    (2, 0.6208, 0.2886),
    (3, 0.5258, 0.301),
    (4, 0.4345, 0.3215),
    (5, 0.3903, 0.3123),
    (6, 0.3342, 0.2716),
    (7, 0.3034, 0.2551),
    (8, 0.2735, 0.2258),
    (9, 0.2405, 0.1959),
    (10, 0.2283, 0.1789),
    (12, 0.2071, 0.1457),
    (14, 0.1669, 0.1198),
    (16, 0.1530, 0.0909),
    (18, 0.1339, 0.0719),
    (20, 0.1265, 0.0561),
    (22, 0.1200, 0.0460),
    (26, 0.0990, 0.0280),
    (30, 0.0870, 0.0190),
    (34, 0.0770, 0.0140),
    (38, 0.0690, 0.0100),
];

/// Three rates from 21 measurements.
fn gas_oil() -> made!() {
    let (n, each) = (intervals(38), intervals(1));
    let mut ocp = Problem::new(rk4::<Cracking>(2)?)
        .stage_cost(GeneralCost::<CrackingMisfit>::new())
        .terminal_cost(GeneralCost::<CrackingMisfit>::new())
        .on(over(n, 0.95))?;
    ocp.fix_initial_state(&[1.0, 0.0])?.shared("u")?.bound("u", ..1, 0.0, 20.0)?;
    ocp.set_parameters(.., &[0.0; 3])?;
    for (at, a, b) in CRACKING {
        ocp.set_parameters(each * at..=each * at, &[a, b, 1.0])?;
    }
    line(&mut ocp, &[1.0, 0.3], &[0.069, 0.01], &[0.0; 3])?;
    Ok(ocp)
}

/// Prey and predators; four rates; measurements and whether there are some.
#[ode]
pub fn lotka(x: [f64; 2], u: [f64; 4], _p: [f64; 3]) -> [f64; 2] {
    [-u[0] * x[0] + u[1] * x[0] * x[1], u[2] * x[1] - u[3] * x[0] * x[1]]
}

#[function]
fn lotka_misfit(x: [f64; 2], _u: [f64; 4], p: [f64; 3]) -> f64 {
    p[2] * ((x[0] - p[0]) * (x[0] - p[0]) + (x[1] - p[1]) * (x[1] - p[1]))
}

const LOTKA: [[f64; 2]; 10] = [
    [0.58462429, 1.653802752],
    [1.480323792, 1.898433328],
    [1.941197515, 0.791087389],
    [1.266090393, 0.402385741],
    [0.68499583, 0.435968041],
    [0.435253441, 0.725707829],
    [0.404814065, 1.244405746],
    [0.822427034, 2.052562952],
    [1.771604896, 1.426515341],
    [1.754832745, 0.548344791],
];

/// Four rates from ten measurements.
fn predator_prey() -> made!() {
    let (n, each) = (intervals(40), intervals(4));
    let mut ocp = Problem::new(rk4::<Lotka>(2)?)
        .stage_cost(GeneralCost::<LotkaMisfit>::new())
        .terminal_cost(GeneralCost::<LotkaMisfit>::new())
        .on(over(n, 10.0))?;
    ocp.fix_initial_state(&[0.4, 1.0])?.shared("u")?.bound("u", ..1, -1.0, 5.0)?;
    ocp.set_parameters(.., &[0.0; 3])?;
    for (i, [a, b]) in LOTKA.iter().enumerate() {
        ocp.set_parameters(each * (i + 1)..=each * (i + 1), &[*a, *b, 1.0])?;
    }
    ocp.guess(&[0.4, 1.0], &[0.8, 0.8, 1.5, 1.5])?;
    Ok(ocp)
}

/// Tuberculosis in two strains: susceptible, treated, latent and infectious of both; efforts.
#[ode]
pub fn two_strains(x: [f64; 6], u: [f64; 2]) -> [f64; 6] {
    const PEOPLE: f64 = 30000.0;
    const LEAVE: f64 = 0.0143;
    let [s, t, l1, l2, i1, i2] = x;
    let (one, two) = (13.0 * i1 / PEOPLE, 0.029 * i2 / PEOPLE);
    let failures = 1.0 - u[1];
    [
        LEAVE * PEOPLE - (one + two + LEAVE) * s,
        2.0 * u[0] * l1 + (1.0 - failures * 0.5) * i1 - (LEAVE + one + two) * t,
        one * (s + t) + failures * 0.4 * i1 - (LEAVE + 0.5 + 2.0 * u[0] + two) * l1,
        failures * 0.1 * i1 - (LEAVE + 1.0) * l2 + two * (s + l1 + t),
        0.5 * l1 - (LEAVE + 1.0) * i1,
        l2 - LEAVE * i2,
    ]
}

#[function]
fn resistant(x: [f64; 6], u: [f64; 2]) -> f64 {
    x[3] + x[5] + 25.0 * u[0] * u[0] + 250.0 * u[1] * u[1]
}

/// As few of the resistant strain as possible in five years.
fn tuberculosis() -> made!() {
    let n = intervals(50);
    let dynamics = WithIntegral::new(rk4::<TwoStrains>(1)?, Quadrature::<Resistant>::new());
    let mut ocp = Problem::new(dynamics).on(over(n, 5.0))?;
    let start = [76.0, 1.0, 36.0, 2.0, 4.0, 1.0].map(|part| part * 250.0);
    ocp.fix_initial_state(&start)?.bound("u", .., 0.05, 0.95)?.bound("x", 1.., 0.0, FREE)?;
    ocp.guess(&start, &[0.5, 0.5])?;
    Ok(ocp)
}

/// HIV: healthy cells, viruses; two treatments.
#[ode]
pub fn immunology(x: [f64; 2], u: [f64; 2]) -> [f64; 2] {
    let [t, v] = x;
    [
        2.0 - 1.5 * v / (14.0 + v) - 0.002 * t - 2.5e-4 * v * t + u[0] * t,
        30.0 * (1.0 - u[1]) * v / (1.0 + v) - 0.007 * v * t,
    ]
}

#[function]
fn burden(x: [f64; 2], u: [f64; 2]) -> f64 {
    2.5e5 * u[0] * u[0] + 75.0 * u[1] * u[1] - x[0]
}

/// Joshi's treatment over fifty days.
fn hiv() -> made!() {
    let n = intervals(100);
    let dynamics = WithIntegral::new(rk4::<Immunology>(4)?, Quadrature::<Burden>::new());
    let mut ocp = Problem::new(dynamics).on(over(n, 50.0))?;
    ocp.fix_initial_state(&[400.0, 3.0])?.bound("u[0]", .., 0.0, 0.02)?.bound("u[1]", .., 0.0, 0.9)?;
    ocp.bound("x", 1.., 0.0, FREE)?.guess(&[400.0, 3.0], &[0.01, 0.45])?;
    Ok(ocp)
}

/// All of them.
pub fn all() -> Vec<Entry> {
    let facts = Facts::new;
    let betts = "J. T. Betts, Practical Methods for Optimal Control, 2010";
    vec![
        Entry::new(
            facts("bock", "PSOPT, notorious; exact data: closed form", 0.0, 0.0, &["parameter", "unstable"]),
            bock,
        ),
        Entry::new(
            facts(
                "two_parameters",
                "PSOPT, param2; exact data: closed form",
                0.0,
                0.0,
                &["parameter", "unstable", "time-dependent"],
            ),
            two_parameters,
        ),
        Entry::new(
            facts("gas_oil", "PSOPT, cracking; COPS 3.0", 5.228971e-3, 5e-10, &["parameter", "data"]),
            gas_oil,
        ),
        Entry::new(
            facts("predator_prey", "PSOPT, predator", 2.753366e-2, 5e-9, &["parameter", "data"]),
            predator_prey,
        ),
        Entry::new(facts("tuberculosis", betts, 5152.07310, 5e-6, &["units", "smooth"]), tuberculosis),
        Entry::new(facts("hiv", betts, -29514.4477, 5e-5, &["units", "smooth"]), hiv),
    ]
}
