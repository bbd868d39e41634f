//! The outputs of derivatives over a step: matrices of results, and rows of `D` at a stage.

use crate::linalg::{Arithmetic, PanelRow};
use crate::scalar::Lanes;
use crate::shape::InBounds;
use core::ops::Range;

/// The destination of derivatives.
pub(crate) trait DerivativeOutput<E> {
    /// The columns of a matrix for the panel that begins with `column`.
    fn columns_mut<const W: usize>(&mut self, column: usize) -> [&mut [E]; W];
    /// The memory of the columns after these, if it is known.
    fn next_columns<const W: usize>(&self, _column: usize) -> &[E] {
        &[]
    }
}

/// `V + Σ_i weight_i dy_i` of a panel.
pub(in crate::irk) struct PanelCombination<'a, E, const S: usize, const W: usize> {
    /// The matrix `V`. `None` stands for zero, or for the unit matrix.
    pub base: Option<&'a [[E; W]]>,
    /// The row of the one in each column of the unit matrix; empty without unit matrix.
    pub unit_rows: &'a [u32],
    /// The derivatives of the stages.
    pub dy: &'a [PanelRow<E, S, W>],
    /// The range of unknowns of the rows.
    pub unknowns: Range<usize>,
    /// `−weight_i`
    pub minus_weights: &'a [E; S],
}

/// Number of rows that are computed before they are written column by column.
const ROWS_PER_BLOCK: usize = 4;

impl<E: Lanes, const S: usize, const W: usize> PanelCombination<'_, E, S, W> {
    /// Writes the columns; returns their sum, which is finite only if all elements are.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub fn write<A: Arithmetic>(&self, to: &mut [&mut [E]; W]) -> E {
        let mut sums = [E::from_f64(0.0); W];
        let (blocks, rest) =
            self.dy.get(self.unknowns.clone()).in_bounds().unwrap_or_default().as_chunks::<ROWS_PER_BLOCK>();
        for (n, dy) in blocks.iter().enumerate() {
            self.write_rows::<A, ROWS_PER_BLOCK>(n * ROWS_PER_BLOCK, dy, to, &mut sums);
        }
        for (n, dy) in rest.iter().enumerate() {
            self.write_rows::<A, 1>(
                blocks.len() * ROWS_PER_BLOCK + n,
                core::array::from_ref(dy),
                to,
                &mut sums,
            );
        }
        for (to, &row) in to.iter_mut().zip(self.unit_rows) {
            if let Some(one) = to.get_mut(row as usize) {
                *one = *one + E::from_f64(1.0);
            }
        }
        let mut sum = E::from_f64(0.0);
        for element in sums {
            sum = sum + element;
        }
        sum
    }

    /// Writes `R` rows.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn write_rows<A: Arithmetic, const R: usize>(
        &self,
        begin: usize,
        dy: &[PanelRow<E, S, W>; R],
        to: &mut [&mut [E]; W],
        sums: &mut [E; W],
    ) {
        let v = self.base.and_then(|v| v.get(begin..)?.first_chunk::<R>());
        let mut rows = v.copied().unwrap_or([[E::from_f64(0.0); W]; R]);
        for (row, dk) in rows.iter_mut().zip(dy) {
            for (&weight, dk) in self.minus_weights.iter().zip(dk) {
                A::subtract_row(row, weight, dk);
            }
            for (sum, &element) in sums.iter_mut().zip(&*row) {
                *sum = *sum + element;
            }
        }
        // Squares of four by four scalars are transposed in registers.
        let square_blocks =
            if const { size_of::<E>() <= 8 && R == ROWS_PER_BLOCK } { W / ROWS_PER_BLOCK } else { 0 };
        for square in 0..square_blocks {
            let mut numbers = [[E::from_f64(0.0); ROWS_PER_BLOCK]; ROWS_PER_BLOCK];
            for (to, row) in numbers.iter_mut().zip(&rows) {
                if let Some(row) = row.as_chunks::<ROWS_PER_BLOCK>().0.get(square) {
                    *to = *row;
                }
            }
            let numbers = A::transposed(&numbers);
            for (to, numbers) in to.iter_mut().skip(square * ROWS_PER_BLOCK).zip(&numbers) {
                if let Some(to) = to.get_mut(begin..begin + ROWS_PER_BLOCK) {
                    to.copy_from_slice(numbers);
                }
            }
        }
        for (c, to) in to.iter_mut().enumerate().skip(square_blocks * ROWS_PER_BLOCK) {
            if let Some(to) = to.get_mut(begin..begin + R) {
                for (to, row) in to.iter_mut().zip(&rows) {
                    *to = row[c];
                }
            }
        }
    }
}
