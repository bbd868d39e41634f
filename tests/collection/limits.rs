//! Options and limits.

use crate::Test;
use crate::ocps::GIVEN;
use crate::ocps::vehicles::car_within;
use casados::ocp::{HeapSqp, OcpError, SqpOptions, Status};

/// The limit of iterations proves nothing.
#[test]
fn status_at_the_iteration_limit() -> Test {
    for most in [50.0, 1.0] {
        for limit in [0, 1, 2] {
            let mut ocp = car_within(most, GIVEN)?;
            let mut sqp = HeapSqp::new(&ocp)?;
            sqp.options.max_iterations = limit;
            let status = sqp.solve(&mut ocp)?.status;
            assert_eq!(status, Status::MaxIterations);
            assert!(status.to_string().contains("options.max_iterations"));
        }
    }
    Ok(())
}

/// What makes no sense is refused by its name.
#[test]
fn invalid_options() -> Test {
    type Change = fn(&mut SqpOptions, f64);
    let bad: [(&str, Change, &[f64]); 4] = [
        ("tolerance", |o, v| o.tolerance = v, &[f64::NAN, -1.0, 0.0, f64::INFINITY]),
        ("qp_accuracy", |o, v| o.qp_accuracy = v, &[f64::NAN, -1e-3, 2.0]),
        ("elastic_penalty", |o, v| o.elastic_penalty = v, &[f64::NAN, -1.0, 0.0, f64::INFINITY]),
        ("shortest_step", |o, v| o.shortest_step = v, &[f64::NAN, -1.0, 0.0, 1.5]),
    ];
    let mut ocp = car_within(50.0, GIVEN)?;
    for (expected, change, values) in bad {
        for &wrong in values {
            let mut sqp = HeapSqp::new(&ocp)?;
            change(&mut sqp.options, wrong);
            match sqp.solve(&mut ocp) {
                Err(error @ OcpError::InvalidOption { name, value, .. }) => {
                    assert_eq!((name, value.to_bits()), (expected, wrong.to_bits()));
                    assert!(error.to_string().contains(expected));
                }
                other => return Err(format!("{expected} {wrong}: {other:?}").into()),
            }
        }
    }
    Ok(())
}

/// QPs of an iteration share their iterations, whatever they end with: on the way to a verdict, and
/// to a solution.
#[test]
fn limit_of_qp_iterations() -> Test {
    for most in [12, 30, 100] {
        for time in [1.0, 50.0] {
            let mut ocp = car_within(time, GIVEN)?;
            let mut sqp = HeapSqp::new(&ocp)?;
            sqp.options.max_qp_iterations = most;
            let outcome = sqp.solve(&mut ocp)?;
            println!("{}{outcome}", sqp.log());
            assert!(sqp.log().0.iter().all(|row| row.qp_iterations <= most), "{most}: {outcome}");
            assert!(!outcome.is_converged() || time > 1.0, "{outcome}");
        }
    }
    let mut ocp = car_within(50.0, GIVEN)?;
    let mut sqp = HeapSqp::new(&ocp)?;
    sqp.options.max_qp_iterations = 3;
    let refused = sqp.solve(&mut ocp);
    assert!(matches!(refused, Err(OcpError::InvalidOption { name: "max_qp_iterations", .. })));
    Ok(())
}

/// The log grows with what happens, not with what may.
#[test]
fn large_iteration_limits() -> Test {
    let mut ocp = car_within(50.0, GIVEN)?;
    let mut sqp = HeapSqp::new(&ocp)?;
    sqp.options.max_iterations = usize::MAX;
    assert!(sqp.solve(&mut ocp)?.is_converged());
    Ok(())
}
