//! The same problem in other units of the cost, of states and of a constraint is the same problem.

use crate::Test;
use casados::ocp::{
    Barrier, Constraint, Convexification, Exact, Formulation, GeneralCost, Globalisation, HeapIpm, HeapOcp,
    HeapSqp, Horizon, OcpError, Outcome, Problem, SecondOrder, Status,
};
use casados::prelude::*;
use casados::qp::residuals;

/// What the cost, states and the constraint are multiplied by.
#[derive(Clone, Copy, Debug)]
struct Units {
    cost: f64,
    states: f64,
    row: f64,
}

const UNSCALED: Units = Units { cost: 1.0, states: 1.0, row: 1.0 };

/// Each alone and all together; and a cost of 1e8 with masses in milligrams.
fn others() -> impl Iterator<Item = Units> {
    let costs = [1e-6, 1.0, 1e6].into_iter();
    let pairs = costs.flat_map(|cost| [1e-3, 1.0, 1e3].map(|states| (cost, states)));
    pairs
        .flat_map(|(cost, states)| [1e-4, 1.0, 1e4].map(|row| Units { cost, states, row }))
        .chain([Units { cost: 1e8, states: 1e6, row: 1.0 }, Units { cost: 1e-8, states: 1e-6, row: 1.0 }])
}

/// A boat that is pushed, with quadratic drag; p = [cost, states, row].
#[ode]
fn boat(x: [f64; 2], u: f64, p: [f64; 3]) -> [f64; 2] {
    let speed = x[1] / p[1];
    [x[1], p[1] * (u - 0.3 * speed * (speed * speed + 1e-2).sqrt())]
}

/// Effort, and how far it is from where it should be.
#[function]
fn price(x: [f64; 2], u: f64, p: [f64; 3]) -> f64 {
    p[0] * (0.5 * u * u + (x[0] / p[1] - 0.8).powi(2))
}

/// The power of the engine.
#[function]
fn power(x: [f64; 2], u: f64, p: [f64; 3]) -> f64 {
    p[2] * (x[1] / p[1] * u)
}

const N: usize = 30;

/// From rest to rest in 1.5 s, with at most a power of 1.2 and a speed of 1.02.
fn transfer_problem(
    units: Units,
    length: f64,
) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Box<dyn std::error::Error>> {
    let Units { cost, states, row } = units;
    let problem = Problem::new(Erk::<Boat, Rk4>::new(Options::default())?)
        .running_cost(GeneralCost::<Price>::new())
        .path_constraints(Constraint::<Power>::new([f64::NEG_INFINITY], [1.2 * row]));
    let mut ocp = problem.on(Horizon::uniform(N, 0.05))?;
    ocp.set_parameters(.., &[cost, states, row])?.fix_initial_state(&[0.0, 0.0])?;
    ocp.bound("x[0]", N.., length * states, length * states)?.bound("x[1]", N.., 0.0, 0.0)?;
    ocp.bound("u", .., -3.0, 3.0)?.bound("x[1]", 1..N, -states, 1.02 * states)?;
    ocp.guess(&[0.0, 0.0], &[0.0])?;
    Ok(ocp)
}

/// Writes a solution, in the units of the plain problem, as the iterate of the plain one.
fn write_unscaled<P: Formulation<f64>, Q: Formulation<f64>>(
    from: &HeapOcp<P>,
    units: Units,
    plain: &mut HeapOcp<Q>,
) -> Test {
    let Units { cost, states, row } = units;
    for (k, stage) in from.iterate().stages().enumerate() {
        let to = plain.iterate_mut().stage_mut(k).ok_or("no stage")?;
        // Multipliers are derivatives of the cost.
        for (to, from, factor) in [
            (to.x, stage.x, 1.0 / states),
            (to.u, stage.u, 1.0),
            (to.dynamics, stage.dynamics, states / cost),
            (to.x_lower, stage.x_lower, states / cost),
            (to.x_upper, stage.x_upper, states / cost),
            (to.u_lower, stage.u_lower, 1.0 / cost),
            (to.u_upper, stage.u_upper, 1.0 / cost),
            (to.g_lower, stage.g_lower, row / cost),
            (to.g_upper, stage.g_upper, row / cost),
        ] {
            to.iter_mut().zip(from).for_each(|(to, from)| *to = factor * from);
        }
    }
    Ok(())
}

/// What solves the problem, with default options but these.
#[derive(Clone, Copy, Debug)]
enum Solver {
    Ipm(Barrier),
    Sqp(Globalisation),
}

impl Solver {
    /// How a run ends, and its log.
    fn solve<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
        self,
        ocp: &mut HeapOcp<P>,
    ) -> Result<(Outcome, String), OcpError> {
        match self {
            Self::Ipm(barrier) => {
                let mut ipm = HeapIpm::new(ocp)?;
                ipm.options.barrier = barrier;
                Ok((ipm.solve(ocp)?, ipm.log().to_string()))
            }
            Self::Sqp(globalisation) => {
                let mut sqp = HeapSqp::new(ocp)?;
                sqp.options.globalisation = globalisation;
                Ok((sqp.solve(ocp)?, sqp.log().to_string()))
            }
        }
    }

    /// The default.
    fn tolerance(self) -> f64 {
        match self {
            Self::Ipm(_) => 1e-8,
            Self::Sqp(_) => 1e-6,
        }
    }
}

/// In no more than half as many iterations again as in plain units. The conditions of optimality of
/// the plain problem hold at each solution, judged element by element by code that is not the
/// solver's.
#[test]
fn iterations_in_other_units() -> Test {
    for solver in [
        Solver::Ipm(Barrier::Adaptive),
        Solver::Ipm(Barrier::Monotone),
        Solver::Sqp(Globalisation::Merit),
        Solver::Sqp(Globalisation::Filter),
    ] {
        let solve = |units| -> Result<_, Box<dyn std::error::Error>> {
            let mut ocp = transfer_problem(units, 1.0)?;
            let (outcome, log) = solver.solve(&mut ocp)?;
            assert!(outcome.is_converged(), "{solver:?} {units:?}: {outcome}\n{log}");
            Ok((ocp, outcome))
        };
        let (_, first) = solve(UNSCALED)?;
        for units in others() {
            let (ocp, outcome) = solve(units)?;
            println!("{solver:?} {units:?}: {outcome}");
            // Gaps of a state of 1e6 are to be 1e-14 of it, which takes some more.
            let most = if units.states > 1e3 { 2.0 } else { 1.5 };
            assert!(outcome.iterations as f64 <= most * first.iterations as f64, "{outcome} {first}");
            let mut plain = transfer_problem(UNSCALED, 1.0)?;
            write_unscaled(&ocp, units, &mut plain)?;
            plain.linearise(Exact { convexification: Convexification::None })?;
            let (judged, _) = residuals(plain.qp(), plain.iterate());
            // Residuals are relative to units, which are at most the sizes that the problem names:
            // 1.2 of the power, 1 of the rest.
            let tolerance = 1.2 * solver.tolerance();
            assert!(judged.largest() <= tolerance, "{units:?} {judged}");
            // Both objectives are off by residuals times multipliers: of 300 conditions, none of
            // whose multipliers is above 10.
            let most = 2.0 * tolerance * 300.0 * 10.0;
            let objective = outcome.objective / units.cost;
            assert!((objective - first.objective).abs() <= most, "{objective}");
        }
    }
    Ok(())
}

/// What a run says of itself is in the units of the problem.
#[test]
fn residuals_in_other_units() -> Test {
    let cases = [Units { cost: 1e6, states: 1e3, row: 1e4 }, Units { cost: 1e-6, states: 1e-3, row: 1e-4 }];
    let solvers = [Solver::Ipm(Barrier::Adaptive), Solver::Sqp(Globalisation::Merit)];
    for (units, solver) in cases.into_iter().flat_map(|units| solvers.map(|solver| (units, solver))) {
        let mut ocp = transfer_problem(units, 1.0)?;
        let (outcome, _) = solver.solve(&mut ocp)?;
        let (judged, _) = residuals(ocp.qp(), ocp.iterate());
        // Sums in another order: roundings of terms as large as these.
        let largest = |of: &dyn Fn(&casados::qp::SolutionStage<'_, f64>) -> f64| {
            ocp.iterate().stages().fold(1.0, |m: f64, stage| m.max(of(&stage)))
        };
        let forces = largest(&|s| s.dynamics.iter().chain(s.g_upper).fold(0.0, |m: f64, y| m.max(y.abs())));
        let values = largest(&|s| s.x.iter().fold(0.0, |m: f64, x| m.max(x.abs())));
        let near = |a: f64, b: f64, terms: f64| (a - b).abs() <= 1e-14 * terms * units.row.max(1.0);
        let found = outcome.residuals;
        assert!(near(found.stationarity, judged.stationarity, forces), "{found} {judged}");
        assert!(near(found.dynamics, judged.dynamics, values), "{found} {judged}");
        assert!(near(found.complementarity, judged.complementarity, forces), "{found} {judged}");
    }
    Ok(())
}

/// A way that is too long is missed by as much in all units.
#[test]
fn violations_in_other_units() -> Test {
    let missed = |solver: Solver, units: Units| -> Result<f64, Box<dyn std::error::Error>> {
        let mut ocp = transfer_problem(units, 2.0)?;
        let (outcome, log) = solver.solve(&mut ocp)?;
        match outcome.status {
            Status::Infeasible { constraint, violation } if constraint.name == "x[0]" => {
                Ok(violation / units.states)
            }
            status => Err(format!("{solver:?} {units:?} {status}\n{log}").into()),
        }
    };
    for solver in [Solver::Ipm(Barrier::Adaptive), Solver::Sqp(Globalisation::Merit)] {
        // At a speed of 1.02 it gets no farther than 1.53.
        let first = missed(solver, UNSCALED)?;
        assert!((2.0 - 1.53..2.0).contains(&first), "{first}");
        for units in others().filter(|units| units.row == 1.0) {
            let other = missed(solver, units)?;
            println!("{solver:?} {units:?} {other}");
            assert!((other - first).abs() <= 1e-3 * first, "{units:?} {other} {first}");
        }
    }
    Ok(())
}

/// Without units the plain problem has the same solution.
#[test]
fn scaling_switched_off() -> Test {
    let mut objectives = [[0.0; 2]; 2];
    for (objectives, scaling) in objectives.iter_mut().zip([true, false]) {
        let mut ocp = transfer_problem(UNSCALED, 1.0)?;
        let mut ipm = HeapIpm::new(&ocp)?;
        ipm.options.scaling = scaling;
        let by_ipm = ipm.solve(&mut ocp)?;
        let mut ocp = transfer_problem(UNSCALED, 1.0)?;
        let mut sqp = HeapSqp::new(&ocp)?;
        sqp.options.scaling = scaling;
        let by_sqp = sqp.solve(&mut ocp)?;
        assert!(by_ipm.is_converged() && by_sqp.is_converged(), "{by_ipm} {by_sqp}");
        *objectives = [by_ipm.objective, by_sqp.objective];
    }
    let [with, without] = objectives;
    assert!((with[0] - without[0]).abs() <= 2.0 * 1e-8 * 300.0 * 10.0, "{objectives:?}");
    // All units of the plain problem are one.
    assert_eq!(with[1], without[1]);
    Ok(())
}
