//! Problems that are easy to write and hard to solve.

use crate::{Test, solve};
use casados::qp::{
    HeapInteriorPoint, HeapQp, HeapSolution, QpError, QpField, QpSolver, QpStart, Side, StageDims,
};

const INFINITY: f64 = f64::INFINITY;

/// `x₊ = x + u` for some intervals, with costs `½ x² + ½ r u²`, from `x₀ = 0`.
fn integrator(intervals: usize, r: f64) -> Result<HeapQp<f64>, QpError> {
    let mut dims = vec![StageDims::new(1, 1, 0); intervals + 1];
    dims[intervals].nu = 0;
    let mut qp = HeapQp::new(&dims)?;
    for mut stage in qp.stages_mut() {
        stage.a_mut().set(0, 0, 1.0);
        stage.b_mut().set(0, 0, 1.0);
        stage.q_mut().set(0, 0, 1.0);
        stage.r_mut().set(0, 0, r);
    }
    qp.fix_initial_state(&[0.0])?;
    Ok(qp)
}

fn assert_close(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} instead of {expected}");
}

/// Without inequalities Newton's method is exact after one step. The scalar Riccati equation has
/// the solution `p = q + a² p − (a b p)² / (r + b² p)`: with `q = r = a = b = 1` the golden ratio,
/// `u = −p / (1 + p) x`.
#[test]
fn no_inequality() -> Test {
    let mut qp = integrator(60, 1.0)?;
    qp.fix_initial_state(&[1.0])?;
    let (solution, statistics, _) = solve(&qp)?;
    assert_eq!(statistics.iterations, 1);
    let p = (1.0 + 5f64.sqrt()) / 2.0;
    // The end of the horizon is felt by (1 − p/(1+p))^120 = 1e-50 only.
    assert_close(solution.stage(0).ok_or("no stage")?.u[0], -p / (1.0 + p), 1e-14);
    Ok(())
}

/// A horizon without interval: a plain QP.
#[test]
fn a_single_stage() -> Test {
    let mut qp = HeapQp::<f64>::new(&[StageDims::new(0, 2, 1)])?;
    let mut stage = qp.stage_mut(0).ok_or("no stage")?;
    stage.r_mut().set_diagonal([1.0, 1.0]);
    stage.d_mut().fill_with(|_, _| 1.0);
    stage.g_bounds_mut().set(0, 3.0, INFINITY);
    stage.u_bounds_mut().set(0, -INFINITY, 1.0);
    let (solution, ..) = solve(&qp)?;
    let point = solution.stage(0).ok_or("no stage")?;
    // u₀ ≤ 1 and u₀ + u₁ ≥ 3 are active: u = (1, 2), and the multipliers are 1 and 2.
    assert_close(point.u[0], 1.0, 1e-9);
    assert_close(point.u[1], 2.0, 1e-9);
    assert_close(point.g_lower[0], 2.0, 1e-8);
    assert_close(point.u_upper[0], 1.0, 1e-8);
    Ok(())
}

/// Two equal bounds: of a control, of a state in the middle, and of a general constraint.
#[test]
fn equal_lower_and_upper_bounds() -> Test {
    let mut qp = integrator(6, 0.1)?;
    qp.stage_mut(1).ok_or("no stage")?.u_bounds_mut().set(0, 0.25, 0.25);
    qp.stage_mut(4).ok_or("no stage")?.x_bounds_mut().set(0, 2.0, 2.0);
    let (solution, ..) = solve(&qp)?;
    // Equations hold to the tolerance.
    assert_close(solution.stage(1).ok_or("no stage")?.u[0], 0.25, 1e-10);
    assert_close(solution.stage(4).ok_or("no stage")?.x[0], 2.0, 1e-10);
    Ok(())
}

/// An equation of states and controls at the end of a horizon, and its multiplier:
/// `min ½ (x² + u²)`, `x + u = 2`.
#[test]
fn general_equations() -> Test {
    let mut qp = HeapQp::<f64>::new(&[StageDims::new(1, 1, 1)])?;
    let mut stage = qp.stage_mut(0).ok_or("no stage")?;
    stage.q_mut().set(0, 0, 1.0);
    stage.r_mut().set(0, 0, 1.0);
    stage.c_mut().set(0, 0, 1.0);
    stage.d_mut().set(0, 0, 1.0);
    stage.g_bounds_mut().set(0, 2.0, 2.0);
    let (solution, ..) = solve(&qp)?;
    let point = solution.stage(0).ok_or("no stage")?;
    assert_close(point.x[0], 1.0, 1e-10);
    assert_close(point.u[0], 1.0, 1e-10);
    assert_close(point.g_lower[0], 1.0, 1e-9);
    Ok(())
}

/// The same constraint many times: multipliers are not unique, and neither is the active set.
#[test]
fn redundant_constraints() -> Test {
    let mut dims = [StageDims::new(1, 1, 5); 5];
    dims[4].nu = 0;
    let mut qp = HeapQp::<f64>::new(&dims)?;
    for mut stage in qp.stages_mut() {
        stage.a_mut().set(0, 0, 1.0);
        stage.b_mut().set(0, 0, 1.0);
        stage.q_mut().set(0, 0, 1.0);
        stage.gradient_x_mut()[0] = -3.0;
        stage.r_mut().set(0, 0, 0.1);
        stage.c_mut().fill_with(|_, _| 1.0);
        for i in 0..5 {
            stage.g_bounds_mut().set(i, -INFINITY, 1.0);
        }
        stage.x_bounds_mut().set(0, -INFINITY, 1.0);
    }
    qp.fix_initial_state(&[0.0])?;
    // A bound at 0 of a state that is fixed there is active whatever happens.
    let (solution, ..) = solve(&qp)?;
    assert_close(solution.stage(4).ok_or("no stage")?.x[0], 1.0, 1e-8);
    Ok(())
}

/// Two controls that do the same and cost nothing: the Hessian is singular, and their sum is
/// determined.
#[test]
fn singular_hessian() -> Test {
    let mut dims = [StageDims::new(1, 2, 0); 4];
    dims[3].nu = 0;
    let mut qp = HeapQp::<f64>::new(&dims)?;
    for mut stage in qp.stages_mut() {
        stage.a_mut().set(0, 0, 1.0);
        stage.b_mut().fill_with(|_, _| 1.0);
        stage.q_mut().set(0, 0, 1.0);
    }
    qp.fix_initial_state(&[1.0])?;
    let (solution, statistics, _) = solve(&qp)?;
    assert!(statistics.regularised > 0);
    let point = solution.stage(0).ok_or("no stage")?;
    assert_close(point.u[0] + point.u[1], -1.0, 1e-9);
    Ok(())
}

/// Controls that cost almost nothing, and almost the same of two of them.
#[test]
fn nearly_singular_hessian() -> Test {
    let mut dims = [StageDims::new(2, 2, 0); 11];
    dims[10].nu = 0;
    let mut qp = HeapQp::<f64>::new(&dims)?;
    for mut stage in qp.stages_mut() {
        stage.a_mut().set_diagonal([1.0, 0.9]);
        stage.b_mut().fill_with(|i, j| 1.0 + if i == 1 && j == 1 { 1e-6 } else { 0.0 });
        stage.q_mut().set_diagonal([1.0, 1e-8]);
        stage.r_mut().set_diagonal([1e-10, 1e-10]);
        for i in 0..2 {
            stage.u_bounds_mut().set(i, -0.5, 0.5);
        }
    }
    qp.fix_initial_state(&[2.0, -1.0])?;
    solve(&qp)?;
    Ok(())
}

/// `min ½ x²` with the soft bound `x ≥ 1`: with a linear penalty `ρ < 1` it is `x = ρ`, with a
/// quadratic one `Z` it is `x = Z / (1 + Z)`, and with `ρ > 1` the bound holds.
#[test]
fn soft_bounds() -> Test {
    for (linear, quadratic, expected) in
        [(0.3, 0.0, 0.3), (0.0, 3.0, 0.75), (0.2, 1.0, 0.6), (5.0, 0.0, 1.0), (5.0, 2.0, 1.0)]
    {
        for general in [false, true] {
            let mut qp = HeapQp::<f64>::new(&[StageDims::new(1, 0, 1)])?;
            let mut stage = qp.stage_mut(0).ok_or("no stage")?;
            stage.q_mut().set(0, 0, 1.0);
            stage.c_mut().set(0, 0, 1.0);
            let mut bounds = if general { stage.g_bounds_mut() } else { stage.x_bounds_mut() };
            bounds.set(0, 1.0, INFINITY);
            bounds.soften(0, linear, quadratic);
            let (solution, ..) = solve(&qp)?;
            assert_close(solution.stage(0).ok_or("no stage")?.x[0], expected, 1e-8);
        }
    }
    Ok(())
}

/// A state at the start without bounds goes where it costs least, one with bounds to the nearest of
/// them, and one of which a component is given keeps it.
#[test]
fn bounds_of_the_initial_state() -> Test {
    for (lower, upper, expected) in
        [(-INFINITY, INFINITY, 3.0), (-1.0, 1.0, 1.0), (4.0, INFINITY, 4.0), (2.0, 2.0, 2.0)]
    {
        let mut qp = HeapQp::<f64>::new(&[StageDims::new(2, 1, 0), StageDims::new(2, 0, 0)])?;
        for mut stage in qp.stages_mut() {
            // The cost is that of x₀ = 3, wherever the other component is.
            stage.q_mut().set_diagonal([1.0, 1.0]);
            stage.gradient_x_mut().copy_from_slice(&[-3.0, 0.0]);
            stage.r_mut().set(0, 0, 1.0);
            stage.a_mut().set(0, 0, 1.0);
            stage.b_mut().set(1, 0, 1.0);
        }
        let mut stage = qp.stage_mut(0).ok_or("no stage")?;
        stage.x_bounds_mut().set(0, lower, upper);
        stage.x_bounds_mut().set(1, 0.5, 0.5);
        let (solution, ..) = solve(&qp)?;
        let x = solution.stage(0).ok_or("no stage")?.x;
        assert_close(x[0], expected, 1e-8);
        assert_close(x[1], 0.5, 1e-9);
    }
    Ok(())
}

/// With `|u| ≤ 0.1` a state cannot be 1 after three intervals: it misses that by 0.7.
#[test]
fn location_of_infeasibility() -> Test {
    let mut qp = integrator(5, 1.0)?;
    for mut stage in qp.stages_mut() {
        stage.u_bounds_mut().set(0, -0.1, 0.1);
    }
    qp.stage_mut(3).ok_or("no stage")?.x_bounds_mut().set(0, 1.0, INFINITY);
    let mut solution = HeapSolution::new(qp.dims())?;
    let found = HeapInteriorPoint::new().solve(qp.view(), QpStart::Cold, solution.view_mut());
    let Err(QpError::Infeasible { field, stage, index, side, violation }) = found else {
        return Err(format!("{found:?}").into());
    };
    assert_eq!((field, stage, index, side), (QpField::StateBounds, 3, 0, Side::Lower));
    assert_close(violation, 0.7, 1e-6);
    // The point is the one that is least infeasible.
    assert_close(solution.stage(3).ok_or("no stage")?.x[0], 0.3, 1e-6);
    Ok(())
}

/// Two general constraints that exclude each other, and equations that do.
#[test]
fn contradictory_constraints() -> Test {
    for (first, second, violation) in
        [((1.0, INFINITY), (-INFINITY, 0.0), 1.0), ((2.0, 2.0), (-1.0, -1.0), 3.0)]
    {
        let mut qp = integrator(3, 1.0)?;
        let mut dims = qp.dims().to_vec();
        dims[2].ng = 2;
        qp = HeapQp::new(&dims)?;
        for mut stage in qp.stages_mut() {
            stage.a_mut().set(0, 0, 1.0);
            stage.b_mut().set(0, 0, 1.0);
            stage.r_mut().set(0, 0, 1.0);
            stage.c_mut().fill_with(|_, _| 1.0);
        }
        qp.fix_initial_state(&[0.0])?;
        let mut stage = qp.stage_mut(2).ok_or("no stage")?;
        stage.g_bounds_mut().set(0, first.0, first.1);
        stage.g_bounds_mut().set(1, second.0, second.1);
        let mut solution = HeapSolution::new(qp.dims())?;
        let found = HeapInteriorPoint::new().solve(qp.view(), QpStart::Cold, solution.view_mut());
        let Err(QpError::Infeasible { field, stage, violation: found, .. }) = found else {
            return Err(format!("{found:?}").into());
        };
        assert_eq!((field, stage), (QpField::GeneralBounds, 2));
        // The sum of both violations is what is smallest, and the larger one is at least half of
        // it.
        assert!(found >= 0.5 * violation - 1e-6 && found <= violation + 1e-6, "{found}");
    }
    Ok(())
}

#[test]
fn nonconvex_problem() -> Test {
    let mut qp = integrator(5, 1.0)?;
    qp.stage_mut(3).ok_or("no stage")?.r_mut().set(0, 0, -10.0);
    qp.fix_initial_state(&[1.0])?;
    let mut solution = HeapSolution::new(qp.dims())?;
    let found = HeapInteriorPoint::new().solve(qp.view(), QpStart::Cold, solution.view_mut());
    assert!(
        matches!(found, Err(QpError::NotConvex { stage: 3, index: 0, pivot }) if pivot < 0.0),
        "{found:?}"
    );
    Ok(())
}

/// A control that costs less the larger it is.
#[test]
fn unbounded() -> Test {
    let mut qp = HeapQp::<f64>::new(&[StageDims::new(0, 1, 0)])?;
    let mut stage = qp.stage_mut(0).ok_or("no stage")?;
    stage.gradient_u_mut()[0] = -1.0;
    stage.u_bounds_mut().set(0, 0.0, INFINITY);
    let mut solution = HeapSolution::new(qp.dims())?;
    let found = HeapInteriorPoint::new().solve(qp.view(), QpStart::Cold, solution.view_mut());
    assert!(matches!(found, Err(QpError::Stalled { .. } | QpError::MaxIterations { .. })), "{found:?}");
    Ok(())
}

/// Data of very different sizes in one problem.
#[test]
fn badly_scaled() -> Test {
    let mut qp = integrator(10, 1.0)?;
    for mut stage in qp.stages_mut() {
        stage.q_mut().set(0, 0, 1e6);
        stage.r_mut().set(0, 0, 1e-4);
        stage.b_mut().set(0, 0, 1e-3);
        stage.u_bounds_mut().set(0, -1e3, 1e3);
    }
    qp.fix_initial_state(&[5.0])?;
    let mut solver = HeapInteriorPoint::new();
    let mut solution = HeapSolution::new(qp.dims())?;
    let statistics = solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
    // Forces are of the size 1e6 · 5.
    let (residuals, tolerance) = (statistics.residuals, solver.options.tolerance);
    assert!(residuals.stationarity.max(residuals.complementarity) <= 5e6 * tolerance, "{residuals}");
    assert!(residuals.dynamics.max(residuals.inequalities) <= tolerance, "{residuals}");
    assert_close(solution.stage(0).ok_or("no stage")?.u[0], -1e3, 1e-6);
    Ok(())
}

/// `min ½ u² − u` with `0.6 ≤ u ≤ 1.7` and a soft upper bound that means none: `u = 1`.
#[test]
fn soft_bounds_without_effect() -> Test {
    for none in [1e8, 1e9, 1e10, 1e12, 1e14, 1e15, 1e20, 1e300, INFINITY] {
        let mut qp = HeapQp::<f64>::new(&[StageDims::new(0, 1, 1)])?;
        let mut stage = qp.stage_mut(0).ok_or("no stage")?;
        stage.r_mut().set(0, 0, 1.0);
        stage.gradient_u_mut()[0] = -1.0;
        stage.u_bounds_mut().set(0, 0.6, 1.7);
        stage.d_mut().set(0, 0, 1.0);
        stage.g_bounds_mut().set(0, -0.9, none);
        stage.g_bounds_mut().soften(0, 100.0, 0.0);
        let (solution, ..) = solve(&qp)?;
        assert_close(solution.stage(0).ok_or("no stage")?.u[0], 1.0, 1e-9);
    }
    Ok(())
}

/// A row `0 ≤ 0`, beside variables and in a stage without any: every multiplier of it satisfies the
/// conditions, NaN does not.
#[test]
fn rows_without_variables() -> Test {
    let mut qp = HeapQp::<f64>::new(&[StageDims::new(1, 1, 0), StageDims::new(0, 0, 1)])?;
    let mut stage = qp.stage_mut(0).ok_or("no stage")?;
    stage.q_mut().set(0, 0, 1.0);
    stage.r_mut().set(0, 0, 1.0);
    qp.stage_mut(1).ok_or("no stage")?.g_bounds_mut().set(0, -INFINITY, 0.0);
    let (solution, ..) = solve(&qp)?;
    assert!(solution.stage(1).ok_or("no stage")?.g_upper[0].is_finite());
    let mut qp = integrator(3, 1.0)?;
    let mut dims = qp.dims().to_vec();
    dims[1].ng = 1;
    qp = HeapQp::new(&dims)?;
    for mut stage in qp.stages_mut() {
        stage.a_mut().set(0, 0, 1.0);
        stage.b_mut().set(0, 0, 1.0);
        stage.q_mut().set(0, 0, 1.0);
        stage.r_mut().set(0, 0, 1.0);
        stage.u_bounds_mut().set(0, -0.1, 0.1);
        stage.g_bounds_mut().set(0, -INFINITY, 0.0);
    }
    qp.fix_initial_state(&[1.0])?;
    let (solution, ..) = solve(&qp)?;
    assert_close(solution.stage(0).ok_or("no stage")?.u[0], -0.1, 1e-8);
    Ok(())
}
