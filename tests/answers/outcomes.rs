//! What outcomes say beyond their status: whether a solution is a local one, and which bound a run
//! without a solution violates most.

use crate::Test;
use casados::ocp::{
    Constraint, GeneralCost, HeapIpm, HeapOcp, HeapSqp, Horizon, LeastSquaresCost, Map, Outcome, Part,
    Problem, Status,
};
use casados::prelude::*;
use casados::qp::Side;

#[function]
fn add(x: f64, u: f64) -> f64 {
    x + 0.1 * u
}
#[function]
fn both(x: f64, u: f64) -> [f64; 2] {
    [x, u]
}
#[function]
fn square(x: f64, u: f64) -> f64 {
    x * x + u * u
}
#[function]
fn product(x: f64, u: f64) -> f64 {
    x * u
}
#[function]
fn sum(x: f64, u: f64) -> f64 {
    x + u
}

macro_rules! outcomes {
    ($make:expr) => {{
        let (mut first, mut second) = ($make, $make);
        first.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
        second.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
        [HeapSqp::new(&first)?.solve(&mut first)?, HeapIpm::new(&second)?.solve(&mut second)?]
    }};
}

fn assert_convexity(outcomes: [Outcome; 2], is_convex: bool) {
    for outcome in outcomes {
        assert!(outcome.is_converged() && outcome.is_convex == is_convex, "{outcome:?}");
        let local = outcome.to_string().starts_with("converged to a local solution after");
        assert!(local != is_convex, "{outcome}");
    }
}

/// Linear dynamics and constraints with squares of linear outputs are convex; any other dynamics,
/// constraint or cost is not known to be.
#[test]
fn solutions_are_local_unless_the_problem_is_convex() -> Test {
    let map = || Problem::new(Map::<Add, f64>::new());
    let squares = || LeastSquaresCost::<Both>::diagonal(&[1.0; 2]);
    let horizon = || Horizon::uniform(4, 0.1);
    let linear = || Constraint::<Sum>::new([-3.0], [3.0]);
    assert_convexity(outcomes!(map().stage_cost(squares()).on(horizon())?), true);
    assert_convexity(outcomes!(map().stage_cost(squares()).path_constraints(linear()).on(horizon())?), true);
    // The same cost, of which nobody sees that it is convex.
    assert_convexity(outcomes!(map().stage_cost(GeneralCost::<Square>::new()).on(horizon())?), false);
    let curved = || Constraint::<Product>::new([-3.0], [3.0]);
    assert_convexity(outcomes!(map().stage_cost(squares()).path_constraints(curved()).on(horizon())?), false);
    Ok(())
}

#[ode]
fn cart(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u]
}
#[ode]
fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u - x[0].sin()]
}
#[function]
fn deviation(x: [f64; 2], u: f64) -> [f64; 3] {
    [x[0], x[1], u]
}

#[test]
fn linearity_of_models() -> Test {
    macro_rules! solved {
        ($model:ty) => {{
            let mut ocp = Problem::new(Irk::<$model, Gauss<2>>::new(Options::default())?)
                .running_cost(LeastSquaresCost::<Deviation>::diagonal(&[1.0; 3]))
                .on(Horizon::uniform(5, 0.1))?;
            ocp.fix_initial_state(&[1.0, 0.0])?.guess(&[1.0, 0.0], &[0.0])?;
            HeapIpm::new(&ocp)?.solve(&mut ocp)?
        }};
    }
    assert!(solved!(Cart).is_convex && !solved!(Pendulum).is_convex);
    Ok(())
}

#[dae]
fn tank(xdot: f64, x: f64, z: f64, u: f64) -> [f64; 2] {
    [xdot - u + z, z - 0.1 * x * x]
}
#[function]
fn outflow(_x: f64, z: f64, _u: f64) -> f64 {
    z
}
#[function]
fn inflow(_x: f64, _z: f64, u: f64) -> f64 {
    0.5 * u * u
}

/// The bound that is violated most, by the trajectory of the iterate: its code is another one.
fn assert_named_constraint<P: casados::ocp::Formulation<f64>>(
    ocp: &mut HeapOcp<P>,
    outcome: &Outcome,
) -> Test {
    let (constraint, violation) = outcome.violated.ok_or("no bound is named")?;
    let solution = ocp.solution()?;
    let largest = solution.violations(0.0);
    let largest = largest.first().ok_or("no bound is violated")?;
    assert!(
        (largest.name, largest.stage, largest.side) == (constraint.name, constraint.stage, constraint.side)
    );
    assert!((largest.amount - violation).abs() <= 1e-12 * violation, "{violation}, {largest}");
    let text = outcome.to_string();
    assert!(text.contains(&format!("; largest violation: {violation:.2e} of {constraint}")), "{text}");
    Ok(())
}

/// Walls on both sides that exclude each other, and runs that end before they can say so.
#[test]
fn names_of_contradictory_constraints() -> Test {
    for iterations in [0, 1] {
        let mut ocp = Problem::new(Map::<Add, f64>::new())
            .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
            .on(Horizon::uniform(10, 0.1))?;
        ocp.fix_initial_state(&[0.0])?.bound("u", .., -1.0, 1.0)?;
        ocp.bound("x", 2..4, 3.0, 9.0)?.bound("x", 5..8, -9.0, -2.0)?.guess(&[0.0], &[0.0])?;
        let mut sqp = HeapSqp::new(&ocp)?;
        sqp.options.max_iterations = iterations;
        let outcome = sqp.solve(&mut ocp)?;
        assert_eq!(outcome.status, Status::MaxIterations, "{outcome}");
        assert_named_constraint(&mut ocp, &outcome)?;
    }
    // Constraints of algebraic states, which are those of the iterate.
    let mut ocp = Problem::new(Irk::<Tank, RadauIIA<2>>::new(Options::default())?)
        .running_cost(GeneralCost::<Inflow>::new())
        .path_constraints(Constraint::<Outflow>::new([5.0], [9.0]))
        .on(Horizon::uniform(5, 0.1))?;
    ocp.fix_initial_state(&[1.0])?.bound("u", .., -1.0, 1.0)?.guess(&[1.0], &[0.0])?;
    let mut sqp = HeapSqp::new(&ocp)?;
    sqp.options.max_iterations = 0;
    let outcome = sqp.solve(&mut ocp)?;
    let (constraint, violation) = outcome.violated.ok_or("no bound is named")?;
    assert_eq!(
        (constraint.part, constraint.name, constraint.side),
        (Part::PathBounds, "Outflow", Side::Lower)
    );
    // At the guess the outflow is 0.1; at nodes it is that of the polynomial through the stages.
    assert!((violation - 4.9).abs() < 1e-4, "{violation}: {outcome}");
    assert_named_constraint(&mut ocp, &outcome)
}

/// Soft bounds may be violated, and a status that names a constraint needs no other one.
#[test]
fn statuses_without_a_constraint() -> Test {
    let make = || -> Result<_, Box<dyn std::error::Error>> {
        let mut ocp = Problem::new(Map::<Add, f64>::new())
            .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
            .on(Horizon::uniform(5, 0.1))?;
        ocp.fix_initial_state(&[0.0])?.bound("u", .., -1.0, 1.0)?.bound("x", 5.., 3.0, 9.0)?;
        ocp.guess(&[0.0], &[0.0])?;
        Ok(ocp)
    };
    let mut soft = make()?;
    soft.soften("x", 5.., 1.0, 0.0)?;
    let mut sqp = HeapSqp::new(&soft)?;
    sqp.options.max_iterations = 0;
    assert_eq!(sqp.solve(&mut soft)?.violated, None);
    let mut hard = make()?;
    let outcome = HeapSqp::new(&hard)?.solve(&mut hard)?;
    assert!(matches!(outcome.status, Status::Infeasible { .. }) && outcome.violated.is_none(), "{outcome}");
    Ok(())
}
