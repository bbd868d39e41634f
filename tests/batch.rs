//! Intervals side by side against one interval after the other, which are tested against
//! independent references.
//!
//! Both solve the same stages to rounding and differentiate them exactly, each with errors of ε
//! times the condition of the Newton matrix (as in `tests/reference.rs`, where the conditions come
//! from): so they are apart by twice that at most. Errors are relative to the largest element of a
//! result.

#[path = "../examples/models/awe.rs"]
mod awe;
#[allow(dead_code)]
#[path = "../examples/models/chain.rs"]
mod chain;
mod data;
#[path = "../examples/models/pendulum.rs"]
mod pendulum;

use awe::Awe;
use casados::batch::{self, Slice};
use casados::error::Argument;
use casados::memory::Heap;
use casados::model::{Kinematic, VectorP, VectorU, VectorX};
use casados::prelude::*;
use casados::result::{Adjoint, Forward, ForwardAdjoint, Hessian, Nominal};
use casados::shape::Matrix;
use casados::{Method, Real, irk};
use chain::{Chain, stretched};
use data::Record;
use nalgebra::{SVector, Vector1, vector};
use pendulum::Pendulum;

type Test = Result<(), Box<dyn std::error::Error>>;

/// Numbers of intervals: one alone, whole and incomplete groups of any register, and a horizon.
const COUNTS: [usize; 5] = [1, 3, 4, 5, 40];

/// Pendulum and chain have Newton matrices with conditions of order ten; four steps add up.
const ORDINARY: f64 = 2.0 * 100.0;
/// Aircraft: 6e3.
const AIRCRAFT: f64 = 2.0 * 6e3;

/// Intervals of a model, with adjoint seeds.
struct Horizon<M: Dae, T: Real = f64> {
    x0: Vec<VectorX<M, T>>,
    u: Vec<VectorU<M, T>>,
    p: Vec<VectorP<M, T>>,
    h: Vec<T>,
    lambda: Vec<VectorX<M, T>>,
}

impl<M: Dae, T: Real> Horizon<M, T> {
    fn intervals(&self) -> Intervals<'_, M, T> {
        Intervals { x0: &self.x0, u: &self.u, p: &self.p, h: &self.h, t0: &[] }
    }
}

fn chain<const NX: usize>(count: usize) -> Horizon<Chain<NX>>
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

fn pendulum<T: Real>(count: usize) -> Horizon<Pendulum, T> {
    let number = T::from_f64;
    Horizon {
        x0: (0..count).map(|k| vector![0.0, 0.1 * k as f64, 1.0, 0.3].map(number)).collect(),
        u: (0..count).map(|k| Vector1::new(k as f64 / 10.0 - 2.0).map(number)).collect(),
        p: vec![],
        h: vec![number(0.05)],
        lambda: vec![vector![1.0, -0.5, 0.25, 2.0].map(number)],
    }
}

fn aircraft(count: usize) -> Result<Horizon<Awe>, Box<dyn std::error::Error>> {
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
fn close<T: Real>(what: &str, bound: f64, pairs: &[(&[T], &[T])]) {
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

/// Every call of a batch against single calls.
fn check<M: Dae, B: Method<S>, T: Real, const S: usize>(
    options: Options,
    horizon: &Horizon<M, T>,
    bound: f64,
) -> Test {
    let mut batch = batch::Integrator::<M, B, S, T>::new(options)?;
    let mut irk = irk::Integrator::<M, B, S, T, Heap>::new(options)?;
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
            irk.set_parameters(p)?;
        }
        let expected = irk.hessian(x0, u, h, lambda)?;
        close("nominal", bound, pairs!(nominal[k], expected; x z z0));
        for result in [&forward[k], &both[k].forward, &hessian[k].first.forward] {
            let fields =
                pairs!(result, expected; x z z0 dx_dx0 dx_du dx_dp dz_dx0 dz_du dz_dp dz0_dx0 dz0_du dz0_dp);
            close("forward", bound, fields);
        }
        close("adjoint", bound, pairs!(adjoint[k], expected; x z z0 grad_x0 grad_u grad_p));
        close("forward adjoint", bound, pairs!(both[k], expected; grad_x0 grad_u grad_p));
        let fields = pairs!(hessian[k], expected; grad_x0 grad_u grad_p h_xx h_xu h_uu h_xp h_up h_pp);
        close("Hessian", bound, fields);
    }
    Ok(())
}

fn steps(steps: usize) -> Options {
    Options { steps, ..Default::default() }
}

#[test]
fn chains() -> Test {
    for count in COUNTS {
        check::<_, Gauss<2>, _, 2>(steps(1), &chain::<21>(count), ORDINARY)?;
        check::<_, Gauss<4>, _, 4>(steps(4), &chain::<21>(count), ORDINARY)?;
    }
    check::<_, Gauss<2>, _, 2>(steps(2), &chain::<33>(40), ORDINARY)
}

#[test]
fn pendulums() -> Test {
    for count in COUNTS {
        check::<_, Gauss<2>, _, 2>(steps(1), &pendulum::<f64>(count), ORDINARY)?;
        check::<_, Gauss<4>, _, 4>(steps(4), &pendulum::<f64>(count), ORDINARY)?;
    }
    Ok(())
}

/// Three kinematic states, that follow another one, the control and the parameter, and are felt by
/// three more.
#[ode]
fn followers(x: [f64; 6], u: f64, p: f64) -> [f64; 6] {
    let [a, b, c, v, w, y] = x;
    [
        2.0 * y,
        u,
        -3.0 * p,
        -(a + b).sin() - 0.3 * c * w,
        (a - c).cos() * b - 0.1 * v * v,
        a * b * c - w + 0.2 * v - 0.1 * y * y,
    ]
}

#[test]
fn kinematic_states() -> Test {
    let of = Followers::STRUCTURE.elimination.kinematic;
    let found: Vec<usize> = (0..of.len()).filter(|&state| of[state].equation != Kinematic::NONE).collect();
    assert_eq!(found, [0, 1, 2]);
    for count in COUNTS {
        let horizon = Horizon::<Followers> {
            x0: (0..count).map(|k| SVector::from_fn(|i, _| ((3 * k + i) as f64).sin())).collect(),
            u: (0..count).map(|k| Vector1::new((k as f64).cos())).collect(),
            p: (0..count).map(|k| Vector1::new(0.1 * k as f64 - 1.0)).collect(),
            h: vec![0.2],
            lambda: vec![vector![1.0, -0.5, 0.25, 2.0, -1.0, 0.75]],
        };
        check::<_, Gauss<2>, _, 2>(steps(2), &horizon, ORDINARY)?;
        check::<_, Gauss<3>, _, 3>(steps(1), &horizon, ORDINARY)?;
        check::<_, Gauss<4>, _, 4>(steps(3), &horizon, ORDINARY)?;
        check::<_, RadauIIA<3>, _, 3>(steps(2), &horizon, ORDINARY)?;
    }
    Ok(())
}

/// The Jacobian changes by a multiple of itself from stage to stage, by the state, what is
/// algebraic, and the time.
#[dae]
fn driven(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, t: f64) -> [f64; 3] {
    let [a, b] = x;
    [
        xdot[0] - b,
        xdot[1] + (2.0 + (5.0 * t).sin()) * a * (1.0 + a * a) - z * b - u,
        z - 2.0 - (a * b + 0.1 * z * z).cos(),
    ]
}

/// Of a batch one Jacobian in the middle of the stages is taken for all of them, of a single call
/// the mean of theirs: iterations converge as fast.
#[test]
fn jacobian_in_the_middle() -> Test {
    fn same<B: Method<S>, const S: usize>(options: Options) -> Test {
        let mut batch = batch::Integrator::<Driven, B, S, f64>::new(options)?;
        let mut single = irk::Integrator::<Driven, B, S, f64, Heap>::new(options)?;
        single.set_time(0.7)?;
        let (x0, u) = ([vector![1.5, -1.0]; 8], [Vector1::new(0.5)]);
        let mut results = vec![Nominal::default(); 8];
        batch.solve(
            &Intervals { x0: &x0, u: &u, h: &[0.4], t0: &[0.7], ..Default::default() },
            &mut results,
        )?;
        let expected = single.solve(&x0[0], &u[0], 0.4)?;
        for result in &results {
            close("nominal", ORDINARY, pairs!(result, expected; x z z0));
        }
        let work = batch.statistics().work;
        let groups = work.steps / single.statistics().steps;
        let iterations = [work.iterations, groups * single.statistics().iterations];
        // One more in a step, where an increment is just above the tolerance.
        assert!(iterations[0] <= iterations[1] + work.steps, "{iterations:?}");
        Ok(())
    }
    for count in [1, 2, 5] {
        same::<Gauss<3>, 3>(steps(count))?;
        same::<Gauss<4>, 4>(steps(count))?;
        same::<RadauIIA<3>, 3>(steps(count))?;
    }
    Ok(())
}

/// An equation and a state of a size that single precision does not have.
#[dae]
fn immense(xdot: [f64; 2], x: [f64; 2]) -> [f64; 2] {
    [1e60 * (xdot[0] - x[1] * 1e-60), xdot[1] + 1e60 * x[0] * (1.0 + x[0] * x[0]).sqrt()]
}

/// Nine digits of the Newton matrix are those of a fast motion to `x₀ = x₁`, and the slow one is in
/// the others.
#[dae]
fn coupled(xdot: [f64; 2], x: [f64; 2]) -> [f64; 2] {
    [xdot[0] + 1e9 * (x[0] - x[1]) + x[0] * x[0], xdot[1] - 1e9 * (x[0] - x[1]) + x[1].sin()]
}

/// Where coarse factors are of no use results are those of single calls all the same.
#[test]
fn beyond_coarse_numbers() -> Test {
    let x0: Vec<_> = (0..9).map(|k| vector![0.1 * k as f64 - 0.3, 1e60 * (0.2 + 0.1 * k as f64)]).collect();
    let mut batch = Batch::<Immense, Gauss<4>>::new(steps(3))?;
    let mut single = Irk::<Immense, Gauss<4>>::new(steps(3))?;
    let mut results = vec![Nominal::default(); x0.len()];
    batch.solve(&Intervals { x0: &x0, h: &[0.3], ..Default::default() }, &mut results)?;
    for (x0, result) in x0.iter().zip(&results) {
        let expected = single.solve(x0, &vector![], 0.3)?;
        for i in 0..2 {
            close("immense", ORDINARY, &[(&result.x.as_slice()[i..=i], &expected.x.as_slice()[i..=i])]);
        }
    }

    let x0: Vec<_> = (0..9).map(|k| SVector::repeat(0.1 * k as f64 + 0.2)).collect();
    let mut results = vec![Nominal::default(); x0.len()];
    let mut batch = Batch::<Coupled, RadauIIA<3>>::new(steps(2))?;
    let mut single = Irk::<Coupled, RadauIIA<3>>::new(steps(2))?;
    batch.solve(&Intervals { x0: &x0, h: &[0.3], ..Default::default() }, &mut results)?;
    for (x0, result) in x0.iter().zip(&results) {
        let expected = single.solve(x0, &vector![], 0.3)?;
        // A rounding error of a residual is 1e9 ε, and moves the slow motion by as much.
        close("coupled", 1e9, pairs!(result, expected; x));
    }
    Ok(())
}

#[test]
fn in_single_precision() -> Test {
    for count in COUNTS {
        check::<_, Gauss<2>, _, 2>(steps(2), &pendulum::<f32>(count), ORDINARY)?;
    }
    Ok(())
}

#[test]
fn aircraft_on_its_orbit() -> Test {
    for count in COUNTS {
        check::<_, RadauIIA<4>, _, 4>(steps(1), &aircraft(count)?, AIRCRAFT)?;
    }
    Ok(())
}

#[test]
fn options_of_newton() -> Test {
    let newton = Newton::default();
    for newton in [
        Newton { jacobian: Jacobian::Full, ..newton },
        Newton { jacobian: Jacobian::Frozen, ..newton },
        Newton { fixed_iterations: Some(8), ..newton },
    ] {
        let options = Options { steps: 2, newton, ..Default::default() };
        check::<_, Gauss<2>, _, 2>(options, &chain::<21>(7), ORDINARY)?;
    }
    Ok(())
}

/// Warm starts are those of each interval: nothing is left to do, and results are the same.
#[test]
fn warm_starts() -> Test {
    let horizon = chain::<21>(9);
    let options = Options { steps: 2, start: Start::Warm, ..Default::default() };
    let mut batch = Batch::<Chain<21>, Gauss<2>>::new(options)?;
    let mut first = vec![Nominal::default(); 9];
    let mut again = first.clone();
    batch.solve(&horizon.intervals(), &mut first)?;
    let cold = batch.statistics().work.iterations;
    batch.solve(&horizon.intervals(), &mut again)?;
    let work = batch.statistics().work;
    // One that changes the last digits, and one that sees it.
    assert!(work.iterations <= 2 * work.steps && work.iterations < cold, "{work:?}, cold {cold}");
    for (a, b) in again.iter().zip(&first) {
        close("warm", ORDINARY, pairs!(a, b; x));
    }
    batch.reset();
    batch.solve(&horizon.intervals(), &mut again)?;
    assert_eq!(batch.statistics().work.iterations, cold);
    assert_eq!(again, first);
    Ok(())
}

/// `ẋ = −√x + u`, `p z = x`: not finite for `x < 0`, singular for `p = 0`.
#[dae]
fn fragile(xdot: f64, x: f64, z: f64, u: f64, p: f64) -> [f64; 2] {
    [xdot + x.sqrt() - u, p * z - x + z * z * z * 0.01]
}

/// Intervals that fail say why, as a single call does, leave their results as they were, and change
/// no bit of others.
#[test]
fn failures() -> Test {
    let count = 11;
    let good = Horizon::<Fragile> {
        x0: (0..count).map(|k| Vector1::new(1.0 + 0.1 * k as f64)).collect(),
        u: (0..count).map(|k| Vector1::new(0.1 * k as f64)).collect(),
        p: vec![Vector1::new(2.0); count],
        h: vec![0.1],
        lambda: vec![Vector1::new(1.0)],
    };
    let mut batch = Batch::<Fragile, RadauIIA<2>>::new(steps(3))?;
    let mut single = Irk::<Fragile, RadauIIA<2>>::new(steps(3))?;
    for bad in 0..count {
        // The bits that the others have beside a copy of a neighbour.
        let neighbour = if bad % 2 == 0 && bad + 1 < count { bad + 1 } else { bad - 1 };
        let mut copy = Horizon::<Fragile> {
            x0: good.x0.clone(),
            u: good.u.clone(),
            p: good.p.clone(),
            h: good.h.clone(),
            lambda: good.lambda.clone(),
        };
        copy.x0[bad] = good.x0[neighbour];
        copy.u[bad] = good.u[neighbour];
        let mut expected = vec![Hessian::default(); count];
        batch.hessian(&copy.intervals(), &copy.lambda, &mut expected)?;
        for kind in 0..3 {
            match kind {
                0 => copy.x0[bad] = Vector1::new(f64::NAN),
                1 => copy.x0[bad] = Vector1::new(-1.0),
                _ => (copy.x0[bad], copy.p[bad]) = (good.x0[bad], Vector1::new(0.0)),
            }
            let before = Hessian { h_xx: Vector1::new(42.0), ..Default::default() };
            let mut results = vec![before; count];
            let outcome = batch.hessian(&copy.intervals(), &copy.lambda, &mut results);
            single.set_parameters(&copy.p[bad])?;
            let error = single.hessian(&copy.x0[bad], &copy.u[bad], 0.1, &copy.lambda[0]).unwrap_err();
            // A value that is not a number equals nothing, not itself.
            let same = |a: &dyn std::fmt::Debug| assert_eq!(format!("{a:?}"), format!("{error:?}"));
            match outcome {
                Err(BatchError::Intervals { failed: 1, first, error }) if first == bad => same(&error),
                other => panic!("{other:?}"),
            }
            same(&batch.status(bad).unwrap_err());
            assert_eq!(batch.statistics().failed, 1);
            for k in 0..count {
                if k == bad {
                    assert_eq!(results[k], before);
                } else {
                    assert_eq!(batch.status(k), Ok(()));
                    assert_eq!(results[k], expected[k], "interval {k} beside {bad}, {kind}");
                }
            }
        }
    }
    assert_eq!(batch.status(count), Err(Error::NoResult));
    Ok(())
}

#[test]
fn wrong_lengths() -> Test {
    let horizon = pendulum::<f64>(5);
    let mut batch = Batch::<Pendulum, Gauss<2>>::new(steps(1))?;
    let intervals = horizon.intervals();
    let mut results = vec![Nominal::default(); 5];
    let length = |outcome: Result<(), BatchError>, expected: Slice, elements: usize| match outcome {
        Err(BatchError::Length { slice, length, intervals: 5 }) => {
            assert_eq!((slice, length), (expected, elements));
        }
        other => panic!("{other:?}"),
    };
    let u = Slice::Argument(Argument::U);
    length(batch.solve(&intervals, &mut results[..4]), Slice::Results, 4);
    length(batch.solve(&Intervals { u: &horizon.u[..4], ..intervals }, &mut results), u, 4);
    length(batch.solve(&Intervals { u: &[], ..intervals }, &mut results), u, 0);
    length(batch.solve(&Intervals { h: &[], ..intervals }, &mut results), Slice::Argument(Argument::H), 0);
    let t0 = Slice::Argument(Argument::T);
    length(batch.solve(&Intervals { t0: &[0.0, 1.0], ..intervals }, &mut results), t0, 2);
    let lambda = &[horizon.lambda[0]; 2];
    let mut adjoint = vec![Adjoint::default(); 5];
    length(batch.adjoint(&intervals, lambda, &mut adjoint), Slice::Argument(Argument::Lambda), 2);
    batch.solve(&Intervals::default(), &mut [])?;
    Ok(())
}

/// Intervals start at times of their own.
#[dae]
fn forced(xdot: f64, x: f64, t: f64) -> f64 {
    xdot + x - t.sin()
}

#[test]
fn times() -> Test {
    let mut batch = Batch::<Forced, Gauss<3>>::new(steps(2))?;
    let mut single = Irk::<Forced, Gauss<3>>::new(steps(2))?;
    let (x0, t0) = (vec![Vector1::new(1.0); 6], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    let mut results = vec![Nominal::default(); 6];
    batch.solve(&Intervals { x0: &x0, h: &[0.1], t0: &t0, ..Default::default() }, &mut results)?;
    for k in 0..6 {
        single.set_time(t0[k])?;
        close("x", ORDINARY, pairs!(results[k], single.solve(&x0[k], &vector![], 0.1)?; x));
    }
    Ok(())
}

/// However many threads there are, results are the same to the last bit.
#[cfg(feature = "parallel")]
#[test]
fn t34_threads() -> Test {
    for count in COUNTS {
        let horizon = chain::<21>(count);
        let mut batch = Batch::<Chain<21>, Gauss<2>>::new(steps(2))?;
        let mut expected = vec![Hessian::default(); count];
        batch.set_threads(1);
        batch.hessian(&horizon.intervals(), &horizon.lambda, &mut expected)?;
        let statistics = *batch.statistics();
        for threads in [2, 3, 8] {
            batch.set_threads(threads);
            let mut results = vec![Hessian::default(); count];
            batch.hessian(&horizon.intervals(), &horizon.lambda, &mut results)?;
            assert!(results == expected);
            assert_eq!(*batch.statistics(), statistics);
        }
    }
    Ok(())
}
