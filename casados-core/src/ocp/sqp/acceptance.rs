//! Whether a point is good enough: merit function and filter.

use super::options::{Globalisation, SqpOptions};
use crate::ocp::filter::{Filter, Measure, objective_decides};

/// `γ_φ`: what the objective of a new iterate must be better by, as a part of the violation.
const MARGIN: f64 = 1e-5;
/// The part of the expected decrease that is enough.
const ARMIJO: f64 = 1e-4;

/// What a line search remembers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    pub filter: Filter,
    /// Whether the last step was a full one: then the next full step is tried by linearising there,
    /// which is not to be done again.
    pub full: bool,
    /// Seconds of the linearisation at the iterate, if there is one.
    pub linearised: Option<f64>,
}

/// A line search: where it begins, and what it expects.
#[derive(Clone, Copy)]
pub(super) struct Line {
    pub here: Measure,
    /// Of the objective.
    pub slope: f64,
}

impl Search {
    pub fn new() -> Self {
        Self { filter: Filter::new(MARGIN, f64::INFINITY), full: true, linearised: None }
    }

    /// Whether a point is good enough after a step of this length.
    pub fn accepts(&mut self, options: &SqpOptions, length: f64, line: &Line, there: &Measure) -> bool {
        let Line { here, slope } = line;
        if !there.is_finite() {
            return false;
        }
        // Near the solution, differences are roundings.
        let noise = 1e4 * f64::EPSILON * (1.0 + here.objective.abs() + here.violation);
        match options.globalisation {
            Globalisation::FullStep => true,
            Globalisation::Merit => {
                let merit = |m: &Measure| m.objective + m.violation;
                let slope = slope - here.violation;
                merit(there) <= merit(here) + ARMIJO * length * slope.min(0.0) + noise
            }
            Globalisation::Filter => {
                if !self.filter.admits(there, noise) {
                    return false;
                }
                if objective_decides(length, *slope, here.violation) {
                    return there.objective <= here.objective + ARMIJO * length * slope + noise;
                }
                self.filter.improves(there, here, noise)
            }
        }
    }
}
