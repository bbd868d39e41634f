//! Intervals that fail, and arguments of wrong lengths.

use crate::horizon::*;
use crate::models::pendulum::Pendulum;
use casados::batch::Slice;
use casados::error::Argument;
use casados::prelude::*;
use casados::result::{Adjoint, Hessian, Nominal};
use nalgebra::Vector1;

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
            let mut before = Hessian::default();
            before.h_xx = Vector1::new(42.0);
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
