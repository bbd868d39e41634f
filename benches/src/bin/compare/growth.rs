//! How cost grows with the size of the chain, and what accuracy costs.

use super::casadi::Casadi;
use super::rows::{Measured, Timer, run_in_turn};
use super::{Failure, MeasurementBudget};
use casados::prelude::*;
use casados_benches::case::{Case, Family, Mode};
use casados_benches::time::log_log_slope;

/// Times of one method over the size of the chain.
pub struct ScalingWithSize {
    pub stages: usize,
    pub steps: usize,
    /// States, and the times of the four modes.
    pub points: Vec<(usize, [Measured; 4])>,
}

impl ScalingWithSize {
    pub fn measure(
        masses: &[usize],
        stages: usize,
        steps: usize,
        effort: MeasurementBudget,
    ) -> Result<Self, Failure> {
        let cases: Vec<_> = masses.iter().map(|m| Case::chain(*m, Family::Gauss, stages, steps)).collect();
        let questions = cases.iter().flat_map(|case| Mode::ALL_MODES.map(|mode| (case, mode)));
        let timers = questions.map(|(case, mode)| Timer::new(case, 1e-8, Start::Zero, mode, 0..1));
        let times = run_in_turn(timers.collect::<Result<_, _>>()?, effort)?;
        let points = cases.iter().zip(times.chunks_exact(4)).map(|(c, t)| (c.nx, [t[0], t[1], t[2], t[3]]));
        Ok(Self { stages, steps, points: points.collect() })
    }

    /// The slope of log time over log nx.
    pub fn fitted_exponent(&self, mode: usize) -> f64 {
        log_log_slope(self.points.iter().map(|(nx, times)| (*nx as f64, times[mode].time.median)))
    }

    /// The same of the time for each iteration of Newton's method: longer chains need more of them.
    pub fn fitted_exponent_per_iteration(&self, mode: usize) -> f64 {
        let time = |measured: &Measured| measured.time.median / measured.iterations as f64;
        log_log_slope(self.points.iter().map(|(nx, times)| (*nx as f64, time(&times[mode]))))
    }
}

/// A time and the errors of state and Jacobian against the exact flow.
pub struct Precision {
    pub stages: usize,
    pub steps: usize,
    pub simulation: Measured,
    pub forward: Measured,
}

/// A chain of 5 masses: Gauss-Legendre with 1 to 5 stages, 1 to 8 steps.
pub fn work_precision(
    casadi: &mut Casadi,
    effort: MeasurementBudget,
) -> Result<(Vec<Precision>, f64), Failure> {
    let (flow, uncertainty) = casadi.exact_flow(&Case::chain(5, Family::Gauss, 4, 1))?;
    let mut methods = Vec::new();
    let mut timers = Vec::new();
    for stages in 1..=5 {
        for steps in [1, 2, 4, 8] {
            let mut case = Case::chain(5, Family::Gauss, stages, steps);
            case.reference = Some(("flow", flow.clone()));
            methods.push((stages, steps));
            for mode in [Mode::Simulation, Mode::Forward] {
                timers.push(Timer::new(&case, 0.0, Start::Zero, mode, 0..1)?);
            }
        }
    }
    let times = run_in_turn(timers, effort)?;
    let all = methods.into_iter().zip(times.chunks_exact(2)).map(|((stages, steps), t)| Precision {
        stages,
        steps,
        simulation: t[0],
        forward: t[1],
    });
    Ok((all.collect(), uncertainty))
}
