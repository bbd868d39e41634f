//! Clocks of users: runs end when they are told to, with what is best so far.

use super::Test;
use super::ipm::{CartPole, swing_up};
use casados::ocp::{
    Convexification, Exact, Formulation, GaussNewton, HeapIpm, HeapOcp, HeapRealTime, HeapSqp, Horizon,
    LeastSquaresCost, OcpError, Problem, Status,
};
use casados::prelude::*;
use casados::qp::{Condensing, HeapInteriorPoint, HeapSolution, QpError, QpSolver, QpStart, residuals};

/// The clock ends a run wherever it is, with the best iterate: more time leaves no worse one.
#[test]
fn best_iterate_of_the_interior_point() -> Test {
    let mut least = f64::INFINITY;
    for time in [0, 1, 2, 5, 9, 14] {
        let mut ocp = swing_up()?;
        let mut ipm = HeapIpm::new(&ocp)?;
        let mut asked = 0;
        let outcome = ipm.solve_until(&mut ocp, &mut || {
            asked += 1;
            asked > time
        })?;
        assert_eq!((outcome.status, asked), (Status::OutOfTime, time + 1));
        ocp.linearise(Exact { convexification: Convexification::None })?;
        let (judged, _) = residuals(ocp.qp(), ocp.iterate());
        assert!(judged.largest().is_finite());
        assert!(outcome.residuals.largest() <= least, "{time} {outcome}");
        least = outcome.residuals.largest();
    }
    Ok(())
}

/// The same of sequential quadratic programming, down to iterations of its QPs: the clock is asked
/// until it is late, and not again.
#[test]
fn best_iterate_of_sequential_programming() -> Test {
    let (mut least, mut late) = (f64::INFINITY, 0);
    for time in 0.. {
        let mut ocp = swing_up()?;
        let mut sqp = HeapSqp::new(&ocp)?;
        // Residuals are compared in the units of the problem.
        sqp.options.scaling = false;
        let mut asked = 0;
        let outcome = sqp.solve_until(&mut ocp, &mut || {
            asked += 1;
            asked > time
        })?;
        ocp.linearise(Exact { convexification: Convexification::None })?;
        let (judged, _) = residuals(ocp.qp(), ocp.iterate());
        assert!(judged.largest() <= 2.0 * outcome.residuals.largest(), "{time}: {judged} {outcome}");
        assert!(outcome.residuals.largest() <= least, "{time}: {outcome}");
        least = outcome.residuals.largest();
        if outcome.is_converged() {
            break;
        }
        assert_eq!((outcome.status, asked), (Status::OutOfTime, time + 1));
        late += 1;
    }
    // Each of at least six iterations asks once, and so do those of its QP.
    assert!(late > 2 * 6, "{late}");
    Ok(())
}

#[function]
fn swing(x: [f64; 4], u: [f64; 1]) -> [f64; 5] {
    [x[0], x[1], 0.1 * x[2], 0.1 * x[3], 0.1 * u[0]]
}

/// A pendulum upright on a cart, which a force holds.
fn upright(x0: &[f64; 4]) -> Result<HeapOcp<impl Formulation<f64>>, Box<dyn std::error::Error>> {
    let mut ocp = Problem::new(Erk::<CartPole, Rk4>::new(Options::default())?)
        .stage_cost(LeastSquaresCost::<Swing>::diagonal(&[1.0; 5]))
        .on(Horizon::uniform(20, 0.05))?;
    ocp.fix_initial_state(x0)?.bound("u", .., -20.0, 20.0)?.guess(x0, &[0.0])?;
    Ok(ocp)
}

/// A sample that is late leaves the plan as it was, bit by bit, and the next one is in time.
#[test]
fn plan_after_late_samples() -> Test {
    let x0 = [0.0, 0.1, 0.0, 0.0];
    let mut controller = HeapRealTime::new(upright(&x0)?)?;
    controller.prepare()?.feedback(&x0)?;
    let plan = |controller: &HeapRealTime<_>| -> Vec<f64> {
        controller.ocp().iterate().stages().flat_map(|stage| [stage.x, stage.u].concat()).collect()
    };
    let before = plan(&controller);
    let x = [0.01, 0.12, 0.0, 0.0];
    // A warm start asks nobody for the time, a cold one before the factorisation that it takes.
    controller.reset();
    let late = controller.prepare()?.feedback_until(&x, &mut || true);
    assert!(matches!(late, Err(OcpError::Qp(QpError::OutOfTime { iterations: 0, .. }))), "{late:?}");
    assert!(plan(&controller).iter().zip(&before).all(|(a, b)| a.to_bits() == b.to_bits()));
    let u = controller.prepare()?.feedback_until(&x, &mut || false)?.u[0];
    assert_ne!(u, before[4]);
    Ok(())
}

/// Condensing hands the clock on.
#[test]
fn deadlines_of_condensed_problems() -> Test {
    let mut ocp = upright(&[0.0, 0.1, 0.0, 0.0])?;
    ocp.linearise(GaussNewton::default())?;
    let (mut solver, mut solution) =
        (Condensing::new(2, HeapInteriorPoint::new()), HeapSolution::new(ocp.qp().dims())?);
    let late = solver.solve_until(ocp.qp(), QpStart::Cold, solution.view_mut(), &mut || true);
    assert!(matches!(late, Err(QpError::OutOfTime { .. })), "{late:?}");
    solver.solve_until(ocp.qp(), QpStart::Cold, solution.view_mut(), &mut || false)?;
    Ok(())
}
