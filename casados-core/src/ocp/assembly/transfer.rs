//! The linearised dynamics of an interval, in the layout of the QP.

use crate::linalg::dot;
use crate::ocp::formulation::free::Free;
use crate::ocp::formulation::functions::dynamics::{IntegralTerms, IntervalResult};
use crate::ocp::formulation::functions::point::{Terms, add_blocks};
use crate::ocp::formulation::instance::data::inputs;
use crate::ocp::formulation::problem::Formulation;
use crate::qp::element::set;
use crate::qp::{Arrays, part, part_mut, splat};
use crate::scalar::{Packed, Real, Registers, compiled};
use crate::shape::Shape;
use bytemuck::Zeroable;

/// More lanes than any register has.
const MOST_LANES: usize = 16;

/// So many rows are copied element by element.
const FEW: usize = 2;

/// `[A B]ᵀ`, a column for each next state, and `x₊ − A x − B u`.
pub(in crate::ocp) struct Transfer<'a, T> {
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

compiled! {
    /// See [`Transfer`].
    Transfers: Transfer<'r, T>
}

impl<T: Real> Transfer<'_, T> {
    pub fn run(self) {
        T::compiled::<Transfers>(self);
    }
}

impl<T: Real> Registers<T> for Transfer<'_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let Self { columns: [a, b], next, point, matrix, ld, offset } = self;
        let nx = next.len();
        let n = nx + b.len() / nx.max(1);
        // Element `i` of column `j` of `[A B]`, and what follows.
        let from = |i: usize, j: usize| {
            let (columns, j) = if j < nx { (a, j) } else { (b, j - nx) };
            columns.get(j * nx + i..).unwrap_or_default()
        };
        let whole = nx - nx % E::LANES;
        let end = if whole + FEW < nx && nx >= E::LANES { nx } else { whole };
        let mut tile: [E::Cell; MOST_LANES] = Zeroable::zeroed();
        let Some(tile) = tile.get_mut(..E::LANES) else { return };
        for i in (0..end).step_by(E::LANES) {
            // The last rows together with some that are written a second time.
            let i = i.min(nx - E::LANES);
            let Some(next) = E::cells(part(next, i, E::LANES)).first() else { return };
            let mut sum = E::load(next);
            for j in (0..n).step_by(E::LANES) {
                let mut columns = [E::from_f64(0.0); MOST_LANES];
                // As many as the optimiser knows.
                for (l, column) in columns.iter_mut().enumerate().take(E::LANES) {
                    if j + l < n
                        && let Some(cell) = E::cells(part(from(i, j + l), 0, E::LANES)).first()
                        && let Some(&v) = point.get(j + l)
                    {
                        *column = E::load(cell);
                        sum = sum.minus_product(*column, splat(v));
                    }
                }
                E::transpose(&columns[..E::LANES], tile);
                let rows = matrix.get_mut(i * ld..).unwrap_or_default().chunks_mut(ld.max(1));
                for (row, from) in rows.zip(&*tile) {
                    // Zeros go where there are zeros.
                    if let Some(to) = E::cells_mut(part_mut(row, j, E::LANES)).first_mut() {
                        *to = *from;
                    }
                }
            }
            if let Some(offset) = E::cells_mut(part_mut(offset, i, E::LANES)).first_mut() {
                sum.store(offset);
            }
        }
        for i in end..nx {
            let row = part_mut(matrix, i * ld, n);
            let mut sum = next.get(i).copied().unwrap_or(T::ZERO);
            for (j, (to, &v)) in row.iter_mut().zip(point).enumerate() {
                *to = from(i, j).first().copied().unwrap_or(T::ZERO);
                sum = sum - *to * v;
            }
            if let Some(offset) = offset.get_mut(i) {
                *offset = sum;
            }
        }
    }
}

/// What intervals have left in the QP.
pub(in crate::ocp) struct Left {
    /// Whether Hessians are those of costs at nodes alone.
    pub plain: bool,
    /// Whether they add to costs: all of them do, or none. Then these are cleared where those at
    /// nodes are added.
    pub adding: bool,
}

impl Left {
    /// Writes an interval to its stage.
    pub fn transfer<P: Formulation<T>, T: Real>(
        &mut self,
        step: &IntervalResult<'_, T>,
        free: Free<'_>,
        Arrays { ld, matrix, hessian, gradient, offset, .. }: Arrays<'_, T>,
        point: &[T],
    ) {
        let nx = P::Shape::NX;
        if free.count() > 0 {
            let n = inputs::<P::Shape>(free.count());
            transfer_with_free(step, free, (matrix, ld), offset, part(point, 0, n));
        } else {
            Transfer { columns: [step.dx, step.du], next: step.x, point, matrix, ld, offset }.run();
        }
        let IntegralTerms { x, u, p, hessian: blocks, hessian_p: blocks_p, .. } = step.cost;
        self.plain &= blocks.iter().chain(&step.hessian).all(|block| block.is_empty());
        if self.plain && x.is_empty() && u.is_empty() {
            return;
        }
        self.adding = true;
        let mut terms = Terms { free, gradient, hessian, ld };
        terms.hessian.fill(T::ZERO);
        terms.gradient.fill(T::ZERO);
        x.iter().enumerate().for_each(|(i, &slope)| terms.slope(i, slope));
        (nx + free.count()..).zip(u).for_each(|(i, &slope)| terms.slope(i, slope));
        free.elements(p).for_each(|(w, slope)| terms.slope(nx + w, slope));
        add_blocks(&mut terms, nx, blocks, blocks_p);
        add_blocks(&mut terms, nx, step.hessian, step.hessian_p);
    }
}

/// As [`Transfer`], with the derivatives by free parameters between those by states and controls.
fn transfer_with_free<T: Real>(
    step: &IntervalResult<'_, T>,
    free: Free<'_>,
    (matrix, ld): (&mut [T], usize),
    offset: &mut [T],
    point: &[T],
) {
    let nx = step.x.len();
    matrix.get_mut(..nx * ld).unwrap_or_default().fill(T::ZERO);
    let states = step.dx.chunks_exact(nx.max(1)).enumerate();
    let controls = (nx + free.count()..).zip(step.du.chunks_exact(nx.max(1)));
    let parameters = free.columns(step.dp, nx).map(|(w, column)| (nx + w, column));
    for (j, column) in states.chain(controls).chain(parameters) {
        for (i, &value) in column.iter().enumerate() {
            set(matrix, i * ld + j, value);
        }
    }
    let columns = matrix.chunks_exact(ld.max(1));
    for ((offset, &x), column) in offset.iter_mut().zip(step.x).zip(columns) {
        *offset = x - dot(column, point);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::qp::padded_len;
    use alloc::vec;
    use alloc::vec::Vec;

    /// In integers, of which all sums are exact.
    #[test]
    fn every_size() {
        for (nx, nu) in (1..20).flat_map(|nx| [0, 1, 3, 8].map(|nu| (nx, nu))) {
            let number = |i: usize, j: usize| ((i * 7 + j * 13 + 5) % 11) as f64 - 5.0;
            let (n, ld) = (nx + nu, padded_len::<f64>(nx + nu));
            let [a, b] = [0..nx, nx..n]
                .map(|columns| columns.flat_map(|j| (0..nx).map(move |i| number(i, j))).collect::<Vec<_>>());
            let next: Vec<f64> = (0..nx).map(|i| number(i, 50)).collect();
            let mut point: Vec<f64> = (0..n).map(|j| number(70, j)).collect();
            point.resize(ld, 0.0);
            let (mut matrix, mut offset) = (vec![0.0; nx * ld], vec![0.0; padded_len::<f64>(nx)]);
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
