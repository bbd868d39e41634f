//! Forward sensitivities by the dense fallback.

use super::sweep::ForwardSweep;
use crate::irk::directions::{Directions, panel_mut, panels};
use crate::irk::workspace::StageWorkspace;
use crate::memory::Fallback;
use crate::model::Dae;
use crate::scalar::Lanes;
use crate::shape::{Array, InBounds, Shape};

impl<M: Dae, E: Lanes, R: Array<E>, const S: usize> ForwardSweep<M, E, R, S> {
    /// Solves column by column, with the factors of the whole matrix.
    pub(super) fn solve_columns<D: Directions<E>, F: Fallback>(
        &mut self,
        work: &mut StageWorkspace<M, E, S, F>,
        directions: D,
    ) {
        let StageWorkspace { increment, linearization: linear, .. } = work;
        let dy = R::flat_mut(self.dy_mut());
        panels!([D::COLUMNS, directions.columns()], E, S, column, W => {
            let rows = panel_mut::<E, W>(dy, column, M::Shape::NK * S);
            for c in 0..W {
                read_column(rows, c, increment.as_mut().as_flattened_mut().as_flattened_mut());
                linear.factors.solve(increment);
                write_column(increment.as_ref().as_flattened().as_flattened(), rows, c);
            }
        });
    }
}

// Executed rarely: loops of their own are not unrolled.

/// Reads a column of a panel.
#[inline(never)]
fn read_column<E: Copy, const W: usize>(rows: &[[E; W]], column: usize, to: &mut [E]) {
    for (to, row) in to.iter_mut().zip(rows) {
        if let Some(element) = row.get(column).in_bounds() {
            *to = *element;
        }
    }
}

/// Writes a column of a panel.
#[inline(never)]
pub(super) fn write_column<E: Copy, const W: usize>(from: &[E], rows: &mut [[E; W]], column: usize) {
    for (from, row) in from.iter().zip(rows) {
        if let Some(element) = row.get_mut(column).in_bounds() {
            *element = *from;
        }
    }
}
