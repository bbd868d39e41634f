//! Guesses that are not plain.

use crate::{Test, ocps};
use casados::ocp::{Formulation, GeneralCost, HeapIpm, HeapOcp, HeapSqp, Horizon, Problem, SecondOrder};
use casados::prelude::*;
use casados::{Erk, Rk4};

/// A number from −1 to 1 for each stage and state.
fn noise(seed: f64, stage: usize, state: usize) -> f64 {
    let angle = 12.9898 * (stage as f64 + 1.0) + 78.233 * (state as f64 + 1.0) + 37.719 * seed;
    let value = angle.sin() * 4375.85453;
    2.0 * (value - value.floor()) - 1.0
}

/// Adds noise to the states of the guess: that part of how far each of them goes, and of 0.1.
fn disturb<P: Formulation<f64>>(ocp: &mut HeapOcp<P>, part: f64, seed: f64) -> Test {
    let last = ocp.intervals();
    let ends = (ocp.stage(0)?.x.to_vec(), ocp.stage(last)?.x.to_vec());
    for k in 0..=last {
        let x = ocp.iterate_mut().stage_mut(k).ok_or("no stage")?.x;
        for (i, (x, (a, b))) in x.iter_mut().zip(ends.0.iter().zip(&ends.1)).enumerate() {
            *x += part * ((a - b).abs() + 0.1) * noise(seed, k, i);
        }
    }
    Ok(())
}

fn assert_convergence<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(ocp: &mut HeapOcp<P>) -> Test {
    let mut sqp = HeapSqp::new(ocp)?;
    let outcome = sqp.solve(ocp)?;
    println!("{}{outcome}", sqp.log());
    if outcome.is_converged() { Ok(()) } else { Err(outcome.to_string().into()) }
}

/// Gaps of the guess are closed before violations are compared: the swing-up is feasible.
#[test]
fn disturbed_swing_ups() -> Test {
    for (part, seed) in [(0.1, 1.0), (0.1, 2.0), (0.3, 3.0), (0.3, 4.0)] {
        let mut ocp = ocps::mechanics::pendulum(ocps::GIVEN)?;
        disturb(&mut ocp, part, seed)?;
        assert_convergence(&mut ocp)?;
    }
    Ok(())
}

/// The same point at all nodes.
#[test]
fn constant_guess_of_a_chain() -> Test {
    let mut ocp = ocps::textbook::hanging_chain(ocps::GIVEN)?;
    ocp.guess(&[1.0, 0.0, 0.0], &[2.0])?;
    assert_convergence(&mut ocp)
}

/// The density of the atmosphere overflows below the ground, where bounds do not let the rocket be.
#[test]
fn guess_outside_of_the_domain() -> Test {
    for seed in [3.0, 4.0] {
        let mut ocp = ocps::flight::goddard(ocps::GIVEN)?;
        disturb(&mut ocp, 0.3, seed)?;
        assert!(ocp.linearise(casados::ocp::Exact::default()).is_err());
        assert_convergence(&mut ocp)?;
    }
    Ok(())
}

/// From the start everywhere a car is held by the first disc, where violations have a minimum; from
/// the middle gaps are as large as violations, and are closed first. The second attempt begins at a
/// simulation, which drives through.
#[test]
fn constant_guess_among_obstacles() -> Test {
    for place in [0.0, 5.0] {
        let mut ocp = ocps::vehicles::obstacles(ocps::GIVEN)?;
        ocp.guess(&[place, 0.0, 0.0, 1.0], &[0.0; 2])?;
        assert_convergence(&mut ocp)?;
    }
    Ok(())
}

/// The end everywhere: at the start that is far from the state that is given.
#[test]
fn constant_guess_of_a_swing_up() -> Test {
    let mut ocp = ocps::mechanics::pendulum(ocps::GIVEN)?;
    ocp.guess(&[std::f64::consts::PI, 0.0], &[0.0])?;
    assert_convergence(&mut ocp)
}

/// People who may fall ill, who are, who have been or are vaccinated, and doses; doses a day.
#[ode]
fn epidemic(x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    let infections = 0.4 * x[0] * x[1] / 1e6;
    [-infections - u[0], infections - 0.1 * x[1], 0.1 * x[1] + u[0], u[0]]
}

#[function]
fn burden(x: [f64; 4], u: [f64; 1]) -> f64 {
    x[1] + 1e-4 * u[0] * u[0]
}

fn vaccination() -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, ocps::Failure> {
    let n = 60;
    let mut ocp = Problem::new(Erk::<Epidemic, Rk4>::new(Options::default())?)
        .running_cost(GeneralCost::<Burden>::new())
        .on(Horizon::uniform(n, 2.0))?;
    let start = [990e3, 10e3, 0.0, 0.0];
    ocp.fix_initial_state(&start)?.bound("u", .., 0.0, 15e3)?;
    ocp.bound("x[0]", .., 0.0, f64::INFINITY)?.bound("x[3]", .., 0.0, 400e3)?;
    ocps::line(&mut ocp, &start, &[500e3, 0.0, 500e3, 0.0], &[0.0])?;
    Ok(ocp)
}

/// Along the guess an epidemic grows by ten powers of ten in the linearised dynamics: gaps that are
/// closed there leave no QP that is solved. Those of a simulation are closed.
#[test]
fn gaps_over_unstable_dynamics() -> Test {
    let (mut one, mut other) = (vaccination()?, vaccination()?);
    let by_sqp = HeapSqp::new(&one)?.solve(&mut one)?;
    let by_ipm = HeapIpm::new(&other)?.solve(&mut other)?;
    assert!(by_sqp.is_converged() && by_sqp.iterations <= 20, "{by_sqp}");
    assert!(by_ipm.is_converged(), "{by_ipm}");
    // Stationary in units: of forces 1e4, tolerances are a hundredth of it.
    assert!((by_sqp.objective - by_ipm.objective).abs() <= 1e-6 * by_sqp.objective, "{by_sqp}{by_ipm}");
    Ok(())
}
