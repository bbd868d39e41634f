//! The example models: the identities of their sensitivities.

use crate::interval::{check_interval, options};
use crate::models::awe::Awe;
use crate::models::chain::Chain;
use crate::models::pendulum::Pendulum;
use casados::{DormandPrince5, Erk, Gauss, Irk, RadauIIA, Rk4};
use nalgebra::SVector;
use reference_data::Record;

#[test]
fn pendulum_sensitivities() {
    let x0 = SVector::from([0.1, 2.4, -0.3, 1.2]);
    let (u, p) = (SVector::from([0.7]), SVector::zeros());
    check_interval::<Pendulum, _, 4, 1, 0>(
        Irk::<Pendulum, Gauss<2>>::new(options(1)).expect("valid"),
        &x0,
        &u,
        &p,
        0.05,
    );
    check_interval::<Pendulum, _, 4, 1, 0>(
        Irk::<Pendulum, Gauss<4>>::new(options(4)).expect("valid"),
        &x0,
        &u,
        &p,
        0.1,
    );
    check_interval::<Pendulum, _, 4, 1, 0>(
        Irk::<Pendulum, RadauIIA<3>>::new(options(2)).expect("valid"),
        &x0,
        &u,
        &p,
        0.1,
    );
    check_interval::<Pendulum, _, 4, 1, 0>(
        Erk::<Pendulum, Rk4>::new(options(3)).expect("valid"),
        &x0,
        &u,
        &p,
        0.1,
    );
    check_interval::<Pendulum, _, 4, 1, 0>(
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
    check_interval::<Chain<9>, _, 9, 3, 0>(
        Irk::<Chain<9>, Gauss<2>>::new(options(1)).expect("valid"),
        &x0,
        &u,
        &p,
        0.2,
    );
    check_interval::<Chain<9>, _, 9, 3, 0>(
        Irk::<Chain<9>, RadauIIA<2>>::new(options(3)).expect("valid"),
        &x0,
        &u,
        &p,
        0.2,
    );
    check_interval::<Chain<9>, _, 9, 3, 0>(
        Erk::<Chain<9>, Rk4>::new(options(2)).expect("valid"),
        &x0,
        &u,
        &p,
        0.2,
    );
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
    check_interval::<Awe, _, 23, 4, 0>(irk, &x0, &u, &SVector::zeros(), h);
}
