//! Options that make no sense are refused by their names.

use crate::Test;
use casados::ocp::{Barrier, HeapIpm, Horizon, IpmOptions, LeastSquaresCost, Map, OcpError, Problem};
use casados::prelude::*;

#[function]
fn push(x: f64, u: f64) -> f64 {
    x + u
}

#[function]
fn both(x: f64, u: f64) -> [f64; 2] {
    [x, u]
}

#[test]
fn nonlinear_interior_point() -> Test {
    type Change = fn(&mut IpmOptions, f64);
    let cases: [(&str, Change, &[f64]); 6] = [
        ("tolerance", |o, v| o.tolerance = v, &[f64::NAN, -1.0, 0.0, f64::INFINITY]),
        ("acceptable_tolerance", |o, v| o.acceptable_tolerance = v, &[f64::NAN, 0.0]),
        ("start_mu", |o, v| o.start_mu = v, &[f64::NAN, 0.0, 1e11, f64::MAX, f64::INFINITY]),
        ("bound_push", |o, v| o.bound_push = v, &[f64::NAN, 0.0, 2.0]),
        ("warm_push", |o, v| o.warm_push = v, &[f64::NAN, -1e-3, 0.6]),
        ("elastic_penalty", |o, v| o.elastic_penalty = v, &[f64::NAN, -1.0, f64::MAX, f64::INFINITY]),
    ];
    let mut ocp = Problem::new(Map::<Push, f64>::new())
        .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
        .on(Horizon::uniform(3, 1.0))?;
    ocp.fix_initial_state(&[1.0])?.bound("u", .., -0.3, 0.3)?.guess(&[0.0], &[0.0])?;
    for (expected, change, values) in cases {
        for &wrong in values {
            let mut ipm = HeapIpm::new(&ocp)?;
            change(&mut ipm.options, wrong);
            match ipm.solve(&mut ocp) {
                Err(OcpError::InvalidOption { name, value, .. }) => {
                    assert_eq!((name, value.to_bits()), (expected, wrong.to_bits()));
                }
                other => return Err(format!("{expected} {wrong}: {other:?}").into()),
            }
        }
    }
    // The largest ones end too, with every barrier: what is left of them follows from the iterate.
    for barrier in [Barrier::Monotone, Barrier::Adaptive] {
        let mut ipm = HeapIpm::new(&ocp)?;
        (ipm.options.start_mu, ipm.options.elastic_penalty, ipm.options.barrier) = (1e10, 1e10, barrier);
        assert!(ipm.solve(ocp.guess(&[0.0], &[0.0])?)?.is_converged());
    }
    let mut ipm = HeapIpm::new(&ocp)?;
    (ipm.options.max_iterations, ipm.options.acceptable_iterations) = (usize::MAX, usize::MAX);
    assert!(ipm.solve(&mut ocp)?.is_converged());
    Ok(())
}
