//! The derivatives of slopes, for adaptive integrators.

use super::memory::ForwardPass;
use super::output::DerivativeOutput;
use crate::irk::directions::IdentityDirections;
use crate::memory::{Fallback, fallback::Pivoting};
use crate::model::{ArrayW, ArrayX, Dae};
use crate::scalar::Real;
use crate::shape::{InBounds, Plain};
use core::mem::take;

impl<M: Dae, T: Real, const S: usize> ForwardPass<M, T, S> {
    /// Writes the derivatives of `Σ_i weight_i k_i` of the last step, one row per direction.
    pub(crate) fn slope_derivatives(&self, weights: &[T; S], to: &mut ArrayW<M, ArrayX<M, T>>) {
        for direction in to.as_mut() {
            direction.as_mut().fill(T::ZERO);
        }
        let directions = (Pivoting::plan::<M>(), IdentityDirections::for_model::<M, T, Pivoting>());
        self.sweep.write_slopes(directions, weights, &mut DirectionRows::<M, T> { rows: to });
    }
}

/// A matrix with one row per direction.
struct DirectionRows<'a, M: Dae, T: Plain> {
    rows: &'a mut ArrayW<M, ArrayX<M, T>>,
}

impl<M: Dae, T: Real> DerivativeOutput<T> for DirectionRows<'_, M, T> {
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn columns_mut<const W: usize>(&mut self, column: usize) -> [&mut [T]; W] {
        let mut columns: [&mut [T]; W] = core::array::from_fn(|_| Default::default());
        let (mut next, mut rest) = (0, self.rows.as_mut());
        let directions = M::STRUCTURE.directions.get(column..).in_bounds().unwrap_or_default();
        for (to, &direction) in columns.iter_mut().zip(directions) {
            let from = take(&mut rest).get_mut(direction as usize - next..).in_bounds().unwrap_or_default();
            if let Some((own, following)) = from.split_first_mut() {
                (*to, rest, next) = (own.as_mut(), following, direction as usize + 1);
            }
        }
        columns
    }
}
