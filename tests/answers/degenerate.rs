//! Small problems that are degenerate on purpose, with solutions that pen and paper give.

use crate::Test;
use casados::ocp::{
    Constraint, ConstraintName, Formulation, GeneralCost, HeapIpm, HeapOcp, Horizon, Map, Outcome, Part,
    Problem, SecondOrder, Status,
};
use casados::prelude::*;
use casados::qp::Side;

const NONE: f64 = f64::INFINITY;

type Result<T> = core::result::Result<T, Box<dyn std::error::Error>>;

/// Solves, and shows the log where something is not as it has to be. Where no multipliers exist
/// residuals may stay above the tolerance: such problems are solved and do not converge.
fn solve_and_check<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
    ocp: &mut HeapOcp<P>,
    check: impl Fn(&HeapOcp<P>, &Outcome) -> bool,
) -> Result<Outcome> {
    let mut ipm = HeapIpm::new(ocp)?;
    let outcome = ipm.solve(ocp)?;
    let point: Vec<_> = (0..=ocp.intervals()).filter_map(|k| ocp.stage(k).ok().map(|s| (s.x, s.u))).collect();
    if check(ocp, &outcome) { Ok(outcome) } else { Err(format!("{}{outcome}\n{point:?}", ipm.log()).into()) }
}

/// The controls of the first stage.
fn first_controls<P: Formulation<f64>>(ocp: &HeapOcp<P>) -> Vec<f64> {
    ocp.stage(0).map_or(vec![], |stage| stage.u.to_vec())
}

fn assert_near(values: &[f64], expected: &[f64], tolerance: f64) -> bool {
    values.len() == expected.len() && values.iter().zip(expected).all(|(a, b)| (a - b).abs() <= tolerance)
}

/// Neither state nor time: what there is are controls. The state adds up `u[0]`.
#[function]
fn sum(x: [f64; 1], u: [f64; 2]) -> [f64; 1] {
    [x[0] + u[0]]
}

/// A problem with a cost and constraints of two controls, on one interval.
macro_rules! problem {
    ($cost:ty) => {
        Problem::new(Map::<Sum, f64>::new()).stage_cost(GeneralCost::<$cost>::new())
    };
    ($cost:ty, $constraint:ty, $lower:expr, $upper:expr) => {
        problem!($cost).path_constraints(Constraint::<$constraint>::new($lower, $upper))
    };
}

/// On one interval from zero on, from a guess of the controls.
macro_rules! on_one {
    ($problem:expr, $guess:expr) => {{
        let mut ocp = $problem.on(Horizon::uniform(1, 1.0))?;
        ocp.fix_initial_state(&[0.0])?.guess(&[0.0], &$guess)?;
        ocp
    }};
}

#[function]
fn energy(_x: [f64; 1], u: [f64; 2]) -> f64 {
    u[0] * u[0] + u[1] * u[1]
}
#[function]
fn from_one(_x: [f64; 1], u: [f64; 2]) -> f64 {
    (u[0] - 1.0) * (u[0] - 1.0) + (u[1] - 1.0) * (u[1] - 1.0)
}
#[function]
fn from_two(_x: [f64; 1], u: [f64; 2]) -> f64 {
    (u[0] - 2.0) * (u[0] - 2.0) + u[1] * u[1]
}
#[function]
fn first(_x: [f64; 1], u: [f64; 2]) -> f64 {
    u[0]
}
#[function]
fn concave(_x: [f64; 1], u: [f64; 2]) -> f64 {
    -u[0] * u[0] + u[1] * u[1]
}
#[function]
fn double_well(_x: [f64; 1], u: [f64; 2]) -> f64 {
    u[0] * u[0] - u[1] * u[1] + u[1].powi(4)
}
#[function]
fn one_control(_x: [f64; 1], u: [f64; 2]) -> f64 {
    (u[0] - 1.0) * (u[0] - 1.0)
}

#[function]
fn twice_the_end(x: [f64; 1], _u: [f64; 2]) -> [f64; 2] {
    [x[0], 2.0 * x[0]]
}

/// Linearly dependent equations at the end: half of the way in each of two steps.
#[test]
fn d01_dependent_terminal_equations() -> Test {
    let problem =
        problem!(Energy).terminal_constraints(Constraint::<TwiceTheEnd>::new([1.0, 2.0], [1.0, 2.0]));
    let mut ocp = problem.on(Horizon::uniform(2, 1.0))?;
    ocp.fix_initial_state(&[0.0])?.guess(&[0.3], &[0.0, 0.4])?;
    solve_and_check(&mut ocp, |ocp, outcome| {
        outcome.is_solved() && assert_near(&first_controls(ocp), &[0.5, 0.0], 1e-6)
    })?;
    Ok(())
}

#[function]
fn plane_twice(_x: [f64; 1], u: [f64; 2]) -> [f64; 2] {
    [u[0] + u[1], 3.0 * u[0] + 3.0 * u[1]]
}

/// Linearly dependent equations along the way.
#[test]
fn d02_dependent_path_equations() -> Test {
    let mut ocp = on_one!(problem!(Energy, PlaneTwice, [1.0, 3.0], [1.0, 3.0]), [0.9, -0.4]);
    solve_and_check(&mut ocp, |ocp, outcome| {
        outcome.is_solved() && assert_near(&first_controls(ocp), &[0.5, 0.5], 1e-6)
    })?;
    Ok(())
}

#[function]
fn square(_x: [f64; 1], u: [f64; 2]) -> f64 {
    u[0] * u[0]
}

/// `u² ≤ 0`: one feasible point, no multiplier. A violation of 1e-8 is 1e-4 of `u`.
#[test]
fn d03_inequality_without_interior() -> Test {
    let mut ocp = on_one!(problem!(FromOne, Square, [-NONE], [0.0]), [0.5, 0.0]);
    solve_and_check(&mut ocp, |ocp, _| assert_near(&first_controls(ocp), &[0.0, 1.0], 1e-3))?;
    Ok(())
}

/// `u² = 0`: its gradient vanishes at the solution.
#[test]
fn d04_equation_with_a_gradient_that_vanishes() -> Test {
    let mut ocp = on_one!(problem!(FromOne, Square, [0.0], [0.0]), [0.5, 0.0]);
    solve_and_check(&mut ocp, |ocp, _| assert_near(&first_controls(ocp), &[0.0, 1.0], 1e-3))?;
    Ok(())
}

#[function]
fn product(_x: [f64; 1], u: [f64; 2]) -> f64 {
    u[0] * u[1]
}

/// Complementarity, `0 ≤ u₀ ⊥ u₁ ≥ 0`: no feasible point is regular. Solutions are (1, 0) and
/// (0, 1); a product of 1e-8 and more is what tolerances leave.
#[test]
fn d05_complementarity_constraints() -> Test {
    let mut ocp = on_one!(problem!(FromOne, Product, [-NONE], [0.0]), [0.8, 0.3]);
    ocp.bound("u", .., 0.0, NONE)?;
    solve_and_check(&mut ocp, |ocp, outcome| {
        outcome.is_solved()
            && (assert_near(&first_controls(ocp), &[1.0, 0.0], 1e-3)
                || assert_near(&first_controls(ocp), &[0.0, 1.0], 1e-3))
    })?;
    Ok(())
}

#[function]
fn cusp(_x: [f64; 1], u: [f64; 2]) -> f64 {
    (1.0 - u[0]).powi(3) - u[1]
}

/// Problem 13 of Hock and Schittkowski: the conditions of optimality do not hold at the solution
/// (1, 0), which a cube makes hard to tell: 1e-8 of the constraint is 2e-3 of `u₀`.
#[test]
fn d06_hock_schittkowski_13() -> Test {
    let mut ocp = on_one!(problem!(FromTwo, Cusp, [0.0], [NONE]), [-2.0, -2.0]);
    ocp.bound("u", .., 0.0, NONE)?;
    solve_and_check(&mut ocp, |ocp, _| assert_near(&first_controls(ocp), &[1.0, 0.0], 2e-2))?;
    Ok(())
}

#[function]
fn two_sides(_x: [f64; 1], u: [f64; 2]) -> [f64; 2] {
    [u[0] * u[0], u[0]]
}

/// A. Wächter, L. T. Biegler, Math. Program. 88 (2000): from −2 steps to the linearised constraints
/// never leave the wrong side. At −1 the sum of violations has a minimum of its own: to end there
/// is right, to call it a solution is not.
#[test]
fn d07_waechter_biegler() -> Test {
    let mut ocp = on_one!(problem!(First, TwoSides, [1.0, 0.5], [NONE, NONE]), [-2.0, 0.0]);
    ocp.bound("u[1]", .., 0.0, 0.0)?;
    let (part, side) = (Part::PathBounds, Side::Lower);
    let expected =
        ConstraintName { part, stage: 0, name: "TwoSides", output: 1, point: 0, side, phase: None };
    solve_and_check(&mut ocp, |ocp, outcome| {
        let solved = outcome.is_solved() && assert_near(&first_controls(ocp), &[1.0, 0.0], 1e-6);
        solved
            || (is_infeasible(outcome, expected, 1.5)
                && assert_near(&first_controls(ocp), &[-1.0, 0.0], 1e-4))
    })?;
    Ok(())
}

/// A concave cost between two bounds: the nearer end, downhill.
#[test]
fn d08_concave_cost() -> Test {
    let mut ocp = on_one!(problem!(Concave), [0.3, 1.0]);
    ocp.bound("u[0]", .., -1.0, 2.0)?;
    solve_and_check(&mut ocp, |ocp, outcome| {
        outcome.is_solved() && assert_near(&first_controls(ocp), &[2.0, 0.0], 1e-6)
    })?;
    Ok(())
}

/// An indefinite Hessian at the start: a well beside the saddle.
#[test]
fn d09_indefinite_hessian() -> Test {
    let mut ocp = on_one!(problem!(DoubleWell), [1.0, 0.1]);
    let depth = core::f64::consts::FRAC_1_SQRT_2;
    solve_and_check(&mut ocp, |ocp, outcome| {
        outcome.is_solved() && assert_near(&first_controls(ocp), &[0.0, depth], 1e-6)
    })?;
    Ok(())
}

/// A saddle of which constraints leave the direction upwards only.
#[test]
fn d10_indefinite_but_for_constraints() -> Test {
    let mut ocp = on_one!(problem!(Concave, First, [0.5], [0.5]), [0.1, 0.9]);
    solve_and_check(&mut ocp, |ocp, outcome| {
        outcome.is_solved() && assert_near(&first_controls(ocp), &[0.5, 0.0], 1e-6)
    })?;
    Ok(())
}

/// Whether a run says that a constraint cannot be satisfied, which, and by how much.
fn is_infeasible(outcome: &Outcome, expected: ConstraintName, distance: f64) -> bool {
    matches!(outcome.status, Status::Infeasible { constraint, violation }
        if constraint == expected && (violation - distance).abs() < 1e-4)
}

/// A state out of reach: missed by two.
#[test]
fn d11_state_out_of_reach() -> Test {
    let mut ocp = on_one!(problem!(Energy), [0.0, 0.0]);
    ocp.bound("u[0]", .., -1.0, 1.0)?.bound("x[0]", 1.., 3.0, 4.0)?;
    let (part, side) = (Part::StateBounds, Side::Lower);
    let expected = ConstraintName { part, stage: 1, name: "x[0]", output: 0, point: 0, side, phase: None };
    solve_and_check(&mut ocp, |_, outcome| is_infeasible(outcome, expected, 2.0))?;
    Ok(())
}

#[function]
fn both(_x: [f64; 1], u: [f64; 2]) -> [f64; 2] {
    [u[0], u[0]]
}

/// Two equations that contradict each other: their violations add up to one.
#[test]
fn d12_contradictory_equations() -> Test {
    let mut ocp = on_one!(problem!(Energy, Both, [0.0, 1.0], [0.0, 1.0]), [0.3, 0.0]);
    solve_and_check(&mut ocp, |_, outcome| {
        matches!(outcome.status, Status::Infeasible { constraint, violation }
            if constraint.part == Part::PathBounds && violation > 0.49 && violation < 1.01)
    })?;
    Ok(())
}

/// `u² ≤ −1`: missed by one, at zero.
#[test]
fn d13_no_real_solution() -> Test {
    let mut ocp = on_one!(problem!(FromOne, Square, [-NONE], [-1.0]), [0.5, 0.0]);
    let (part, side) = (Part::PathBounds, Side::Upper);
    let expected = ConstraintName { part, stage: 0, name: "Square", output: 0, point: 0, side, phase: None };
    solve_and_check(&mut ocp, |_, outcome| is_infeasible(outcome, expected, 1.0))?;
    Ok(())
}

/// A linear cost without bounds.
#[test]
fn d14_unbounded_linear() -> Test {
    let mut ocp = on_one!(problem!(First), [0.0, 0.0]);
    solve_and_check(&mut ocp, |_, outcome| outcome.status == Status::Unbounded)?;
    Ok(())
}

/// A concave cost with one bound, on the other side.
#[test]
fn d15_unbounded_concave() -> Test {
    let mut ocp = on_one!(problem!(Concave), [0.3, 0.1]);
    ocp.bound("u[0]", .., 0.0, NONE)?;
    solve_and_check(&mut ocp, |_, outcome| outcome.status == Status::Unbounded)?;
    Ok(())
}

/// A control that equal bounds fix.
#[test]
fn d16_fixed_control() -> Test {
    let mut ocp = on_one!(problem!(FromOne), [0.0, 0.0]);
    ocp.bound("u[0]", .., 0.7, 0.7)?;
    solve_and_check(&mut ocp, |ocp, outcome| {
        outcome.is_solved() && assert_near(&first_controls(ocp), &[0.7, 1.0], 1e-7)
    })?;
    Ok(())
}

/// Nothing is free.
#[test]
fn d17_everything_fixed() -> Test {
    let mut ocp = on_one!(problem!(FromOne), [0.0, 0.0]);
    ocp.bound("u[0]", .., 0.7, 0.7)?.bound("u[1]", .., -0.2, -0.2)?;
    solve_and_check(&mut ocp, |ocp, outcome| {
        outcome.is_solved()
            && assert_near(&first_controls(ocp), &[0.7, -0.2], 1e-7)
            && assert_near(ocp.stage(1).unwrap().x, &[0.7], 1e-7)
    })?;
    Ok(())
}

/// A control that costs nothing and does nothing.
#[test]
fn d18_singular_hessian() -> Test {
    let mut ocp = on_one!(problem!(OneControl), [0.0, 0.3]);
    solve_and_check(&mut ocp, |ocp, outcome| {
        outcome.is_solved() && assert_near(&first_controls(ocp)[..1], &[1.0], 1e-6)
    })?;
    Ok(())
}

/// A bound at the minimum itself: active without a force. `s λ = μ = 1e-9` is 2e-5 of either.
#[test]
fn d19_weakly_active_bound() -> Test {
    let mut ocp = on_one!(problem!(FromOne), [0.0, 0.0]);
    ocp.bound("u", .., -5.0, 1.0)?;
    solve_and_check(&mut ocp, |ocp, outcome| {
        outcome.is_solved() && assert_near(&first_controls(ocp), &[1.0, 1.0], 1e-4)
    })?;
    Ok(())
}

/// The same bound three times.
#[test]
fn d20_redundant_bounds() -> Test {
    let mut ocp = on_one!(problem!(FromTwo, Both, [-NONE, -NONE], [1.0, 1.0]), [0.0, 0.5]);
    ocp.bound("u[0]", .., -NONE, 1.0)?;
    solve_and_check(&mut ocp, |ocp, outcome| {
        outcome.is_solved() && assert_near(&first_controls(ocp), &[1.0, 0.0], 1e-6)
    })?;
    Ok(())
}

/// `u ≤ 1` and `u ≥ 1` as two inequalities: nothing is inside.
#[test]
fn d21_no_interior() -> Test {
    let mut ocp = on_one!(problem!(Energy, Both, [-NONE, 1.0], [1.0, NONE]), [0.0, 0.5]);
    solve_and_check(&mut ocp, |ocp, outcome| {
        outcome.is_solved() && assert_near(&first_controls(ocp), &[1.0, 0.0], 1e-6)
    })?;
    Ok(())
}

#[function]
fn keeps_one(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [x[0], 0.5 * x[1] + u[0]]
}
#[function]
fn around(x: [f64; 2], u: [f64; 1]) -> f64 {
    (x[0] - 1.0) * (x[0] - 1.0) + (x[1] - 2.0) * (x[1] - 2.0) + u[0] * u[0]
}

/// A state that never changes is periodic by itself. Of the other, `x = ½ x + u` all along: least
/// is `(x − 2)² + ¼ x²` at 1.6.
#[test]
fn d22_redundant_periodicity() -> Test {
    let problem = Problem::new(Map::<KeepsOne, f64>::new()).stage_cost(GeneralCost::<Around>::new());
    let mut ocp = problem.on(Horizon::uniform(6, 1.0))?;
    ocp.free_initial_state().periodic("x")?.guess(&[0.0, 0.3], &[0.1])?;
    solve_and_check(&mut ocp, |ocp, outcome| {
        let stages = || (0..=6).filter_map(|k| ocp.stage(k).ok());
        outcome.is_solved() && stages().all(|stage| assert_near(stage.x, &[1.0, 1.6], 1e-6))
    })?;
    Ok(())
}

/// Periodicity of a state that is given at both ends.
#[test]
fn d23_periodicity_of_given_states() -> Test {
    let problem = Problem::new(Map::<KeepsOne, f64>::new()).stage_cost(GeneralCost::<Around>::new());
    let mut ocp = problem.on(Horizon::uniform(1, 1.0))?;
    ocp.fix_initial_state(&[1.0, 1.0])?.bound("x[1]", 1.., 1.0, 1.0)?.periodic("x")?;
    ocp.guess(&[0.0, 0.3], &[0.1])?;
    solve_and_check(&mut ocp, |ocp, outcome| {
        outcome.is_solved() && assert_near(&first_controls(ocp), &[0.5], 1e-6)
    })?;
    Ok(())
}

/// A shared control with the same bound at every stage: the same side six times. Least is
/// `Σ (u − 2)²` at the bound.
#[test]
fn d24_shared_control_with_bounds_everywhere() -> Test {
    let mut ocp = problem!(FromTwo).on(Horizon::uniform(6, 1.0))?;
    ocp.fix_initial_state(&[0.0])?
        .shared("u[0]")?
        .bound("u[0]", .., -1.0, 1.5)?
        .guess(&[0.0], &[0.1, 0.3])?;
    solve_and_check(&mut ocp, |ocp, outcome| {
        outcome.is_solved() && assert_near(&first_controls(ocp), &[1.5, 0.0], 1e-6)
    })?;
    Ok(())
}
