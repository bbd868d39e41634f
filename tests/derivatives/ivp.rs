//! The models of the IVP set: their derivatives three ways, and what is known of their equations
//! without solving them.

use casados::testing::{Points, check_derivatives, check_pattern};
use casados::{Dae, GraphDae};

use crate::models::ivp::chemistry::{
    AkzoNobel, E5, E5Conserved, Hires, Oregonator, Robertson, RobertsonConserved,
};
use crate::models::ivp::circuits::{RingModulator, TransistorAmplifier, TransistorCapacitors};
use crate::models::ivp::mechanics::{Pleiades, Squeezer};
use crate::models::ivp::oscillators::{VanDerPol, VanDerPolScaled};
use reference_data::Record;

fn derivatives<M: GraphDae>(points: &Points<M>) {
    check_derivatives(points).assert();
    check_pattern(points).assert();
}

#[test]
fn derivatives_of_chemistry() {
    derivatives::<Robertson>(&Points::random(8).all(0.1..=1.0));
    derivatives::<RobertsonConserved>(&Points::random(8).all(0.1..=1.0));
    derivatives::<Hires>(&Points::random(8).all(0.0..=1.0));
    derivatives::<Oregonator>(&Points::random(8).all(0.1..=3.0));
    derivatives::<E5>(&Points::random(8).all(0.0..=1.0));
    derivatives::<E5Conserved>(&Points::random(8).all(0.0..=1.0));
    derivatives::<AkzoNobel>(&Points::random(8).all(0.1..=1.0));
}

#[test]
fn derivatives_of_other_models() {
    derivatives::<VanDerPol>(&Points::random(8).all(-2.0..=2.0));
    derivatives::<VanDerPolScaled>(&Points::random(8).all(-2.0..=2.0));
    derivatives::<RingModulator>(&Points::random(4).all(-0.3..=0.3));
    derivatives::<TransistorAmplifier>(&Points::random(4).all(-0.05..=0.05));
    derivatives::<TransistorCapacitors>(&Points::random(4).all(-0.05..=0.05));
    derivatives::<Pleiades>(&Points::random(2).all(-3.0..=3.0));
    derivatives::<Squeezer>(&Points::random(4).all(-1.0..=1.0));
}

fn residual<M: GraphDae>(v: &[f64], equations: usize) -> Vec<f64> {
    let mut f = vec![f64::NAN; equations];
    M::residual_of(v, &mut f);
    f
}

/// `ẋ` of an explicit model.
fn derivative<M: GraphDae>(x: &[f64], p: &[f64], t: f64) -> Vec<f64> {
    let v: Vec<f64> = [&vec![0.0; x.len()], x, p, &[t]].concat();
    residual::<M>(&v, x.len()).iter().map(|f| -f).collect()
}

/// What mass and charge say about the sums of rates: each is a sum of at most eight terms, so that
/// rounding is below 16 ε of the largest.
#[test]
fn invariants() {
    let sum = |terms: &[f64]| {
        let largest = terms.iter().fold(0.0f64, |m, t| m.max(t.abs()));
        assert!(terms.iter().sum::<f64>().abs() <= 16.0 * f64::EPSILON * largest, "{terms:?}");
    };
    let robertson = derivative::<Robertson>(&[0.7, 1e-5, 0.3], &[0.04, 3e7, 1e4], 0.0);
    sum(&robertson);
    // The first three rates with their constants: three known numbers.
    assert!((robertson[2] - 3e7 * 1e-10).abs() < 1e-15);
    assert!((robertson[0] - (1e4 * 1e-5 * 0.3 - 0.028)).abs() < 1e-15);
    let e5 = derivative::<E5>(&[1.7e-3, 1e-10, 0.9e-10, 1e-11], &[], 0.0);
    // y2 − y3 − y4 is constant.
    let [_, y2, y3, y4] = e5[..] else { panic!("four rates") };
    let terms = 7.89e-10 * 1.7e-3 + 1.1e7 * 1.7e-3 * 0.9e-10;
    assert!((y2 - y3 - y4).abs() <= 16.0 * f64::EPSILON * terms, "{e5:?}");
    let hires = derivative::<Hires>(&[0.3, 0.1, 0.2, 0.5, 0.7, 0.1, 0.4, 0.003], &[], 0.0);
    sum(&[hires[6], hires[7]]);
    let pleiades =
        Record::load("ivp/ends.json").expect("the reference is there").record("pleiades").expect("a problem");
    let x0 = pleiades.numbers("x0", 28).expect("x0");
    let stars = derivative::<Pleiades>(&x0, &[], 0.0);
    for forces in [14, 21] {
        sum(&(0..7).map(|j| (j + 1) as f64 * stars[forces + j]).collect::<Vec<_>>());
    }
}

/// The start values of Akzo Nobel and of the squeezer are consistent as published.
#[test]
fn start_values() {
    let x = [0.444, 0.00123, 0.0, 0.007, 0.0];
    let p = [18.7, 0.58, 0.09, 0.42, 34.4, 3.3, 115.83, 0.9, 737.0];
    let v = [&[0.0; 5], &x[..], &[0.35999964], &p, &[0.0]].concat();
    // The product 115.83 · 0.444 · 0.007 = 0.35999964, rounded three times.
    assert!(residual::<AkzoNobel>(&v, 6)[5].abs() <= 3.0 * f64::EPSILON);

    let q =
        Record::load("ivp/ends.json").expect("the reference is there").record("squeezer").expect("a problem");
    let x = q.numbers("x0", 14).expect("x0");
    // Hairer and Wanner, Solving ODEs II, section VII.7.
    #[allow(clippy::excessive_precision)] // As published.
    let w = [14222.4439199541138705911625887, -10666.8329399655854029433719415, 0.0, 0.0, 0.0, 0.0, 0.0];
    #[allow(clippy::excessive_precision)]
    let lambda = [98.5668703962410896057654982170, -6.12268834425566265503114393122, 0.0, 0.0, 0.0, 0.0];
    let v = [&[0.0; 7], &w[..], &x, &w, &lambda, &[0.0]].concat();
    for (row, f) in residual::<Squeezer>(&v, 27).iter().enumerate() {
        // Terms are at most |w| · 0.04 = 600 in the constraints, and two of them cancel with an
        // error of ε each; the data have 30 digits.
        assert!(f.abs() <= 600.0 * 4.0 * f64::EPSILON, "equation {row}: {f:e}");
    }
    assert_eq!(Squeezer::STRUCTURE.z.len(), 13);
}

/// Both forms of the amplifier have the same currents.
#[test]
fn forms_of_the_amplifier() {
    let y = [0.1, 0.2, 0.15, 2.9, 0.3, 0.21, 4.0, 1.2];
    let rates = [3.0, -2.0, 5.0, 0.7, -1.3, 2.5, 4.0, -0.4];
    let capacitors = |y: &[f64]| [y[1] - y[0], y[2], y[4] - y[3], y[5], y[7] - y[6]];
    let nodes = [&rates[..], &y, &[0.003]].concat();
    let nodes = residual::<TransistorAmplifier>(&nodes, 8);
    let other = [&capacitors(&rates)[..], &capacitors(&y), &[y[0], y[3], y[6]], &[0.003]].concat();
    let other = residual::<TransistorCapacitors>(&other, 8);
    let same = |a: f64, b: f64| assert!((a - b).abs() <= 1e-13 * a.abs().max(1e-3), "{a} {b}");
    for row in [0, 2, 3, 5, 6] {
        same(nodes[row], other[row]);
    }
    // Currents into a node, and those through both plates of its capacitor.
    for (first, second) in [(0, 1), (3, 4), (6, 7)] {
        same(nodes[first] + nodes[second], -other[second]);
    }
}
