//! The same results, but for rounding, with every kind of registers that this machine has: one
//! interval, and many side by side, in every mode.

use crate::models::chain::{Chain, stretched};
use crate::models::pendulum::Pendulum;
use casados::__private::Matrix;
use casados::batch::{self, Single};
use casados::model::{VectorU, VectorX};
use casados::prelude::*;
use casados::result::{Adjoint, Forward, Hessian, Nominal};
use casados::testing::{Level, limit_level};
use nalgebra::{SVector, Vector1, vector};

type Test = Result<(), Box<dyn std::error::Error>>;

/// One lane is left over in a register of four, five in one of eight.
const INTERVAL_COUNT: usize = 13;

/// Conditions of the Newton matrices are of order ten, and four steps add up (as in
/// `tests/batch`). One step of an explicit method of four stages is 120 apart at most (there, too).
const TOLERANCE: f64 = 2.0 * 100.0 * f64::EPSILON;

struct Horizon<M: Dae> {
    x0: Vec<VectorX<M, f64>>,
    u: Vec<VectorU<M, f64>>,
    h: f64,
    lambda: Vec<VectorX<M, f64>>,
}

/// All results of all modes in a list for each matrix.
fn flatten_results<M: Dae>(
    nominal: &Nominal<M>,
    forward: &Forward<M>,
    adjoint: &Adjoint<M>,
    hessian: &Hessian<M>,
) -> Vec<Vec<f64>> {
    [
        nominal.x.as_slice(),
        forward.x.as_slice(),
        forward.dx_dx0.as_slice(),
        forward.dx_du.as_slice(),
        adjoint.grad_x0.as_slice(),
        adjoint.grad_u.as_slice(),
        hessian.dx_dx0.as_slice(),
        hessian.grad_x0.as_slice(),
        hessian.h_xx.as_slice(),
        hessian.h_xu.as_slice(),
        hessian.h_uu.as_slice(),
    ]
    .map(<[f64]>::to_vec)
    .to_vec()
}

fn results_of_all_modes<I: Single<Number = f64>>(
    horizon: &Horizon<I::Model>,
    single: &mut I,
    batch: &mut batch::Integrator<I>,
) -> Result<Vec<Vec<f64>>, Box<dyn std::error::Error>> {
    let Horizon { x0, u, h, lambda } = horizon;
    let mut all = Vec::new();
    for ((x0, u), lambda) in x0.iter().zip(u).zip(lambda) {
        let nominal = *single.solve(x0, u, *h)?;
        let forward = *single.forward(x0, u, *h)?;
        let adjoint = *single.adjoint(x0, u, *h, lambda)?;
        all.extend(flatten_results(&nominal, &forward, &adjoint, single.hessian(x0, u, *h, lambda)?));
    }
    let intervals = Intervals { x0, u, h: &[*h], ..Default::default() };
    let mut nominal = vec![Nominal::default(); INTERVAL_COUNT];
    let mut forward = vec![Forward::default(); INTERVAL_COUNT];
    let mut adjoint = vec![Adjoint::default(); INTERVAL_COUNT];
    let mut hessian = vec![Hessian::default(); INTERVAL_COUNT];
    batch.solve(&intervals, &mut nominal)?;
    batch.forward(&intervals, &mut forward)?;
    batch.adjoint(&intervals, lambda, &mut adjoint)?;
    batch.hessian(&intervals, lambda, &mut hessian)?;
    for (((nominal, forward), adjoint), hessian) in nominal.iter().zip(&forward).zip(&adjoint).zip(&hessian) {
        all.extend(flatten_results(nominal, forward, adjoint, hessian));
    }
    Ok(all)
}

fn check_level<I: Single<Number = f64>>(
    horizon: &Horizon<I::Model>,
    mut build: impl FnMut() -> Result<(I, batch::Integrator<I>), Error>,
) -> Test {
    limit_level(Level::Single);
    let (mut single, mut batch) = build()?;
    let expected = results_of_all_modes(horizon, &mut single, &mut batch)?;
    for level in [Level::Base, Level::Avx2, Level::Avx512] {
        limit_level(level);
        let (mut single, mut batch) = build()?;
        let found = results_of_all_modes(horizon, &mut single, &mut batch)?;
        for (place, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let size = expected.iter().fold(0.0, |size: f64, value| size.max(value.abs()));
            for (found, expected) in found.iter().zip(expected) {
                let error = (found - expected).abs();
                assert!(
                    error <= TOLERANCE * size,
                    "{level:?}, list {place}: {found:e} instead of {expected:e}, {error:e} apart"
                );
            }
        }
        // What was computed for nothing would agree as well.
        assert!(expected.iter().flatten().any(|value| *value != 0.0));
    }
    Ok(())
}

#[test]
fn results_at_all_simd_levels() -> Test {
    let _turn = crate::serialise();
    let pendulum = Horizon::<Pendulum> {
        x0: (0..INTERVAL_COUNT).map(|k| vector![0.1, 0.3 + 0.05 * k as f64, -0.2, 0.4]).collect(),
        u: (0..INTERVAL_COUNT).map(|k| Vector1::new(0.1 * k as f64)).collect(),
        h: 0.1,
        lambda: vec![vector![1.0, -0.5, 0.25, 2.0]; INTERVAL_COUNT],
    };
    let options = Options { steps: 2, ..Default::default() };
    let one = Options::default();
    check_level(&pendulum, || {
        Ok((Irk::<Pendulum, Gauss<2>>::new(options)?, Batch::<Pendulum, Gauss<2>>::new(options)?))
    })?;
    check_level(&pendulum, || {
        Ok((Irk::<Pendulum, RadauIIA<3>>::new(options)?, Batch::<Pendulum, RadauIIA<3>>::new(options)?))
    })?;
    check_level(&pendulum, || Ok((Erk::<Pendulum, Rk4>::new(one)?, Batch::<Pendulum, Rk4>::new(one)?)))?;
    let wave = |k: usize| SVector::<f64, 9>::from_fn(|i, _| 0.01 * ((k * (i + 3)) as f64).sin());
    let chain = Horizon::<Chain<9>> {
        x0: (0..INTERVAL_COUNT).map(|k| stretched::<9>() + wave(k + 1)).collect(),
        u: (0..INTERVAL_COUNT).map(|k| vector![0.1, -0.05 * k as f64, 0.2]).collect(),
        h: 0.2,
        lambda: vec![SVector::from_fn(|i, _| 1.0 - 0.2 * i as f64); INTERVAL_COUNT],
    };
    check_level(&chain, || {
        Ok((Irk::<Chain<9>, Gauss<4>>::new(options)?, Batch::<Chain<9>, Gauss<4>>::new(options)?))
    })?;
    check_level(&chain, || Ok((Erk::<Chain<9>, Rk4>::new(one)?, Batch::<Chain<9>, Rk4>::new(one)?)))?;
    check_level(&chain, || {
        Ok((Irk::<Chain<9>, Gauss<6>>::new(options)?, Batch::<Chain<9>, Gauss<6>>::new(options)?))
    })
}
