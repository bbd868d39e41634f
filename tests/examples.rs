//! The example models: their derivative code three ways, and the identities of their sensitivities.

use casados::testing::{Points, check_derivatives, check_pattern};
use casados::{DormandPrince5, Erk, Gauss, GraphDae, Irk, RadauIIA, Rk4};
use nalgebra::SVector;

#[path = "../examples/models/awe.rs"]
#[allow(dead_code)]
mod awe;
#[allow(dead_code)]
#[path = "../examples/models/chain.rs"]
mod chain;
mod data;
mod interval;
#[path = "../examples/models/pendulum.rs"]
mod pendulum;

use awe::Awe;
use chain::Chain;
use data::Record;
use interval::{check, options};
use pendulum::Pendulum;

/// Every comparison passes, and at most a tenth of the entries are near a kink or a singularity,
/// where differences say nothing.
fn derivatives<M: GraphDae>(points: &Points<M>) {
    let report = check_derivatives(points);
    report.assert();
    for row in &report.rows {
        assert!(row.inconclusive * 10 <= row.entries, "{report}");
    }
    check_pattern(points).assert();
    assert!(!M::STRUCTURE.jacobian.is_empty(), "{} depends on nothing", M::STRUCTURE.name);
}

#[test]
fn pendulum_derivatives() {
    derivatives::<Pendulum>(&Points::random(20).all(-3.0..=3.0));
}

#[test]
fn chain_derivatives() {
    derivatives::<Chain<9>>(&Points::random(6));
    derivatives::<Chain<21>>(&Points::random(1));
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
    derivatives::<Awe>(&Points::given(points.iter().step_by(13).map(flat)));
}

#[test]
fn pendulum_sensitivities() {
    let x0 = SVector::from([0.1, 2.4, -0.3, 1.2]);
    let (u, p) = (SVector::from([0.7]), SVector::zeros());
    check::<Pendulum, _, 4, 1, 0>(
        Irk::<Pendulum, Gauss<2>>::new(options(1)).expect("valid"),
        &x0,
        &u,
        &p,
        0.05,
    );
    check::<Pendulum, _, 4, 1, 0>(
        Irk::<Pendulum, Gauss<4>>::new(options(4)).expect("valid"),
        &x0,
        &u,
        &p,
        0.1,
    );
    check::<Pendulum, _, 4, 1, 0>(
        Irk::<Pendulum, RadauIIA<3>>::new(options(2)).expect("valid"),
        &x0,
        &u,
        &p,
        0.1,
    );
    check::<Pendulum, _, 4, 1, 0>(Erk::<Pendulum, Rk4>::new(options(3)).expect("valid"), &x0, &u, &p, 0.1);
    check::<Pendulum, _, 4, 1, 0>(
        Erk::<Pendulum, DormandPrince5>::new(options(1)).expect("valid"),
        &x0,
        &u,
        &p,
        0.1,
    );
}

#[test]
fn chain_sensitivities() {
    let record = Record::load("chain/chain_3_irk_s2n1.json").expect("the reference is there");
    let x0: SVector<f64, 9> = record.vector("x0").expect("x0");
    let u: SVector<f64, 3> = record.vector("u").expect("u");
    let p = SVector::zeros();
    check::<Chain<9>, _, 9, 3, 0>(
        Irk::<Chain<9>, Gauss<2>>::new(options(1)).expect("valid"),
        &x0,
        &u,
        &p,
        0.2,
    );
    check::<Chain<9>, _, 9, 3, 0>(
        Irk::<Chain<9>, RadauIIA<2>>::new(options(3)).expect("valid"),
        &x0,
        &u,
        &p,
        0.2,
    );
    check::<Chain<9>, _, 9, 3, 0>(Erk::<Chain<9>, Rk4>::new(options(2)).expect("valid"), &x0, &u, &p, 0.2);
}

/// One of the intervals of the optimal orbit; with an algebraic state.
#[test]
fn aircraft_sensitivities() {
    let record = Record::load("awe/intervals.json").expect("the reference is there");
    let interval = record.records("intervals").expect("intervals").remove(7);
    let x0: SVector<f64, 23> = interval.vector("x0").expect("x0");
    let u: SVector<f64, 4> = interval.vector("u").expect("u");
    let h = record.number("T").expect("T");
    let irk = Irk::<Awe, RadauIIA<4>>::new(options(1)).expect("valid");
    check::<Awe, _, 23, 4, 0>(irk, &x0, &u, &SVector::zeros(), h);
}
