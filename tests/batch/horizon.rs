//! Horizons of the example models, and every call of a batch against single calls.

use crate::models::awe::Awe;
use crate::models::chain::{Chain, stretched};
use crate::models::pendulum::Pendulum;
use casados::__private::Matrix;
use casados::batch::{Single, Standard};
use casados::model::{VectorP, VectorU, VectorX};
use casados::prelude::*;
use casados::result::{Adjoint, Forward, ForwardAdjoint, Hessian, Nominal};
use casados::{Real, batch};
use nalgebra::{SVector, Vector1, vector};
use reference_data::Record;

pub type Test = Result<(), Box<dyn std::error::Error>>;

/// Numbers of intervals: one alone, whole and incomplete groups of any register, and a horizon.
pub const INTERVAL_COUNTS: [usize; 5] = [1, 3, 4, 5, 40];

/// Pendulum and chain have Newton matrices with conditions of order ten; four steps add up.
pub const ORDINARY_TOLERANCE: f64 = 2.0 * 100.0;
/// Aircraft: 6e3.
pub const AIRCRAFT_TOLERANCE: f64 = 2.0 * 6e3;

/// Intervals of a model, with adjoint seeds.
pub struct Horizon<M: Dae, T: Real = f64> {
    pub x0: Vec<VectorX<M, T>>,
    pub u: Vec<VectorU<M, T>>,
    pub p: Vec<VectorP<M, T>>,
    pub h: Vec<T>,
    pub lambda: Vec<VectorX<M, T>>,
}

impl<M: Dae, T: Real> Horizon<M, T> {
    pub fn intervals(&self) -> Intervals<'_, M, T> {
        Intervals { x0: &self.x0, u: &self.u, p: &self.p, h: &self.h, t0: &[] }
    }
}

pub fn chain<const NX: usize>(count: usize) -> Horizon<Chain<NX>>
where
    Chain<NX>: Dae<Shape: casados::Shape<VectorX<f64> = SVector<f64, NX>, VectorU<f64> = SVector<f64, 3>>>,
{
    let wave = |k: usize| SVector::from_fn(|i, _| 0.01 * ((k * (i + 3)) as f64).sin());
    Horizon {
        x0: (0..count).map(|k| stretched() + wave(k)).collect(),
        u: (0..count).map(|k| SVector::from_fn(|i, _| (k + i) as f64 / 20.0 - 1.0)).collect(),
        p: vec![],
        h: (0..count).map(|k| 0.1 + 0.001 * k as f64).collect(),
        lambda: (0..count).map(|k| SVector::from_fn(|i, _| ((k + 2 * i) as f64).cos())).collect(),
    }
}

pub fn pendulum<T: Real>(count: usize) -> Horizon<Pendulum, T> {
    let number = T::from_f64;
    Horizon {
        x0: (0..count).map(|k| vector![0.0, 0.1 * k as f64, 1.0, 0.3].map(number)).collect(),
        u: (0..count).map(|k| Vector1::new(k as f64 / 10.0 - 2.0).map(number)).collect(),
        p: vec![],
        h: vec![number(0.05)],
        lambda: vec![vector![1.0, -0.5, 0.25, 2.0].map(number)],
    }
}

pub fn aircraft(count: usize) -> Result<Horizon<Awe>, Box<dyn std::error::Error>> {
    let reference = Record::load("awe/intervals.json")?;
    let (mut x0, mut u) = (Vec::new(), Vec::new());
    for interval in reference.records("intervals")?.iter().cycle().take(count) {
        x0.push(interval.vector::<23>("x0")?);
        u.push(interval.vector::<4>("u")?);
    }
    Ok(Horizon {
        x0,
        u,
        p: vec![],
        h: vec![reference.number("T")?],
        lambda: vec![reference.vector("lambda")?],
    })
}

/// Two results are the same to so many ε.
pub fn assert_close<T: Real>(what: &str, bound: f64, pairs: &[(&[T], &[T])]) {
    for (field, (a, b)) in pairs.iter().enumerate() {
        let largest = b.iter().map(|b| b.to_f64().abs()).fold(0.0, f64::max);
        for (i, (a, b)) in a.iter().zip(*b).enumerate() {
            let error = (a.to_f64() - b.to_f64()).abs();
            let limit = bound * T::EPSILON * largest;
            assert!(error <= limit, "{what}, field {field}, element {i}: {error:e} of {largest:e}");
        }
    }
}

/// The slices of two results, side by side.
macro_rules! pairs {
    ($a:expr, $b:expr; $($field:ident)*) => { &[$(($a.$field.as_slice(), $b.$field.as_slice())),*] };
}

pub(crate) use pairs;

/// Every call of a batch against single calls.
pub fn check<I: Standard>(options: Options, horizon: &Horizon<I::Model, I::Number>, bound: f64) -> Test {
    check_with(batch::Integrator::<I>::new(options)?, I::of(&options, &I::TABLEAU)?, horizon, bound)
}

/// The same of a batch and an integrator that are there.
pub fn check_with<I: Single>(
    mut batch: batch::Integrator<I>,
    mut single: I,
    horizon: &Horizon<I::Model, I::Number>,
    bound: f64,
) -> Test {
    let count = horizon.x0.len();
    let mut nominal = vec![Nominal::default(); count];
    let mut forward = vec![Forward::default(); count];
    let mut adjoint = vec![Adjoint::default(); count];
    let mut both = vec![ForwardAdjoint::default(); count];
    let mut hessian = vec![Hessian::default(); count];
    let intervals = horizon.intervals();
    batch.solve(&intervals, &mut nominal)?;
    batch.forward(&intervals, &mut forward)?;
    batch.adjoint(&intervals, &horizon.lambda, &mut adjoint)?;
    batch.forward_adjoint(&intervals, &horizon.lambda, &mut both)?;
    batch.hessian(&intervals, &horizon.lambda, &mut hessian)?;
    let statistics = batch.statistics();
    assert_eq!(statistics.redone + statistics.failed, 0);
    #[cfg(target_arch = "x86_64")]
    if std::is_x86_feature_detected!("avx2") && std::is_x86_feature_detected!("fma") && count > 1 {
        assert!(statistics.groups > 0 && statistics.alone <= 1, "{statistics:?}");
    }
    for k in 0..count {
        let x0 = &horizon.x0[k];
        let u = &horizon.u[k % horizon.u.len()];
        let h = horizon.h[k % horizon.h.len()];
        let lambda = &horizon.lambda[k % horizon.lambda.len()];
        if let Some(p) = horizon.p.get(k) {
            single.set_parameters(p)?;
        }
        let expected = single.hessian(x0, u, h, lambda)?;
        assert_close("nominal", bound, pairs!(nominal[k], expected; x z z0));
        for result in [&forward[k], &both[k].forward, &hessian[k].first.forward] {
            let fields =
                pairs!(result, expected; x z z0 dx_dx0 dx_du dx_dp dz_dx0 dz_du dz_dp dz0_dx0 dz0_du dz0_dp);
            assert_close("forward", bound, fields);
        }
        assert_close("adjoint", bound, pairs!(adjoint[k], expected; x z z0 grad_x0 grad_u grad_p));
        assert_close("forward adjoint", bound, pairs!(both[k], expected; grad_x0 grad_u grad_p));
        let fields = pairs!(hessian[k], expected; grad_x0 grad_u grad_p h_xx h_xu h_uu h_xp h_up h_pp);
        assert_close("Hessian", bound, fields);
    }
    Ok(())
}

pub fn steps(steps: usize) -> Options {
    Options { steps, ..Default::default() }
}
