//! Derivatives of solutions against differences of problems that are solved again, and against the regulator.

use crate::Test;
use casados::ocp::{
    Constraint, Convexification, Exact, GaussNewton, GeneralCost, HeapSqp, Horizon, LeastSquaresCost, Map,
    OcpError, Problem, Sensitivities,
};
use casados::prelude::*;

/// A pendulum with a length that does not change: a parameter as a state.
#[ode]
fn pendulum(x: [f64; 3], u: [f64; 1]) -> [f64; 3] {
    [x[1], -x[2] * x[0].sin() + u[0] * x[0].cos(), 0.0]
}

#[function]
fn tracking(x: [f64; 3], u: [f64; 1]) -> [f64; 3] {
    [x[0] - 0.5, 0.3 * x[1] * x[1], 0.2 * u[0]]
}

#[function]
fn energy(x: [f64; 3], _u: [f64; 1]) -> f64 {
    0.5 * x[1] * x[1] - x[0].cos()
}

#[function]
fn speed(x: [f64; 3], u: [f64; 1]) -> f64 {
    x[1] + 0.1 * u[0] * x[0]
}

/// With bounds of controls, a constraint of the path and a soft bound that are active somewhere.
#[test]
fn differences_of_solutions() -> Test {
    let n = 12;
    let mut ocp = Problem::new(Irk::<Pendulum, Gauss<2>>::new(Options::default())?)
        .stage_cost(LeastSquaresCost::<Tracking>::diagonal(&[1.0; 3]))
        .terminal_cost(GeneralCost::<Energy>::new())
        .path_constraints(Constraint::<Speed>::new([f64::NEG_INFINITY], [0.75]))
        .on(Horizon::uniform(n, 0.15))?;
    let x0 = [-0.8, 0.1, 1.3];
    ocp.fix_initial_state(&x0)?.bound("u", .., -2.0, 2.0)?.guess(&x0, &[0.0])?;
    ocp.bound("x[0]", 4.., f64::NEG_INFINITY, 0.1)?.soften("x[0]", 4.., 0.1, 2.0)?;
    let exact = Exact { convexification: Convexification::None };
    let mut sqp = HeapSqp::new(&ocp)?.exact(Exact::default());
    sqp.options.globalisation = casados::ocp::Globalisation::Merit;
    (sqp.options.tolerance, sqp.options.max_iterations) = (1e-9, 100);
    sqp.qp_solver.options.tolerance = 1e-11;
    let outcome = sqp.solve(&mut ocp)?;
    println!("{}{outcome}", sqp.log());
    assert!(outcome.is_converged());
    let stages: Vec<_> = ocp.iterate().stages().collect();
    // All three are active somewhere, and nothing is active everywhere.
    let active =
        |f: &dyn Fn(&casados::qp::SolutionStage<'_, f64>) -> bool| stages.iter().filter(|s| f(s)).count();
    assert!((1..n).contains(&active(&|s| s.u_upper.iter().any(|&m| m > 1e-3))));
    assert!((1..n).contains(&active(&|s| s.g_upper.iter().any(|&m| m > 1e-3))));
    assert!((1..n).contains(&active(&|s| s.x[0] > 0.101)));
    drop(stages);

    let mut result = Sensitivities::new(&ocp)?;
    ocp.differentiate(exact, &mut result)?;
    let step = 1e-5;
    for direction in 0..3 {
        let mut sides = Vec::new();
        for sign in [1.0, -1.0] {
            let mut x0 = x0;
            x0[direction] += sign * step;
            ocp.fix_initial_state(&x0)?;
            assert!(sqp.solve(&mut ocp)?.is_converged());
            let all: Vec<(Vec<f64>, Vec<f64>)> =
                ocp.iterate().stages().map(|stage| (stage.x.to_vec(), stage.u.to_vec())).collect();
            sides.push(all);
        }
        for (k, (plus, minus)) in sides[0].iter().zip(&sides[1]).enumerate() {
            let pairs = plus.0.iter().zip(&minus.0).zip(&result.dx(k)[direction * 3..]);
            let du = result.du(k.min(n - 1)).get(direction..).unwrap_or_default();
            for ((a, b), derivative) in pairs.chain(plus.1.iter().zip(&minus.1).zip(du)) {
                let difference = (a - b) / (2.0 * step);
                // Solutions to 1e-9 over 2e-5, and complementarity of 1e-11 over multipliers of 1e-3: 1e-4 in all.
                assert!((difference - derivative).abs() < 1e-4, "{k} {direction}: {difference} {derivative}");
            }
        }
    }
    // Feedback at the first stage is the derivative of the first control.
    assert_eq!(result.gain(0), result.du(0));
    Ok(())
}

#[function]
fn push(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [x[0] + 0.1 * x[1] + 0.005 * u[0], x[1] + 0.1 * u[0]]
}

#[function]
fn both(x: [f64; 2], u: [f64; 1]) -> [f64; 3] {
    [x[0], x[1], u[0]]
}

/// A long horizon without bounds: gains of the regulator, and `x_k = dx_k/dx₀ x₀`, since everything is linear.
#[test]
fn linear_problems() -> Test {
    let mut ocp = Problem::new(Map::<Push, f64>::new())
        .stage_cost(LeastSquaresCost::<Both>::diagonal(&[2.0, 1.0, 0.5]))
        .on(Horizon::uniform(25, 0.1))?;
    let x0 = [1.0, -0.3];
    let mut result = Sensitivities::new(&ocp)?;
    assert!(matches!(ocp.differentiate(GaussNewton::default(), &mut result), Err(OcpError::Missing { .. })));
    ocp.fix_initial_state(&x0)?.guess(&[0.0; 2], &[0.0])?;
    assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
    ocp.differentiate(GaussNewton::default(), &mut result)?;
    for (k, stage) in ocp.iterate().stages().enumerate() {
        let (dx, gain) = (result.dx(k), result.gain(k));
        for i in 0..2 {
            // Twenty-five products of small matrices.
            assert!((dx[i] * x0[0] + dx[2 + i] * x0[1] - stage.x[i]).abs() < 1e-13);
        }
        if k < 25 {
            assert!((gain[0] * stage.x[0] + gain[1] * stage.x[1] - stage.u[0]).abs() < 1e-12);
        }
    }
    Ok(())
}
