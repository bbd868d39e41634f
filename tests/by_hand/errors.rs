//! Every way in which an implicit integrator can fail, and that it is usable afterwards.

use crate::models::{Fragile, Linear, Nonlinear};
use casados_core::error::{Argument, Place, Quantity};
use casados_core::options::{Newton, Start};
use casados_core::{Error, Gauss, Irk, Options, RadauIIA};
use nalgebra::vector;

#[test]
fn invalid_options() {
    let newton = Newton::default();
    for (options, name) in [
        (Options { steps: 0, ..Default::default() }, "steps"),
        (Options { newton: Newton { tolerance: -1.0, ..newton }, ..Default::default() }, "newton.tolerance"),
        (
            Options { newton: Newton { tolerance: f64::NAN, ..newton }, ..Default::default() },
            "newton.tolerance",
        ),
        (
            Options { newton: Newton { max_iterations: 0, ..newton }, ..Default::default() },
            "newton.max_iterations",
        ),
        (
            Options { newton: Newton { fixed_iterations: Some(0), ..newton }, ..Default::default() },
            "newton.fixed_iterations",
        ),
    ] {
        match Irk::<Linear, Gauss<2>>::new(options).err() {
            Some(Error::InvalidOption { option, .. }) => assert_eq!(option, name),
            other => panic!("{other:?}"),
        }
    }
    // A record of so many steps is larger than the address space.
    let mut irk = Irk::<Linear, Gauss<2>>::new(Options { steps: usize::MAX, ..Default::default() }).unwrap();
    irk.set_parameters(&vector![1.0]).unwrap();
    let error = irk.solve(&vector![1.0], &vector![0.0], 1.0).unwrap_err();
    assert!(matches!(error, Error::OutOfMemory { .. }), "{error}");
}

#[test]
fn non_finite_inputs() {
    let mut irk = Irk::<Nonlinear, Gauss<2>>::new(Options::default()).unwrap();
    let (x0, u, lambda) = (vector![1.0, 2.0], vector![3.0], vector![1.0, 1.0]);
    assert_eq!(irk.solve(&x0, &u, 0.1).unwrap_err(), Error::ParametersNotSet);
    irk.set_parameters(&vector![1.0]).unwrap();
    let nan = f64::NAN;
    let at = |result: Result<(), Error>, expected: (Argument, usize, &str)| match result {
        Err(Error::NonFiniteInput { argument, index, name, value }) => {
            assert_eq!((argument, index, name), expected);
            assert!(!value.is_finite());
        }
        other => panic!("{other:?}"),
    };
    at(irk.solve(&vector![1.0, nan], &u, 0.1).map(|_| ()), (Argument::X0, 1, "x[1]"));
    at(irk.forward(&x0, &vector![f64::INFINITY], 0.1).map(|_| ()), (Argument::U, 0, "u"));
    at(irk.solve(&x0, &u, nan).map(|_| ()), (Argument::H, 0, ""));
    at(irk.adjoint(&x0, &u, 0.1, &vector![nan, 1.0]).map(|_| ()), (Argument::Lambda, 0, "x[0]"));
    at(irk.hessian(&x0, &u, 0.1, &vector![1.0, -f64::INFINITY]).map(|_| ()), (Argument::Lambda, 1, "x[1]"));
    at(irk.forward_adjoint(&x0, &u, 0.1, &vector![1.0, nan]).map(|_| ()), (Argument::Lambda, 1, "x[1]"));
    at(irk.set_parameters(&vector![nan]), (Argument::P, 0, "p"));
    at(irk.set_time(nan), (Argument::T, 0, ""));
    at(irk.set_start(&vector![nan, 0.0], &vector![0.0]), (Argument::StartXdot, 0, "x[0]"));
    at(irk.set_start(&vector![0.0, 0.0], &vector![nan]), (Argument::StartZ, 0, "z"));
    // None of this is remembered.
    let result = *irk.hessian(&x0, &u, 0.1, &lambda).unwrap();
    let mut fresh = Irk::<Nonlinear, Gauss<2>>::new(Options::default()).unwrap();
    fresh.set_parameters(&vector![1.0]).unwrap();
    assert_eq!(fresh.hessian(&x0, &u, 0.1, &lambda).unwrap(), &result);
    at(irk.dense(nan).map(|_| ()), (Argument::T, 0, ""));
    let error = irk.solve(&vector![1.0, nan], &u, 0.1).unwrap_err();
    assert_eq!(error.to_string(), "`x[1]` of x0 is NaN: it must be finite");
}

#[test]
fn non_finite_models() {
    let mut irk = Irk::<Fragile, RadauIIA<2>>::new(Options { steps: 2, ..Default::default() }).unwrap();
    let error = irk.solve(&vector![-1.0], &vector![1.0], 0.1).unwrap_err();
    match error {
        Error::NonFiniteModel { quantity: Quantity::Residual, equation: 0, value, at } => {
            assert!(value.is_nan());
            assert_eq!(at, Place { step: 0, stage: 0, iteration: 0 });
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(
        error.to_string(),
        "equation 0 of the model is NaN at step 0, stage 0, iteration 0: look for roots, logarithms or quotients \
         outside of their domains, or take shorter steps"
    );
    // The root is zero: the residual is finite, its derivative is not.
    let error = irk.solve(&vector![0.0], &vector![1.0], 0.0).unwrap_err();
    assert!(matches!(
        error,
        Error::NonFiniteModel { quantity: Quantity::Jacobian, equation: 0, value, .. } if value == f64::NEG_INFINITY
    ));
    // The level falls below zero in the second step only.
    let error = irk.solve(&vector![1.0], &vector![3.0], 0.8).unwrap_err();
    match error {
        Error::NonFiniteModel { at, .. } => assert_eq!(at.step, 1, "{error}"),
        other => panic!("{other:?}"),
    }
    assert_eq!(irk.statistics().steps, 1);
}

#[test]
fn singular_matrices() {
    // One stage of Radau IIA is implicit Euler: 1 − h p = 0 at h = p = 1.
    let mut irk = Irk::<Linear, RadauIIA<1>>::new(Options::default()).unwrap();
    irk.set_parameters(&vector![1.0]).unwrap();
    let error = irk.solve(&vector![1.0], &vector![0.0], 1.0).unwrap_err();
    let at = Place { step: 0, stage: 0, iteration: 0 };
    // Only equation z = x couples the unknowns: it takes the column of x, and none is left for z.
    assert_eq!(error, Error::Singular { unknown: "z", at });
    // u z = x does not determine z at u = 0.
    let mut irk = Irk::<Fragile, Gauss<3>>::new(Options::default()).unwrap();
    let error = irk.solve(&vector![1.0], &vector![0.0], 0.1).unwrap_err();
    assert_eq!(error, Error::Singular { unknown: "ratio", at });
    let text = error.to_string();
    assert!(
        text.contains("singular at step 0, stage 0") && text.contains("do not determine `ratio`"),
        "{text}"
    );
    // Of size 1e-300 it does.
    let ratio = irk.solve(&vector![1.0], &vector![1e-300], 0.0).unwrap().z[0];
    assert!((ratio * 1e-300 - 1.0).abs() < 1e-14);
}

#[test]
fn divergent_iterations() {
    let newton = Newton { max_iterations: 2, ..Default::default() };
    let mut irk = Irk::<Nonlinear, Gauss<2>>::new(Options { newton, ..Default::default() }).unwrap();
    irk.set_parameters(&vector![1.3]).unwrap();
    let error = irk.forward(&vector![0.4, -0.7], &vector![0.9], 0.3).unwrap_err();
    match error {
        Error::NotConverged { residual, increment, at, .. } => {
            assert!(residual > 1e-12 && increment > 1e-8);
            assert_eq!((at.step, at.iteration), (0, 2));
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn overflow_of_results() {
    let mut irk = Irk::<Linear, Gauss<1>>::new(Options::default()).unwrap();
    irk.set_parameters(&vector![1.0]).unwrap();
    // (1 + h/2)/(1 − h/2) = 1e4 nearly, times 1e307.
    let error = irk.forward(&vector![1e307], &vector![0.0], 2.0 - 4e-4).unwrap_err();
    assert!(matches!(error, Error::Overflow { step: 0, .. }), "{error:?}");
}

#[test]
fn warm_start_after_errors() {
    let options = Options { steps: 2, start: Start::Warm, ..Default::default() };
    let mut irk = Irk::<Fragile, RadauIIA<2>>::new(options).unwrap();
    let mut calm = Irk::<Fragile, RadauIIA<2>>::new(options).unwrap();
    let (x0, u, lambda) = (vector![1.0], vector![0.5], vector![2.0]);
    irk.hessian(&x0, &u, 0.3, &lambda).unwrap();
    calm.hessian(&x0, &u, 0.3, &lambda).unwrap();
    irk.hessian(&vector![1.0], &vector![3.0], 0.8, &lambda).unwrap_err();
    irk.forward(&vector![-1.0], &u, 0.3).unwrap_err();
    irk.adjoint(&x0, &vector![0.0], 0.3, &lambda).unwrap_err();
    irk.solve(&vector![f64::NAN], &u, 0.3).unwrap_err();
    // The dense output still is that of the last successful call.
    assert_eq!(irk.dense_forward(0.1).unwrap(), calm.dense_forward(0.1).unwrap());
    irk.forward(&vector![-1.0], &u, 0.3).unwrap_err();
    assert_eq!(irk.dense_forward(0.2).unwrap(), calm.dense_forward(0.2).unwrap());
    let near = vector![1.01];
    let expected = *calm.hessian(&near, &u, 0.3, &lambda).unwrap();
    assert_eq!(irk.hessian(&near, &u, 0.3, &lambda).unwrap(), &expected);
    assert_eq!(irk.statistics(), calm.statistics());
}

#[test]
fn missing_start_values() {
    let mut irk =
        Irk::<Fragile, Gauss<2>>::new(Options { start: Start::Given, ..Default::default() }).unwrap();
    assert_eq!(irk.solve(&vector![1.0], &vector![1.0], 0.1).unwrap_err(), Error::StartNotGiven);
}
