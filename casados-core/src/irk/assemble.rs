//! The Newton matrix: `J_ij = δ_ij [f_ẋ,i | f_z,i] + h a_ij [f_x,i | 0]`, and its factors.

use super::evaluate::entries;
use super::record::{Coefficients, Linearization};
use crate::error::{Error, Place};
use crate::model::Dae;
use crate::scalar::Real;
use crate::shape::Shape;

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
    ) -> Result<(), Error> {
        let Self { jacobian, factors } = self;
        let (blocks, nx) = (M::STRUCTURE.blocks, M::Shape::NX);
        factors.clear();
        for (stage, jacobian) in jacobian.iter().enumerate() {
            for (r, c, value) in entries::<M, T>(jacobian, blocks[0], blocks[1]) {
                factors.add(r, c, stage, value);
            }
            for (r, c, value) in entries::<M, T>(jacobian, blocks[1], blocks[2]) {
                factors.add_row(r, c - nx, stage, h * value, &coefficients.a[stage]);
            }
            for (r, c, value) in entries::<M, T>(jacobian, blocks[2], blocks[3]) {
                factors.add(r, c - nx, stage, value);
            }
        }
        factors.factor().map_err(|(unknown, stage)| Error::Singular {
            unknown: unknown_name::<M>(unknown),
            at: Place { step, stage, iteration },
        })
    }
}

/// Name of an unknown `(k, z)`: of `k` the state whose derivative it is.
pub(crate) fn unknown_name<M: Dae>(unknown: usize) -> &'static str {
    let (x, z) = (M::STRUCTURE.x, M::STRUCTURE.z);
    let name = if unknown < x.len() { x.get(unknown) } else { z.get(unknown - x.len()) };
    name.copied().unwrap_or("")
}
