//! Intervals side by side against one interval after the other, which are tested against
//! independent references.
//!
//! Both solve the same stages to rounding and differentiate them exactly, each with errors of ε
//! times the condition of the Newton matrix (as in `tests/optimised/reference.rs`, where the
//! conditions come from): so they are apart by twice that at most. Errors are relative to the
//! largest element of a result.

use crate::horizon::*;
use crate::models::chain::Chain;
use casados::__private::Kinematic;
use casados::Heap;
use casados::prelude::*;
use casados::result::{Hessian, Nominal};
use casados::{Method, batch, irk};
use nalgebra::{SVector, Vector1, vector};

#[test]
fn chains() -> Test {
    for count in INTERVAL_COUNTS {
        check::<Irk<_, Gauss<2>, _>>(steps(1), &chain::<21>(count), ORDINARY_TOLERANCE)?;
        check::<Irk<_, Gauss<4>, _>>(steps(4), &chain::<21>(count), ORDINARY_TOLERANCE)?;
    }
    check::<Irk<_, Gauss<2>, _>>(steps(2), &chain::<33>(40), ORDINARY_TOLERANCE)
}

#[test]
fn pendulums() -> Test {
    for count in INTERVAL_COUNTS {
        check::<Irk<_, Gauss<2>, _>>(steps(1), &pendulum::<f64>(count), ORDINARY_TOLERANCE)?;
        check::<Irk<_, Gauss<4>, _>>(steps(4), &pendulum::<f64>(count), ORDINARY_TOLERANCE)?;
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
    for count in INTERVAL_COUNTS {
        let horizon = Horizon::<Followers> {
            x0: (0..count).map(|k| SVector::from_fn(|i, _| ((3 * k + i) as f64).sin())).collect(),
            u: (0..count).map(|k| Vector1::new((k as f64).cos())).collect(),
            p: (0..count).map(|k| Vector1::new(0.1 * k as f64 - 1.0)).collect(),
            h: vec![0.2],
            lambda: vec![vector![1.0, -0.5, 0.25, 2.0, -1.0, 0.75]],
        };
        check::<Irk<_, Gauss<2>, _>>(steps(2), &horizon, ORDINARY_TOLERANCE)?;
        check::<Irk<_, Gauss<3>, _>>(steps(1), &horizon, ORDINARY_TOLERANCE)?;
        check::<Irk<_, Gauss<4>, _>>(steps(3), &horizon, ORDINARY_TOLERANCE)?;
        check::<Irk<_, RadauIIA<3>, _>>(steps(2), &horizon, ORDINARY_TOLERANCE)?;
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
fn midpoint_jacobian() -> Test {
    fn assert_same<B: Method<S>, const S: usize>(options: Options) -> Test {
        let mut batch = batch::Integrator::<irk::Integrator<Driven, B, S, f64, Heap>>::new(options)?;
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
            assert_close("nominal", ORDINARY_TOLERANCE, pairs!(result, expected; x z z0));
        }
        let work = batch.statistics().work;
        let groups = work.steps / single.statistics().steps;
        let iterations = [work.iterations, groups * single.statistics().iterations];
        // One more in a step, where an increment is just above the tolerance.
        assert!(iterations[0] <= iterations[1] + work.steps, "{iterations:?}");
        Ok(())
    }
    for count in [1, 2, 5] {
        assert_same::<Gauss<3>, 3>(steps(count))?;
        assert_same::<Gauss<4>, 4>(steps(count))?;
        assert_same::<RadauIIA<3>, 3>(steps(count))?;
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
fn fallback_from_single_precision() -> Test {
    let x0: Vec<_> = (0..9).map(|k| vector![0.1 * k as f64 - 0.3, 1e60 * (0.2 + 0.1 * k as f64)]).collect();
    let mut batch = Batch::<Immense, Gauss<4>>::new(steps(3))?;
    let mut single = Irk::<Immense, Gauss<4>>::new(steps(3))?;
    let mut results = vec![Nominal::default(); x0.len()];
    batch.solve(&Intervals { x0: &x0, h: &[0.3], ..Default::default() }, &mut results)?;
    for (x0, result) in x0.iter().zip(&results) {
        let expected = single.solve(x0, &vector![], 0.3)?;
        for i in 0..2 {
            assert_close(
                "immense",
                ORDINARY_TOLERANCE,
                &[(&result.x.as_slice()[i..=i], &expected.x.as_slice()[i..=i])],
            );
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
        assert_close("coupled", 1e9, pairs!(result, expected; x));
    }
    Ok(())
}

#[test]
fn in_single_precision() -> Test {
    for count in INTERVAL_COUNTS {
        check::<Irk<_, Gauss<2>, _>>(steps(2), &pendulum::<f32>(count), ORDINARY_TOLERANCE)?;
    }
    Ok(())
}

#[test]
fn aircraft_on_its_orbit() -> Test {
    for count in INTERVAL_COUNTS {
        check::<Irk<_, RadauIIA<4>, _>>(steps(1), &aircraft(count)?, AIRCRAFT_TOLERANCE)?;
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
        check::<Irk<_, Gauss<2>, _>>(options, &chain::<21>(7), ORDINARY_TOLERANCE)?;
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
        assert_close("warm", ORDINARY_TOLERANCE, pairs!(a, b; x));
    }
    batch.reset();
    batch.solve(&horizon.intervals(), &mut again)?;
    assert_eq!(batch.statistics().work.iterations, cold);
    assert_eq!(again, first);
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
        assert_close("x", ORDINARY_TOLERANCE, pairs!(results[k], single.solve(&x0[k], &vector![], 0.1)?; x));
    }
    Ok(())
}

/// However many threads there are, results are the same to the last bit.
#[test]
fn t34_threads() -> Test {
    for count in INTERVAL_COUNTS {
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
