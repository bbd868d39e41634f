//! Diagonal second derivatives in a single control or parameter, which need no row of `D`.

use super::products::StridedMatrix;
use crate::irk::directions::column_of;
use crate::linalg::{Arithmetic, Kernel};
use crate::plan::Plan;
use crate::scalar::Lanes;
use crate::shape::InBounds;

/// Adds second derivatives in a control or a parameter alone: its row of `D_i` is a row of the unit
/// matrix.
pub(in crate::irk) struct DiagonalUpdate<'a, M, E, const S: usize> {
    pub plan: M,
    pub entries: &'a [[E; S]],
    pub sum: StridedMatrix<'a, E>,
}

impl<M: Plan, E: Lanes, const S: usize> Kernel for DiagonalUpdate<'_, M, E, S> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(mut self) {
        for diagonal_controls in self.plan.structure().diagonal_controls {
            let column = column_of(self.plan, diagonal_controls.direction as usize);
            let Some(column) = column else { continue };
            let (Some(entries), Some(row)) = (
                self.entries.get(diagonal_controls.entry as usize).in_bounds(),
                self.sum.row_mut(column, column),
            ) else {
                continue;
            };
            let Some(to) = row.first_mut() else { continue };
            for &entry in entries {
                *to = A::subtract(*to, E::from_f64(1.0), entry);
            }
        }
    }
}
