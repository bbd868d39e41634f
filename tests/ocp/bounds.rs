//! Bounds and constraints of every kind, against solutions that are known.

use crate::Test;
use casados::ocp::{
    Constraint, GaussNewton, HeapOcp, HeapSqp, Horizon, LeastSquaresCost, Map, OcpError, Problem,
};
use casados::prelude::*;
use casados::qp::residuals;

/// A point that moves in the plane as it is told.
#[function]
fn go(x: [f64; 2], u: [f64; 2]) -> [f64; 2] {
    [x[0] + u[0], x[1] + u[1]]
}

#[function]
fn place(x: [f64; 2], _u: [f64; 2]) -> [f64; 2] {
    x
}

#[function]
fn speed(_x: [f64; 2], u: [f64; 2]) -> [f64; 2] {
    u
}

/// The square of the distance from the origin.
#[function]
fn distance(x: [f64; 2], _u: [f64; 2]) -> f64 {
    x[0] * x[0] + x[1] * x[1]
}

/// One interval to a target at (3, 4) in a disc of radius one: the point of the disc that is
/// nearest, (0.6, 0.8).
#[test]
fn terminal_constraints() -> Test {
    let mut ocp = Problem::new(Map::<Go, f64>::new())
        .terminal_cost(LeastSquaresCost::<Place>::diagonal(&[1.0; 2]))
        .terminal_constraints(Constraint::<Distance>::new([f64::NEG_INFINITY], [1.0]))
        .on(Horizon::uniform(1, 1.0))?;
    ocp.fix_initial_state(&[0.0; 2])?.set_terminal_reference(&[3.0, 4.0])?;
    ocp.guess(&[0.1, 0.2], &[0.0; 2])?;
    // The constraint bends more than the cost: without its second derivatives full steps would go
    // back and forth.
    let mut sqp = HeapSqp::new(&ocp)?;
    sqp.options.tolerance = 1e-8;
    let outcome = sqp.solve(&mut ocp)?;
    assert!(outcome.is_converged(), "{}{outcome}", sqp.log());
    let end = ocp.stage(1)?;
    assert!((end.x[0] - 0.6).abs() < 1e-7 && (end.x[1] - 0.8).abs() < 1e-7);
    // x − target + 2 λ x = 0: λ = (5 − 1) / 2.
    assert!((end.g_upper[0] - 2.0).abs() < 1e-6);
    // The general residuals of the QP at the iterate are those that were computed.
    ocp.linearise(GaussNewton::default())?;
    let (mine, objective) = ocp.residuals();
    let (general, _) = residuals(ocp.qp(), ocp.iterate());
    assert!((mine.largest() - general.largest()).abs() < 1e-12);
    assert!((objective - 8.0).abs() < 1e-6);
    Ok(())
}

/// `½ (x − 3)²` with a soft bound `x ≤ 1`: the violation `e` satisfies
/// `e − 2 + linear + quadratic e = 0`.
#[test]
fn soft_bounds() -> Test {
    for (linear, quadratic) in [(0.0, 1.0), (0.5, 0.0), (0.5, 2.0), (5.0, 1.0)] {
        let expected = f64::max((2.0 - linear) / (1.0 + quadratic), 0.0);
        let mut ocp = Problem::new(Map::<Go, f64>::new())
            .terminal_cost(LeastSquaresCost::<Place>::diagonal(&[1.0; 2]))
            .on(Horizon::uniform(1, 1.0))?;
        ocp.fix_initial_state(&[0.0; 2])?.set_terminal_reference(&[3.0, 0.0])?;
        ocp.bound("x[0]", 1..=1, f64::NEG_INFINITY, 1.0)?.soften("x[0]", 1..=1, linear, quadratic)?;
        ocp.guess(&[0.0; 2], &[0.0; 2])?;
        let outcome = HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?;
        assert!(outcome.is_converged());
        let x = ocp.stage(1)?.x[0];
        assert!((x - 1.0 - expected).abs() < 1e-6, "{x} {expected}");
        let e = expected;
        let objective = 0.5 * (x - 3.0) * (x - 3.0) + linear * e + 0.5 * quadratic * e * e;
        assert!((outcome.objective - objective).abs() < 1e-6);
    }
    Ok(())
}

/// Penalties of one side, one output and one stage: a target at 3 with a soft bound there, and what
/// pulls back where only the other side, output or stage is soft.
#[test]
fn penalties_by_output_side_and_stage() -> Test {
    let solve = |soften: &dyn Fn(&mut Plane) -> Result<(), OcpError>| {
        let mut ocp = plane(3.0)?;
        soften(&mut ocp)?;
        assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
        let end = ocp.stage(2)?;
        Ok::<_, OcpError>([end.x[0], end.x[1], ocp.stage(1)?.u[0]])
    };
    let near = |found: [f64; 3], expected: [f64; 3]| {
        let distance = |(a, b): (f64, f64)| (a - b).abs();
        assert!(found.into_iter().zip(expected).map(distance).all(|d| d < 1e-5), "{found:?} {expected:?}");
    };
    // Hard: both outputs of the end at 1, and at both stages half of the way.
    near(solve(&|_| Ok(()))?, [1.0, 1.0, 0.5]);
    // The force is `3 − x`, and leaving the bound costs 1/2 each.
    let upper = |ocp: &mut Plane| ocp.soften_upper("Place[0]", .., 0.5, 0.0).map(|_| ());
    near(solve(&upper)?, [2.5, 1.0, 1.25]);
    let both = |ocp: &mut Plane| ocp.soften("Place", 2.., 0.5, 0.0).map(|_| ());
    near(solve(&both)?, [2.5, 2.5, 1.25]);
    let lower = |ocp: &mut Plane| ocp.soften_lower("Place", .., 0.5, 0.0).map(|_| ());
    near(solve(&lower)?, [1.0, 1.0, 0.5]);
    let quadratic = |ocp: &mut Plane| ocp.soften("Place[1]", .., 0.0, 1.0).map(|_| ());
    near(solve(&quadratic)?, [1.0, 2.0, 0.5]);
    // Speeds are bounded by 0.4. Beyond that the first one costs 1 at stage 1, and is worth it
    // until the force is 1 too.
    let slow = |ocp: &mut Plane| {
        ocp.set_terminal_bounds(&[-9.0; 2], &[9.0; 2])?.bound("u", .., -0.4, 0.4)?;
        ocp.soften_upper("u[0]", 1..=1, 1.0, 0.0).map(|_| ())
    };
    near(solve(&slow)?, [2.0, 0.8, 1.6]);
    let text = |result: Result<(), OcpError>| result.err().map(|error| error.to_string()).unwrap_or_default();
    assert_eq!(
        text(solve(&|ocp| ocp.soften("Place", ..2, 1.0, 0.0).map(|_| ())).map(|_| ())),
        "`Place` has no finite bound at stages 0 to 1: call `bound` before `soften`"
    );
    assert_eq!(
        text(solve(&|ocp| ocp.soften("Place[1]", .., -1.0, 0.0).map(|_| ())).map(|_| ())),
        "stage 0: a penalty of `Place` is -1: it must be at least 0, and finite if quadratic"
    );
    Ok(())
}

type Plane =
    HeapOcp<Problem<Map<Go, f64>, LeastSquaresCost<Speed>, LeastSquaresCost<Place>, (), Constraint<Place>>>;

/// Two intervals from the origin to a target, at both coordinates held by an upper bound of 1.
/// Speeds cost next to nothing.
fn plane(target: f64) -> Result<Plane, OcpError> {
    let mut ocp = Problem::new(Map::<Go, f64>::new())
        .stage_cost(LeastSquaresCost::<Speed>::diagonal(&[1e-9; 2]))
        .terminal_cost(LeastSquaresCost::<Place>::diagonal(&[1.0; 2]))
        .terminal_constraints(Constraint::<Place>::new([-9.0; 2], [1.0; 2]))
        .on(Horizon::uniform(2, 1.0))?;
    ocp.fix_initial_state(&[0.0; 2])?.set_terminal_reference(&[target; 2])?.guess(&[0.0; 2], &[0.0; 2])?;
    Ok(ocp)
}

/// The same as constraints of the path, two at once, of which the second is soft: `x₀² + x₁² ≤ 4`
/// and `u ≤ 0.5`.
#[test]
fn path_constraints() -> Test {
    let n = 8;
    let infinity = f64::INFINITY;
    let mut ocp = Problem::new(Map::<Go, f64>::new())
        .stage_cost(LeastSquaresCost::<Speed>::diagonal(&[1e-2; 2]))
        .terminal_cost(LeastSquaresCost::<Place>::diagonal(&[1.0; 2]))
        .path_constraints((
            Constraint::<Distance>::new([-infinity], [4.0]),
            Constraint::<Speed>::new([-0.5; 2], [0.5; 2]).soft(1e2, 0.0),
        ))
        .on(Horizon::uniform(n, 1.0))?;
    ocp.fix_initial_state(&[0.0; 2])?.set_terminal_reference(&[3.0, 0.0])?;
    ocp.guess(&[0.0; 2], &[0.0; 2])?;
    let outcome = HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?;
    assert!(outcome.is_converged());
    // 7 intervals to 2, which is as far as the path may go, the last one 0.5 beyond.
    let before = ocp.stage(n - 1)?;
    assert!((before.x[0] - 2.0).abs() < 1e-5, "{:?}", before);
    assert!((before.u[0] - 0.5).abs() < 1e-5 && (ocp.stage(n)?.x[0] - 2.5).abs() < 1e-5);
    for stage in ocp.iterate().stages().take(n - 1) {
        assert!((stage.u[0] - 2.0 / 7.0).abs() < 1e-5);
    }
    // Bounds of stages may be changed.
    ocp.set_path_bounds(n - 1..n, &[-infinity, -0.5, -0.5], &[1.0, 0.5, 0.5])?;
    let outcome = HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?;
    assert!(outcome.is_converged());
    assert!((ocp.stage(n)?.x[0] - 1.5).abs() < 1e-5);
    Ok(())
}
