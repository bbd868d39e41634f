//! Verdicts at degenerate starts, on contradictory bounds, and on bounded problems far from one.

use crate::Test;
use casados::ocp::{
    Constraint, GeneralCost, HeapIpm, HeapOcp, HeapSqp, Horizon, LeastSquaresCost, Map, Outcome, Part,
    Problem, Status,
};
use casados::prelude::*;
use casados::qp::Side;

#[function]
fn walk(x: [f64; 2], u: [f64; 2]) -> [f64; 2] {
    [x[0] + 0.1 * u[0], x[1] + 0.1 * u[1]]
}

#[function]
fn direction(_x: [f64; 2], u: [f64; 2]) -> f64 {
    u[0] * u[0] + u[1] * u[1]
}

#[function]
fn distance(x: [f64; 2], _u: [f64; 2]) -> f64 {
    x[0] * x[0] + x[1] * x[1]
}

/// Tilted: of directions of length one the best is `(−0.6, −0.8)`.
#[function]
fn tilted(_x: [f64; 2], u: [f64; 2]) -> f64 {
    0.6 * u[0] + 0.8 * u[1]
}

#[function]
fn effort(_x: [f64; 2], u: [f64; 2]) -> f64 {
    u[0] * u[0] + u[1] * u[1]
}

macro_rules! solve {
    ($ocp:expr) => {{
        let mut first = $ocp;
        let mut sqp = HeapSqp::new(&first)?;
        let by_sqp = sqp.solve(&mut first)?;
        let mut second = $ocp;
        let mut ipm = HeapIpm::new(&second)?;
        let by_ipm = ipm.solve(&mut second)?;
        println!("{}{by_sqp}\n{}{by_ipm}", sqp.log(), ipm.log());
        assert!(sqp.log().0.first().is_some() && ipm.log().0.first().is_some());
        let perturbed = [sqp.log(), ipm.log()].map(|log| log.0.iter().any(|row| row.perturbed));
        [(by_sqp, perturbed[0]), (by_ipm, perturbed[1])]
    }};
}

/// At `u = 0` the gradient of `u₁² + u₂² = 1` vanishes: the start is beside it. Each control of the
/// solution is `(−0.6, −0.8)`, and the objective minus one for each of them.
#[test]
fn unit_directions_from_zero() -> Test {
    for n in [1_usize, 4, 25] {
        let make = || -> Result<_, Box<dyn std::error::Error>> {
            let mut ocp = Problem::new(Map::<Walk, f64>::new())
                .stage_cost(GeneralCost::<Tilted>::new())
                .path_constraints(Constraint::<Direction>::new([1.0], [1.0]))
                .on(Horizon::uniform(n, 0.1))?;
            ocp.fix_initial_state(&[0.0, 0.0])?.guess(&[0.0; 2], &[0.0; 2])?;
            Ok(ocp)
        };
        for (outcome, perturbed) in solve!(make()?) {
            assert!(perturbed && outcome.is_converged(), "{n}: {outcome}");
            assert!((outcome.objective + n as f64).abs() < 1e-5 * n as f64, "{n}: {outcome}");
        }
    }
    Ok(())
}

/// The end is at least one away from where every state of the guess is: its gradient vanishes
/// there. The least effort is that of a straight line, `n (10 / n)²`.
#[test]
fn degenerate_initial_guess() -> Test {
    for n in [2_usize, 10] {
        let make = || -> Result<_, Box<dyn std::error::Error>> {
            let mut ocp = Problem::new(Map::<Walk, f64>::new())
                .stage_cost(GeneralCost::<Effort>::new())
                .terminal_constraints(Constraint::<Distance>::new([1.0], [f64::INFINITY]))
                .on(Horizon::uniform(n, 0.1))?;
            ocp.fix_initial_state(&[0.0, 0.0])?.guess(&[0.0; 2], &[0.0; 2])?;
            Ok(ocp)
        };
        for (outcome, perturbed) in solve!(make()?) {
            let expected = 100.0 / n as f64;
            assert!(perturbed && outcome.is_converged(), "{n}: {outcome}");
            assert!((outcome.objective - expected).abs() < 1e-4 * expected, "{n}: {outcome}");
        }
    }
    Ok(())
}

/// A guess where all gradients are numbers is where a run begins.
#[test]
fn regular_initial_guesses() -> Test {
    let make = || -> Result<_, Box<dyn std::error::Error>> {
        let mut ocp = Problem::new(Map::<Walk, f64>::new())
            .stage_cost(GeneralCost::<Tilted>::new())
            .path_constraints(Constraint::<Direction>::new([1.0], [1.0]))
            .on(Horizon::uniform(3, 0.1))?;
        ocp.fix_initial_state(&[0.0, 0.0])?.guess(&[0.0; 2], &[0.1, -0.3])?;
        Ok(ocp)
    };
    assert!(solve!(make()?).iter().all(|(_, perturbed)| !perturbed));
    Ok(())
}

#[function]
fn add(x: f64, u: f64) -> f64 {
    x + u
}

#[function]
fn squares(x: f64, u: f64) -> f64 {
    0.5 * (x * x + u * u)
}

#[function]
fn size(x: f64, u: f64) -> [f64; 2] {
    [x, u]
}

/// A shared control of at most `a` at the first stages and of at least `b` later.
fn shared(n: usize, a: f64, b: f64) -> Result<[Outcome; 2], Box<dyn std::error::Error>> {
    let make = || -> Result<_, Box<dyn std::error::Error>> {
        let mut ocp = Problem::new(Map::<Add, f64>::new())
            .stage_cost(GeneralCost::<Squares>::new())
            .on(Horizon::uniform(n, 1.0))?;
        ocp.fix_initial_state(&[0.3])?.shared("u")?;
        ocp.bound("u", ..2, -10.0, a)?.bound("u", 2.., b, 10.0)?.guess(&[0.0], &[0.0])?;
        Ok(ocp)
    };
    Ok(solve!(make()?).map(|(outcome, _)| outcome))
}

#[test]
fn contradictory_bounds_of_a_shared_control() -> Test {
    for n in [3, 12] {
        for outcome in shared(n, 0.0, 0.5)? {
            let Status::Infeasible { constraint, violation } = outcome.status else {
                return Err(outcome.to_string().into());
            };
            assert_eq!((constraint.part, constraint.side), (Part::ControlBounds, Side::Lower), "{outcome}");
            assert_eq!((constraint.stage, violation), (2, 0.5), "{outcome}");
        }
        // They have one number in common.
        for outcome in shared(n, 0.5, 0.5)? {
            assert!(outcome.is_converged(), "{outcome}");
        }
    }
    Ok(())
}

type Sum<C> = HeapOcp<Problem<Map<Add, f64>, C>, f64>;

/// `x₀ = 0`, `u ≥ c`: all controls are `c`, and the objective is `½ c² Σ (k² + 1)`, `17.5 c²` over
/// five stages.
#[test]
fn bounded_problems_with_large_solutions() -> Test {
    fn bounded<C>(mut ocp: Sum<C>, lower: f64, upper: f64) -> Result<Sum<C>, Box<dyn std::error::Error>>
    where
        Problem<Map<Add, f64>, C>: casados::ocp::Formulation<f64>,
    {
        ocp.fix_initial_state(&[0.0])?.bound("u", .., lower, upper)?.guess(&[0.0], &[0.0])?;
        Ok(ocp)
    }
    for (c, upper) in [(1e4, f64::INFINITY), (1e8, f64::INFINITY), (1e12, 2e12), (1e12, 1e300)] {
        let horizon = || Horizon::uniform(5, 1.0);
        let plain = Problem::new(Map::<Add, f64>::new()).stage_cost(GeneralCost::<Squares>::new());
        let least =
            Problem::new(Map::<Add, f64>::new()).stage_cost(LeastSquaresCost::<Size>::diagonal(&[1.0, 1.0]));
        let mut ocp = bounded(plain.clone().on(horizon())?, c, upper)?;
        let outcomes = [HeapIpm::new(&ocp)?.solve(&mut ocp)?, {
            let mut ocp = bounded(least.on(horizon())?, c, upper)?;
            HeapIpm::new(&ocp)?.solve(&mut ocp)?
        }];
        for outcome in outcomes {
            assert!(outcome.is_converged(), "{c:e}: {outcome}");
            assert!((outcome.objective / (17.5 * c * c) - 1.0).abs() < 1e-6, "{c:e}: {outcome}");
        }
        // States have no bounds and a guess of zero: their unit is that of the control.
        let mut ocp = bounded(plain.on(horizon())?, c, upper)?;
        let outcome = HeapSqp::new(&ocp)?.solve(&mut ocp)?;
        let objective = outcome.objective / (17.5 * c * c);
        assert!(outcome.is_converged() && (objective - 1.0).abs() < 1e-6, "{c:e}: {outcome}");
    }
    Ok(())
}

/// QPs that are found infeasible have iterations, too.
#[test]
fn iterations_of_infeasible_qps() -> Test {
    let mut ocp = Problem::new(Map::<Add, f64>::new())
        .stage_cost(GeneralCost::<Squares>::new())
        .on(Horizon::uniform(3, 1.0))?;
    ocp.fix_initial_state(&[0.0])?.bound("u", .., -1.0, 1.0)?.bound("x", 3.., 5.0, 6.0)?;
    ocp.guess(&[0.0], &[0.0])?;
    let mut sqp = HeapSqp::new(&ocp)?;
    sqp.options.elastic = false;
    let outcome = sqp.solve(&mut ocp)?;
    assert!(matches!(outcome.status, Status::InfeasibleQp { .. }), "{outcome}");
    assert!(outcome.qp_iterations > 0, "{outcome}");
    Ok(())
}

/// From rest over one metre in one interval of a second: `u = 2`. The second control does nothing.
#[ode]
fn pushed(x: [f64; 2], u: [f64; 2]) -> [f64; 2] {
    [x[1], u[0]]
}
#[function]
fn first_squared(_x: [f64; 2], u: [f64; 2]) -> f64 {
    u[0] * u[0]
}

/// The equations determine the solution: one step for variables, one for multipliers.
#[test]
fn one_interval_and_a_control_without_effect() -> Test {
    let mut ocp = Problem::new(Erk::<Pushed, Rk4>::new(Options::default())?)
        .running_cost(GeneralCost::<FirstSquared>::new())
        .on(Horizon::uniform(1, 1.0))?;
    ocp.fix_initial_state(&[0.0; 2])?.guess(&[0.0; 2], &[0.0; 2])?.bound("x[0]", 1.., 1.0, 1.0)?;
    let outcome = HeapIpm::new(&ocp)?.solve(&mut ocp)?;
    assert!(outcome.is_converged(), "{outcome}");
    assert!((ocp.stage(0)?.u[0] - 2.0).abs() < 1e-9, "{outcome}");
    // ∫ u₀² dt with u₀ = 2; an error of 1e-9 of u₀ changes it by 4e-9.
    assert!((outcome.objective - 4.0).abs() < 1e-8, "{outcome}");
    Ok(())
}

/// Bounded controls cannot reach the terminal bound. Residuals contain violations of the given
/// bounds, also if penalties replace these.
#[test]
fn violations_of_an_infeasible_problem_are_in_its_residuals() -> Test {
    let problem = Problem::new(Map::<Add, f64>::new()).stage_cost(GeneralCost::<Squares>::new());
    let mut ocp = problem.on(Horizon::uniform(3, 1.0))?;
    ocp.fix_initial_state(&[0.0])?.bound("u", .., -0.5, 0.5)?.bound("x", 3.., 2.0, 3.0)?;
    ocp.guess(&[0.0], &[0.0])?;
    let outcome = HeapIpm::new(&ocp)?.solve(&mut ocp)?;
    let Status::Infeasible { violation, .. } = outcome.status else { return Err(outcome.to_string().into()) };
    let distance = 2.0 - ocp.stage(3)?.x[0];
    assert!((violation - 0.5).abs() < 1e-3 && distance <= outcome.residuals.inequalities, "{outcome}");
    Ok(())
}
