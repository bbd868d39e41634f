//! What phases refuse, by name.

use crate::Test;
use casados::ocp::{
    Continuous, GeneralCost, HeapIpm, HeapOcp, HeapSqp, Horizon, Jump, OcpError, Part, Phases, Problem,
    Status,
};
use casados::prelude::*;

#[ode(duration = p)]
fn cart(x: [f64; 2], u: f64, _p: f64) -> [f64; 2] {
    [x[1], u]
}
#[ode]
fn carts(x: [f64; 3], _u: f64, _p: f64) -> [f64; 3] {
    [x[1], x[2], 0.0]
}
#[function]
fn effort(_x: [f64; 2], u: f64, _p: f64) -> f64 {
    u * u
}
#[function]
fn pair(x: [f64; 2], _u: f64, _p: f64) -> [f64; 2] {
    [x[0], x[1]]
}
#[function]
fn three(x: [f64; 2], _u: f64, _p: f64) -> [f64; 3] {
    [x[0], x[1], 0.0]
}
#[function]
fn of_three(x: [f64; 3], _u: f64, _p: f64) -> [f64; 2] {
    [x[0], x[1]]
}
#[function]
fn by_control(x: [f64; 2], u: f64, _p: f64) -> [f64; 2] {
    [x[0], x[1] + u]
}
#[function]
fn by_time(x: [f64; 2], _u: f64, _p: f64, t: f64) -> [f64; 2] {
    [x[0] + t, x[1]]
}

fn ride_phases() -> Result<HeapOcp<impl casados::ocp::ExactFormulation<f64>>, OcpError> {
    let mut ride = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
        .running_cost(GeneralCost::<Effort>::new())
        .on(Horizon::free(4, 0.5..=3.0, 1.0))?;
    ride.guess(&[0.0; 2], &[0.0])?;
    Ok(ride)
}

fn first() -> Result<HeapOcp<impl casados::ocp::ExactFormulation<f64>>, OcpError> {
    let mut ride = ride_phases()?;
    ride.fix_initial_state(&[0.0; 2])?;
    Ok(ride)
}

#[test]
fn invalid_links() -> Test {
    let (mut one, mut other) = (first()?, ride_phases()?);
    let error = Phases::new(&mut one).then(Jump::<Three>::new(), &mut other).join().err().ok_or("it fits")?;
    let expected =
        matches!(error, OcpError::LinkDimension { link: "Three", what: "output", expected: 2, found: 3 });
    assert!(expected, "{error}");
    assert!(error.to_string().contains("`Three` has 3 outputs instead of 2"));

    let error =
        Phases::new(&mut one).then(Jump::<OfThree>::new(), &mut other).join().err().ok_or("it fits")?;
    let expected =
        matches!(error, OcpError::LinkDimension { link: "OfThree", what: "x", expected: 2, found: 3 });
    assert!(expected, "{error}");

    let error = Phases::new(&mut one)
        .then(Jump::<ByControl>::new(), &mut other)
        .join()
        .err()
        .ok_or("there is none")?;
    let expected =
        matches!(error, OcpError::NotThere { function: "ByControl", variable: "u", terminal: true });
    assert!(expected, "{error}");

    let error =
        Phases::new(&mut one).then(Jump::<ByTime>::new(), &mut other).join().err().ok_or("it is free")?;
    assert!(matches!(error, OcpError::DependsOnTime { function: "ByTime" }), "{error}");

    let mut larger =
        Problem::new(Irk::<Carts, Gauss<2>>::new(Options::default())?).on(Horizon::uniform(3, 0.1))?;
    larger.set_parameters(.., &[1.0])?.guess(&[0.0; 3], &[0.0])?;
    let error = Phases::new(&mut one).then(Continuous, &mut larger).join().err().ok_or("it fits")?;
    let expected = matches!(error, OcpError::LinkDimension { link: "Continuous", expected: 3, found: 2, .. });
    assert!(expected, "{error}");
    Ok(())
}

#[test]
fn incomplete_phases() -> Test {
    let (mut one, mut other) = (ride_phases()?, ride_phases()?);
    let error = Phases::new(&mut one).then(Continuous, &mut other).join().err().ok_or("it is not said")?;
    assert!(matches!(error, OcpError::Missing { part: Part::InitialState, .. }), "{error}");

    let (mut one, mut other) = (first()?, first()?);
    let error = Phases::new(&mut one).then(Continuous, &mut other).join().err().ok_or("there are two")?;
    assert!(matches!(error, OcpError::Phase { phase: 1, model: "Cart", .. }), "{error}");
    assert!(error.to_string().contains("an initial state"), "{error}");

    let (mut one, mut other) = (first()?, ride_phases()?);
    other.shared("u")?;
    let error = Phases::new(&mut one).then(Continuous, &mut other).join().err().ok_or("it is shared")?;
    assert!(matches!(error, OcpError::Phase { phase: 1, .. }), "{error}");

    let (mut one, mut other) = (first()?, ride_phases()?);
    one.free_initial_state().periodic("x")?;
    let error = Phases::new(&mut one).then(Continuous, &mut other).join().err().ok_or("it is periodic")?;
    assert!(matches!(error, OcpError::Phase { phase: 0, .. }), "{error}");
    Ok(())
}

#[test]
fn invalid_times_and_names() -> Test {
    // Times that cross, and times that are none.
    let problem = || -> Result<_, OcpError> {
        Ok(Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
            .running_cost(GeneralCost::<Effort>::new()))
    };
    let error = problem()?.on(Horizon::free(4, 3.0..=1.0, 2.0)).err().ok_or("it is empty")?;
    let expected = matches!(error, OcpError::CrossedBounds { part: Part::ParameterBounds, name: "p", .. });
    assert!(expected, "{error}");
    let error = problem()?.on(Horizon::free(4, -1.0..=1.0, 0.5)).err().ok_or("it is negative")?;
    assert!(matches!(error, OcpError::Times { .. }), "{error}");
    let error = problem()?.on(Horizon::free(4, 1.0..=2.0, 5.0)).err().ok_or("it is outside")?;
    assert!(matches!(error, OcpError::OutOfRange { name: "p", .. }), "{error}");
    let error = ride_phases()?.bound("speed", .., 0.0, 1.0).err().ok_or("there is none")?;
    assert!(matches!(error, OcpError::UnknownName { known, .. } if known.model == "Cart"), "{error}");
    Ok(())
}

/// A verdict names the phase.
#[test]
fn phase_of_an_infeasible_constraint() -> Test {
    for by_sqp in [false, true] {
        let (mut one, mut other) = (first()?, ride_phases()?);
        one.bound("u", .., -1.0, 1.0)?.bound("x[0]", 4.., -1e3, 1.0)?;
        // In three seconds, from one metre and three metres per second.
        other.bound("u", .., -1.0, 1.0)?.bound("x[0]", 4.., 50.0, 50.0)?;
        let mut both = Phases::new(&mut one).then(Jump::<Pair>::new(), &mut other).join()?;
        let outcome = if by_sqp {
            HeapSqp::new(&both)?.solve(&mut both)?
        } else {
            HeapIpm::new(&both)?.solve(&mut both)?
        };
        let (Status::Infeasible { constraint, .. } | Status::InfeasibleQp { constraint, .. }) =
            outcome.status
        else {
            return Err(format!("it is infeasible: {outcome}").into());
        };
        assert_eq!((constraint.phase, constraint.name, constraint.stage), (Some(1), "x[0]", 4), "{outcome}");
        assert!(outcome.to_string().contains("`x[0]` at stage 4 of phase 1"), "{outcome}");
    }
    Ok(())
}
