//! Newton steps with inertia correction: `δ_w` on the diagonal makes the reduced Hessian positive
//! definite.

use super::newton::newton_step;
use crate::ocp::nlp::advanced::{DampingOptions, InertiaOptions};
use crate::qp::QpError;
use crate::qp::interior::Iterate;
use crate::scalar::Real;

/// State of the regularisation `δ_w` and of the damping.
#[derive(Clone, Copy, Debug)]
pub(in crate::ocp::nlp) struct Regularisation {
    inertia: InertiaOptions,
    options: DampingOptions,
    /// The last `δ_w` of an inertia correction.
    last_delta: f64,
    /// The lower bound of `δ_w` after short steps.
    damping: f64,
    /// Consecutive short steps.
    short_steps: usize,
}

impl Regularisation {
    pub fn new(inertia: InertiaOptions, options: DampingOptions) -> Self {
        Self { inertia, options, last_delta: 0.0, damping: 0.0, short_steps: 0 }
    }

    /// The state at the start of a run, with the same options.
    pub fn restarted(&self) -> Self {
        Self::new(self.inertia, self.options)
    }

    /// Updates the damping after an accepted step; `step_fraction` is its length relative to the
    /// step to the boundary. With curved constraints and a nearly singular reduced Hessian full
    /// steps leave the constraints, and the line search makes them very short. As in a trust
    /// region, damped directions allow longer steps.
    pub fn update_damping(&mut self, step_fraction: f64) {
        let options = self.options;
        if step_fraction >= options.short_step_fraction {
            self.short_steps = 0;
            if step_fraction >= 1.0 {
                let reduced_damping = self.damping / options.damping_dec_fact;
                self.damping =
                    if reduced_damping > 1e-2 * options.first_damping { reduced_damping } else { 0.0 };
            }
            return;
        }
        self.short_steps += 1;
        if self.short_steps >= options.short_steps_before_damping || self.damping > 0.0 {
            self.damping =
                (options.damping_inc_fact * self.damping).max(options.first_damping).max(self.last_delta);
            if self.damping > options.max_damping {
                (self.damping, self.short_steps) = (0.0, 0);
            }
        }
    }

    /// Computes the Newton step towards `μ`, and returns its `δ_w` (Wächter and Biegler, algorithm
    /// IC).
    ///
    /// # Errors
    /// The errors of the recursion.
    pub fn compute_regularised_step<T: Real>(
        &mut self,
        iterate: &mut Iterate<'_, T>,
        mu: T,
        objective_unit: f64,
    ) -> Result<f64, QpError> {
        let options = self.inertia;
        let mut last_error = match self.try_factorisation(iterate, mu, self.damping, objective_unit) {
            Ok(()) => return Ok(self.damping * objective_unit),
            Err(failed) => failed,
        };
        let mut delta = if self.last_delta > 0.0 {
            (options.perturb_dec_fact * self.last_delta).max(options.min_hessian_perturbation)
        } else {
            options.first_hessian_perturbation
        };
        delta = delta.max(self.options.damping_inc_fact * self.damping);
        while delta < options.max_hessian_perturbation {
            match self.try_factorisation(iterate, mu, delta, objective_unit) {
                Ok(()) => {
                    self.last_delta = delta;
                    return Ok(delta * objective_unit);
                }
                Err(error) => last_error = error,
            }
            delta *=
                if self.last_delta > 0.0 { options.perturb_inc_fact } else { options.perturb_inc_fact_first };
        }
        Err(last_error)
    }

    /// Factorises once; a non-finite step is an error.
    fn try_factorisation<T: Real>(
        &self,
        iterate: &mut Iterate<'_, T>,
        mu: T,
        delta: f64,
        objective_unit: f64,
    ) -> Result<(), QpError> {
        match newton_step(iterate, mu, T::from_f64(delta * objective_unit)) {
            Ok(()) if !iterate.step.iter().all(|d| d.is_finite()) => {
                Err(QpError::NotConvex { stage: 0, index: 0, pivot: f64::NAN })
            }
            // Directions with vanishing pivots would not move.
            Ok(())
                if iterate.riccati.regularised > 0 && delta < self.inertia.vanishing_pivot_perturbation =>
            {
                Err(QpError::NotConvex { stage: 0, index: 0, pivot: 0.0 })
            }
            result => result,
        }
    }
}
