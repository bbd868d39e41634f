//! Time of one call by criterion: simulation, forward, adjoint, Hessian, from start values of zero,
//! to rounding.
//!
//! `cargo bench --manifest-path benches/Cargo.toml -- 'chain 5'` runs a part. "s4n4" is a method of
//! 4 stages with 4 steps.

use casados::prelude::Start;
use casados_benches::calls::{open_calls, options};
use casados_benches::case::{Case, Family, Mode};
use criterion::{Criterion, criterion_group, criterion_main};
use std::time::Duration;

fn cases() -> Vec<Case> {
    let mut cases = vec![Case::pendulum(Family::Gauss, 2, 1), Case::pendulum(Family::Gauss, 4, 4)];
    for masses in [3, 5, 7, 9, 13] {
        cases.extend([(2, 1), (4, 4)].map(|(s, n)| Case::chain(masses, Family::Gauss, s, n)));
    }
    cases.push(Case::awe().expect("the data are part of the repository"));
    cases
}

fn integrators(c: &mut Criterion) {
    for case in cases() {
        let mut integrator =
            open_calls(&case, options(&case, 0.0, Start::Zero)).expect("the case is compiled in");
        let mut group = c.benchmark_group(&case.name);
        for mode in Mode::ALL_MODES {
            group.bench_function(mode.name(), |b| b.iter(|| integrator.call_input(mode, 0)));
        }
        group.finish();
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .warm_up_time(Duration::from_millis(100))
        .measurement_time(Duration::from_millis(500))
        .sample_size(20)
        .without_plots();
    targets = integrators
}
criterion_main!(benches);
