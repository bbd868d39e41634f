//! The matrices of derivatives in results.

use super::output::DerivativeOutput;
use crate::model::NO_COLUMN;
use crate::plan::Plan;
use crate::scalar::Lanes;
use crate::shape::{InBounds, Matrix};
use core::mem::take;

/// Three matrices of derivatives with respect to `x₀`, `u` and `p`, in column-major order.
pub(super) struct DerivativeMatrices<'a, M, T> {
    plan: M,
    matrices: [&'a mut [T]; 3],
    rows: usize,
}

impl<'a, M: Plan, T: Lanes> DerivativeMatrices<'a, M, T> {
    pub fn new<X: Matrix<T>>(
        plan: M,
        x: &'a mut X,
        u: &'a mut impl Matrix<T>,
        p: &'a mut impl Matrix<T>,
    ) -> Self {
        let matrices = [x.as_mut_slice(), u.as_mut_slice(), p.as_mut_slice()];
        Self { plan, matrices, rows: X::ROWS }
    }

    /// Returns the matrix of element `index` of `w`, and its column in that matrix.
    #[inline(always)]
    fn matrix_and_column(plan: M, index: usize) -> (usize, usize) {
        let (nx, nu) = (plan.nx(), plan.nu());
        if index < nx {
            (0, index)
        } else if index < nx + nu {
            (1, index - nx)
        } else {
            (2, index - nx - nu)
        }
    }

    /// Writes the columns of `dx₊` in directions without influence.
    pub fn fill_inactive_columns(&mut self) {
        for (index, &column) in self.plan.structure().column_of_direction.iter().enumerate() {
            if column == NO_COLUMN {
                let ((part, column), rows) = (Self::matrix_and_column(self.plan, index), self.rows);
                let matrix = self.matrices.get_mut(part);
                let column = matrix.and_then(|matrix| matrix.get_mut(column * rows..(column + 1) * rows));
                let column = column.unwrap_or_default();
                column.fill(T::from_f64(0.0));
                if let Some(element) = column.get_mut(index) {
                    *element = T::from_f64(1.0);
                }
            }
        }
    }
}

impl<M: Plan, T: Lanes> DerivativeOutput<T> for DerivativeMatrices<'_, M, T> {
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn columns_mut<const W: usize>(&mut self, column: usize) -> [&mut [T]; W] {
        let mut columns: [&mut [T]; W] = core::array::from_fn(|_| Default::default());
        // The memory after the last column of each matrix: directions ascend.
        let [x, u, p] = &mut self.matrices;
        let mut rest = [(0, &mut **x), (0, &mut **u), (0, &mut **p)];
        let directions = self.plan.structure().directions.get(column..).in_bounds().unwrap_or_default();
        for (to, &direction) in columns.iter_mut().zip(directions) {
            let (part, own) = Self::matrix_and_column(self.plan, direction as usize);
            let Some((next, rest)) = rest.get_mut(part).in_bounds() else { continue };
            let from = take(rest).get_mut((own - *next) * self.rows..).in_bounds().unwrap_or_default();
            (*to, *rest) = from.split_at_mut_checked(self.rows).unwrap_or_default();
            *next = own + 1;
        }
        columns
    }

    #[cfg_attr(not(debug_assertions), inline(always))]
    fn next_columns<const W: usize>(&self, column: usize) -> &[T] {
        let Some(&first) = self.plan.structure().directions.get(column + W) else { return &[] };
        let (part, own) = Self::matrix_and_column(self.plan, first as usize);
        let from = self.matrices.get(part).and_then(|matrix| matrix.get(own * self.rows..));
        let from = from.unwrap_or_default();
        from.get(..W * self.rows).unwrap_or(from)
    }
}

/// One matrix in column-major order.
pub(super) struct SingleMatrix<'a, T> {
    pub matrix: &'a mut [T],
    pub rows: usize,
}

impl<T: Lanes> DerivativeOutput<T> for SingleMatrix<'_, T> {
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn columns_mut<const W: usize>(&mut self, column: usize) -> [&mut [T]; W] {
        let mut columns: [&mut [T]; W] = core::array::from_fn(|_| Default::default());
        let matrix = self.matrix.get_mut(column * self.rows..).in_bounds().unwrap_or_default();
        // `max(1)`: the chunk length is positive for a model without states too.
        for (to, own) in columns.iter_mut().zip(matrix.chunks_exact_mut(self.rows.max(1))) {
            *to = own;
        }
        columns
    }
}
