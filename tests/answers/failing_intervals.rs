//! Intervals that cannot be integrated.

use crate::Test;
use casados::ocp::{Exact, GaussNewton, Horizon, LeastSquaresCost, OcpError, Problem, Shooting};
use casados::prelude::*;

/// Only where x is positive.
#[ode]
fn shrinking(x: f64, u: f64) -> f64 {
    u - x.ln()
}

#[function]
fn both(x: f64, u: f64) -> [f64; 2] {
    [x, u]
}

/// The first of several intervals that fail is named, and afterwards the QP is what it was.
#[test]
fn intervals_of_a_batch_that_fail() -> Test {
    let batch = Batch::<Shrinking, Gauss<2>>::new(Options::default())?;
    let mut ocp = Problem::new(Shooting::new(batch))
        .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
        .on(Horizon::uniform(40, 0.1))?;
    ocp.free_initial_state().guess(&[1.0], &[0.1])?;
    ocp.linearise(Exact::default())?;
    let sound = format!("{:?}", ocp.qp());
    for stage in [21, 30] {
        ocp.guess_stage(stage, &[-1.0], &[0.1])?;
    }
    let outcomes = [ocp.linearise(Exact::default()), ocp.linearise(GaussNewton::default())];
    for outcome in outcomes {
        assert!(matches!(outcome, Err(OcpError::Integration { interval: 21, .. })), "{outcome:?}");
    }
    for stage in [21, 30] {
        ocp.guess_stage(stage, &[1.0], &[0.1])?;
    }
    ocp.linearise(Exact::default())?;
    assert_eq!(format!("{:?}", ocp.qp()), sound);
    Ok(())
}
