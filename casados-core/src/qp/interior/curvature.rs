//! Test whether a negative pivot is negative curvature or a rounding error.

use super::cholesky::{substitute, unit};
use super::kernels::{Columns, add_transposed, symmetric};
use super::riccati::Riccati;
use super::vector::largest_magnitude_ignoring_nan;
use crate::qp::error::QpError;
use crate::qp::layout::{StageOffsets, StageOffsetsIter, copy_common, part, part_mut, take_mut};
use crate::qp::problem::QpView;
use crate::scalar::Real;

impl<T: Real> Riccati<'_, T> {
    /// Returns an error if the Hessian has negative curvature along the direction of a negative
    /// pivot; otherwise the pivot is a rounding error. The direction has a one in one control (or,
    /// with an index from `nu` on, in one initial state); earlier pivots and later stages follow
    /// such that the rest of `dᵀ M d` vanishes.
    pub fn verify(
        &mut self,
        qp: QpView<'_, T>,
        from: &StageOffsets,
        (index, pivot): (usize, T),
        direction: &mut [T],
    ) -> Result<(), QpError> {
        let (mut curvature, mut size) = (T::ZERO, T::ZERO);
        let mut rest = direction.get_mut(from.row..).unwrap_or_default();
        for place in StageOffsetsIter::<T>::new(qp.dims).skip(from.stage) {
            let StageOffsets { nx, nu, n, ld, next, .. } = place;
            let data = part(qp.data, place.data, place.data_len());
            let matrix = Columns { data: part(data, 0, place.matrix()), ld };
            let (panel, inverse) =
                (part(self.panels, place.factor, ld * place.pivots), part(self.inverse, place.v, ld));
            let v = part_mut(take_mut(&mut rest, place.rows), 0, ld);
            let state = index.checked_sub(nu);
            let (begin, from_here) = (if state.is_some() { 0 } else { nx }, place.stage == from.stage);
            // The state is determined by the stage before.
            let given = if from_here { 0 } else { nx };
            v.iter_mut().skip(given).for_each(|v| *v = T::ZERO);
            if from_here {
                let columns = panel.get(if state.is_some() { nu * ld } else { 0 }..).unwrap_or_default();
                unit(
                    part_mut(v, begin, ld - begin),
                    columns,
                    ld,
                    begin,
                    part(inverse, begin, ld - begin),
                    state.unwrap_or(index),
                );
            }
            if !from_here || state.is_some() {
                let u = part_mut(self.g, 0, nu);
                u.fill(T::ZERO);
                add_transposed::<T, T>(u, Columns { data: panel, ld }, v, nx, nu);
                substitute(u, panel, ld, nx, part(inverse, nx, nu));
                copy_common(part_mut(v, nx, nu), u);
            }
            let coming = part_mut(rest, 0, next);
            coming.fill(T::ZERO);
            add_transposed::<T, T>(coming, matrix, v, n, next);
            let product = part_mut(self.g, 0, ld);
            product.fill(T::ZERO);
            let hessian = part(data, place.matrix(), place.hessian());
            symmetric::<T, T>(product, hessian, ld, v, n);
            let largest = largest_magnitude_ignoring_nan::<T, T>(T::ZERO, hessian);
            for (&v, &product) in v.iter().zip(&*product) {
                curvature = curvature + v * product;
                size = size + largest * v * v;
            }
        }
        let rounding = T::from_f64(64.0 * T::EPSILON) * size;
        if pivot.is_finite() && curvature.is_finite() && curvature < -rounding {
            return Err(QpError::NotConvex { stage: from.stage, index, pivot: pivot.to_f64() });
        }
        Ok(())
    }
}
