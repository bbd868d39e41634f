//! Forward sensitivities where the whole matrix was pivoted.

use super::sweep::Sweep;
use crate::irk::directions::{Directions, panel_mut, panels};
use crate::irk::workspace::Work;
use crate::memory::Fallback;
use crate::model::Dae;
use crate::scalar::Lanes;
use crate::shape::{Array, Shape};

impl<M: Dae, E: Lanes, R: Array<E>, const S: usize> Sweep<M, E, R, S> {
    /// Solves by the factors of the whole matrix, column by column.
    pub(super) fn solve_columns<D: Directions<E>, F: Fallback>(&mut self, work: &mut Work<M, E, S, F>) {
        let Work { increment, linear, .. } = work;
        let rows = M::Shape::NK;
        let dy = R::flat_mut(self.dy_mut());
        panels!(D::COLUMNS, E, S, column, W => {
            let (packets, _) = panel_mut::<E, W>(dy, column, rows * S).as_chunks_mut::<S>();
            for c in 0..W {
                for (to, from) in increment.as_mut().iter_mut().zip(packets.iter()) {
                    for (to, row) in to.iter_mut().zip(from) {
                        *to = [row[c]];
                    }
                }
                linear.factors.solve(increment);
                for (to, from) in packets.iter_mut().zip(increment.as_ref()) {
                    for (to, [from]) in to.iter_mut().zip(from) {
                        to[c] = *from;
                    }
                }
            }
        });
    }
}
