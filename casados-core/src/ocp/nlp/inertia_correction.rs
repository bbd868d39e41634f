//! Inertia correction: a multiple of the identity is added to a Hessian whose reduced Hessian is
//! not positive definite (A. Wächter, L. T. Biegler, Math. Program. 106, 2006, section 3.1).

use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::qp::{QpError, StageDims};
use crate::scalar::Real;

/// The first and the smallest regularisation `δ`.
const FIRST_DELTA: f64 = 1e-6;
const MIN_DELTA: f64 = 1e-8;
/// The largest regularisation `δ`.
const MAX_DELTA: f64 = 1e10;
/// The factor by which `δ` grows within an iteration, and decreases between iterations.
const DELTA_FACTOR: f64 = 4.0;
/// The maximum number of increases of `δ` after QPs that failed for an unknown reason.
const MAX_UNSOLVED_QPS: usize = 1;

/// The regularisation of the last QP that required one, decreased after each QP that required none.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::ocp) struct InertiaCorrection {
    last_delta: f64,
}

impl InertiaCorrection {
    /// Returns the regularisation to try after `delta`.
    fn next_delta(&mut self, delta: f64) -> f64 {
        let next_delta = if delta > 0.0 {
            DELTA_FACTOR * delta
        } else if self.last_delta > 0.0 {
            (self.last_delta / DELTA_FACTOR).max(MIN_DELTA)
        } else {
            FIRST_DELTA
        };
        self.last_delta = next_delta.min(MAX_DELTA);
        next_delta
    }
}

impl<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Solves the QP at the iterate, and adds `delta` to its Hessian as required.
    ///
    /// # Errors
    /// The errors of `solve`.
    pub(in crate::ocp) fn correct_inertia(
        &mut self,
        correction: &mut InertiaCorrection,
        delta: &mut f64,
        mut solve: impl FnMut(&Self) -> Result<(), QpError>,
    ) -> Result<(), QpError> {
        let mut unsolved_qps = 0;
        while let Err(error) = solve(self) {
            let may_retry = match error {
                QpError::NotConvex { .. } => true,
                QpError::MaxIterations { .. } | QpError::Stalled { .. } => {
                    unsolved_qps += 1;
                    unsolved_qps <= MAX_UNSOLVED_QPS
                }
                _ => false,
            };
            if !(may_retry && *delta < MAX_DELTA) {
                return Err(error);
            }
            let larger_delta = correction.next_delta(*delta);
            self.regularise(T::from_f64(larger_delta - *delta));
            *delta = larger_delta;
        }
        if *delta == 0.0 {
            correction.last_delta /= DELTA_FACTOR;
        }
        Ok(())
    }
}
