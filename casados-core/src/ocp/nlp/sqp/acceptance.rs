//! Whether a point is good enough: merit function and filter.

use super::options::Globalisation;
use crate::ocp::nlp::filter::{ETA_PHI, Filter, Measure, objective_decides};

/// What a line search remembers.
#[derive(Clone, Copy, Debug)]
pub(in crate::ocp::nlp) struct Search {
    pub filter: Filter,
    /// Whether the last step was a full one: then the next full step is tried by linearising there,
    /// which is not to be done again.
    pub full: bool,
    /// Seconds of the linearisation at the iterate, if there is one.
    pub linearised: Option<f64>,
}

/// A line search: where it begins, and what it expects.
#[derive(Clone, Copy)]
pub(in crate::ocp::nlp) struct Line {
    pub here: Measure,
    /// Of the objective.
    pub slope: f64,
}

impl Line {
    /// Whether the merit function, if it is a parabola along the step, has its least before the end
    /// of a step of this length: whether it shrinks by less than half of what its slope promises.
    pub fn overshoots(&self, length: f64, there: &Measure) -> bool {
        let promised = length * (self.slope - self.here.violation);
        there.merit() - self.here.merit() > 0.5 * promised.min(0.0) + self.noise()
    }

    /// Near the solution, differences are roundings.
    fn noise(&self) -> f64 {
        1e4 * f64::EPSILON * (1.0 + self.here.objective.abs() + self.here.violation)
    }
}

impl Search {
    pub fn new() -> Self {
        Self { filter: Filter::new(f64::INFINITY), full: true, linearised: None }
    }

    /// Whether a point is good enough after a step of this length.
    pub fn accepts(&mut self, by: Globalisation, length: f64, line: &Line, there: &Measure) -> bool {
        let Line { here, slope } = line;
        if !there.is_finite() {
            return false;
        }
        let noise = line.noise();
        match by {
            Globalisation::FullStep => true,
            Globalisation::Merit => {
                let slope = slope - here.violation;
                there.merit() <= here.merit() + ETA_PHI * length * slope.min(0.0) + noise
            }
            Globalisation::Filter => {
                if !self.filter.admits(there, noise) {
                    return false;
                }
                if objective_decides(length, *slope, here.violation) {
                    return there.objective <= here.objective + ETA_PHI * length * slope + noise;
                }
                self.filter.improves(there, here, noise)
            }
        }
    }
}
