//! The linearised dynamics of an interval, in the layout of the QP.

use crate::qp::{part, part_mut};
use crate::scalar::{Packed, Real, Registers};
use bytemuck::Zeroable;

/// More lanes than any register has.
const MOST_LANES: usize = 16;

/// `[A B]ᵀ`, a column for each next state, and `x₊ − A x − B u`.
pub(super) struct Transfer<'a, T> {
    /// `A` and `B`, column after column.
    pub columns: [&'a [T]; 2],
    /// `x₊`
    pub next: &'a [T],
    /// `(x, u)`, and zeros to the length of a column.
    pub point: &'a [T],
    /// Columns `ld` apart.
    pub matrix: &'a mut [T],
    pub ld: usize,
    pub offset: &'a mut [T],
}

impl<T: Real> Transfer<'_, T> {
    pub fn run(self) {
        T::registers(self);
    }

    /// Column `j` of `[A B]`.
    #[inline(always)]
    fn column(&self, j: usize) -> &[T] {
        let ([a, b], nx) = (self.columns, self.next.len());
        if j < nx { part(a, j * nx, nx) } else { part(b, (j - nx) * nx, nx) }
    }
}

impl<T: Real> Registers<T> for Transfer<'_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let (nx, ld) = (self.next.len(), self.ld);
        let n = nx + self.columns[1].len() / nx.max(1);
        let whole = nx - nx % E::LANES;
        let mut tile: [E::Cell; MOST_LANES] = Zeroable::zeroed();
        let Some(tile) = tile.get_mut(..E::LANES) else { return };
        for j in (0..n).step_by(E::LANES) {
            let count = E::LANES.min(n - j);
            for i in (0..whole).step_by(E::LANES) {
                let mut columns = [E::from_f64(0.0); MOST_LANES];
                for (l, to) in columns.iter_mut().enumerate().take(count) {
                    if let Some(cell) = E::cells(part(self.column(j + l), i, E::LANES)).first() {
                        *to = E::load(cell);
                    }
                }
                E::transpose(columns.get(..count).unwrap_or_default(), tile);
                for (r, from) in tile.iter().enumerate() {
                    // Zeros go where there are zeros.
                    let to = part_mut(self.matrix, (i + r) * ld + j, E::LANES);
                    if let Some(to) = E::cells_mut(to).first_mut() {
                        *to = *from;
                    }
                }
            }
            for i in whole..nx {
                for l in 0..count {
                    let value = self.column(j + l).get(i).copied().unwrap_or(T::ZERO);
                    if let Some(to) = self.matrix.get_mut(i * ld + j + l) {
                        *to = value;
                    }
                }
            }
        }
        let columns = self.matrix.chunks_exact(ld.max(1));
        for ((offset, &next), column) in self.offset.iter_mut().zip(self.next).zip(columns) {
            let mut sum = E::from_f64(0.0);
            for (column, point) in E::cells(column).iter().zip(E::cells(self.point)) {
                sum = sum.minus_product(E::load(column), E::load(point));
            }
            *offset = next + sum.total();
        }
    }
}
