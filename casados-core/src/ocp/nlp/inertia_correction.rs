//! Inertia correction: a multiple of the identity is added to a Hessian whose reduced Hessian is
//! not positive definite (A. Wächter, L. T. Biegler, Math. Program. 106, 2006, section 3.1).

use super::advanced::InertiaOptions;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::qp::{QpError, StageDims};
use crate::scalar::Real;

/// The regularisation of the last QP that required one, decreased after each QP that required none.
#[derive(Clone, Copy, Debug)]
pub(in crate::ocp) struct InertiaCorrection {
    options: InertiaOptions,
    last_delta: f64,
}

impl InertiaCorrection {
    pub fn new(options: InertiaOptions) -> Self {
        Self { options, last_delta: 0.0 }
    }

    /// Returns the regularisation to try after `delta`.
    fn next_delta(&mut self, delta: f64) -> f64 {
        let options = &self.options;
        let next_delta = if delta > 0.0 {
            options.perturb_inc_fact * delta
        } else if self.last_delta > 0.0 {
            (options.perturb_dec_fact * self.last_delta).max(options.min_hessian_perturbation)
        } else {
            options.first_hessian_perturbation
        };
        self.last_delta = next_delta.min(options.max_hessian_perturbation);
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
                    unsolved_qps <= correction.options.max_unsolved_qps
                }
                _ => false,
            };
            if !(may_retry && *delta < correction.options.max_hessian_perturbation) {
                return Err(error);
            }
            let larger_delta = correction.next_delta(*delta);
            self.regularise(T::from_f64(larger_delta - *delta));
            *delta = larger_delta;
        }
        if *delta == 0.0 {
            correction.last_delta *= correction.options.perturb_dec_fact;
        }
        Ok(())
    }
}
