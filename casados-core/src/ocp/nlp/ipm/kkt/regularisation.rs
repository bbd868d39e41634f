//! Newton steps with inertia correction: `δ_w` on the diagonal makes the reduced Hessian positive
//! definite.

use super::newton::newton_step;
use crate::qp::QpError;
use crate::qp::interior::Iterate;
use crate::scalar::Real;

/// The first `δ_w`, in units of the objective over squares of units of variables, as all `δ_w`
/// here.
const FIRST_HESSIAN_PERTURBATION: f64 = 1e-4;
/// The smallest `δ_w` with which directions of vanishing pivots are acceptable.
const VANISHING_PIVOT_PERTURBATION: f64 = 1e-6;
/// The smallest positive `δ_w`.
const MIN_HESSIAN_PERTURBATION: f64 = 1e-20;
/// The upper limit of `δ_w`; the inertia correction fails beyond it.
const MAX_HESSIAN_PERTURBATION: f64 = 1e20;
/// The growth factors of `δ_w`: in the first inertia correction, and in later ones.
const PERTURB_INC_FACT_FIRST: f64 = 100.0;
const PERTURB_INC_FACT: f64 = 8.0;
/// The ratio of the first `δ_w` of an iteration to the last `δ_w`.
const PERTURB_DEC_FACT: f64 = 1.0 / 3.0;
/// Steps up to this fraction of the step to the boundary are short.
const SHORT_STEP_FRACTION: f64 = 0.1;
/// The number of consecutive short steps after which the steps are damped.
const SHORT_STEPS_BEFORE_DAMPING: usize = 8;
/// The first damping, in the unit of `δ_w`.
const FIRST_DAMPING: f64 = 1e-3;
/// The largest damping; damping is dropped above it.
const MAX_DAMPING: f64 = 1e2;

/// State of the regularisation `δ_w` and of the damping.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::ocp::nlp) struct Regularisation {
    /// The last `δ_w` of an inertia correction.
    last_delta: f64,
    /// The lower bound of `δ_w` after short steps.
    damping: f64,
    /// Consecutive short steps.
    short_steps: usize,
}

impl Regularisation {
    /// Updates the damping after an accepted step; `step_fraction` is its length relative to the
    /// step to the boundary. With curved constraints and a nearly singular reduced Hessian full
    /// steps leave the constraints, and the line search makes them very short. As in a trust
    /// region, damped directions allow longer steps.
    pub fn update_damping(&mut self, step_fraction: f64) {
        if step_fraction >= SHORT_STEP_FRACTION {
            self.short_steps = 0;
            if step_fraction >= 1.0 {
                let reduced_damping = self.damping / 3.0;
                self.damping = if reduced_damping > 1e-2 * FIRST_DAMPING { reduced_damping } else { 0.0 };
            }
            return;
        }
        self.short_steps += 1;
        if self.short_steps >= SHORT_STEPS_BEFORE_DAMPING || self.damping > 0.0 {
            self.damping = (8.0 * self.damping).max(FIRST_DAMPING).max(self.last_delta);
            if self.damping > MAX_DAMPING {
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
        let mut last_error = match self.try_factorisation(iterate, mu, self.damping, objective_unit) {
            Ok(()) => return Ok(self.damping * objective_unit),
            Err(failed) => failed,
        };
        let mut delta = if self.last_delta > 0.0 {
            (PERTURB_DEC_FACT * self.last_delta).max(MIN_HESSIAN_PERTURBATION)
        } else {
            FIRST_HESSIAN_PERTURBATION
        };
        delta = delta.max(8.0 * self.damping);
        while delta < MAX_HESSIAN_PERTURBATION {
            match self.try_factorisation(iterate, mu, delta, objective_unit) {
                Ok(()) => {
                    self.last_delta = delta;
                    return Ok(delta * objective_unit);
                }
                Err(error) => last_error = error,
            }
            delta *= if self.last_delta > 0.0 { PERTURB_INC_FACT } else { PERTURB_INC_FACT_FIRST };
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
            Ok(()) if iterate.riccati.regularised > 0 && delta < VANISHING_PIVOT_PERTURBATION => {
                Err(QpError::NotConvex { stage: 0, index: 0, pivot: 0.0 })
            }
            result => result,
        }
    }
}
