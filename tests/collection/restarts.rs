//! Problems on which long first steps lead astray: the run begins again with steps that are damped,
//! or steps are shortened where the merit function turns before their ends.

use super::ocps::line;
use super::units::fix;
use super::{Test, objective_change_by_residuals, solve};
use casados::ocp::{
    Exact, Formulation, GeneralCost, HeapIpm, HeapOcp, HeapSqp, Horizon, Problem, SecondOrder, Status,
};
use casados::prelude::*;
use casados::qp::residuals;
use casados::{Erk, Rk4};
use std::f64::consts::PI;
use std::ops::ControlFlow;

/// An F-8 aircraft over `τ ∈ [0, 1]`: angle of attack, pitch, pitch rate, and the time that
/// everything takes; the deflection of the elevator. W. L. Garrard, J. M. Jordan, "Design of
/// nonlinear automatic flight control systems", Automatica 13 (1977).
#[ode]
fn crusader(x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    let ([a, pitch, rate, time], w) = (x, u[0]);
    let lift = -0.877 * a + rate - 0.088 * a * rate + 0.47 * a * a - 0.019 * pitch * pitch - a * a * rate
        + 3.846 * a * a * a
        - 0.215 * w
        + 0.28 * a * a * w
        + 0.47 * a * w * w
        + 0.63 * w * w * w;
    let moment = -4.208 * a - 0.396 * rate - 0.47 * a * a - 3.564 * a * a * a - 20.967 * w
        + 6.265 * a * a * w
        + 46.0 * a * w * w
        + 61.4 * w * w * w;
    [time * lift, time * rate, time * moment, 0.0]
}

#[function]
fn time(x: [f64; 4], _u: [f64; 1]) -> f64 {
    x[3]
}

/// To rest in the shortest time from a large angle of attack.
fn aircraft() -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Box<dyn std::error::Error>>
{
    let n = 60;
    let erk = Erk::<Crusader, Rk4>::new(Options::default())?;
    let mut ocp = Problem::new(erk)
        .terminal_cost(GeneralCost::<Time>::new())
        .on(Horizon::uniform(n, 1.0 / n as f64))?;
    ocp.free_initial_state();
    ocp.bound("x[3]", .., 0.1, 30.0)?.bound("u", .., -0.05236, 0.05236)?;
    for (i, first) in [0.4655, 0.0, 0.0].into_iter().enumerate() {
        ocp.bound(&format!("x[{i}]"), 0..=0, first, first)?;
        ocp.bound(&format!("x[{i}]"), n..=n, 0.0, 0.0)?;
    }
    for k in 0..=n {
        let x = [0.4655 * (1.0 - k as f64 / n as f64), 0.0, 0.0, 5.0];
        ocp.guess_stage(k, &x, if k < n { &[0.0] } else { &[] })?;
    }
    Ok(ocp)
}

/// The first step goes to the shortest time that is allowed, where violations have a minimum of
/// their own. IPOPT (CasADi 3.8.2, the same discretisation and guess) takes 86 iterations to
/// 5.730851135986 at a tolerance of 1e-6.
#[test]
fn shortest_admissible_time() -> Test {
    let mut ocp = aircraft()?;
    let (outcome, log) = solve(&mut ocp)?;
    assert!(outcome.is_converged() && outcome.iterations <= 86, "{outcome}");
    // The first attempt ends in the minimum of violations.
    let shortest = log.iter().map(|row| row.objective).fold(f64::INFINITY, f64::min);
    assert!(shortest < 0.2, "{shortest}");
    ocp.linearise(Exact::default())?;
    let (judged, _) = residuals(ocp.qp(), ocp.iterate());
    assert!(judged.largest() <= 1e-6, "{judged}");
    // Residuals of both solvers are below 1e-6, and IPOPT relaxes bounds by 1e-8.
    let tolerance = (2.0 * 1e-6 + 1e-8) * objective_change_by_residuals(&ocp);
    assert!((outcome.objective - 5.730851135986).abs() <= tolerance, "{outcome}, {tolerance:e}");
    Ok(())
}

/// Where a run ends in its second attempt, an iterate of the first one may be the best.
#[test]
fn best_iterate_of_both_attempts() -> Test {
    let mut ocp = aircraft()?;
    let (mut shortest, mut best) = (f64::INFINITY, f64::INFINITY);
    let outcome = HeapSqp::new(&ocp)?.solve_observed(&mut ocp, &mut |row| {
        shortest = row.objective.min(shortest);
        best = row.residuals.largest().min(best);
        let is_second = shortest < 0.2 && row.objective > 1.0;
        if is_second { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    assert_eq!(outcome.status, Status::Stopped, "{outcome}");
    assert_eq!(outcome.residuals.largest(), best);
    // Its violations, by code that is not the solver's.
    ocp.linearise(Exact::default())?;
    let (judged, _) = residuals(ocp.qp(), ocp.iterate());
    assert!(judged.dynamics <= 1.001 * best && judged.inequalities <= 1.001 * best, "{judged}, {best:e}");
    Ok(())
}

/// A particle that is steered over `τ ∈ [0, 1]`: position, velocity, and the time that everything
/// takes; the angle of a constant force. E. D. Dolan, J. J. Moré, T. S. Munson, "Benchmarking
/// optimization software with COPS 3.0", 2004, problem 9.
#[ode]
fn particle(x: [f64; 5], u: [f64; 1]) -> [f64; 5] {
    let ([_, _, vx, vy, time], (s, c)) = (x, u[0].sin_cos());
    [time * vx, time * vy, time * 100.0 * c, time * 100.0 * s, 0.0]
}

#[function]
fn steering_time(x: [f64; 5], _u: [f64; 1]) -> f64 {
    x[4]
}

/// Far from a feasible point multipliers give the Hessian a curvature that needs a `δ_w` which
/// makes them larger: without that curvature few iterations are enough.
#[test]
fn indefinite_hessians_far_from_feasibility() -> Test {
    let n = 50;
    let mut ocp = Problem::new(Erk::<Particle, Rk4>::new(Options::default())?)
        .terminal_cost(GeneralCost::<SteeringTime>::new())
        .on(Horizon::uniform(n, 1.0 / n as f64))?;
    ocp.free_initial_state();
    ocp.bound("u", .., -PI / 2.0, PI / 2.0)?.bound("x[4]", .., 0.0, f64::INFINITY)?;
    fix(&mut ocp, 0, &[(0, 0.0), (1, 0.0), (2, 0.0), (3, 0.0)])?;
    fix(&mut ocp, n, &[(1, 5.0), (2, 45.0), (3, 0.0)])?;
    line(&mut ocp, &[0.0, 0.0, 0.0, 0.0, 1.0], &[10.0, 5.0, 45.0, 0.0, 1.0], &[0.0])?;
    let outcome = HeapIpm::new(&ocp)?.solve(&mut ocp)?;
    assert!(outcome.is_converged() && outcome.iterations <= 25, "{outcome}");
    // IPOPT's (CasADi 3.8.2, the same discretisation and guess, a tolerance of 1e-6).
    assert!((outcome.objective - 0.5545954638).abs() < 1e-7, "{outcome}");
    Ok(())
}
