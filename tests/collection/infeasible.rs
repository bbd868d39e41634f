//! Problems without a solution beside ones that barely have one: both solvers say which is which,
//! and of the first kind what is violated by how much.

use super::ocps::line;
use super::units::fix;
use casados::ocp::{
    Constraint, Formulation, GeneralCost, HeapIpm, HeapOcp, HeapSqp, Horizon, Outcome, Problem, SecondOrder,
    Status,
};
use casados::prelude::*;
use casados::{Erk, Rk4};

type Test<T = ()> = Result<T, Box<dyn std::error::Error>>;

/// The outcomes of both solvers, with what each leaves.
fn outcomes_of_both_solvers<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
    make: impl Fn() -> Test<HeapOcp<P>>,
) -> Test<[(Outcome, HeapOcp<P>); 2]> {
    let (mut one, mut other) = (make()?, make()?);
    let mut sqp = HeapSqp::new(&one)?;
    let by_sqp = sqp.solve(&mut one)?;
    println!("{}{by_sqp}", sqp.log());
    let mut ipm = HeapIpm::new(&other)?;
    let by_ipm = ipm.solve(&mut other)?;
    println!("{}{by_ipm}", ipm.log());
    Ok([(by_sqp, one), (by_ipm, other)])
}

/// The name of what is violated, its stage, and by how much.
fn violated_constraint(outcome: &Outcome) -> Test<(&'static str, usize, f64)> {
    let Status::Infeasible { constraint, violation } = outcome.status else {
        return Err(outcome.to_string().into());
    };
    Ok((constraint.name, constraint.stage, violation))
}

/// A car that brakes: metres, metres per second; the part of 3 m/s² that it brakes with.
#[ode]
fn braking(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [x[1], -3.0 * u[0] - 0.0002 * x[1] * x[1]]
}

#[function]
fn effort(_x: [f64; 2], u: [f64; 1]) -> f64 {
    u[0] * u[0]
}

fn braking_problem(wall: f64) -> Test<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>> {
    let n = 40;
    let mut ocp = Problem::new(Erk::<Braking, Rk4>::new(Options::default())?)
        .stage_cost(GeneralCost::<Effort>::new())
        .on(Horizon::uniform(n, 0.2))?;
    ocp.fix_initial_state(&[0.0, 20.0])?.bound("u", .., 0.0, 1.0)?;
    ocp.bound("x[0]", 1.., f64::NEG_INFINITY, wall)?;
    fix(&mut ocp, n, &[(1, 0.0)])?;
    line(&mut ocp, &[0.0, 20.0], &[60.0, 0.0], &[0.0])?;
    Ok(ocp)
}

/// From `v` the way is `ln(1 + k v² / a) / 2k = 65.79 m`: a wall after 60 m is hit at many stages.
#[test]
fn stopping_distance() -> Test {
    let way = (1.0 + 0.0002 * 400.0 / 3.0_f64).ln() / 0.0004;
    let mut ocp = braking_problem(60.0)?;
    let outcome = HeapIpm::new(&ocp)?.solve(&mut ocp)?;
    let (name, stage, violation) = violated_constraint(&outcome)?;
    assert!(outcome.iterations <= 60 && name == "x[0]", "{outcome}");
    // What is said is what the iterate does.
    assert!((violation - (ocp.stage(stage)?.x[0] - 60.0)).abs() < 1e-9, "{outcome}");
    // The sum of violations has its minimum there; it is said where a hundredth is left of it,
    // spread over eight stages.
    assert!((violation - (way - 60.0)).abs() < 0.05, "{violation} {way}");
    for (outcome, _) in outcomes_of_both_solvers(|| braking_problem(66.0))? {
        assert!(outcome.is_converged(), "{outcome}");
    }
    Ok(())
}

/// The level of a tank into which `4 sin²(0.3 t)` flows, and time.
#[ode]
fn tank(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    let s = (0.3 * x[1]).sin();
    [4.0 * s * s - u[0] * x[0].sqrt(), 1.0]
}

fn tank_problem(valve: f64) -> Test<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>> {
    let mut ocp = Problem::new(Erk::<Tank, Rk4>::new(Options::default())?)
        .stage_cost(GeneralCost::<Effort>::new())
        .on(Horizon::uniform(60, 0.2))?;
    ocp.fix_initial_state(&[5.0, 0.0])?.bound("u", .., 0.0, valve)?.bound("x[0]", 1.., 1.0, 8.0)?;
    line(&mut ocp, &[5.0, 0.0], &[5.0, 12.0], &[0.3])?;
    Ok(ocp)
}

/// QPs with large penalties are too hard there, and violations stay all the same. Until `t = 8`
/// there flow in `2 t − sin(0.6 t) / 0.3 = 19.3`; out flow no more than `4 √(8 + v)`, where `v` is
/// the largest violation: `5 + 19.3 − 4 √(8 + v) ≤ 8 + v`, so that `v > 3`.
#[test]
fn overflowing_tank() -> Test {
    for (outcome, ocp) in outcomes_of_both_solvers(|| tank_problem(0.5))? {
        let (name, stage, violation) = violated_constraint(&outcome)?;
        assert!(outcome.iterations <= 50 && name == "x[0]" && violation > 3.0, "{outcome}");
        assert!((violation - (ocp.stage(stage)?.x[0] - 8.0)).abs() < 1e-9, "{outcome}");
    }
    for (outcome, _) in outcomes_of_both_solvers(|| tank_problem(1.1))? {
        assert!(outcome.is_converged(), "{outcome}");
    }
    Ok(())
}

#[ode]
fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [x[1], u[0]]
}

/// Below one metre until stage `below`, above two from stage `above` on.
fn contradictory_bounds(
    below: usize,
    above: usize,
) -> Test<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>> {
    #[function]
    fn sides(x: [f64; 2], _u: [f64; 1]) -> [f64; 2] {
        [x[0], x[0]]
    }
    let n = 40;
    let mut ocp = Problem::new(Erk::<Cart, Rk4>::new(Options::default())?)
        .stage_cost(GeneralCost::<Effort>::new())
        .path_constraints(Constraint::<Sides>::new([f64::NEG_INFINITY; 2], [f64::INFINITY; 2]))
        .on(Horizon::uniform(n, 0.1))?;
    ocp.fix_initial_state(&[0.0, 0.0])?.bound("u", .., -20.0, 20.0)?;
    for k in 0..n {
        let lower = [f64::NEG_INFINITY, if k >= above { 2.0 } else { f64::NEG_INFINITY }];
        let upper = [if k <= below { 1.0 } else { f64::INFINITY }, f64::INFINITY];
        ocp.set_path_bounds(k..=k, &lower, &upper)?;
    }
    line(&mut ocp, &[0.0, 0.0], &[3.0, 0.0], &[0.0])?;
    Ok(ocp)
}

/// Both at once cannot be, whatever the QP with large penalties makes of that: one of them is
/// violated by half of a metre at least.
#[test]
fn contradictory_constraints() -> Test {
    for (outcome, _) in outcomes_of_both_solvers(|| contradictory_bounds(20, 15))? {
        let (name, stage, violation) = violated_constraint(&outcome)?;
        assert!(outcome.iterations <= 50 && name == "Sides", "{outcome}");
        assert!((15..=20).contains(&stage) && violation >= 0.5 - 1e-9, "{outcome}");
    }
    // With 20 m/s² a metre from 1 to 2 takes less than the seven stages between.
    for (outcome, _) in outcomes_of_both_solvers(|| contradictory_bounds(15, 22))? {
        assert!(outcome.is_converged(), "{outcome}");
    }
    Ok(())
}

/// A car at 10 m/s that turns by 10 times `u` rad per second at most, over `τ ∈ [0, 1]`; the last
/// state is the time that everything takes.
#[ode]
fn dubins(x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    let (s, c) = x[2].sin_cos();
    [10.0 * x[3] * c, 10.0 * x[3] * s, x[3] * u[0], 0.0]
}

#[function]
fn time(x: [f64; 4], _u: [f64; 1]) -> f64 {
    x[3]
}

#[function]
fn ellipse(x: [f64; 4], _u: [f64; 1]) -> f64 {
    let (a, b) = ((x[0] - 100.0) / 20.0, x[1] / 300.0);
    a * a + b * b
}

/// To a place 200 m away, within 25 s, around an ellipse of 300 m on either side of the way.
fn walled_problem() -> Test<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>> {
    let n = 60;
    let mut ocp = Problem::new(Erk::<Dubins, Rk4>::new(Options::default())?)
        .terminal_cost(GeneralCost::<Time>::new())
        .path_constraints(Constraint::<Ellipse>::new([1.0], [f64::INFINITY]))
        .on(Horizon::uniform(n, 1.0 / n as f64))?;
    ocp.free_initial_state();
    ocp.bound("x[3]", .., 1.0, 25.0)?.bound("x[1]", .., -100.0, 100.0)?.bound("u", .., -1.0, 1.0)?;
    fix(&mut ocp, 0, &[(0, 0.0), (1, 0.0), (2, 0.0)])?;
    fix(&mut ocp, n, &[(0, 200.0), (1, 0.0), (2, 0.0)])?;
    line(&mut ocp, &[0.0, 0.0, 0.0, 20.0], &[200.0, 0.0, 0.0, 20.0], &[0.0])?;
    Ok(ocp)
}

/// A wall that is wider than the corridor: each of them names what it leaves, the wall or the end
/// behind it.
#[test]
fn walled_corridor() -> Test {
    for (outcome, _) in outcomes_of_both_solvers(walled_problem)? {
        let (name, stage, _) = violated_constraint(&outcome)?;
        assert!(name == "Ellipse" || (name, stage) == ("x[0]", 60), "{outcome}");
    }
    Ok(())
}
