//! Mistakes are typed errors that name field and stage.

use crate::Test;
use casados::ocp::{
    Constraint, GeneralCost, HeapSqp, Horizon, LeastSquaresCost, Map, OcpError, Part, Problem,
};
use casados::prelude::*;

#[function]
fn next(x: [f64; 2], u: [f64; 1], p: [f64; 1]) -> [f64; 2] {
    [x[0] + p[0] * x[1], x[1] + u[0]]
}

#[function]
fn output(x: [f64; 2], u: [f64; 1], _p: [f64; 1]) -> [f64; 2] {
    [x[0], u[0]]
}

#[function]
fn root(x: [f64; 2], _u: [f64; 1], _p: [f64; 1]) -> f64 {
    x[0].sqrt()
}

/// A problem without mistakes, but for what is missing.
macro_rules! problem {
    () => {
        Problem::new(Map::<Next, f64>::new())
            .stage_cost(LeastSquaresCost::<Output>::diagonal(&[1.0; 2]))
            .path_constraints(Constraint::<Root>::new([0.0], [9.0]))
            .on(Horizon::uniform(3, 0.1))?
    };
}

#[test]
fn names() -> Test {
    let mut ocp = problem!();
    let Err(error) = ocp.bound("speed", .., 0.0, 1.0).map(|_| ()) else { return Err("no error".into()) };
    assert_eq!(
        error.to_string(),
        "`Next` has no state or control `speed`: its states are `x[0]`, `x[1]`, its controls `u[0]`"
    );
    // The beginning of a name is none.
    assert!(matches!(ocp.bound("x[", .., 0.0, 1.0), Err(OcpError::UnknownName { .. })));
    let long = "a name that is much longer than names of states are, and not one of them";
    let Err(error) = ocp.soften(long, .., 0.0, 1.0).map(|_| ()) else { return Err("no error".into()) };
    assert!(error.to_string().contains("`a name that is much longer than `"));
    Ok(())
}

#[test]
fn stages() -> Test {
    let mut ocp = problem!();
    let error = |result: Result<(), OcpError>| result.err().map(|error| error.to_string());
    assert_eq!(
        error(ocp.bound("x", 2..=4, 0.0, 1.0).map(|_| ())).as_deref(),
        Some("there is no stage 4: the bounds of the states are at stages 0 to 3")
    );
    assert_eq!(
        error(ocp.bound("u", 3..=3, 0.0, 1.0).map(|_| ())).as_deref(),
        Some("there is no stage 3: the bounds of the controls are at stages 0 to 2")
    );
    assert!(matches!(
        ocp.set_reference(3..=3, &[0.0; 2]),
        Err(OcpError::NoSuchStage { part: Part::Reference, stage: 3, stages: 3 })
    ));
    assert!(matches!(ocp.guess_stage(4, &[0.0; 2], &[]), Err(OcpError::NoSuchStage { stage: 4, .. })));
    assert!(matches!(ocp.stage(4), Err(OcpError::NoSuchStage { stage: 4, stages: 4, .. })));
    Ok(())
}

#[test]
fn values() -> Test {
    let mut ocp = problem!();
    assert!(matches!(
        ocp.bound("x[1]", 2.., 1.0, 0.0),
        Err(OcpError::CrossedBounds { part: Part::StateBounds, stage: 2, index: 1, lower: 1.0, upper: 0.0 })
    ));
    assert!(matches!(
        ocp.bound("u", .., f64::NAN, 0.0),
        Err(OcpError::InvalidValue { part: Part::ControlBounds, .. })
    ));
    assert!(matches!(
        ocp.bound("u", .., f64::INFINITY, f64::INFINITY),
        Err(OcpError::InvalidValue { part: Part::ControlBounds, .. })
    ));
    assert!(matches!(
        ocp.soften("u", .., -1.0, 0.0),
        Err(OcpError::InvalidValue { part: Part::Penalty, value: -1.0, .. })
    ));
    assert!(matches!(
        ocp.set_path_bounds(1.., &[2.0], &[1.0]),
        Err(OcpError::CrossedBounds { part: Part::PathBounds, stage: 1, index: 0, .. })
    ));
    assert!(matches!(
        ocp.set_reference(1.., &[0.0, f64::NAN]),
        Err(OcpError::InvalidValue { part: Part::Reference, stage: 1, index: 1, .. })
    ));
    assert!(matches!(
        ocp.fix_initial_state(&[0.0; 3]),
        Err(OcpError::Length { part: Part::InitialState, stage: 0, expected: 2, found: 3 })
    ));
    assert!(matches!(
        ocp.set_parameters(.., &[]),
        Err(OcpError::Length { part: Part::Parameters, expected: 1, found: 0, .. })
    ));
    assert!(matches!(
        ocp.guess_stage(3, &[0.0; 2], &[0.0]),
        Err(OcpError::Length { part: Part::Controls, stage: 3, expected: 0, found: 1 })
    ));
    Ok(())
}

#[test]
fn what_is_missing() -> Test {
    let mut ocp = problem!();
    let mut sqp = HeapSqp::new(&ocp)?;
    ocp.guess(&[1.0; 2], &[0.0])?;
    assert!(matches!(sqp.solve(&mut ocp), Err(OcpError::Missing { part: Part::InitialState, .. })));
    ocp.fix_initial_state(&[1.0; 2])?;
    ocp.set_parameters(..2, &[0.1])?;
    assert!(matches!(sqp.solve(&mut ocp), Err(OcpError::Missing { part: Part::Parameters, stage: 2 })));
    ocp.set_parameters(.., &[0.1])?;
    assert!(sqp.solve(&mut ocp)?.is_converged());
    Ok(())
}

#[test]
fn horizons() {
    let problem = |horizon| Problem::new(Map::<Next, f64>::new()).on(horizon).map(|_| ());
    assert!(matches!(problem(Horizon::uniform(0, 0.1)), Err(OcpError::Missing { part: Part::Times, .. })));
    assert!(matches!(problem(Horizon::uniform(3, 0.0)), Err(OcpError::Times { interval: 0, .. })));
    assert!(matches!(problem(Horizon::uniform(3, f64::NAN)), Err(OcpError::Times { .. })));
    assert!(matches!(
        problem(Horizon::nodes(&[0.0, 0.2, 0.1])),
        Err(OcpError::Times { interval: 1, start: 0.2, end: 0.1 })
    ));
}

/// Functions of what does not exist where they are evaluated.
#[test]
fn what_does_not_exist() {
    let terminal = Problem::new(Map::<Next, f64>::new())
        .terminal_cost(LeastSquaresCost::<Output>::diagonal(&[1.0; 2]))
        .on(Horizon::uniform(3, 0.1));
    assert_eq!(
        terminal.err().map(|error| error.to_string()).as_deref(),
        Some("`Output` depends on `u[0]`, which does not exist at the end of the horizon")
    );
}

/// A value that is not finite, with the stage; the iterate is the last one that has values.
#[test]
fn functions_without_a_value() -> Test {
    let mut ocp = problem!();
    ocp.fix_initial_state(&[1.0; 2])?.set_parameters(.., &[0.1])?;
    ocp.guess(&[1.0; 2], &[0.0])?.guess_stage(2, &[-1.0, 0.0], &[0.0])?;
    let mut sqp = HeapSqp::new(&ocp)?;
    assert!(matches!(
        sqp.solve(&mut ocp),
        Err(OcpError::NonFiniteFunction { function: "Root", stage: 2, output: 0, .. })
    ));
    assert_eq!(ocp.stage(2)?.x, [-1.0, 0.0]);
    Ok(())
}

/// Memory that is not the heap: lengths are checked.
#[test]
fn memory_of_the_caller() -> Test {
    type Small = Problem<Map<Next, f64>, LeastSquaresCost<Output>>;
    const DIMS: [casados::qp::StageDims; 4] = Small::dims::<f64, 4>();
    const LENGTH: usize = Small::memory::<f64>(&DIMS);
    let problem =
        || Problem::new(Map::<Next, f64>::new()).stage_cost(LeastSquaresCost::<Output>::diagonal(&[1.0; 2]));
    let mut memory = [0.0; LENGTH];
    let horizon = Horizon::uniform(3, 0.1);
    let mut short = [0.0; LENGTH - 1];
    assert!(matches!(
        problem().on_horizon(horizon, &DIMS, &mut short),
        Err(OcpError::Length { part: Part::Memory, expected: LENGTH, .. })
    ));
    assert!(matches!(
        problem().on_horizon(horizon, &DIMS[1..], &mut memory),
        Err(OcpError::Length { part: Part::Dimensions, expected: 4, found: 3, .. })
    ));
    let mut ocp = problem().on_horizon(horizon, &DIMS, &mut memory)?;
    ocp.fix_initial_state(&[1.0; 2])?.set_parameters(.., &[0.1])?.guess(&[1.0; 2], &[0.0])?;
    ocp.linearise(casados::ocp::GaussNewton::default())?;
    assert!(ocp.residuals().0.largest().is_finite());
    Ok(())
}

#[test]
fn general_costs_name_their_function() -> Test {
    let mut ocp = Problem::new(Map::<Next, f64>::new())
        .stage_cost(GeneralCost::<Root>::new())
        .on(Horizon::uniform(2, 0.1))?;
    ocp.fix_initial_state(&[-1.0, 0.0])?.set_parameters(.., &[0.1])?.guess(&[-1.0, 0.0], &[0.0])?;
    let error = HeapSqp::new(&ocp)?.solve(&mut ocp).err().map(|error| error.to_string());
    assert_eq!(error.as_deref(), Some("stage 0: output 0 of `Root` is NaN"));
    Ok(())
}
