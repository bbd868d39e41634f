//! What may be a mistake before a problem is solved, by name.

use crate::Test;
use casados::ocp::{Constraint, Horizon, Problem, Warning};
use casados::prelude::*;

#[ode]
fn cart(x: [f64; 2], u: f64, p: f64) -> [f64; 2] {
    [x[1], u / p]
}
#[function]
fn circle(x: [f64; 2], u: f64, _p: f64) -> [f64; 2] {
    [u * u + x[0] * x[0], x[0] + u]
}

fn warning_texts(warnings: &[Warning]) -> Vec<String> {
    warnings.iter().map(ToString::to_string).collect()
}

#[test]
fn names_in_warnings() -> Test {
    let circle = Constraint::<Circle>::new([1.0, -5.0], [1.0, 5.0]);
    let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
        .path_constraints(circle)
        .on(Horizon::uniform(3, 0.1))?;
    ocp.free_initial_state().set_parameters(.., &[1.0])?.guess(&[0.5, 0.0], &[0.5])?;
    assert_eq!(warning_texts(&ocp.warnings()?), [] as [&str; 0]);

    // Outside of bounds, where it is so by most; of the state at the start alone if that is free.
    ocp.guess_stage(2, &[0.5, 3.0], &[0.5])?.bound("x[1]", 1.., -1.0, 1.0)?;
    ocp.guess_stage(3, &[0.5, 1.5], &[])?;
    let warnings = ocp.warnings()?;
    let expected = "the guess 3e0 violates the upper bound of `x[1]` at stage 2, 1e0; solvers move it inside";
    assert_eq!(warning_texts(&warnings), [expected]);

    // At the origin nothing says where the circle is.
    ocp.guess(&[0.0, 0.0], &[0.0])?;
    let warnings = ocp.warnings()?;
    assert!(
        matches!(warnings[..], [Warning::VanishingGradient { constraint, violation }]
            if constraint.name == "Circle" && constraint.output == 0 && constraint.stage == 0 && violation == 1.0),
        "{:?}",
        warning_texts(&warnings)
    );

    // A mass in kg beside forces in giganewtons.
    ocp.guess(&[0.1, 0.0], &[0.5])?.free("p", 1e-3..=1e-2, 5e-3)?.bound("u", .., -1e9, 1e9)?;
    let warnings = ocp.warnings()?;
    assert_eq!(
        warnings,
        [Warning::FarUnits { small: ("p", 1e-2), large: ("u", 1e9) }],
        "{:?}",
        warning_texts(&warnings)
    );
    Ok(())
}

/// The first state is the one that is given, whatever its guess.
#[test]
fn guesses_of_given_states() -> Test {
    let mut ocp =
        Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?).on(Horizon::uniform(2, 0.1))?;
    ocp.fix_initial_state(&[1.0, 0.0])?.set_parameters(.., &[1.0])?.guess(&[0.0, 0.0], &[0.0])?;
    assert_eq!(ocp.warnings()?, []);
    Ok(())
}

#[ode]
fn boat(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1] * u, 0.0]
}
#[function]
fn twice(x: [f64; 2], _u: f64) -> f64 {
    2.0 * x[0]
}

/// Without a sail no wind moves a boat: an end elsewhere is out of reach, as a bound and as a
/// constraint. With a sail, or one that is free, it is not; nor is an end where it is anyway.
#[test]
fn unreachable_ends() -> Test {
    let mut ocp = Problem::new(Irk::<Boat, Gauss<2>>::new(Options::default())?)
        .terminal_constraints(Constraint::<Twice>::new([1.0], [4.0]))
        .on(Horizon::uniform(3, 0.1))?;
    ocp.fix_initial_state(&[0.25, 0.0])?.guess(&[0.25, 0.0], &[0.5])?.bound("x[0]", 3.., 1.0, 1.0)?;
    ocp.guess_stage(3, &[1.0, 0.0], &[])?;
    let warnings = ocp.warnings()?;
    let [Warning::UnreachableEnd { bound, value, limit }, Warning::UnreachableEnd { bound: other, .. }] =
        warnings[..]
    else {
        return Err(format!("{:?}", warning_texts(&warnings)).into());
    };
    assert!((value - 0.25).abs() < 1e-12);
    assert_eq!((bound.name, bound.stage, limit), ("x[0]", 3, 1.0));
    assert_eq!((other.name, other.output), ("Twice", 0));
    assert!(warnings[0].to_string().starts_with("the lower bound of `x[0]` at stage 3, 1e0, is unreach"));
    ocp.guess_stage(3, &[0.25, 0.0], &[])?
        .bound("x[0]", 3.., 0.25, 0.25)?
        .set_terminal_bounds(&[0.0], &[0.5])?;
    assert_eq!(warning_texts(&ocp.warnings()?), [] as [&str; 0]);

    ocp.bound("x[0]", 3.., 1.0, 1.0)?.set_terminal_bounds(&[1.0], &[4.0])?;
    ocp.fix_initial_state(&[0.25, 1.0])?.guess(&[1.0, 1.0], &[0.5])?;
    assert_eq!(warning_texts(&ocp.warnings()?), [] as [&str; 0]);
    // Of a control that is given nothing is moved, and a free sail is a way.
    ocp.bound("u", .., 0.5, 0.5)?;
    assert_eq!(ocp.warnings()?.len(), 2);
    ocp.free_initial_state();
    assert_eq!(warning_texts(&ocp.warnings()?), [] as [&str; 0]);
    Ok(())
}
