//! How cost grows with the size of the chain, and what accuracy costs.

use super::casadi::Casadi;
use super::rows::{Measured, time};
use super::{Effort, Failure};
use casados::prelude::*;
use casados_benches::case::{Case, Family, Mode};
use casados_benches::time::slope;

/// Times of one method over the size of the chain.
pub struct Growth {
    pub stages: usize,
    pub steps: usize,
    /// States, and the times of the four modes.
    pub points: Vec<(usize, [Measured; 4])>,
}

impl Growth {
    pub fn measure(masses: &[usize], stages: usize, steps: usize, effort: Effort) -> Result<Self, Failure> {
        let mut points = Vec::new();
        for masses in masses {
            let case = Case::chain(*masses, Family::Gauss, stages, steps);
            let mut times = [Measured::default(); 4];
            for (measured, mode) in times.iter_mut().zip(Mode::ALL) {
                *measured = time(&case, 1e-8, Start::Zero, mode, 0..1, effort)?;
            }
            points.push((case.nx, times));
        }
        Ok(Self { stages, steps, points })
    }

    /// The slope of log time over log nx, by least squares over the sizes from `nx` on.
    pub fn exponent(&self, mode: usize, from: usize) -> f64 {
        let points = self.points.iter().filter(|(nx, _)| *nx >= from);
        slope(points.map(|(nx, times)| (*nx as f64, times[mode].time.median)))
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
pub fn work_precision(casadi: &mut Casadi, effort: Effort) -> Result<(Vec<Precision>, f64), Failure> {
    let (flow, uncertainty) = casadi.flow(&Case::chain(5, Family::Gauss, 4, 1))?;
    let mut all = Vec::new();
    for stages in 1..=5 {
        for steps in [1, 2, 4, 8] {
            let mut case = Case::chain(5, Family::Gauss, stages, steps);
            case.reference = Some(("flow", flow.clone()));
            let one = |mode| time(&case, 0.0, Start::Zero, mode, 0..1, effort);
            let (simulation, forward) = (one(Mode::Simulation)?, one(Mode::Forward)?);
            all.push(Precision { stages, steps, simulation, forward });
        }
    }
    Ok((all, uncertainty))
}
