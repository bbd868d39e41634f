//! Controls that are the same at all stages: parameters of the recursion, not eliminated by it.

use crate::qp::element::set;
use crate::qp::layout::{StageOffsets, part_mut};
use crate::qp::marked_indices;
use crate::scalar::Real;

/// Where the recursion leaves what belongs to shared controls.
pub struct Shared<'s, T> {
    /// For every control whether it is shared.
    marks: &'s [T],
    /// Their columns of `M`, over the variables of all stages, one control after the other.
    columns: &'s mut [T],
    /// The length of one of these.
    length: usize,
}

impl<'s, T: Real> Shared<'s, T> {
    /// There are none.
    pub fn without_shared_controls() -> Self {
        Self { marks: &[], columns: &mut [], length: 0 }
    }

    /// Those that are marked, each with a column of that length.
    pub fn new(marks: &'s [T], columns: &'s mut [T], length: usize) -> Self {
        Self { marks, columns, length }
    }

    /// Takes rows and columns of shared controls out of `M`, and leaves those of the identity:
    /// elimination passes them by.
    pub fn extract_shared_controls(&mut self, place: &StageOffsets, m: &mut [T]) {
        let StageOffsets { nx, nu, n, ld, .. } = *place;
        let rows = || marked_indices(self.marks).filter(|&j| j < nu).map(|j| nx + j);
        for (c, row) in rows().enumerate() {
            let column = part_mut(self.columns, c * self.length + place.v, ld);
            for (i, element) in column.iter_mut().enumerate().take(n) {
                // Above the diagonal among controls there is nothing.
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
