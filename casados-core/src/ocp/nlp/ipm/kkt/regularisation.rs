//! Newton's step, with as much on the diagonal (`δ_w`) as makes the reduced Hessian positive
//! definite.

use super::newton::newton_step;
use crate::qp::QpError;
use crate::qp::interior::Iterate;
use crate::scalar::Real;

/// The first `δ_w`, as all of them in units of forces over the squares of those of variables.
const FIRST_HESSIAN_PERTURBATION: f64 = 1e-4;
/// With this on the diagonal, directions without curvature may be left alone.
const VANISHING_PIVOT_PERTURBATION: f64 = 1e-6;
/// `δ_w` is never less.
const MIN_HESSIAN_PERTURBATION: f64 = 1e-20;
/// Where this is not enough nothing is.
const MAX_HESSIAN_PERTURBATION: f64 = 1e20;
/// What `δ_w` grows by where it is not enough: while none is known, and after that.
const PERTURB_INC_FACT_FIRST: f64 = 100.0;
const PERTURB_INC_FACT: f64 = 8.0;
/// The first `δ_w` of an iteration is this part of the last one.
const PERTURB_DEC_FACT: f64 = 1.0 / 3.0;
/// A step that goes no farther than this part of what bounds leave of it is short,
const SHORT_STEP_FRACTION: f64 = 0.1;
/// and after so many in sequence the next ones are damped,
const SHORT_STEPS_BEFORE_DAMPING: usize = 8;
/// at first by this, as `δ_w` is,
const FIRST_DAMPING: f64 = 1e-3;
/// and not at all any more where this does not help.
const MAX_DAMPING: f64 = 1e2;

/// What is remembered of `δ_w`.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::ocp::nlp) struct Regularisation {
    /// The last one that curvature asked for.
    last_delta: f64,
    /// No less is taken while steps are short.
    damping: f64,
    /// So many steps in sequence were short.
    short_steps: usize,
}

impl Regularisation {
    /// A step was accepted that goes so far of what bounds leave of it. Where constraints are
    /// curved and the reduced Hessian is nearly singular, full steps leave the constraints at once,
    /// and what the line search leaves of them is nothing: as in a trust region shorter steps in
    /// another direction go farther.
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

    /// Newton's step towards `μ`, and the `δ_w` that it took (Wächter and Biegler, algorithm IC).
    ///
    /// # Errors
    /// Those of the recursion.
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

    /// One factorisation; a step that is not finite is no step.
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
            // Directions in which pivots vanished would not move at all.
            Ok(()) if iterate.riccati.regularised > 0 && delta < VANISHING_PIVOT_PERTURBATION => {
                Err(QpError::NotConvex { stage: 0, index: 0, pivot: 0.0 })
            }
            result => result,
        }
    }
}
