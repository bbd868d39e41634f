//! `Debug` of errors, which a `main` that returns `Result` prints, is their text, and `?` converts
//! the errors of what a controller consists of.

use crate::Test;
use casados::error::{Argument, Place, Quantity, Refusal, Started};
use casados::ocp::{
    Formulation, HeapOcp, Horizon, LeastSquaresCost, OcpError, Part, Problem, TrajectoryError,
};
use casados::prelude::*;
use casados::qp::{QpError, QpField, Side};
use casados::{Inconsistent, TableauError, batch, result};
use nalgebra::vector;
use std::fmt::{Debug, Display};

#[ode]
fn cart(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u]
}
#[function]
fn deviation(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[0], u]
}

fn problem() -> Result<HeapOcp<impl Formulation<f64>>, OcpError> {
    let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
        .stage_cost(LeastSquaresCost::<Deviation>::diagonal(&[1.0; 2]))
        .on(Horizon::uniform(3, 0.1))?;
    ocp.fix_initial_state(&[1.0, 0.0])?;
    Ok(ocp)
}

/// Each says something, and the same in both ways.
fn check_debug_texts<E: Debug + Display>(errors: &[E]) {
    for error in errors {
        assert_eq!(format!("{error:?}"), format!("{error}"));
        assert_eq!(format!("{:?}", Err::<(), _>(error)), format!("Err({error})"));
        assert!(format!("{error}").contains(' '), "{error}");
    }
}

fn debug_of_integrators() -> Vec<Error> {
    let at = Place { step: 1, stage: 2, iteration: 3 };
    let started = Started { unknown: "z", value: 0.5 };
    let input = |argument, name| Error::NonFiniteInput { argument, index: 1, name, value: f64::NAN };
    let model = |quantity| Error::NonFiniteModel { quantity, equation: 1, value: f64::NAN, at };
    let underflow = |reason| Error::StepSizeUnderflow { t: 1.0, h: 1e-15, reason, unsettled: None };
    let not_converged = |started| Error::NotConverged {
        residual: 1.0,
        equation: 0,
        unknown: "x",
        increment: 2.0,
        at,
        started,
    };
    let inconsistent = |singular| Error::InconsistentStart {
        t: 0.0,
        equation: 1,
        residual: 1.0,
        unknown: "z",
        value: 2.0,
        singular,
    };
    let (t, start, end) = (1.0, 0.0, 0.5);
    vec![
        Error::InvalidOption { option: "steps", value: 0.0, reason: "at least one is needed" },
        Error::Tableau(TableauError::Empty),
        Error::NotExplicit { stage: 1 },
        input(Argument::X0, "x[1]"),
        input(Argument::Nu, ""),
        input(Argument::H, ""),
        input(Argument::T, ""),
        Error::ParametersNotSet,
        Error::StartNotGiven,
        model(Quantity::Residual),
        model(Quantity::Jacobian),
        model(Quantity::Adjoint),
        model(Quantity::Hessian),
        Error::NonFiniteStart { quantity: Quantity::Residual, equation: 1, value: f64::NAN, started, at },
        Error::Singular { unknown: "z", at },
        Error::NotPivoted { step: 1 },
        not_converged(None),
        not_converged(Some(started)),
        inconsistent(false),
        inconsistent(true),
        Error::Overflow { step: 1, index: 2 },
        Error::NonFiniteFunction { function: "Cost", output: 0, value: f64::INFINITY, at },
        underflow(Refusal::Error),
        underflow(Refusal::NotConverged),
        underflow(Refusal::Singular),
        underflow(Refusal::NotFinite),
        underflow(Refusal::Resolution),
        Error::TooManySteps { t, steps: 100, stiff: true, rounding: None },
        Error::TooManySteps { t, steps: 100, stiff: false, rounding: None },
        Error::TooManySteps { t, steps: 100, stiff: false, rounding: Some(40.0) },
        Error::OutsideInterval { t, start, end },
        Error::Unordered { index: 1, t, before: 2.0, end: 3.0 },
        Error::TooManyEvents { t, events: 100 },
        Error::Grazing { event: 0, function: "Guard", t },
        Error::DependsOnTime { function: "Guard" },
        Error::Intervals { controls: 2, ends: 3 },
        Error::NoInterpolation,
        Error::NoResult,
        Error::NotProjected { equation: 4, derivative: 1, residual: 1e-3 },
        Error::OutOfMemory { bytes: 100 },
    ]
}

fn debug_of_tableaux() -> [TableauError; 4] {
    [
        TableauError::Empty,
        TableauError::NotFinite,
        TableauError::RowSum { stage: 0, sum: 0.5, node: 0.4 },
        TableauError::WeightSum { sum: 0.9 },
    ]
}

fn debug_of_start_values() -> [Inconsistent; 6] {
    let (equation, derivative, residual) = (4, 1, 1e-3);
    let input =
        |name| Inconsistent::NonFiniteInput { argument: Argument::T, index: 0, name, value: f64::NAN };
    [
        Inconsistent::NoSuchState { name: "x[7]" },
        input(""),
        input("x[0]"),
        Inconsistent::NonFinite { equation, derivative, value: f64::NAN },
        Inconsistent::Dependent { equation, derivative, residual },
        Inconsistent::NotConverged { equation, derivative, residual },
    ]
}

fn debug_of_batches(error: Error) -> [BatchError; 4] {
    [
        BatchError::Length { slice: batch::Slice::Results, length: 3, intervals: 1 },
        BatchError::Intervals { failed: 2, first: 1, error },
        BatchError::Integrator(error),
        BatchError::OutOfMemory { bytes: 100 },
    ]
}

fn debug_of_qps() -> Vec<QpError> {
    let (field, stage, index) = (QpField::StateBounds, 1, 2);
    vec![
        QpError::Dimension { field, stage, expected: 1, found: 2 },
        QpError::CrossedBounds { field, stage, index, lower: 1.0, upper: 0.0 },
        QpError::InvalidValue { field, stage, index, value: f64::NAN },
        QpError::Infeasible { field, stage, index, side: Side::Upper, violation: 1.0 },
        QpError::NotConvex { stage, index, pivot: -1.0 },
        QpError::Coupled,
        QpError::InvalidOption { name: "tolerance", value: -1.0, allowed: "positive" },
        QpError::OutOfMemory { bytes: 100 },
    ]
}

fn debug_of_problems(error: Error) -> Vec<OcpError> {
    let (part, stage, name) = (Part::StateBounds, 1, "x[0]");
    let mut errors = vec![
        OcpError::NoSuchStage { part, stage, stages: 1 },
        OcpError::EmptyRange { part, start: 2, end: 2, stages: 4 },
        OcpError::Length { part, stage, expected: 2, found: 1 },
        OcpError::Length { part: Part::Dimensions, stage, expected: 2, found: 1 },
        OcpError::InvalidValue { part, stage, name, index: 0, value: f64::NAN },
        OcpError::InvalidWeight { function: "Cost", outputs: [0, 1], value: -1.0, allowed: "positive" },
        OcpError::InvalidArrivalWeight { states: ["x[0]", "x[1]"], value: -1.0, allowed: "positive" },
        OcpError::Times { interval: 0, start: 0.0, end: 0.0 },
        OcpError::CrossedBounds { part, stage, name, index: 0, lower: 1.0, upper: 0.0 },
        OcpError::Missing { part: Part::Times, stage },
        OcpError::Missing { part: Part::InitialState, stage },
        OcpError::Missing { part: Part::Parameters, stage },
        OcpError::NotThere { function: "Cost", variable: "u", terminal: true },
        OcpError::NonFiniteFunction { function: "Cost", stage, output: 0, value: f64::NAN, phase: None },
        OcpError::NonFiniteDerivative {
            field: QpField::A,
            stage,
            of: "x",
            output: 0,
            by: "u",
            value: f64::NAN,
            phase: Some(1),
        },
        OcpError::Integration { interval: 3, error, phase: Some(1) },
        OcpError::Integrator(error),
        OcpError::Coupled,
        OcpError::InvalidOption { name: "tolerance", value: -1.0, allowed: "positive" },
        OcpError::OutOfMemory { bytes: 100 },
    ];
    errors.extend(debug_of_qps().into_iter().map(OcpError::Qp));
    errors.extend(debug_of_start_values().map(OcpError::Inconsistent));
    errors.extend(debug_of_batches(error).map(OcpError::from));
    errors
}

#[test]
fn debug_texts() -> Test {
    let error = debug_of_integrators()[0];
    check_debug_texts(&debug_of_integrators());
    check_debug_texts(&debug_of_tableaux());
    check_debug_texts(&debug_of_start_values());
    check_debug_texts(&debug_of_batches(error));
    check_debug_texts(&debug_of_qps());
    let mut problems = debug_of_problems(error);
    let mut ocp = problem()?;
    problems.extend(ocp.bound("speed", .., 0.0, 1.0).err());
    problems.extend(ocp.soften("u", .., 1.0, 1.0).err());
    check_debug_texts(&problems);
    let (name, found) = (String::from("x"), vec![String::from("x[0]"), String::from("x[1]")]);
    let mut trajectories = vec![
        TrajectoryError::Ambiguous { name: name.clone(), found },
        TrajectoryError::Length { name: name.clone(), found: 3, expected: 4 },
        TrajectoryError::Times,
        TrajectoryError::Beyond { name, first: 4, found: 1, times: 4 },
    ];
    trajectories.extend(ocp.solution()?.state("speed").err());
    trajectories.extend(problems.into_iter().map(TrajectoryError::from));
    check_debug_texts(&trajectories);
    Ok(())
}

/// What is nested is found by `source`, and said once.
#[test]
fn error_sources() {
    let error = debug_of_integrators()[1];
    let nested: [&dyn std::error::Error; 4] =
        [&error, &BatchError::Integrator(error), &OcpError::Integrator(error), &TrajectoryError::from(error)];
    for error in nested {
        let source = error.source().map(ToString::to_string);
        assert_eq!(source, Some(error.to_string()));
    }
}

/// The plan of a controller, a simulation and a batch in one function, with `?` alone.
fn derive_all_errors(h: f64) -> Result<f64, OcpError> {
    let x = vector![1.0, 0.0];
    problem()?;
    let mut plant = Irk::<Cart, Gauss<2>>::new(Options::default())?;
    let end = plant.solve(&x, &vector![0.0], h)?.x;
    let mut batch = Batch::<Cart, Gauss<2>>::new(Options::default())?;
    let mut ends = vec![result::Nominal::default(); 2];
    batch
        .solve(&Intervals { x0: &[x; 2], u: &[vector![0.0]; 2], h: &[h], ..Default::default() }, &mut ends)?;
    Ok((ends[1].x - end).norm())
}

/// The name of a trajectory, a tableau of one's own, and all of the above.
fn convert_further_errors(h: f64) -> Result<f64, TrajectoryError> {
    let tableau = || -> Result<_, Error> { Ok(casados::Tableau::new([[0.5]], [1.0], [0.5])?) };
    tableau()?;
    problem()?.solution()?.state("x[0]")?;
    Ok(derive_all_errors(h)?)
}

#[test]
fn error_conversion() -> Test {
    assert_eq!(convert_further_errors(0.1)?, 0.0);
    let error = derive_all_errors(f64::NAN).expect_err("the length is no number");
    assert_eq!(format!("{error:?}"), "the length `h` of the interval is NaN: it must be finite");
    let refused = Tableau::new([[0.5]], [1.0], [0.4]).map_err(Error::from).expect_err("sums of rows");
    assert_eq!(format!("{refused:?}"), "row 0 of A sums to 5e-1, but c[0] = 4e-1");
    // Of a batch the interval is known.
    let error = debug_of_integrators()[0];
    let of_batch = OcpError::from(BatchError::Intervals { failed: 1, first: 2, error });
    assert!(matches!(of_batch, OcpError::Integration { interval: 2, .. }));
    assert!(matches!(
        BatchError::from(Error::OutOfMemory { bytes: 1 }),
        BatchError::OutOfMemory { bytes: 1 }
    ));
    assert!(matches!(OcpError::from(Error::OutOfMemory { bytes: 1 }), OcpError::OutOfMemory { bytes: 1 }));
    Ok(())
}
