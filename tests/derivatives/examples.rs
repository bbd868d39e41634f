//! The example models: their derivative code three ways.

use crate::check;
use crate::models::awe::Awe;
use crate::models::chain::Chain;
use crate::models::pendulum::Pendulum;
use casados::testing::Points;
use reference_data::Record;

#[test]
fn pendulum_derivatives() {
    check::<Pendulum>(&Points::random(20).all(-3.0..=3.0));
}

#[test]
fn chain_derivatives() {
    check::<Chain<9>>(&Points::random(6));
    check::<Chain<21>>(&Points::random(1));
}

/// At points around the optimal orbit that are not consistent: the equations hold nowhere.
#[test]
fn aircraft_derivatives() {
    let record = Record::load("awe/points.json").expect("the points are there");
    let points = record.records("points").expect("a list of points");
    let flat = |point: &Record| -> [f64; 52] {
        let vector = |key, length| point.numbers(key, length).expect("a vector");
        let parts = [vector("xdot", 23), vector("x", 23), vector("z", 1), vector("u", 4), vec![0.0]];
        parts.concat().try_into().expect("52 numbers")
    };
    check::<Awe>(&Points::given(points.iter().step_by(13).map(flat)));
}
