//! Where active sets change: smoothed solutions, weakly active bounds; and what is refused.

use crate::Test;
use crate::mass::{Both, Push};
use crate::solution_derivatives::{
    AT, By, EXACT, Energy, N, Pendulum, Speed, TOLERANCE, Tracking, Work, bounded, check_by_differences,
    solved,
};
use casados::ocp::{
    Constraint, GeneralCost, HeapIpm, HeapSqp, Horizon, LeastSquaresCost, Map, OcpError, Problem,
    Sensitivities, SolutionFactors,
};
use casados::prelude::*;
use casados::qp::HeapSolution;

/// Solutions of the barrier problem are smooth, with bounds of all kinds: hard, soft, of the path.
#[test]
fn smoothed_solutions() -> Test {
    for mu in [1e-1, 1e-2, 1e-3] {
        let solve = |at: &[f64]| {
            let irk = Irk::<Pendulum, Gauss<2>>::new(Options::default())?;
            solved(bounded!(irk, at), By::Barrier(mu))
        };
        check_by_differences(&AT, By::Barrier(mu), solve, TOLERANCE)?;
    }
    Ok(())
}

#[function]
fn sum(x: f64, u: f64) -> f64 {
    x + u
}
#[function]
fn state(x: f64, _u: f64) -> f64 {
    x
}
#[function]
fn control(_x: f64, u: f64) -> f64 {
    u
}

/// `min ½ u² + ½ (x₀ + u)²` with `u ≥ −1`: `u = max(−x₀ / 2, −1)`, weakly active at `x₀ = 2`. With
/// the barrier `s = u + 1` solves `2 (s − 1) + x₀ = μ / s`.
#[test]
fn weakly_active_bounds() -> Test {
    let build = |x0: f64| -> Result<_, OcpError> {
        let mut ocp = Problem::new(Map::<Sum, f64>::new())
            .stage_cost(LeastSquaresCost::<Control>::diagonal(&[1.0]))
            .terminal_cost(LeastSquaresCost::<State>::diagonal(&[1.0]))
            .on(Horizon::uniform(1, 1.0))?;
        ocp.fix_initial_state(&[x0])?.bound("u", .., -1.0, f64::INFINITY)?.guess(&[x0], &[0.0])?;
        Ok(ocp)
    };
    for (x0, weak, slopes) in [(1.0, 0, [-0.5, -0.5]), (3.0, 0, [0.0, 0.0]), (2.0, 1, [-0.5, 0.0])] {
        let mut ocp = build(x0)?;
        let mut sqp = HeapSqp::new(&ocp)?;
        sqp.options.tolerance = 1e-10;
        assert!(sqp.solve(&mut ocp)?.is_converged());
        let mut result = Sensitivities::new(&ocp)?;
        ocp.differentiate(EXACT, &mut result)?;
        assert_eq!(result.factors().weakly_active(), weak);
        // One of both sides; a spring of 1e8 gives way by its inverse.
        let slope = result.du(0)[0];
        assert!(slopes.iter().any(|expected| (slope - expected).abs() < 1e-7), "{x0} {slope}");
    }
    for mu in [1e-1, 1e-4, 1e-6] {
        for x0 in [0.0, 1.0, 1.9, 2.0, 2.1, 3.0] {
            let mut ocp = build(x0)?;
            let mut ipm = HeapIpm::new(&ocp)?;
            (ipm.options.tolerance, ipm.options.final_mu) = (1e-11, mu);
            assert!(ipm.solve(&mut ocp)?.is_converged());
            let half = 0.5 * (x0 - 2.0);
            let s = 0.5 * ((half * half + 2.0 * mu).sqrt() - half);
            // s λ = μ to 1e-11, relative to μ ≥ 1e-6.
            assert!((ocp.stage(0)?.u[0] - (s - 1.0)).abs() < 1e-5 * s, "{mu} {x0}");
            let mut factors = SolutionFactors::new(&ocp)?;
            factors.smoothing = mu;
            ocp.factorise(EXACT, &mut factors)?;
            let slope = -1.0 / (2.0 + mu / (s * s));
            assert!((factors.gain(0)[0] - slope).abs() < 1e-4 * slope.abs(), "{mu} {x0}");
            // V′ = x₀ + u, V″ = 1 + du/dx₀.
            assert!((factors.value_gradient_x0()[0] - (x0 + s - 1.0)).abs() < 1e-8);
            assert!((factors.value_hessian().xx[0] - (1.0 + slope)).abs() < 1e-4);
        }
    }
    Ok(())
}

/// Mistakes have names.
#[test]
fn refused_options() -> Test {
    let build = |n: usize| -> Result<_, OcpError> {
        let problem = Problem::new(Map::<Push, f64>::new());
        let problem = problem.stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 3]));
        let mut ocp = problem.on(Horizon::uniform(n, 0.1))?;
        ocp.guess(&[1.0, 0.0], &[0.0])?;
        Ok(ocp)
    };
    let mut ocp = build(4)?;
    let mut factors = SolutionFactors::new(&ocp)?;
    assert!(matches!(ocp.factorise(EXACT, &mut factors), Err(OcpError::Missing { .. })));
    ocp.fix_initial_state(&[1.0, 0.0])?;
    for smoothing in [-1.0, f64::NAN, f64::INFINITY] {
        factors.smoothing = smoothing;
        let result = ocp.factorise(EXACT, &mut factors);
        assert!(matches!(result, Err(OcpError::InvalidOption { name: "smoothing", .. })));
    }
    factors.smoothing = 0.0;
    ocp.factorise(EXACT, &mut factors)?;
    let other = build(5)?;
    let mut seed = HeapSolution::new(other.qp().dims())?;
    assert!(matches!(factors.adjoint(&seed), Err(OcpError::Length { .. })));
    let mut of_other = SolutionFactors::new(&other)?;
    assert!(matches!(ocp.factorise(EXACT, &mut of_other), Err(OcpError::Length { .. })));
    seed = HeapSolution::new(ocp.qp().dims())?;
    seed.stage_mut(2).ok_or("no stage")?.x[1] = f64::NAN;
    let result = factors.adjoint(&seed);
    assert!(matches!(result, Err(OcpError::InvalidValue { stage: 2, index: 1, .. })));
    ocp.shared("u")?;
    let mut gains = Sensitivities::new(&ocp)?;
    assert!(matches!(ocp.gains(&mut gains), Err(OcpError::Coupled)));
    let mut ipm = HeapIpm::new(&ocp)?;
    for mu in [-1.0, 0.2, f64::NAN] {
        ipm.options.final_mu = mu;
        let result = ipm.solve(&mut ocp);
        assert!(matches!(result, Err(OcpError::InvalidOption { name: "final_mu", .. })), "{mu}");
    }
    Ok(())
}
