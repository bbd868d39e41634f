//! Time of one call: simulation, Jacobian, adjoint, Hessian, from start values of zero.
//!
//! "s4n4" is a method of 4 stages with 4 steps. `cargo bench --bench integrators -- chain` runs a part.

#[path = "../examples/models/awe.rs"]
mod awe;
#[path = "../examples/models/chain.rs"]
mod chain;
#[path = "../tests/data/mod.rs"]
mod data;
#[path = "../examples/models/pendulum.rs"]
mod pendulum;

use awe::Awe;
use casados::prelude::*;
use chain::{Chain, stretched};
use criterion::{Criterion, criterion_group, criterion_main};
use data::Record;
use nalgebra::{SVector, vector};
use pendulum::Pendulum;
use std::hint::black_box;
use std::time::Duration;

fn cold(steps: usize) -> Options {
    Options { steps, start: Start::Zero, ..Default::default() }
}

/// The four questions to one integrator.
macro_rules! questions {
    ($criterion:ident, $name:expr, $integrator:ty, $steps:expr, $x0:expr, $u:expr, $h:expr, $lambda:expr) => {{
        let (x0, u, h, lambda) = ($x0, $u, $h, $lambda);
        let mut irk = <$integrator>::new(cold($steps)).expect("the options are valid");
        let mut group = $criterion.benchmark_group($name);
        group.bench_function("simulation", |b| b.iter(|| irk.solve(black_box(&x0), &u, h).map(drop)));
        group.bench_function("jacobian", |b| b.iter(|| irk.forward(black_box(&x0), &u, h).map(drop)));
        group.bench_function("adjoint", |b| b.iter(|| irk.adjoint(black_box(&x0), &u, h, &lambda).map(drop)));
        group.bench_function("hessian", |b| b.iter(|| irk.hessian(black_box(&x0), &u, h, &lambda).map(drop)));
        group.finish();
    }};
}

fn pendulum(c: &mut Criterion) {
    let x0 = vector![0.0, 3.441592653589793, 0.5, -0.7];
    let lambda = SVector::repeat(1.0);
    questions!(c, "pendulum s2n1", Irk<Pendulum, Gauss<2>>, 1, x0, vector![1.5], 0.05, lambda);
    questions!(c, "pendulum s4n4", Irk<Pendulum, Gauss<4>>, 4, x0, vector![1.5], 0.05, lambda);
}

macro_rules! chains {
    ($criterion:ident, $($nx:literal),*) => {$(
        let (x0, u, h) = (stretched::<$nx>(), vector![-1.0, 1.0, 1.0], 0.2);
        let lambda = SVector::repeat(1.0);
        let masses = ($nx - 3) / 6 + 2;
        questions!($criterion, format!("chain {masses} s2n1"), Irk<Chain<$nx>, Gauss<2>>, 1, x0, u, h, lambda);
        questions!($criterion, format!("chain {masses} s4n4"), Irk<Chain<$nx>, Gauss<4>>, 4, x0, u, h, lambda);
    )*};
}

fn chain(c: &mut Criterion) {
    chains!(c, 9, 21, 33, 45, 69);
}

/// The first interval of the optimal orbit.
fn awe(c: &mut Criterion) {
    let reference = Record::load("awe/intervals.json").expect("the file is part of the repository");
    let h = reference.number("T").expect("a number");
    let interval = &reference.records("intervals").expect("a list")[0];
    let (x0, u) = (interval.vector("x0").expect("23 numbers"), interval.vector("u").expect("4 numbers"));
    let lambda = reference.vector("lambda").expect("23 numbers");
    questions!(c, "awe radau s4n1", Irk<Awe, RadauIIA<4>>, 1, x0, u, h, lambda);
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .warm_up_time(Duration::from_millis(100))
        .measurement_time(Duration::from_millis(500))
        .sample_size(20)
        .without_plots();
    targets = pendulum, chain, awe
}
criterion_main!(benches);
