//! Problems on which steps of the merit function are short again and again, and one whose QPs
//! have to be accurate at first.

use super::ocps::line;
use super::units::fix;
use super::{Test, solve};
use casados::ocp::{
    Constraint, Exact, Formulation, GeneralCost, HeapIpm, HeapOcp, Horizon, Problem, SecondOrder,
    WithIntegral,
};
use casados::prelude::*;
use casados::qp::residuals;
use casados::{Erk, Rk4};

/// The conditions of optimality, element by element, by code that is not the solver's.
fn is_optimal<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(ocp: &mut HeapOcp<P>) -> Test {
    ocp.linearise(Exact::default())?;
    let (judged, _) = residuals(ocp.qp(), ocp.iterate());
    assert!(judged.largest() <= 1e-6, "{judged}");
    Ok(())
}

/// A rider in the Alps. J. T. Betts, "Practical methods for optimal control and estimation using
/// nonlinear programming", 2010, section 4.11.7.
#[ode]
fn alp(x: [f64; 4], u: [f64; 2]) -> [f64; 4] {
    [
        -10.0 * x[0] + u[0] + u[1],
        -2.0 * x[1] + u[0] + 2.0 * u[1],
        -3.0 * x[2] + 5.0 * x[3] + u[0] - u[1],
        5.0 * x[2] - 3.0 * x[3] + u[0] + 3.0 * u[1],
    ]
}

#[function]
fn tires(x: [f64; 4], u: [f64; 2]) -> f64 {
    100.0 * (x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3]) + 0.01 * (u[0] * u[0] + u[1] * u[1])
}

#[function]
fn above_terrain(x: [f64; 4], _u: [f64; 2], t: f64) -> f64 {
    let peak = |middle: f64, steepness: f64| (-steepness * (t - middle) * (t - middle)).exp();
    x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3]
        - 3.0 * peak(3.0, 12.0)
        - 3.0 * peak(6.0, 10.0)
        - 3.0 * peak(10.0, 6.0)
        - 8.0 * peak(15.0, 4.0)
        - 0.01
}

/// A straight line from the start to the end, without forces.
macro_rules! ride {
    () => {{
        let n = 100;
        let erk = Erk::<Alp, Rk4>::new(Options { steps: 2, ..Options::default() })?;
        let mut ocp = Problem::new(erk)
            .running_cost(GeneralCost::<Tires>::new())
            .path_constraints(Constraint::<AboveTerrain>::new([0.0], [f64::INFINITY]))
            .on(Horizon::uniform(n, 20.0 / n as f64))?;
        let (start, end) = ([2.0, 1.0, 2.0, 1.0], [2.0, 3.0, 1.0, -2.0]);
        ocp.fix_initial_state(&start)?;
        fix(&mut ocp, n, &[(0, 2.0), (1, 3.0), (2, 1.0), (3, -2.0)])?;
        line(&mut ocp, &start, &end, &[0.0, 0.0])?;
        ocp
    }};
}

/// The merit function follows the bend of the terrain in pairs of a short step and a damped one.
/// IPOPT (CasADi 3.8.2, the same discretisation and guess) takes 149 iterations to 2651.8576.
#[test]
fn curved_terrain() -> Test {
    let mut ocp = ride!();
    let (outcome, _) = solve(&mut ocp)?;
    assert!(outcome.is_converged() && outcome.iterations <= 149, "{outcome}");
    assert!((outcome.objective - 2651.8576).abs() <= 1e-6 * 2651.8576, "{outcome}");
    is_optimal(&mut ocp)
}

/// Without damping steps are 1e-4 for hundreds of iterations.
#[test]
fn terrain_by_interior_point() -> Test {
    let mut ocp = ride!();
    let outcome = HeapIpm::new(&ocp)?.solve(&mut ocp)?;
    assert!(outcome.is_converged(), "{outcome}");
    assert!((outcome.objective - 2651.8576).abs() <= 1e-6 * 2651.8576, "{outcome}");
    is_optimal(&mut ocp)
}

/// Cells of the immune system and viruses per cubic millimetre over fifty days; two treatments.
/// H. R. Joshi, "Optimal control of an HIV immunology model", Optimal Control Applications and
/// Methods 23 (2002).
#[ode]
fn immunity(x: [f64; 2], u: [f64; 2]) -> [f64; 2] {
    let [cells, viruses] = x;
    [
        2.0 - 1.5 * viruses / (14.0 + viruses) - 0.002 * cells - 2.5e-4 * viruses * cells + u[0] * cells,
        30.0 * (1.0 - u[1]) * viruses / (1.0 + viruses) - 0.007 * viruses * cells,
    ]
}

#[function]
fn illness(x: [f64; 2], u: [f64; 2]) -> f64 {
    2.5e5 * u[0] * u[0] + 75.0 * u[1] * u[1] - x[0]
}

/// Multipliers are zero at first, and the largest residual is the gradient of a cost in large
/// units: QPs that were solved to a part of that ended in QPs that were not solved. IPOPT (as
/// above) takes 38 iterations to -29513.830; it relaxes bounds by 1e-8 of their size.
#[test]
fn gradients_in_large_units() -> Test {
    let n = 50;
    let erk = Erk::<Immunity, Rk4>::new(Options { steps: 2, ..Options::default() })?;
    let mut ocp =
        Problem::new(WithIntegral::new(erk, Quadrature::<Illness>::new())).on(Horizon::uniform(n, 1.0))?;
    ocp.fix_initial_state(&[400.0, 3.0])?.bound("u[0]", .., 0.0, 0.02)?.bound("u[1]", .., 0.0, 0.9)?;
    ocp.bound("x", .., 0.0, f64::INFINITY)?.guess(&[400.0, 3.0], &[0.0, 0.0])?;
    let (outcome, _) = solve(&mut ocp)?;
    assert!(outcome.is_converged() && outcome.iterations <= 57, "{outcome}");
    assert!((outcome.objective + 29513.830).abs() <= 1e-6 * 29513.830, "{outcome}");
    Ok(())
}
