//! Shared controls: parameters of the recursion, which does not eliminate them.

use crate::qp::element::set;
use crate::qp::layout::{StageOffsets, part_mut};
use crate::qp::marked_indices;
use crate::scalar::Real;

/// Columns of shared controls, which the recursion writes.
pub struct Shared<'s, T> {
    /// A mark for every control: whether it is shared.
    marks: &'s [T],
    /// Their columns of `M`, over the variables of all stages, one control after the other.
    columns: &'s mut [T],
    /// The length of a column.
    length: usize,
}

impl<'s, T: Real> Shared<'s, T> {
    /// No shared controls.
    pub fn without_shared_controls() -> Self {
        Self { marks: &[], columns: &mut [], length: 0 }
    }

    /// The marked controls, each with a column of this length.
    pub fn new(marks: &'s [T], columns: &'s mut [T], length: usize) -> Self {
        Self { marks, columns, length }
    }

    /// Moves rows and columns of shared controls out of `M`, and replaces them by those of the
    /// identity, which elimination leaves unchanged.
    pub fn extract_shared_controls(&mut self, place: &StageOffsets, m: &mut [T]) {
        let StageOffsets { nx, nu, n, ld, .. } = *place;
        let rows = || marked_indices(self.marks).filter(|&j| j < nu).map(|j| nx + j);
        for (c, row) in rows().enumerate() {
            let column = part_mut(self.columns, c * self.length + place.v, ld);
            for (i, element) in column.iter_mut().enumerate().take(n) {
                // Among controls only the lower triangle is stored.
                let index = if (nx..row).contains(&i) { i * ld + row } else { row * ld + i };
                *element = m.get(index).copied().unwrap_or(T::ZERO);
            }
        }
        for row in rows() {
            part_mut(m, row * ld, ld).fill(T::ZERO);
            for column in nx..n {
                set(m, column * ld + row, if column == row { T::ONE } else { T::ZERO });
            }
        }
    }
}
