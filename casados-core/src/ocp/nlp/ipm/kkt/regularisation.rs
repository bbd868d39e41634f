//! Newton's step, with as much on the diagonal (`δ_w`) as makes the reduced Hessian positive
//! definite.

use super::newton::step;
use crate::qp::QpError;
use crate::qp::interior::Iterate;
use crate::scalar::Real;

/// The first `δ_w`, as all of them in units of forces over the squares of those of variables.
const FIRST_HESSIAN_PERTURBATION: f64 = 1e-4;
/// With this on the diagonal, directions without curvature may be left alone.
const FLAT: f64 = 1e-6;
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
const SHORT: f64 = 0.1;
/// and after so many in sequence the next ones are damped,
const SHORT_STEPS_BEFORE_DAMPING: usize = 8;
/// at first by this, as `δ_w` is,
const FIRST_DAMPING: f64 = 1e-3;
/// and not at all any more where this does not help.
const MOST_DAMPING: f64 = 1e2;

/// What is remembered of `δ_w`.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::ocp::nlp) struct Regularisation {
    /// The last one that curvature asked for.
    last: f64,
    /// No less is taken while steps are short.
    damping: f64,
    /// So many steps in sequence were short.
    short: usize,
}

impl Regularisation {
    /// A step was accepted that goes so far of what bounds leave of it. Where constraints are
    /// curved and the reduced Hessian is nearly singular, full steps leave the constraints at once,
    /// and what the line search leaves of them is nothing: as in a trust region shorter steps in
    /// another direction go farther.
    pub fn gone(&mut self, part: f64) {
        if part >= SHORT {
            self.short = 0;
            if part >= 1.0 {
                let less = self.damping / 3.0;
                self.damping = if less > 1e-2 * FIRST_DAMPING { less } else { 0.0 };
            }
            return;
        }
        self.short += 1;
        if self.short >= SHORT_STEPS_BEFORE_DAMPING || self.damping > 0.0 {
            self.damping = (8.0 * self.damping).max(FIRST_DAMPING).max(self.last);
            if self.damping > MOST_DAMPING {
                (self.damping, self.short) = (0.0, 0);
            }
        }
    }

    /// Newton's step towards `μ`, and the `δ_w` that it took (Wächter and Biegler, algorithm IC).
    ///
    /// # Errors
    /// Those of the recursion.
    pub fn direction<T: Real>(
        &mut self,
        iterate: &mut Iterate<'_, T>,
        mu: T,
        force: f64,
    ) -> Result<f64, QpError> {
        let mut failed = match self.attempt(iterate, mu, self.damping, force) {
            Ok(()) => return Ok(self.damping * force),
            Err(failed) => failed,
        };
        let mut delta = if self.last > 0.0 {
            (PERTURB_DEC_FACT * self.last).max(MIN_HESSIAN_PERTURBATION)
        } else {
            FIRST_HESSIAN_PERTURBATION
        };
        delta = delta.max(8.0 * self.damping);
        while delta < MAX_HESSIAN_PERTURBATION {
            match self.attempt(iterate, mu, delta, force) {
                Ok(()) => {
                    self.last = delta;
                    return Ok(delta * force);
                }
                Err(error) => failed = error,
            }
            delta *= if self.last > 0.0 { PERTURB_INC_FACT } else { PERTURB_INC_FACT_FIRST };
        }
        Err(failed)
    }

    /// One factorisation; a step that is not finite is no step.
    fn attempt<T: Real>(
        &self,
        iterate: &mut Iterate<'_, T>,
        mu: T,
        delta: f64,
        force: f64,
    ) -> Result<(), QpError> {
        match step(iterate, mu, T::from_f64(delta * force)) {
            Ok(()) if !iterate.step.iter().all(|d| d.is_finite()) => {
                Err(QpError::NotConvex { stage: 0, index: 0, pivot: f64::NAN })
            }
            // Directions in which pivots vanished would not move at all.
            Ok(()) if iterate.riccati.regularised > 0 && delta < FLAT => {
                Err(QpError::NotConvex { stage: 0, index: 0, pivot: 0.0 })
            }
            result => result,
        }
    }
}
