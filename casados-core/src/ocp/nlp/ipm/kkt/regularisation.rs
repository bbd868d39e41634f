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
/// The first `δ_w` of an iteration is this part of the last one. IPOPT's third costs iterations
/// where one more factorisation is cheap beside second derivatives.
const PERTURB_DEC_FACT: f64 = 0.1;
/// What is remembered of `δ_w`.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::ocp::nlp) struct Regularisation {
    /// The last one that curvature asked for.
    last: f64,
}

impl Regularisation {
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
        let mut failed = match attempt(iterate, mu, 0.0, force) {
            Ok(()) => return Ok(0.0),
            Err(failed) => failed,
        };
        let mut delta = if self.last > 0.0 {
            (PERTURB_DEC_FACT * self.last).max(MIN_HESSIAN_PERTURBATION)
        } else {
            FIRST_HESSIAN_PERTURBATION
        };
        while delta < MAX_HESSIAN_PERTURBATION {
            match attempt(iterate, mu, delta, force) {
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
}

/// One factorisation; a step that is not finite is no step.
fn attempt<T: Real>(iterate: &mut Iterate<'_, T>, mu: T, delta: f64, force: f64) -> Result<(), QpError> {
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
