//! Derivatives of solutions of phases, against differences of problems that are solved again.

use crate::Test;
use casados::ocp::{
    Constraint, Continuous, ExactFormulation, GeneralCost, HeapIpm, HeapOcp, Horizon, Jump, OcpError,
    PhaseFactors, Phases, Problem,
};
use casados::prelude::*;

type Failure = Box<dyn std::error::Error>;

/// A sledge that is pushed for a free time: place and speed, a mass that is found, a friction, and
/// a price of the push.
#[ode(duration = p.duration)]
mod sledge {
    pub struct Data {
        pub duration: f64,
        pub mass: f64,
        pub friction: f64,
        pub price: f64,
    }
    pub fn sledge(x: [f64; 2], u: f64, p: &Data) -> [f64; 2] {
        [x[1], (u - p.friction * x[1] * x[1]) / p.mass]
    }
    #[function]
    fn costs(_x: [f64; 2], u: f64, p: &Data) -> f64 {
        1.0 + p.price * u * u + 0.1 * p.mass * p.friction
    }
    #[function]
    fn power(x: [f64; 2], u: f64, p: &Data) -> f64 {
        u * x[1] * p.friction
    }
    /// The sledge leaves a load behind: it enters water with a part of its speed.
    #[function]
    fn splash(x: [f64; 2], _u: f64, p: &Data) -> [f64; 3] {
        [x[0] * p.friction, x[1] / (1.0 + p.price * p.mass * x[1]), p.mass]
    }
}

/// In water: place, speed and mass; two controls, a drag and a target.
#[ode]
mod boat {
    pub struct Data {
        pub drag: f64,
        pub target: f64,
    }
    pub fn boat(x: [f64; 3], u: [f64; 2], p: &Data) -> [f64; 3] {
        [x[1], (u[0] - p.drag * x[1]) / x[2], u[1] - 0.1 * x[2]]
    }
    #[function]
    fn effort(x: [f64; 3], u: [f64; 2], p: &Data) -> f64 {
        u[0] * u[0] + 0.5 * u[1] * u[1] + 0.2 * x[2] * p.drag * x[2]
    }
    #[function]
    fn arrival(x: [f64; 3], _u: [f64; 2], p: &Data) -> [f64; 2] {
        [x[0] * p.drag - p.target, x[1] - 0.1 * p.target]
    }
}

type Both<A, B> = (HeapOcp<A>, HeapOcp<B>);

/// The two phases at an initial state and parameters of each; with an active bound of the power.
fn phases(
    x0: &[f64],
    p: [&[f64]; 2],
    largest_power: f64,
) -> Result<Both<impl ExactFormulation<f64>, impl ExactFormulation<f64>>, OcpError> {
    let n = 5;
    let mut slide = Problem::new(Erk::<Sledge, Rk4>::new(Options::default())?)
        .running_cost(GeneralCost::<Costs>::new())
        .path_constraints(Constraint::<Power>::new([-9.0], [largest_power]))
        .on(Horizon::free(n, 0.1..=9.0, 1.5))?;
    slide.set_parameters(.., p[0])?.free("p.mass", 0.2..=9.0, 1.0)?;
    slide.fix_initial_state(x0)?.guess(&[1.0, 1.0], &[0.5])?.bound("x[0]", n.., 2.0, 2.0)?;
    let mut boat = Problem::new(Irk::<Boat, Gauss<2>>::new(Options::default())?)
        .running_cost(GeneralCost::<Effort>::new())
        .terminal_constraints(Constraint::<Arrival>::new([0.0; 2], [0.0; 2]))
        .on(Horizon::uniform(4, 0.4))?;
    boat.set_parameters(.., p[1])?.guess(&[2.0, 0.5, 1.0], &[0.1, 0.1])?.bound("u[1]", .., -5.0, 0.2)?;
    Ok((slide, boat))
}

/// Value, and states, controls and parameters of both phases, one after the other.
fn numbers(x0: &[f64], p: [&[f64]; 2], largest_power: f64) -> Result<Vec<f64>, Failure> {
    let (mut slide, mut boat) = phases(x0, p, largest_power)?;
    let value = {
        let mut both = Phases::new(&mut slide).then(Jump::<Splash>::new(), &mut boat).join()?;
        solve(&mut both)?
    };
    let mut list = vec![value];
    for stage in slide.iterate().stages() {
        list.extend(stage.x.iter().chain(stage.u));
    }
    for stage in boat.iterate().stages() {
        list.extend(stage.x.iter().chain(stage.u));
    }
    Ok(list)
}

fn solve(both: &mut HeapOcp<Phases<'_>>) -> Result<f64, Failure> {
    let mut ipm = HeapIpm::new(both)?;
    ipm.options.tolerance = 1e-12;
    ipm.options.final_mu = 1e-13;
    ipm.options.acceptable_tolerance = 1e-10;
    let outcome = ipm.solve(both)?;
    assert!(outcome.residuals.largest() < 1e-9, "{outcome}");
    Ok(outcome.objective)
}

/// Differences of order four with a step of 2e-3: solutions are exact to 1e-10, or 1e-7 of slopes.
#[test]
fn differences_of_solutions() -> Test {
    const STEP: f64 = 2e-3;
    let (x0, p) = ([0.1, 0.3], [vec![1.0, 1.0, 0.7, 0.2], vec![0.6, 1.8]]);
    for largest_power in [9.0, 1.2] {
        let (mut slide, mut boat) = phases(&x0, [&p[0], &p[1]], largest_power)?;
        let mut both = Phases::new(&mut slide).then(Jump::<Splash>::new(), &mut boat).join()?;
        solve(&mut both)?;
        let mut factors = PhaseFactors::new(&both)?;
        both.factorise_phases(&mut factors)?;
        assert_eq!(factors.weakly_active(), 0);
        let (mut changed, mut active) = (0, 0);
        let names = [(0, "x[0]"), (1, "x[1]")].map(|(i, name)| (0, 2, i, name));
        let of_slide = [(2, "p.friction"), (3, "p.price")].map(|(i, name)| (0, 0, i, name));
        let of_boat = [(0, "p.drag"), (1, "p.target")].map(|(i, name)| (1, 1, i, name));
        for (phase, list, i, name) in names.into_iter().chain(of_slide).chain(of_boat) {
            let at = |times: f64| {
                let (mut x0, mut p) = (x0, p.clone());
                if list == 2 {
                    x0[i] += times * STEP
                } else {
                    p[list][i] += times * STEP
                }
                numbers(&x0, [&p[0], &p[1]], largest_power)
            };
            let [far_below, below, above, far_above] = [at(-2.0)?, at(-1.0)?, at(1.0)?, at(2.0)?];
            let slope =
                |j: usize| (8.0 * (above[j] - below[j]) - (far_above[j] - far_below[j])) / (12.0 * STEP);
            let value =
                if list == 2 { factors.value_gradient_x0()[i] } else { factors.value_gradient_p(phase)[i] };
            let direction = if list == 2 {
                factors.by_initial_state(name)?
            } else {
                factors.by_parameter(phase, name)?
            };
            let mut found = vec![value];
            for k in 0..=5 {
                found.extend(direction.state(0, k));
                found.extend(direction.free_parameters(0));
                found.extend(direction.control(0, k));
            }
            for k in 0..=4 {
                found.extend(direction.state(1, k).iter().chain(direction.control(1, k)));
            }
            for (j, found) in found.iter().enumerate() {
                let expected = slope(j);
                let tolerance = 2e-7 * (1.0 + expected.abs());
                assert!((found - expected).abs() < tolerance, "{name} {j}: {found} {expected} {tolerance:e}");
                changed += usize::from(expected.abs() > 1e-2);
            }
            active += usize::from(direction.control(1, 0)[1] == 0.0);
            // An adjoint of elements of both phases, by name.
            let expected = 0.7 * direction.state(0, 3)[1] - 1.3 * direction.free_parameters(0)[1]
                + 0.4 * direction.control(1, 2)[0]
                - direction.state(1, 4)[2]
                + 0.9 * direction.control(0, 1)[0];
            let seed = [
                (0, 3, "x[1]", 0.7),
                (0, 0, "p.mass", -1.3),
                (1, 2, "u[0]", 0.4),
                (1, 4, "x[2]", -1.0),
                (0, 1, "u", 0.9),
            ];
            let adjoint = factors.adjoint(&seed)?;
            let product = if list == 2 { adjoint.x0[i] } else { adjoint.p[phase][i] };
            assert!(
                (product - expected).abs() < 1e-8 * (1.0 + expected.abs()),
                "{name}: {product} {expected}"
            );
        }
        assert!(changed > 100 && active == 0, "{changed} {active}");
    }
    Ok(())
}

/// Free parameters have no derivatives, other names are refused, and so is the memory of other
/// phases.
#[test]
fn names() -> Test {
    let p = [vec![1.0, 1.0, 0.7, 0.2], vec![0.6, 1.8]];
    let (mut slide, mut boat) = phases(&[0.1, 0.3], [&p[0], &p[1]], 9.0)?;
    let mut both = Phases::new(&mut slide).then(Jump::<Splash>::new(), &mut boat).join()?;
    solve(&mut both)?;
    let mut factors = PhaseFactors::new(&both)?;
    both.factorise_phases(&mut factors)?;
    assert!(factors.by_parameter(0, "p.mass")?.state(1, 4).iter().all(|slope| *slope == 0.0));
    assert_eq!(factors.value_gradient_p(0)[..2], [0.0; 2]);
    let direction = factors.by_parameter(1, "p.drag")?;
    assert!(direction.state(2, 0).is_empty() && direction.state(1, 5).is_empty());
    assert!(direction.control(1, 4).is_empty() && direction.free_parameters(1).is_empty());
    let error = factors.by_initial_state("x[2]").err().ok_or("there is none")?;
    assert!(matches!(error, OcpError::UnknownName { .. }), "{error}");
    let error = factors.by_parameter(1, "p.mass").err().ok_or("there is none")?;
    assert!(matches!(error, OcpError::UnknownParameter { .. }), "{error}");
    let error = factors.by_parameter(2, "p.mass").err().ok_or("there is none")?;
    assert!(matches!(error, OcpError::NoSuchPhase { phase: 2, phases: 2 }), "{error}");
    let seed = |phase, stage, name, weight| (phase, stage, name, weight);
    let error = factors.adjoint(&[seed(0, 6, "x[0]", 1.0)]).err().ok_or("there is none")?;
    assert!(matches!(error, OcpError::NoSuchStage { stage: 6, stages: 6, .. }), "{error}");
    let error = factors.adjoint(&[seed(1, 4, "u[0]", 1.0)]).err().ok_or("there is none")?;
    assert!(matches!(error, OcpError::NoSuchStage { stage: 4, stages: 4, .. }), "{error}");
    let error = factors.adjoint(&[seed(1, 0, "p.drag", 1.0)]).err().ok_or("it is no variable")?;
    assert!(matches!(error, OcpError::UnknownName { .. }), "{error}");
    let error = factors.adjoint(&[seed(1, 0, "x[0]", f64::NAN)]).err().ok_or("it is no number")?;
    assert!(matches!(error, OcpError::InvalidValue { .. }), "{error}");
    drop(both);
    let mut alone = Phases::new(&mut slide).join()?;
    let error = alone.factorise_phases(&mut factors).err().ok_or("these are others")?;
    assert!(matches!(error, OcpError::Length { .. }), "{error}");
    factors = PhaseFactors::new(&alone)?;
    factors.set_smoothing(-1.0);
    let error = alone.factorise_phases(&mut factors).err().ok_or("it is negative")?;
    assert!(matches!(error, OcpError::InvalidOption { name: "smoothing", .. }), "{error}");
    Ok(())
}

/// A phase whose bounds are at points inside of intervals is refused by its number.
#[test]
fn points_inside_intervals() -> Test {
    let mut slide = Problem::new(Erk::<Sledge, Rk4>::new(Options::default())?)
        .path_constraints(Constraint::<Power>::new([-9.0], [9.0]))
        .on(Horizon::free(2, 0.1..=9.0, 1.5))?;
    slide.set_parameters(.., &[1.0; 4])?.fix_initial_state(&[0.0; 2])?.guess(&[1.0, 1.0], &[0.5])?;
    let mut other = Problem::new(Erk::<Sledge, Rk4>::new(Options::default())?)
        .path_constraints(Constraint::<Power>::new([-9.0], [9.0]))
        .on(Horizon::uniform(2, 0.5))?;
    other.inside(&[0.5])?.set_parameters(.., &[1.0; 4])?.guess(&[1.0, 1.0], &[0.5])?;
    let mut both = Phases::new(&mut slide).then(Continuous, &mut other).join()?;
    let mut factors = PhaseFactors::new(&both)?;
    let error = both.factorise_phases(&mut factors).err().ok_or("it is supported")?;
    assert!(matches!(error, OcpError::Unsupported { .. }), "{error}");
    Ok(())
}
