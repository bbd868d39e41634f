//! Mistakes are typed errors that name field and stage.

use crate::Test;
use casados::ocp::{
    Constraint, GeneralCost, HeapIpm, HeapRealTime, HeapSqp, Horizon, LeastSquaresCost, Map, OcpError, Part,
    Problem,
};
use casados::prelude::*;
use casados::qp::StageDims;

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
fn messages_about_names() -> Test {
    let mut ocp = problem!();
    let Err(error) = ocp.bound("speed", .., 0.0, 1.0).map(|_| ()) else { return Err("no error".into()) };
    assert_eq!(
        error.to_string(),
        "`Next` has no variable `speed` of this kind. States: `x[0]`, `x[1]`; controls: `u[0]`"
    );
    // The beginning of a name is none.
    assert!(matches!(ocp.bound("x[", .., 0.0, 1.0), Err(OcpError::UnknownName { .. })));
    let long = "a name that is much longer than names of states are, and not one of them";
    let Err(error) = ocp.soften(long, .., 0.0, 1.0).map(|_| ()) else { return Err("no error".into()) };
    assert!(error.to_string().contains("`a name that is much longer than `"));
    Ok(())
}

/// The text of an error.
fn message<V>(result: Result<V, OcpError>) -> String {
    result.err().map(|error| error.to_string()).unwrap_or_default()
}

#[test]
fn messages_about_stages() -> Test {
    let mut ocp = problem!();
    assert_eq!(
        message(ocp.bound("x", 2..=4, 0.0, 1.0)),
        "there is no stage 4: the bounds of the states are at stages 0 to 3"
    );
    assert_eq!(
        message(ocp.bound("u", 3..=3, 0.0, 1.0)),
        "there is no stage 3: the bounds of the controls are at stages 0 to 2"
    );
    assert_eq!(
        message(ocp.bound("u", 3.., 0.0, 1.0)),
        "there is no stage 3: the bounds of the controls are at stages 0 to 2"
    );
    assert!(matches!(
        ocp.set_reference(3..=3, &[0.0; 2]),
        Err(OcpError::NoSuchStage { part: Part::Reference, stage: 3, stages: 3 })
    ));
    assert!(matches!(ocp.guess_stage(4, &[0.0; 2], &[]), Err(OcpError::NoSuchStage { stage: 4, .. })));
    assert!(matches!(ocp.stage(4), Err(OcpError::NoSuchStage { stage: 4, stages: 4, .. })));
    for end in [usize::MAX, usize::MAX - 1, 5] {
        assert!(matches!(ocp.bound("x", 0..=end, 0.0, 1.0), Err(OcpError::NoSuchStage { stages: 4, .. })));
        assert!(matches!(ocp.bound("x", end.., 0.0, 1.0), Err(OcpError::NoSuchStage { stages: 4, .. })));
    }
    Ok(())
}

/// A range without a stage sets nothing, which nobody means.
#[test]
#[allow(clippy::reversed_empty_ranges)]
fn ranges_without_stages() -> Test {
    let mut ocp = problem!();
    assert_eq!(
        message(ocp.bound("x", 2..2, 0.0, 1.0)),
        "the range of stages 2..2 is empty: the bounds of the states are at stages 0 to 3"
    );
    let empty =
        |result: Result<(), OcpError>| matches!(result, Err(OcpError::EmptyRange { start: 2, end: 2, .. }));
    assert!(empty(ocp.bound("u", 2..=1, 0.0, 1.0).map(|_| ())));
    assert!(empty(ocp.bound("x[0]", .., 0.0, 1.0)?.soften("x[0]", 2..2, 1.0, 0.0).map(|_| ())));
    assert!(empty(ocp.set_path_bounds(2..2, &[0.0], &[1.0]).map(|_| ())));
    assert!(empty(ocp.set_parameters(2..2, &[0.0]).map(|_| ())));
    assert!(empty(ocp.set_reference(2..2, &[0.0; 2]).map(|_| ())));
    assert!(matches!(ocp.bound("x", 3..1, 0.0, 1.0), Err(OcpError::EmptyRange { start: 3, end: 1, .. })));
    assert!(matches!(ocp.bound("x", ..0, 0.0, 1.0), Err(OcpError::EmptyRange { start: 0, end: 0, .. })));
    Ok(())
}

/// Only a bound can be made soft.
#[test]
fn softening_without_bounds() -> Test {
    let mut ocp = problem!();
    assert_eq!(
        message(ocp.soften("x[1]", 1.., 1e3, 0.0)),
        "`x[1]` has no finite bound at stages 1 to 3: call `bound` before `soften`"
    );
    ocp.bound("x[0]", 2..=2, 0.0, f64::INFINITY)?;
    assert!(matches!(ocp.soften("x", ..2, 1e3, 0.0), Err(OcpError::NoBound { start: 0, end: 2, .. })));
    assert!(matches!(ocp.soften("u", .., 1e3, 0.0), Err(OcpError::NoBound { start: 0, end: 3, .. })));
    ocp.soften("x", 1.., 1e3, 0.0)?;
    // Of a state that is given there is no bound.
    ocp.bound("x", .., 0.0, 1.0)?.fix_initial_state(&[1.0; 2])?;
    assert!(matches!(ocp.soften("x", ..1, 1e3, 0.0), Err(OcpError::NoBound { .. })));
    Ok(())
}

/// A state that is given stays what it is where its bounds were soft before.
#[test]
fn initial_states_are_hard() -> Test {
    let mut ocp = problem!();
    ocp.set_parameters(.., &[0.1])?.guess(&[1.0; 2], &[0.0])?;
    // Half a unit of violation would cost less than the way from there.
    ocp.bound("x", .., -2.0, 2.0)?.soften("x", .., 1e-3, 0.0)?.fix_initial_state(&[1.5, 1.0])?;
    assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
    for (x, x0) in ocp.stage(0)?.x.iter().zip([1.5, 1.0]) {
        assert!((x - x0).abs() < 1e-6, "{x} instead of {x0}");
    }
    Ok(())
}

/// Bounds of an initial state that is said to be free afterwards count.
#[test]
fn bounds_before_the_initial_state_is_free() -> Test {
    let mut ocp = problem!();
    ocp.bound("x[0]", .., 0.25, 2.0)?.free_initial_state();
    ocp.set_parameters(.., &[0.1])?.guess(&[1.0; 2], &[0.0])?;
    assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
    assert!(ocp.stage(0)?.x[0] > 0.25 - 1e-6, "{}", ocp.stage(0)?.x[0]);
    Ok(())
}

#[test]
fn messages_about_values() -> Test {
    let mut ocp = problem!();
    assert!(matches!(
        ocp.bound("x[1]", 2.., 1.0, 0.0),
        Err(OcpError::CrossedBounds {
            part: Part::StateBounds,
            stage: 2,
            name: "x[1]",
            index: 1,
            lower: 1.0,
            upper: 0.0
        })
    ));
    assert_eq!(
        message(ocp.bound("x[1]", 2.., 1.0, 0.0)),
        "stage 2: the lower bound 1 of `x[1]` is above the upper bound 0"
    );
    assert_eq!(
        message(ocp.bound("u", .., f64::NAN, 0.0)),
        "stage 0: a bound of `u[0]` is NaN: it must be a number, -inf for no lower bound, or inf for no upper bound"
    );
    assert!(matches!(
        ocp.bound("u", .., f64::INFINITY, f64::INFINITY),
        Err(OcpError::InvalidValue { part: Part::ControlBounds, name: "u[0]", .. })
    ));
    ocp.bound("u", .., -1.0, 1.0)?;
    assert_eq!(
        message(ocp.soften("u", .., -1.0, 0.0)),
        "stage 0: a penalty of `u[0]` is -1: it must be at least 0, and finite if quadratic"
    );
    for (linear, quadratic) in [(f64::NAN, 0.0), (1.0, -1.0), (1.0, f64::INFINITY), (1.0, f64::NAN)] {
        assert!(matches!(
            ocp.soften("u", .., linear, quadratic),
            Err(OcpError::InvalidValue { part: Part::Penalty, name: "u[0]", .. })
        ));
    }
    assert_eq!(
        message(ocp.set_path_bounds(1.., &[2.0], &[1.0])),
        "stage 1: the lower bound 2 of output 0 of `Root` is above the upper bound 1"
    );
    assert_eq!(
        message(ocp.set_reference(1.., &[0.0, f64::NAN])),
        "stage 1: the reference of output 1 of `Output` is NaN: it must be finite"
    );
    assert_eq!(
        message(ocp.set_parameters(1.., &[f64::INFINITY])),
        "stage 1: `p[0]` is inf: it must be finite"
    );
    assert_eq!(
        message(ocp.fix_initial_state(&[0.0, f64::NAN])),
        "the initial value of `x[1]` is NaN: it must be finite"
    );
    assert_eq!(
        message(ocp.guess_stage(2, &[0.0; 2], &[f64::NAN])),
        "stage 2: `u[0]` is NaN: it must be finite"
    );
    Ok(())
}

#[test]
fn messages_about_lengths() -> Test {
    let mut ocp = problem!();
    assert_eq!(message(ocp.fix_initial_state(&[0.0])), "the initial state has 1 element instead of 2");
    assert!(matches!(
        ocp.fix_initial_state(&[0.0; 3]),
        Err(OcpError::Length { part: Part::InitialState, stage: 0, expected: 2, found: 3 })
    ));
    assert_eq!(message(ocp.set_parameters(.., &[])), "stage 0: the parameters have 0 elements instead of 1");
    assert!(matches!(
        ocp.set_path_bounds(.., &[0.0], &[]),
        Err(OcpError::Length { part: Part::PathBounds, expected: 1, found: 0, .. })
    ));
    assert!(matches!(
        ocp.guess_stage(3, &[0.0; 2], &[0.0]),
        Err(OcpError::Length { part: Part::Controls, stage: 3, expected: 0, found: 1 })
    ));
    Ok(())
}

#[test]
fn messages_about_missing_parts() -> Test {
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
fn messages_about_horizons() {
    let problem = |horizon| Problem::new(Map::<Next, f64>::new()).on(horizon).map(|_| ());
    for horizon in [Horizon::uniform(0, 0.1), Horizon::nodes(&[]), Horizon::nodes(&[1.0])] {
        assert_eq!(
            message(problem(horizon)),
            "the horizon has no interval: `Horizon::uniform` takes one at least, `Horizon::nodes` two times"
        );
    }
    assert!(matches!(problem(Horizon::uniform(3, 0.0)), Err(OcpError::Times { interval: 0, .. })));
    assert!(matches!(problem(Horizon::uniform(3, f64::NAN)), Err(OcpError::Times { .. })));
    assert!(matches!(problem(Horizon::uniform(3, f64::MAX)), Err(OcpError::Times { interval: 1, .. })));
    assert!(matches!(
        problem(Horizon::nodes(&[0.0, 0.2, 0.1])),
        Err(OcpError::Times { interval: 1, start: 0.2, end: 0.1 })
    ));
}

/// Sizes that no memory has: errors, and lengths that say so.
#[test]
fn absurd_sizes() {
    type Small = Problem<Map<Next, f64>, LeastSquaresCost<Output>>;
    type Solver<'a> = casados::ocp::Sqp<(), casados::ocp::Exact, f64, &'a [StageDims], &'a mut [f64]>;
    let problem =
        || Problem::new(Map::<Next, f64>::new()).stage_cost(LeastSquaresCost::<Output>::diagonal(&[1.0; 2]));
    let few = Small::dims::<f64, 2>();
    for intervals in [usize::MAX, usize::MAX - 1, usize::MAX / 64, 1 << 50] {
        let horizon = Horizon::uniform(intervals, 0.1);
        assert!(matches!(problem().on(horizon), Err(OcpError::OutOfMemory { .. })), "{intervals}");
        assert!(matches!(
            problem().on_horizon(horizon, &few, &mut []),
            Err(OcpError::Length { part: Part::Dimensions, found: 2, .. })
        ));
    }
    for [nx, nu, ng] in
        [[usize::MAX; 3], [1 << 40, 1 << 40, 0], [0, 0, usize::MAX / 2], [0, usize::MAX / 3, 1]]
    {
        let dims = [StageDims::new(nx, nu, ng), StageDims::new(nx, 0, ng)];
        assert_eq!(Small::memory::<f64>(&dims), usize::MAX);
        assert_eq!(Solver::memory::<Small>(&dims), usize::MAX);
        assert!(Solver::in_memory::<Small>((), &dims, &mut [0.0; 9]).is_err());
    }
}

#[ode]
fn cart(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u]
}

/// Of functions for CasADi patterns are made before anybody calls them.
#[test]
fn exported_horizons_of_absurd_sizes() {
    type Exported = casados::casadi::Horizons<Batch<Cart, Gauss<2>>>;
    for intervals in [usize::MAX, usize::MAX / 64, 1 << 58] {
        let failure = Exported::new(casados::casadi::Settings::new(0.1), intervals).err();
        let said = failure.map_or(String::new(), |failure| failure.0);
        assert!(said.ends_with("bytes of memory could not be allocated"), "{intervals}: {said}");
    }
    assert!(Exported::new(casados::casadi::Settings::new(0.1), 3).is_ok());
}

/// Functions of what does not exist where they are evaluated.
#[test]
fn functions_at_missing_stages() {
    let terminal = Problem::new(Map::<Next, f64>::new())
        .terminal_cost(LeastSquaresCost::<Output>::diagonal(&[1.0; 2]))
        .on(Horizon::uniform(3, 0.1));
    assert_eq!(
        terminal.err().map(|error| error.to_string()).as_deref(),
        Some(
            "`Output` depends on `u[0]`, which does not exist at the end of the horizon: terminal costs and constraints \
             may depend on states and parameters only; move this term to the running cost or the path constraints"
        )
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

/// A derivative that is not finite where there is a value, by its names.
#[test]
fn functions_without_a_derivative() -> Test {
    let mut ocp = problem!();
    ocp.fix_initial_state(&[1.0; 2])?.set_parameters(.., &[0.1])?.guess(&[1.0; 2], &[0.0])?;
    ocp.guess_stage(2, &[0.0; 2], &[0.0])?;
    let expected = "stage 2: the derivative of output 0 of `Root` by `x[0]` is inf: take another guess, or bounds \
                    that keep the variables inside its domain";
    assert_eq!(message(HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)), expected);
    assert_eq!(message(HeapIpm::new(&ocp)?.solve(&mut ocp)), expected);
    let mut controller = HeapRealTime::new(ocp)?;
    assert_eq!(message(controller.prepare()?.feedback(&[1.0; 2])), expected);
    Ok(())
}

/// An iterate that is not finite, wherever that comes from.
#[test]
fn iterates_that_are_not_finite() -> Test {
    let mut ocp = problem!();
    ocp.fix_initial_state(&[1.0; 2])?.set_parameters(.., &[0.1])?.guess(&[1.0; 2], &[0.0])?;
    let mut sqp = HeapSqp::new(&ocp)?;
    let place = ocp.iterate_mut().stage_mut(1).ok_or("no stage")?;
    (place.dynamics[1], place.g_upper[0]) = (f64::NAN, f64::NAN);
    assert_eq!(message(sqp.solve(&mut ocp)), "stage 1: a multiplier of `x[1]` is NaN: it must be finite");
    ocp.iterate_mut().stage_mut(1).ok_or("no stage")?.dynamics[1] = 0.0;
    assert_eq!(message(sqp.solve(&mut ocp)), "stage 1: a multiplier of `Root` is NaN: it must be finite");
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
    assert_eq!(
        error.as_deref(),
        Some(
            "stage 0: output 0 of `Root` is NaN: take another guess, or bounds that keep the variables inside its \
             domain"
        )
    );
    Ok(())
}
