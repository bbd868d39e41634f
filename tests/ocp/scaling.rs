//! The same problem in other units: of the cost, of states, and of a constraint.

use crate::Test;
use casados::ocp::{
    Barrier, Constraint, Convexification, Exact, Formulation, GeneralCost, HeapIpm, HeapOcp, HeapSqp, Horizon,
    Outcome, Problem, SecondOrder,
};
use casados::prelude::*;
use casados::qp::residuals;

/// What cost, states and the constraint are multiplied by.
#[derive(Clone, Copy, Debug)]
struct Units {
    cost: f64,
    states: f64,
    row: f64,
}

const PLAIN: Units = Units { cost: 1.0, states: 1.0, row: 1.0 };

/// All of them: the plain ones, and those that differ in one, two or three.
fn all() -> impl Iterator<Item = Units> {
    [1e-6, 1.0, 1e6].into_iter().flat_map(|cost| {
        [1e-3, 1.0, 1e3]
            .into_iter()
            .flat_map(move |states| [1e-4, 1.0, 1e4].map(|row| Units { cost, states, row }))
    })
}

/// A boat that is pushed, with quadratic drag; p = [cost, states, row].
#[ode]
fn boat(x: [f64; 2], u: f64, p: [f64; 3]) -> [f64; 2] {
    let speed = x[1] / p[1];
    [x[1], p[1] * (u - 0.3 * speed * (speed * speed + 1e-2).sqrt())]
}

/// Effort, and how far it is from where it is to be.
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

/// From rest to rest at 1 in 1.5 s, with at most so much power.
fn boat_in(units: Units) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Box<dyn std::error::Error>> {
    let Units { cost, states, row } = units;
    let problem = Problem::new(Erk::<Boat, Rk4>::new(Options::default())?)
        .running_cost(GeneralCost::<Price>::new())
        .path_constraints(Constraint::<Power>::new([f64::NEG_INFINITY], [1.2 * row]));
    let mut ocp = problem.on(Horizon::uniform(N, 0.05))?;
    ocp.set_parameters(.., &[cost, states, row])?.fix_initial_state(&[0.0, 0.0])?;
    ocp.bound("x[0]", N.., states, states)?.bound("x[1]", N.., 0.0, 0.0)?;
    ocp.bound("u", .., -3.0, 3.0)?.bound("x[1]", 1..N, -states, 1.02 * states)?;
    ocp.guess(&[0.0, 0.0], &[0.0])?;
    Ok(ocp)
}

#[test]
fn probe() -> Test {
    for barrier in [Barrier::Adaptive, Barrier::Monotone] {
        for units in all() {
            let mut ocp = boat_in(units)?;
            let mut ipm = HeapIpm::new(&ocp)?;
            ipm.options.barrier = barrier;
            let outcome = ipm.solve(&mut ocp)?;
            println!("{barrier:?} {units:?}: {:.14} {} {:.9}", outcome.status.to_string(), outcome.iterations, outcome.objective / units.cost);
        }
    }
    for units in all() {
        let mut ocp = boat_in(units)?;
        let mut ipm = HeapSqp::new(&ocp)?;
        let outcome = ipm.solve(&mut ocp)?;
        println!("Sqp {units:?}: {:.14} {} {:.9}", outcome.status.to_string(), outcome.iterations, outcome.objective / units.cost);
    }
    Ok(())
}
