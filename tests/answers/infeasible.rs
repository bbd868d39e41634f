//! Problems without a feasible point, and problems whose QPs have none.

use crate::Test;
use casados::ocp::{
    Constraint, ConstraintName, Globalisation, HeapSqp, Horizon, LeastSquaresCost, Map, Part, Problem, Status,
};
use casados::prelude::*;
use casados::qp::Side;
use core::ops::ControlFlow;

#[function]
fn step(x: [f64; 1], u: [f64; 1]) -> [f64; 1] {
    [x[0] + u[0]]
}

#[function]
fn size(x: [f64; 1], u: [f64; 1]) -> [f64; 2] {
    [x[0], u[0]]
}

#[function]
fn square(x: [f64; 1], _u: [f64; 1]) -> f64 {
    x[0] * x[0]
}

/// Three steps of one at most do not reach five: the end is missed by two, and is named.
#[test]
fn unreachable_end() -> Test {
    for elastic in [true, false] {
        let mut ocp = Problem::new(Map::<Step, f64>::new())
            .stage_cost(LeastSquaresCost::<Size>::diagonal(&[1e-3, 1e-3]))
            .on(Horizon::uniform(3, 1.0))?;
        ocp.fix_initial_state(&[0.0])?.bound("u", .., -1.0, 1.0)?.bound("x", 3..=3, 5.0, 6.0)?;
        ocp.guess(&[0.0], &[0.0])?;
        let mut sqp = HeapSqp::new(&ocp)?.gauss_newton();
        sqp.options.elastic = elastic;
        let outcome = sqp.solve(&mut ocp)?;
        println!("{}{outcome}", sqp.log());
        let expected = ConstraintName {
            part: Part::StateBounds,
            stage: 3,
            name: "x[0]",
            output: 0,
            point: 0,
            side: Side::Lower,
            phase: None,
        };
        match outcome.status {
            Status::Infeasible { constraint, violation } if elastic => {
                assert_eq!(constraint, expected);
                assert!((violation - 2.0).abs() < 1e-5, "{violation}");
                assert_eq!(constraint.to_string(), "the lower bound of `x[0]` at stage 3");
            }
            Status::InfeasibleQp { constraint, .. } if !elastic => assert_eq!(constraint, expected),
            status => return Err(status.to_string().into()),
        }
        if elastic {
            assert!((ocp.stage(3)?.x[0] - 3.0).abs() < 1e-5);
        }
        // The bounds are hard again.
        let qp = ocp.qp();
        assert!(qp.stages().all(|stage| stage.x_bounds().lower_linear.iter().all(|p| p.is_infinite())));
    }
    Ok(())
}

/// `x² ≥ 1` at the end, linearised at `x = 0.1`, asks for `x ≥ 5.05`, which bounds forbid: the
/// first QP is infeasible, the problem is not.
#[test]
fn infeasible_linearisations() -> Test {
    for globalisation in [Globalisation::FullStep, Globalisation::Merit, Globalisation::Filter] {
        let mut ocp = Problem::new(Map::<Step, f64>::new())
            .stage_cost(LeastSquaresCost::<Size>::diagonal(&[0.1, 1.0]))
            .terminal_constraints(Constraint::<Square>::new([1.0], [f64::INFINITY]))
            .on(Horizon::uniform(2, 1.0))?;
        ocp.fix_initial_state(&[0.1])?.bound("x", .., -2.0, 2.0)?.guess(&[0.1], &[0.0])?;
        let mut sqp = HeapSqp::new(&ocp)?.gauss_newton();
        sqp.options.globalisation = globalisation;
        let outcome = sqp.solve(&mut ocp)?;
        println!("{}{outcome}", sqp.log());
        assert!(outcome.is_converged());
        assert!(sqp.log().0.iter().any(|row| row.elastic));
        assert!((ocp.stage(2)?.x[0] - 1.0).abs() < 1e-6);
    }
    Ok(())
}

/// An observer that has seen enough.
#[test]
fn stop_by_observers() -> Test {
    let mut ocp = Problem::new(Map::<Step, f64>::new())
        .stage_cost(LeastSquaresCost::<Size>::diagonal(&[1.0, 1.0]))
        .terminal_constraints(Constraint::<Square>::new([1.0], [f64::INFINITY]))
        .on(Horizon::uniform(2, 1.0))?;
    ocp.fix_initial_state(&[0.1])?.guess(&[0.1], &[0.0])?;
    let mut sqp = HeapSqp::new(&ocp)?.gauss_newton();
    let mut seen = 0;
    let outcome = sqp.solve_observed(&mut ocp, &mut |row| {
        assert_eq!(row.iteration, seen);
        seen += 1;
        if seen == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    assert_eq!((outcome.status, seen, sqp.log().0.len()), (Status::Stopped, 2, 2));
    sqp.options.max_iterations = 1;
    ocp.guess(&[0.1], &[0.0])?;
    assert_eq!(sqp.solve(&mut ocp)?.status, Status::MaxIterations);
    assert!(sqp.log().to_string().lines().count() == 3);
    Ok(())
}
