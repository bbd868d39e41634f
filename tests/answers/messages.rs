//! What a newcomer is told: each message has what is wrong, where by name, the values, and the way
//! out.

use crate::Test;
use casados::ocp::{Formulation, HeapOcp, HeapSqp, Horizon, LeastSquaresCost, OcpError, Problem, Status};
use casados::prelude::*;
use nalgebra::{Vector1, vector};
use std::fmt::Display;

#[ode]
fn cart(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u]
}
#[ode]
fn outflow(x: f64) -> f64 {
    -x.sqrt()
}
#[function]
fn deviation(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[0], u]
}

fn problem(weights: [f64; 2], horizon: Horizon<'_, f64>) -> Result<HeapOcp<impl Formulation<f64>>, OcpError> {
    let irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
    Problem::new(irk).stage_cost(LeastSquaresCost::<Deviation>::diagonal(&weights)).on(horizon)
}

/// The text of an error.
fn message<V, E: Display>(result: Result<V, E>) -> String {
    result.err().map(|error| error.to_string()).unwrap_or_default()
}

#[test]
fn messages_about_horizons_and_weights() {
    let horizon = |n, h| message(problem([1.0; 2], Horizon::uniform(n, h)));
    assert_eq!(
        horizon(0, 0.1),
        "the horizon has no interval: `Horizon::uniform` takes one at least, `Horizon::nodes` two times"
    );
    assert_eq!(horizon(3, 0.0), "interval 0 goes from 0 to 0: times of nodes must be finite and increasing");
    for (weight, shown) in [(-2.0, "-2"), (f64::NAN, "NaN")] {
        assert_eq!(
            message(problem([1.0, weight], Horizon::uniform(3, 0.1))),
            format!("the weight of output 1 of `Deviation` is {shown}: it must be finite and at least 0")
        );
    }
}

#[test]
fn messages_about_values_by_name() -> Test {
    let mut ocp = problem([1.0; 2], Horizon::uniform(3, 0.1))?;
    assert_eq!(
        message(ocp.bound("speed", .., 0.0, 1.0)),
        "`Cart` has no variable `speed` of this kind. States: `x[0]`, `x[1]`; controls: `u`"
    );
    assert_eq!(
        message(ocp.bound("u", .., f64::NAN, 1.0)),
        "stage 0: a bound of `u` is NaN: it must be a number, -inf for no lower bound, or inf for no upper bound"
    );
    assert_eq!(
        message(ocp.bound("x[1]", 1.., 2.0, 1.0)),
        "stage 1: the lower bound 2 of `x[1]` is above the upper bound 1"
    );
    assert_eq!(
        message(ocp.bound("u", 3.., 0.0, 1.0)),
        "there is no stage 3: the bounds of the controls are at stages 0 to 2"
    );
    assert_eq!(
        message(ocp.soften("u", .., 1.0, 1.0)),
        "`u` has no finite bound at stages 0 to 2: call `bound` before `soften`"
    );
    assert_eq!(message(ocp.fix_initial_state(&[1.0])), "the initial state has 1 element instead of 2");
    assert_eq!(
        message(ocp.fix_initial_state(&[1.0, f64::NAN])),
        "the initial value of `x[1]` is NaN: it must be finite"
    );
    assert_eq!(
        message(ocp.set_terminal_reference(&[1.0])),
        "the reference of the terminal cost has 1 element instead of 0: the problem has none"
    );
    ocp.fix_initial_state(&[1.0, 0.0])?;
    assert_eq!(
        message(ocp.solution()?.state("speed")),
        "the solution of `Cart` has no `speed`: it has `x[0]`, `x[1]`"
    );
    Ok(())
}

#[test]
fn messages_about_runs() -> Test {
    let mut ocp = problem([1.0; 2], Horizon::uniform(3, 0.1))?;
    let mut sqp = HeapSqp::new(&ocp)?.gauss_newton();
    assert_eq!(
        message(sqp.solve(&mut ocp)),
        "the initial state is undefined: call `fix_initial_state` or `free_initial_state`"
    );
    ocp.fix_initial_state(&[1.0, 0.0])?;
    let other = problem([1.0; 2], Horizon::uniform(4, 0.1))?;
    assert_eq!(
        message(HeapSqp::new(&other)?.gauss_newton().solve(&mut ocp)),
        "dimensions of another problem: 5 instead of 4 at stage 0. Make solvers and memory for each problem: \
         `HeapSqp::new(&ocp)`"
    );
    // Degrees where radians were meant: too far for 0.3 s.
    ocp.bound("u", .., -1.0, 1.0)?.bound("x[0]", 3.., 90.0, 90.0)?.guess(&[1.0, 0.0], &[0.0])?;
    let outcome = sqp.solve(&mut ocp)?.to_string();
    assert!(outcome.starts_with(
        "locally infeasible: the lower bound of `x[0]` at stage 3 cannot be satisfied (violation 8.9"
    ));
    assert!(outcome.contains(" iterations: objective "));
    assert!(outcome.ends_with(". Soften it (`Ocp::soften`), or take another guess"));
    Ok(())
}

#[test]
fn messages_of_integrators() -> Test {
    let mut irk = Irk::<Outflow, Gauss<2>>::new(Options::default())?;
    assert_eq!(
        message(irk.solve(&Vector1::new(f64::NAN), &vector![], 0.1)),
        "`x` of x0 is NaN: it must be finite"
    );
    assert_eq!(
        message(irk.solve(&Vector1::new(1.0), &vector![], f64::INFINITY)),
        "the length `h` of the interval is inf: it must be finite"
    );
    assert_eq!(
        message(irk.solve(&Vector1::new(-1.0), &vector![], 0.1)),
        "equation 0 of the model is NaN at step 0, stage 0, iteration 0: look for roots, logarithms or quotients outside \
         of their domains, or take shorter steps"
    );
    Ok(())
}

/// Terms are those of the field, and the way out is a call.
#[test]
fn terms_of_the_field_in_messages() {
    let limit = Status::MaxIterations.to_string();
    assert!(limit.starts_with("not converged: the maximum number of iterations was reached"), "{limit}");
    assert!(limit.contains("Raise `options.max_iterations`"), "{limit}");
    assert_eq!(
        OcpError::Coupled.to_string(),
        "feedback gains are not defined for periodic states or shared controls: use `du/dx₀` of `Ocp::differentiate`"
    );
    assert_eq!(
        casados::Error::DependsOnTime { function: "Guard" }.to_string(),
        "Guard depends on the time: second derivatives across events, and first ones across events of algebraic \
         states, need an autonomous model. Add the time as a state, `ẋ = 1`"
    );
}

/// A bead on a wire that begins where `x[0]` is positive: position, velocity, tension.
#[dae(index_reduction)]
fn bead(xdot: [f64; 4], x: [f64; 4], z: f64) -> [f64; 5] {
    let along = x[0].max(0.0);
    [
        xdot[0] - x[2],
        xdot[1] - x[3],
        xdot[2] - z * x[1],
        xdot[3] - z * along + 9.81,
        along * along + along * x[1] - 1.0,
    ]
}

/// Sample points need not be on the wire. Where `x[0]` is negative the constraint has no gradient,
/// which is no fault of the mechanism: some have the full rank, and none is called singular.
#[test]
fn messages_about_vanishing_constraint_gradients() {
    let text = Bead::describe().to_string();
    let rank = text.lines().find(|line| line.contains("sample points")).unwrap_or_default();
    assert!(rank.contains("rank") && rank.contains("which need not satisfy the constraints"), "{text}");
    assert!(!text.contains("singular") && !text.contains("lose rank"), "{text}");
    let numbers: Vec<u32> = rank.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    assert!(matches!(numbers[..], [full, points] if 0 < full && full < points), "{rank}");
}

/// Messages about a model without parameters, and about one reference (singular verb).
#[test]
fn models_without_parameters() -> Test {
    let problem = Problem::new(casados::ocp::Map::<Push, f64>::new())
        .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]));
    let mut ocp = problem.on(Horizon::uniform(3, 1.0))?;
    let message = ocp.free("mass", 0.0..=1.0, 0.5).err().map(|error| error.to_string());
    assert_eq!(message.as_deref(), Some("`Push` has no parameter `mass`: it has none"));
    let message = ocp.set_reference(3.., &[0.0; 2]).err().map(|error| error.to_string());
    let expected = "there is no stage 3: the reference of the stage cost is at stages 0 to 2";
    assert_eq!(message.as_deref(), Some(expected));
    Ok(())
}
#[function]
fn push(x: f64, u: f64) -> f64 {
    x + u
}
#[function]
fn both(x: f64, u: f64) -> [f64; 2] {
    [x, u]
}
