//! The Newton matrix: `J_ij = δ_ij [f_ẋ,i | f_z,i] + h a_ij [f_x,i | 0]`, and its factors.

use super::record::{Coefficients, Linearization};
use crate::error::{Error, Place};
use crate::model::Dae;
use crate::scalar::Real;
use crate::shape::assign;
use crate::statistics::Statistics;

/// What factors are for.
#[derive(Clone, Copy)]
pub(crate) enum Purpose {
    /// An iteration, whose convergence shows whether they were good enough.
    Iteration,
    /// Derivatives, which nothing checks afterwards.
    Sensitivities,
}

impl<M: Dae, T: Real, const S: usize> Linearization<M, T, S> {
    /// Factors of the Newton matrix of the Jacobian that is stored.
    ///
    /// # Errors
    /// [`Error::Singular`]
    pub(crate) fn factor(
        &mut self,
        coefficients: &Coefficients<T, S>,
        h: T,
        step: usize,
        iteration: usize,
        purpose: Purpose,
        statistics: &mut Statistics,
    ) -> Result<(), Error> {
        let Self { jacobian, factors } = self;
        let planned = match purpose {
            Purpose::Iteration => factors.factor(jacobian, &coefficients.a, h),
            Purpose::Sensitivities => factors.factor_checked(jacobian, &coefficients.a, h),
        };
        let planned = planned.map_err(|(unknown, stage)| Error::Singular {
            unknown: unknown_name::<M>(unknown),
            at: Place { step, stage, iteration },
        })?;
        statistics.factorizations += 1;
        statistics.dense += usize::from(!planned);
        Ok(())
    }

    /// Copies what holds.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        assign(&mut self.jacobian, &other.jacobian);
        self.factors.copy_from(&other.factors);
    }
}

/// Name of an unknown `(k, z)`: of `k` the state whose derivative it is.
pub(crate) fn unknown_name<M: Dae>(unknown: usize) -> &'static str {
    let (x, z) = (M::STRUCTURE.x, M::STRUCTURE.z);
    let name = if unknown < x.len() { x.get(unknown) } else { z.get(unknown - x.len()) };
    name.copied().unwrap_or("")
}
