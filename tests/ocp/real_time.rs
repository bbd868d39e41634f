//! One step of sequential quadratic programming per sample.

use crate::Test;
use casados::ocp::{
    Globalisation, HeapOcp, HeapRealTime, HeapSqp, Horizon, LeastSquaresCost, Map, OcpError, Problem,
    Sensitivities, Status,
};
use casados::prelude::*;

/// A pendulum by the midpoint rule with one step of 0.1 s: angle and rate, a torque.
#[function]
fn swing(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    let rate = x[1] + 0.05 * (x[0].sin() + u[0]);
    let angle = x[0] + 0.05 * x[1];
    [x[0] + 0.1 * rate, x[1] + 0.1 * (angle.sin() + u[0])]
}

#[function]
fn effort(x: [f64; 2], u: [f64; 1]) -> [f64; 3] {
    [x[0], 0.3 * x[1], 0.3 * u[0]]
}

#[function]
fn rest(x: [f64; 2], _u: [f64; 1]) -> [f64; 2] {
    [3.0 * x[0], x[1]]
}

type Controlled = Problem<Map<Swing, f64>, LeastSquaresCost<Effort>, LeastSquaresCost<Rest>>;

/// The torque is bounded such that the bound is met at the start.
fn problem() -> Result<HeapOcp<Controlled>, OcpError> {
    let mut ocp = Problem::new(Map::<Swing, f64>::new())
        .stage_cost(LeastSquaresCost::<Effort>::diagonal(&[1.0; 3]))
        .terminal_cost(LeastSquaresCost::<Rest>::diagonal(&[1.0; 2]))
        .on(Horizon::uniform(20, 0.1))?;
    ocp.fix_initial_state(&X0)?.bound("u", .., -2.0, 2.0)?.guess(&X0, &[0.0])?;
    Ok(ocp)
}

const X0: [f64; 2] = [0.8, 0.4];

/// With the same state in every sample the plans are the iterates of sequential quadratic
/// programming with full steps.
#[test]
fn convergence_to_the_solution() -> Test {
    let mut ocp = problem()?;
    let mut sqp = HeapSqp::new(&ocp)?.gauss_newton();
    sqp.options.globalisation = Globalisation::FullStep;
    assert_eq!(sqp.solve(&mut ocp)?.status, Status::Converged);
    let mut controller = HeapRealTime::new(problem()?)?;
    let mut apart = f64::INFINITY;
    for _ in 0..12 {
        let feedback = controller.prepare()?.feedback(&X0)?;
        apart = (feedback.u[0] - ocp.stage(0)?.u[0]).abs();
    }
    // The tolerance of the QPs is 1e-8, and their Hessian at least 0.09 in the controls.
    assert!(apart < 1e-6, "{apart}");
    for (a, b) in controller.ocp().iterate().stages().zip(ocp.iterate().stages()) {
        assert!(a.x.iter().zip(b.x).all(|(a, b)| (a - b).abs() < 1e-6));
    }
    Ok(())
}

/// Gains of the QP that gave the feedback: where the same bounds are active its solution is linear
/// in the state.
#[test]
fn feedback_gains() -> Test {
    // Where the bound is met at the start the first control does not move; where it is not, it
    // does.
    for (near, moves) in [(X0, false), ([0.1, 0.05], true)] {
        let feedback = |x0: [f64; 2]| -> Result<_, OcpError> {
            let mut controller = HeapRealTime::new(problem()?)?;
            controller.qp_solver.options.tolerance = 1e-12;
            let u = controller.prepare()?.feedback(&x0)?.u[0];
            Ok((controller, u))
        };
        let (controller, u) = feedback(near)?;
        let mut result = Sensitivities::new(controller.ocp())?;
        controller.ocp().gains(&mut result)?;
        for (i, &gain) in result.gain(0).iter().enumerate() {
            let mut other = near;
            other[i] += 1e-3;
            let difference = (feedback(other)?.1 - u) / 1e-3;
            // Bounds of the plan are springs of 1.5e-8 relative to what they hold, and the QP is
            // solved to 1e-12 / 0.09, twice.
            assert!((difference - gain).abs() < 1e-7 * (1.0 + gain.abs()), "{difference} {gain}");
            assert_eq!(gain.abs() > 1e-3, moves, "{gain}");
        }
    }
    Ok(())
}

/// The control is the first of the QP that was prepared, for the state that was measured.
#[test]
fn prepared_feedback() -> Test {
    use casados::qp::{HeapInteriorPoint, HeapSolution, QpSolver, QpStart};
    let measured = [0.7, 0.5];
    let mut controller = HeapRealTime::new(problem()?)?;
    let mut ocp = problem()?;
    ocp.linearise(casados::ocp::GaussNewton::default())?;
    ocp.fix_initial_state(&measured)?;
    let mut solution = HeapSolution::new(ocp.qp().dims())?;
    HeapInteriorPoint::new().solve(ocp.qp(), QpStart::Cold, solution.view_mut())?;
    let feedback = controller.prepare()?.feedback(&measured)?;
    let expected = solution.stage(0).ok_or("a stage")?.u;
    assert!((feedback.u[0] - expected[0]).abs() < 1e-7, "{} {}", feedback.u[0], expected[0]);
    // The plan begins where the state was.
    assert!((controller.ocp().stage(0)?.x[0] - measured[0]).abs() < 1e-9);
    Ok(())
}

/// In closed loop the pendulum comes to rest, within the bounds of the torque; warm QPs take fewer
/// iterations.
#[test]
fn closed_loop() -> Test {
    let mut controller = HeapRealTime::new(problem()?)?;
    let mut x = X0;
    let mut iterations = Vec::new();
    for _ in 0..60 {
        let feedback = controller.prepare()?.feedback(&x)?;
        let u = [feedback.u[0]];
        assert!(u[0].abs() <= 2.0 + 1e-7, "{}", u[0]);
        iterations.push(feedback.statistics.iterations);
        x = swing(x, u);
        controller.shift();
    }
    assert!(x[0].abs() < 1e-3 && x[1].abs() < 1e-3, "{x:?}");
    assert!(iterations.last() < iterations.first(), "{iterations:?}");
    Ok(())
}

/// After an error the plan is what it was.
#[test]
fn plan_after_errors() -> Test {
    let mut controller = HeapRealTime::new(problem()?)?;
    controller.prepare()?.feedback(&X0)?;
    let before = controller.ocp().stage(3)?.x.to_vec();
    assert!(matches!(controller.prepare()?.feedback(&[f64::NAN, 0.0]), Err(OcpError::InvalidValue { .. })));
    controller.qp_solver.options.max_iterations = 1;
    controller.qp_solver.options.locate = false;
    assert!(matches!(controller.prepare()?.feedback(&[2.0, -3.0]), Err(OcpError::Qp(_))));
    assert_eq!(controller.ocp().stage(3)?.x, before);
    controller.qp_solver.options.max_iterations = 50;
    controller.prepare()?.feedback(&X0)?;
    Ok(())
}

/// A QP that fails leaves the plan with its multipliers: the next one starts as warm as if it had
/// not been.
#[test]
fn warm_start_after_errors() -> Test {
    let iterations = |fails: bool| -> Result<usize, Box<dyn std::error::Error>> {
        let mut controller = HeapRealTime::new(problem()?)?;
        for _ in 0..5 {
            controller.prepare()?.feedback(&X0)?;
        }
        if fails {
            controller.qp_solver.options.max_iterations = 1;
            controller.qp_solver.options.locate = false;
            assert!(matches!(controller.prepare()?.feedback(&[2.0, -3.0]), Err(OcpError::Qp(_))));
            controller.qp_solver.options.max_iterations = 50;
        }
        Ok(controller.prepare()?.feedback(&X0)?.statistics.iterations)
    };
    assert_eq!(iterations(true)?, iterations(false)?);
    Ok(())
}
