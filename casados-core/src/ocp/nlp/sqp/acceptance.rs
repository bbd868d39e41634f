//! Whether a point is good enough: merit function and filter.

use super::options::Globalisation;
use crate::ocp::nlp::filter::{ETA_PHI, Filter, FilterPair, switching_condition_holds};

/// What a line search remembers.
#[derive(Clone, Copy, Debug)]
pub(in crate::ocp::nlp) struct LineSearchState {
    pub filter: Filter,
    /// Whether the last step was a full one: then the next full step is tried by linearising there,
    /// which is not to be done again.
    pub last_step_was_full: bool,
    /// Seconds of the linearisation at the iterate, if there is one.
    pub linearisation_seconds: Option<f64>,
}

/// A line search: where it begins, and what it expects.
#[derive(Clone, Copy)]
pub(in crate::ocp::nlp) struct MeritModel {
    pub current: FilterPair,
    /// Of the objective.
    pub slope: f64,
}

impl MeritModel {
    /// Whether the merit function, if it is a parabola along the step, has its least before the end
    /// of a step of this length: whether it shrinks by less than half of what its slope promises.
    pub fn overshoots(&self, length: f64, trial_pair: &FilterPair) -> bool {
        let predicted_decrease = length * (self.slope - self.current.violation);
        trial_pair.merit() - self.current.merit() > 0.5 * predicted_decrease.min(0.0) + self.rounding_noise()
    }

    /// Near the solution, differences are roundings.
    fn rounding_noise(&self) -> f64 {
        1e4 * f64::EPSILON * (1.0 + self.current.objective.abs() + self.current.violation)
    }
}

impl LineSearchState {
    pub fn new() -> Self {
        Self { filter: Filter::new(f64::INFINITY), last_step_was_full: true, linearisation_seconds: None }
    }

    /// Whether a point is good enough after a step of this length.
    pub fn accepts(
        &mut self,
        globalisation: Globalisation,
        length: f64,
        model: &MeritModel,
        trial_pair: &FilterPair,
    ) -> bool {
        let MeritModel { current: here, slope } = model;
        if !trial_pair.is_finite() {
            return false;
        }
        let noise = model.rounding_noise();
        match globalisation {
            Globalisation::FullStep => true,
            Globalisation::Merit => {
                let slope = slope - here.violation;
                trial_pair.merit() <= here.merit() + ETA_PHI * length * slope.min(0.0) + noise
            }
            Globalisation::Filter => {
                if !self.filter.is_acceptable(trial_pair, noise) {
                    return false;
                }
                if switching_condition_holds(length, *slope, here.violation) {
                    return trial_pair.objective <= here.objective + ETA_PHI * length * slope + noise;
                }
                self.filter.augment_if_improved(trial_pair, here, noise)
            }
        }
    }
}
