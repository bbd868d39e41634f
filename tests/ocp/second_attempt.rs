//! A pendulum that falls on a cart with short rails, over horizons in which it swings many times:
//! from a guess of zeros violations stay at first, where a simulation has none.
//!
//! Objectives are those of IPOPT 3.14 (CasADi 3.8.2) on the same discretisation with multiple
//! shooting from the same guess, with default options.

use super::Test;
use casados::ocp::{GeneralCost, HeapIpm, Horizon, Problem, Shooting};
use casados::prelude::*;

const LENGTH: f64 = 0.05;
const RAIL: f64 = 0.5;

/// x = [position m, angle rad from above, velocity m/s, rate rad/s], u = force N; a cart of 1 kg, a
/// pendulum of 0.1 kg and 0.8 m.
#[ode]
fn cart_pole(x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    let [_, theta, v, omega] = x;
    let (s, c) = theta.sin_cos();
    let d = 1.1 - 0.1 * c * c;
    [
        v,
        omega,
        (-0.08 * s * omega * omega + 0.981 * c * s + u[0]) / d,
        (-0.08 * c * s * omega * omega + u[0] * c + 1.1 * 9.81 * s) / (0.8 * d),
    ]
}

#[function]
fn effort(x: [f64; 4], u: [f64; 1]) -> f64 {
    1e-2 * (u[0] * u[0] + x[1] * x[1]) + 1e-3 * (x[0] * x[0] + x[2] * x[2] + x[3] * x[3])
}

#[test]
fn violations_that_stay_are_not_the_last_word_where_a_simulation_has_none() -> Test {
    for (intervals, objective) in [(60, 7.082_370_438), (80, 7.642_161_928)] {
        let batch = Batch::<CartPole, Rk4>::new(Options::default())?;
        let mut ocp = Problem::new(Shooting::new(batch))
            .stage_cost(GeneralCost::<Effort>::new())
            .on(Horizon::uniform(intervals, LENGTH))?;
        ocp.fix_initial_state(&[0.0, 0.4, 0.0, 0.0])?.bound("u", .., -5.0, 5.0)?;
        ocp.bound("x[0]", 1.., -RAIL, RAIL)?.guess(&[0.0; 4], &[0.0])?;
        let outcome = HeapIpm::new(&ocp)?.solve(&mut ocp)?;
        assert!(outcome.is_converged(), "{intervals} intervals: {outcome}");
        // IPOPT relaxes bounds by 1e-8, and bounds cost 1 for each metre or newton at most.
        let apart = (outcome.objective - objective).abs();
        assert!(apart <= 1e-7 * objective, "{intervals} intervals: {apart:e} from IPOPT");

        // By another implementation of the dynamics: gaps, and bounds.
        let mut erk = Erk::<CartPole, Rk4>::new(Options::default())?;
        for k in 0..intervals {
            let (here, next) = (ocp.stage(k)?, ocp.stage(k + 1)?);
            let x = nalgebra::Vector4::from_column_slice(here.x);
            let end = erk.solve(&x, &nalgebra::Vector1::new(here.u[0]), LENGTH)?.x;
            let gap = (end - nalgebra::Vector4::from_column_slice(next.x)).amax();
            assert!(gap < 1e-6, "a gap of {gap:e} after interval {k}");
            assert!(here.u[0].abs() <= 5.0 + 1e-6 && next.x[0].abs() <= RAIL + 1e-6);
        }
    }
    Ok(())
}
