//! The linearised dynamics of an interval, in the layout of the QP.

use crate::qp::{assign, part, part_mut, splat};
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
}

impl<T: Real> Registers<T> for Transfer<'_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let (nx, ld) = (self.next.len(), self.ld);
        let [a, b] = self.columns;
        let n = nx + b.len() / nx.max(1);
        // Of `[A B]`.
        let column = |j: usize| if j < nx { part(a, j * nx, nx) } else { part(b, (j - nx) * nx, nx) };
        let whole = nx - nx % E::LANES;
        assign(self.offset, self.next);
        let mut tile: [E::Cell; MOST_LANES] = Zeroable::zeroed();
        let Some(tile) = tile.get_mut(..E::LANES) else { return };
        for j in (0..n).step_by(E::LANES) {
            let count = E::LANES.min(n - j);
            let mut from = [&[][..]; MOST_LANES];
            let mut factors = [E::from_f64(0.0); MOST_LANES];
            for (l, (from, factor)) in from.iter_mut().zip(&mut factors).enumerate().take(count) {
                *from = column(j + l);
                *factor = splat::<T, E>(self.point.get(j + l).copied().unwrap_or(T::ZERO));
            }
            // The last rows together with some that were there before.
            let overlapping = (whole < nx && nx >= E::LANES).then(|| nx - E::LANES);
            for i in (0..whole).step_by(E::LANES).chain(overlapping) {
                let Some(offset) = E::cells_mut(part_mut(self.offset, i, E::LANES)).first_mut() else {
                    return;
                };
                let mut columns = [E::from_f64(0.0); MOST_LANES];
                let mut sum = E::load(offset);
                // As many as the optimiser knows.
                for l in 0..E::LANES {
                    if let Some(cell) = E::cells(part(from[l], i, E::LANES)).first() {
                        columns[l] = E::load(cell);
                        sum = sum.minus_product(columns[l], factors[l]);
                    }
                }
                let before = *offset;
                sum.store(offset);
                // Those that have it already.
                let had = if i + E::LANES > whole { whole - i } else { 0 };
                for lane in 0..had {
                    E::set_lane(offset, lane, E::lane(&before, lane));
                }
                E::transpose(&columns[..E::LANES], tile);
                let rows = self.matrix.get_mut(i * ld..).unwrap_or_default().chunks_mut(ld.max(1));
                for (row, from) in rows.zip(&*tile) {
                    // Zeros go where there are zeros.
                    if let Some(to) = E::cells_mut(part_mut(row, j, E::LANES)).first_mut() {
                        *to = *from;
                    }
                }
            }
            let begin = if overlapping.is_some() { nx } else { whole };
            let rows = self.matrix.get_mut(begin * ld..).unwrap_or_default().chunks_mut(ld.max(1));
            let last = self.offset.get_mut(begin..nx).unwrap_or_default().iter_mut();
            for (i, (row, offset)) in rows.zip(last).enumerate() {
                let (row, point) = (part_mut(row, j, count), part(self.point, j, count));
                for ((to, from), &v) in row.iter_mut().zip(&from).zip(point) {
                    *to = from.get(begin + i).copied().unwrap_or(T::ZERO);
                    *offset = *offset - *to * v;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::qp::pad;
    use alloc::vec;
    use alloc::vec::Vec;

    /// In integers, of which all sums are exact.
    #[test]
    fn every_size() {
        for (nx, nu) in (1..20).flat_map(|nx| [0, 1, 3, 8].map(|nu| (nx, nu))) {
            let number = |i: usize, j: usize| ((i * 7 + j * 13 + 5) % 11) as f64 - 5.0;
            let (n, ld) = (nx + nu, pad::<f64>(nx + nu));
            let [a, b] = [0..nx, nx..n]
                .map(|columns| columns.flat_map(|j| (0..nx).map(move |i| number(i, j))).collect::<Vec<_>>());
            let next: Vec<f64> = (0..nx).map(|i| number(i, 50)).collect();
            let mut point: Vec<f64> = (0..n).map(|j| number(70, j)).collect();
            point.resize(ld, 0.0);
            let (mut matrix, mut offset) = (vec![0.0; nx * ld], vec![0.0; pad::<f64>(nx)]);
            let (columns, target, shift) = ([&a[..], &b[..]], &mut matrix[..], &mut offset[..]);
            Transfer { columns, next: &next, point: &point, matrix: target, ld, offset: shift }.run();
            for i in 0..nx {
                let row: Vec<f64> = (0..n).map(|j| number(i, j)).collect();
                assert_eq!(matrix[i * ld..i * ld + n], row[..], "{nx} {nu} {i}");
                assert!(matrix[i * ld + n..(i + 1) * ld].iter().all(|&padding| padding == 0.0));
                let product: f64 = row.iter().zip(&point).map(|(a, v)| a * v).sum();
                assert_eq!(offset[i], next[i] - product, "{nx} {nu} {i}");
            }
            assert!(offset[nx..].iter().all(|&padding| padding == 0.0), "{nx} {nu}");
        }
    }
}
