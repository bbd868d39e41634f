//! Models too large to be differentiated side by side: their stages are found side by side, and
//! each is differentiated alone.
//!
//! Errors are those of `tests/batch`.

use crate::models::chain::{Chain, stretched};
use casados::BatchStatistics;
use casados::prelude::*;
use casados::result::{Adjoint, Forward, ForwardAdjoint, Hessian, Nominal};
use casados::testing::limit_cache;
use nalgebra::SVector;

type Test = Result<(), Box<dyn std::error::Error>>;

/// One interval is left over in a register of four, three in one of eight.
const INTERVAL_COUNT: usize = 11;

/// The stages of two steps of a chain of five masses fit for as many lanes as there are, its
/// columns for none.
const CACHE_SIZE: usize = 40 << 10;

/// Both solve the same stages to rounding; the condition of the Newton matrix is of order ten, and
/// two steps add up.
const TOLERANCE: f64 = 2.0 * 100.0 * f64::EPSILON;

fn assert_close(what: &str, found: &[f64], expected: &[f64]) {
    let size = expected.iter().fold(0.0, |size: f64, value| size.max(value.abs()));
    for (found, expected) in found.iter().zip(expected) {
        let error = (found - expected).abs();
        assert!(error <= TOLERANCE * size, "{what}: {found:e} instead of {expected:e}, {error:e} apart");
    }
}

/// So many were differentiated alone from stages that were found side by side, and so many computed
/// alone after all.
fn check(statistics: &BatchStatistics, alone: usize, redone: usize) {
    #[cfg(target_arch = "x86_64")]
    if std::is_x86_feature_detected!("avx2") && std::is_x86_feature_detected!("fma") {
        assert!(statistics.groups >= 2, "{statistics:?}");
        assert_eq!((statistics.alone, statistics.redone), (alone, redone), "{statistics:?}");
        // Each alone would take several iterations a step.
        let work = &statistics.work;
        assert!(work.iterations < 4 * work.steps, "{work:?}");
    }
    let _ = (alone, redone);
}

#[test]
fn derivatives_beyond_the_cache() -> Test {
    let _turn = crate::serialise();
    limit_cache(CACHE_SIZE);
    let wave = |k: usize| SVector::from_fn(|i, _| 0.01 * ((k * (i + 3)) as f64).sin());
    let mut x0: Vec<SVector<f64, 21>> = (0..INTERVAL_COUNT).map(|k| stretched() + wave(k)).collect();
    let u: Vec<SVector<f64, 3>> =
        (0..INTERVAL_COUNT).map(|k| SVector::from_fn(|i, _| (k + i) as f64 / 20.0 - 1.0)).collect();
    let lambda: Vec<SVector<f64, 21>> =
        (0..INTERVAL_COUNT).map(|k| SVector::from_fn(|i, _| ((k + 2 * i) as f64).cos())).collect();
    let h = 0.2;
    for start in [Start::Zero, Start::Warm] {
        let options = Options { steps: 2, start, ..Default::default() };
        let mut batch = Batch::<Chain<21>, Gauss<2>>::new(options)?;
        let mut single = Irk::<Chain<21>, Gauss<2>>::new(Options { steps: 2, ..Default::default() })?;
        let mut nominal = vec![Nominal::default(); INTERVAL_COUNT];
        let mut forward = vec![Forward::default(); INTERVAL_COUNT];
        let mut adjoint = vec![Adjoint::default(); INTERVAL_COUNT];
        let mut both = vec![ForwardAdjoint::default(); INTERVAL_COUNT];
        let mut hessian = vec![Hessian::default(); INTERVAL_COUNT];
        let intervals = Intervals { x0: &x0, u: &u, h: &[h], ..Default::default() };
        batch.solve(&intervals, &mut nominal)?;
        batch.adjoint(&intervals, &lambda, &mut adjoint)?;
        batch.forward(&intervals, &mut forward)?;
        check(batch.statistics(), INTERVAL_COUNT, 0);
        batch.forward_adjoint(&intervals, &lambda, &mut both)?;
        check(batch.statistics(), INTERVAL_COUNT, 0);
        batch.hessian(&intervals, &lambda, &mut hessian)?;
        check(batch.statistics(), INTERVAL_COUNT, 0);
        for k in 0..INTERVAL_COUNT {
            let expected = single.hessian(&x0[k], &u[k], h, &lambda[k])?;
            assert_close("x", nominal[k].x.as_slice(), expected.x.as_slice());
            for found in [&forward[k], &both[k].forward, &hessian[k].first.forward] {
                assert_close("x", found.x.as_slice(), expected.x.as_slice());
                assert_close("dx/dx0", found.dx_dx0.as_slice(), expected.dx_dx0.as_slice());
                assert_close("dx/du", found.dx_du.as_slice(), expected.dx_du.as_slice());
            }
            for found in [&adjoint[k].grad_x0, &both[k].grad_x0, &hessian[k].grad_x0] {
                assert_close("gradient", found.as_slice(), expected.grad_x0.as_slice());
            }
            assert_close("h_xx", hessian[k].h_xx.as_slice(), expected.h_xx.as_slice());
            assert_close("h_xu", hessian[k].h_xu.as_slice(), expected.h_xu.as_slice());
            assert_close("h_uu", hessian[k].h_uu.as_slice(), expected.h_uu.as_slice());
        }
    }

    // Where masses lie at one point springs have no direction. Others hear nothing of it.
    let mut batch = Batch::<Chain<21>, Gauss<2>>::new(Options { steps: 2, ..Default::default() })?;
    let mut single = Irk::<Chain<21>, Gauss<2>>::new(Options { steps: 2, ..Default::default() })?;
    let mut expected = vec![Forward::default(); INTERVAL_COUNT];
    batch.forward(&Intervals { x0: &x0, u: &u, h: &[h], ..Default::default() }, &mut expected)?;
    x0[4] = SVector::zeros();
    let mut found = vec![Forward::default(); INTERVAL_COUNT];
    let outcome = batch.forward(&Intervals { x0: &x0, u: &u, h: &[h], ..Default::default() }, &mut found);
    let error = single.forward(&x0[4], &u[4], h).expect_err("no solution");
    match outcome {
        Err(BatchError::Intervals { failed: 1, first: 4, error: found }) => {
            assert_eq!(format!("{found:?}"), format!("{error:?}"));
        }
        other => panic!("{other:?}"),
    }
    check(batch.statistics(), INTERVAL_COUNT - 1, 1);
    for k in (0..INTERVAL_COUNT).filter(|&k| k != 4) {
        assert_close("dx/dx0", found[k].dx_dx0.as_slice(), expected[k].dx_dx0.as_slice());
    }
    assert_eq!(found[4], Forward::default());
    Ok(())
}
