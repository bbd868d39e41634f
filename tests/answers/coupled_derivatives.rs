//! Derivatives of solutions with a free initial state, periodic states and shared controls: against
//! closed forms, and central differences of problems that are solved again.

use crate::Test;
use crate::solution_derivatives::{By, EXACT, TOLERANCE, check_by_differences, solved};
use casados::ocp::{
    Constraint, Formulation, GeneralCost, HeapOcp, HeapSqp, Horizon, LeastSquaresCost, Map, Problem,
    SecondOrder, Sensitivities, SolutionFactors,
};
use casados::prelude::*;
use casados::qp::{HeapSolution, SolutionStage};

#[function]
fn relax(x: [f64; 1], u: [f64; 1], p: [f64; 1]) -> [f64; 1] {
    [p[0] * x[0] + u[0]]
}
#[function]
fn control(_x: [f64; 1], u: [f64; 1], _p: [f64; 1]) -> [f64; 1] {
    [u[0] - 1.0]
}

/// What a constant control holds: `x = p x + 1`, so that `dx/dp = 1/(1 − p)²`.
#[test]
fn derivatives_of_a_steady_state() -> Test {
    const P: f64 = 0.5;
    let mut ocp = Problem::new(Map::<Relax, f64>::new())
        .stage_cost(LeastSquaresCost::<Control>::diagonal(&[1.0]))
        .on(Horizon::uniform(5, 1.0))?;
    ocp.free_initial_state().periodic("x")?.guess(&[0.0], &[0.0])?.set_parameters(.., &[P])?;
    assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
    let mut result = Sensitivities::new(&ocp)?;
    ocp.differentiate(EXACT, &mut result)?;
    for k in 0..=5 {
        // Some ten roundings, and the compliance of the solver, of numbers of four.
        assert!((result.dx_dp(k)[0] - 4.0).abs() < 1e-7, "{k} {:?}", result.dx_dp(k));
        assert_eq!(result.dx(k), [0.0]);
    }
    assert!(result.factors().value_gradient_x0().is_empty());
    // Whatever `p` is, the control costs nothing.
    assert!(result.factors().value_gradient_p()[0].abs() < 1e-7);
    Ok(())
}

#[function]
fn climb(x: [f64; 1], u: [f64; 1], _p: [f64; 1]) -> [f64; 1] {
    [x[0] + u[0]]
}
#[function]
fn height(x: [f64; 1], _u: [f64; 1], p: [f64; 1]) -> [f64; 1] {
    [x[0] - p[0] * p[0]]
}

/// A line through data `p²`, `4`, …: where it begins is the first state, its slope the control of
/// all stages. Every coefficient of the regression is linear in the first number.
#[test]
fn derivatives_of_a_fitted_line() -> Test {
    const P: f64 = 1.3;
    let mut ocp = Problem::new(Map::<Climb, f64>::new())
        .stage_cost(LeastSquaresCost::<Height>::diagonal(&[1.0]))
        .on(Horizon::uniform(4, 1.0))?;
    ocp.free_initial_state().shared("u")?.guess(&[0.0], &[0.0])?;
    for (k, p) in [P, 2.0, -1.0, 2.5].into_iter().enumerate() {
        ocp.set_parameters(k..=k, &[p])?;
    }
    ocp.set_parameters(4..=4, &[0.0])?;
    assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
    let mut factors = SolutionFactors::new(&ocp)?;
    ocp.factorise(EXACT, &mut factors)?;
    // Regression over k = 0, …, 3: intercept Σ (0.7 − 0.3 k) y_k, slope Σ (0.2 k − 0.3) y_k, where
    // y_k = p_k² and all p change together.
    let by_p = |weight: &dyn Fn(f64) -> f64| -> f64 {
        [P, 2.0, -1.0, 2.5].iter().enumerate().map(|(k, p)| weight(k as f64) * 2.0 * p).sum()
    };
    let mut seed = HeapSolution::new(ocp.qp().dims())?;
    seed.stage_mut(0).ok_or("a stage")?.x[0] = 1.0;
    let intercept = factors.adjoint(&seed)?.p[0];
    assert!((intercept - by_p(&|k| 0.7 - 0.3 * k)).abs() < 1e-9, "{intercept}");
    seed.stage_mut(0).ok_or("a stage")?.x[0] = 0.0;
    // Of a shared control the seeds of all stages count.
    for k in 0..4 {
        seed.stage_mut(k).ok_or("a stage")?.u[0] = 0.25;
    }
    let slope = factors.adjoint(&seed)?.p[0];
    assert!((slope - by_p(&|k| 0.2 * k - 0.3)).abs() < 1e-9, "{slope}");
    Ok(())
}

/// A pendulum that is driven in two ways.
#[ode]
fn driven(x: [f64; 2], u: [f64; 2], p: [f64; 2], t: f64) -> [f64; 2] {
    [
        x[1] + 0.1 * u[1] * x[0],
        -p[0] * x[0].sin() - 0.3 * x[1] + u[0] * x[0].cos() + p[1] * (2.0 * t).sin() + u[1],
    ]
}
#[function]
fn swing(x: [f64; 2], u: [f64; 2], p: [f64; 2]) -> [f64; 4] {
    [x[0] - 0.4 * p[0], 0.6 * x[1] + 0.2 * x[0] * x[0], 0.5 * u[0] - 0.1 * x[0], u[1] - 0.2 * p[1]]
}
#[function]
fn end(x: [f64; 2], _u: [f64; 2], p: [f64; 2]) -> f64 {
    0.5 * x[1] * x[1] + p[1] * x[0].cos()
}
#[function]
fn speed(x: [f64; 2], u: [f64; 2], p: [f64; 2]) -> f64 {
    x[1] + 0.1 * p[0] * u[1] * x[0]
}

const INTERVALS: usize = 12;

/// What is coupled.
#[derive(Clone, Copy)]
struct Coupling {
    periodic: &'static [&'static str],
    shared: &'static [&'static str],
    fixed: bool,
}

/// `at` is `(x₀, p)`, or `p` where the initial state is free.
fn problem(
    case: Coupling,
    at: &[f64],
) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Box<dyn std::error::Error>> {
    let mut ocp = Problem::new(Irk::<Driven, Gauss<2>>::new(Options::default())?)
        .running_cost(LeastSquaresCost::<Swing>::diagonal(&[6.0, 3.0, 2.0, 1.5]))
        .terminal_cost(GeneralCost::<End>::new())
        .path_constraints(Constraint::<Speed>::new([f64::NEG_INFINITY], [0.28]))
        .on(Horizon::uniform(INTERVALS, 0.25))?;
    let (x0, p) = at.split_at(at.len() - 2);
    if case.fixed {
        ocp.fix_initial_state(x0)?;
    } else {
        ocp.free_initial_state();
    }
    case.periodic.iter().try_for_each(|name| ocp.periodic(name).map(|_| ()))?;
    case.shared.iter().try_for_each(|name| ocp.shared(name).map(|_| ()))?;
    ocp.bound("u[0]", .., -0.5, 0.6)?.guess(&[0.2, 0.1], &[0.0, 0.1])?.set_parameters(.., p)?;
    Ok(ocp)
}

/// With active bounds of controls, and an active constraint of the path where the initial state is
/// given.
#[test]
fn differences_of_coupled_solutions() -> Test {
    const CASES: [Coupling; 6] = [
        Coupling { periodic: &[], shared: &[], fixed: false },
        Coupling { periodic: &[], shared: &["u[1]"], fixed: true },
        Coupling { periodic: &[], shared: &["u[1]"], fixed: false },
        Coupling { periodic: &["x"], shared: &["u[1]"], fixed: false },
        Coupling { periodic: &["x[1]"], shared: &["u"], fixed: false },
        Coupling { periodic: &["x[0]"], shared: &["u[1]"], fixed: true },
    ];
    for case in CASES {
        let at: &[f64] = if case.fixed { &[-0.3, 0.2, 1.3, 0.8] } else { &[1.3, 0.8] };
        let mut ocp = problem(case, at)?;
        assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
        let active = |f: &dyn Fn(&SolutionStage<'_, f64>) -> bool| {
            ocp.iterate().stages().filter(|stage| f(stage)).count()
        };
        assert_eq!(active(&|s| s.g_upper.iter().any(|&m| m > 1e-3)) > 0, case.fixed);
        let all_are_shared = case.shared == ["u"];
        assert!(all_are_shared || active(&|s| s.u_upper.iter().any(|&m| m > 1e-3)) > 0);
        check_by_differences(at, By::Sqp, |at| solved(problem(case, at)?, By::Sqp), TOLERANCE)?;
        check_by_differences(
            at,
            By::Barrier(1e-2),
            |at| solved(problem(case, at)?, By::Barrier(1e-2)),
            TOLERANCE,
        )?;
    }
    Ok(())
}
