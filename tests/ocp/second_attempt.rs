//! A pendulum that falls on a cart with short rails, over horizons in which it swings many times:
//! from a guess of zeros violations stay at first, where a simulation has none.
//!
//! Objectives are those of IPOPT 3.14 (CasADi 3.8.2) on the same discretisation with multiple
//! shooting from the same guess, with default options.

use super::Test;
use super::ipm::{CartPole, Effort, solve};
use casados::ocp::{Formulation, GeneralCost, HeapOcp, HeapSqp, Horizon, Problem, SecondOrder, Shooting};
use casados::prelude::*;
use casados::qp::residuals;

const LENGTH: f64 = 0.05;
const RAIL: f64 = 0.5;
/// Intervals, IPOPT's objective, and its iterations.
const IPOPT_RESULTS: [(u8, f64, usize); 2] = [(60, 7.082_370_438, 82), (80, 7.642_161_928, 211)];

fn falling(
    intervals: u8,
) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Box<dyn std::error::Error>> {
    let batch = Batch::<CartPole, Rk4>::new(Options::default())?;
    let mut ocp = Problem::new(Shooting::new(batch))
        .stage_cost(GeneralCost::<Effort>::new())
        .on(Horizon::uniform(usize::from(intervals), LENGTH))?;
    ocp.fix_initial_state(&[0.0, 0.4, 0.0, 0.0])?.bound("u", .., -5.0, 5.0)?;
    ocp.bound("x[0]", 1.., -RAIL, RAIL)?.guess(&[0.0; 4], &[0.0])?;
    Ok(ocp)
}

/// Of gaps, by an integrator of single intervals, and of bounds.
fn is_feasible(ocp: &HeapOcp<impl Formulation<f64>>, intervals: u8) -> Test {
    let mut erk = Erk::<CartPole, Rk4>::new(Options::default())?;
    for k in 0..usize::from(intervals) {
        let (here, next) = (ocp.stage(k)?, ocp.stage(k + 1)?);
        let x = nalgebra::Vector4::from_column_slice(here.x);
        let end = erk.solve(&x, &nalgebra::Vector1::new(here.u[0]), LENGTH)?.x;
        let gap = (end - nalgebra::Vector4::from_column_slice(next.x)).amax();
        assert!(gap < 1e-6, "a gap of {gap:e} after interval {k}");
        assert!(here.u[0].abs() <= 5.0 + 1e-6 && next.x[0].abs() <= RAIL + 1e-6);
    }
    Ok(())
}

/// IPOPT ends with a barrier of 2.5e-9 for each bound, of which there are four for each interval.
/// It relaxes them by 1e-8, which their multipliers make 1.5e-10.
fn barrier_share(intervals: u8) -> f64 {
    2.5e-9 * 4.0 * f64::from(intervals)
}

#[test]
fn restart_from_a_feasible_simulation() -> Test {
    for (intervals, objective, iterations) in IPOPT_RESULTS {
        let mut ocp = falling(intervals)?;
        let outcome = solve(&mut ocp)?;
        let apart = (outcome.objective - objective).abs();
        assert!(apart <= barrier_share(intervals), "{intervals} intervals: {apart:e} from IPOPT");
        assert!(outcome.iterations <= iterations, "{outcome}");
        is_feasible(&ocp, intervals)?;
    }
    Ok(())
}

#[test]
fn restart_during_elastic_mode() -> Test {
    for (intervals, objective, iterations) in IPOPT_RESULTS {
        let mut ocp = falling(intervals)?;
        let mut sqp = HeapSqp::new(&ocp)?;
        sqp.options.tolerance = 1e-9;
        let outcome = sqp.solve(&mut ocp)?;
        assert!(outcome.is_converged() && outcome.iterations <= iterations, "{outcome}\n{}", sqp.log());
        let (judged, _) = residuals(ocp.qp(), ocp.iterate());
        assert!(judged.largest() <= 1e-8, "{judged}");
        let apart = (outcome.objective - objective).abs();
        assert!(apart <= barrier_share(intervals), "{intervals} intervals: {apart:e} from IPOPT");
        is_feasible(&ocp, intervals)?;
    }
    Ok(())
}
