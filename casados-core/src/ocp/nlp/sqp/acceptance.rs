//! Acceptance of trial points by merit function or filter.

use super::options::Globalisation;
use crate::ocp::nlp::advanced::FilterOptions;
use crate::ocp::nlp::filter::{Filter, FilterPair};

/// State of the line search, kept between iterations.
#[derive(Clone, Copy, Debug)]
pub(in crate::ocp::nlp) struct LineSearchState {
    pub filter: Filter,
    /// Whether the last step was a full one. Then the next full step is evaluated by linearising at
    /// its end, and the linearisation is reused if it is accepted.
    pub last_step_was_full: bool,
    /// Seconds of the linearisation at the iterate, if it has been done already.
    pub linearisation_seconds: Option<f64>,
}

/// A linear model of the merit function along the direction.
#[derive(Clone, Copy)]
pub(in crate::ocp::nlp) struct MeritModel {
    pub current: FilterPair,
    /// The slope of the objective.
    pub slope: f64,
}

impl MeritModel {
    /// Whether the minimiser of the merit function, modelled as a parabola along the step, is
    /// shorter than this step length: its decrease is less than half of the slope's prediction.
    pub fn overshoots(&self, length: f64, trial_pair: &FilterPair) -> bool {
        let predicted_decrease = length * (self.slope - self.current.violation);
        trial_pair.merit() - self.current.merit() > 0.5 * predicted_decrease.min(0.0) + self.rounding_noise()
    }

    /// The rounding error of differences of the merit function.
    fn rounding_noise(&self) -> f64 {
        1e4 * f64::EPSILON * (1.0 + self.current.objective.abs() + self.current.violation)
    }
}

impl LineSearchState {
    pub fn new(filter: FilterOptions) -> Self {
        let filter = Filter::new(filter, f64::INFINITY);
        Self { filter, last_step_was_full: true, linearisation_seconds: None }
    }

    /// Whether the point at this step length is acceptable.
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
        let (noise, eta_phi) = (model.rounding_noise(), self.filter.options.eta_phi);
        match globalisation {
            Globalisation::FullStep => true,
            Globalisation::Merit => {
                let slope = slope - here.violation;
                trial_pair.merit() <= here.merit() + eta_phi * length * slope.min(0.0) + noise
            }
            Globalisation::Filter => {
                if !self.filter.is_acceptable(trial_pair, noise) {
                    return false;
                }
                if self.filter.options.switching_condition_holds(length, *slope, here.violation) {
                    return trial_pair.objective <= here.objective + eta_phi * length * slope + noise;
                }
                self.filter.augment_if_improved(trial_pair, here, noise)
            }
        }
    }
}
