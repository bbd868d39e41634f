//! The linearised dynamics of an interval, in the layout of the QP.

use crate::linalg::dot;
use crate::ocp::formulation::free_parameters::FreeParametersView;
use crate::ocp::formulation::functions::dynamics::{IntegralTerms, IntervalResult};
use crate::ocp::formulation::functions::node_evaluation::{QuadraticTerms, add_blocks};
use crate::ocp::formulation::instance::data::stage_variable_count;
use crate::ocp::formulation::problem::Formulation;
use crate::qp::element::set;
use crate::qp::{Arrays, part, part_mut, splat};
use crate::scalar::{Packed, Real, Registers, compiled};
use crate::shape::Shape;
use bytemuck::Zeroable;

/// An upper limit of the lanes of all registers.
const MAX_LANES: usize = 16;

/// The largest number of remaining rows that are copied element by element.
const MAX_SCALAR_ROWS: usize = 2;

/// The linearised dynamics: `[A B]ᵀ`, a column for each next state, and `x₊ − A x − B u`.
pub(in crate::ocp) struct LinearisedInterval<'a, T> {
    /// `A` and `B` by columns.
    pub columns: [&'a [T]; 2],
    /// `x₊`
    pub end_state: &'a [T],
    /// `(x, u)`, padded with zeros to the length of a column.
    pub point: &'a [T],
    /// `[A B]ᵀ`, with columns at a distance of `ld`.
    pub matrix: &'a mut [T],
    pub ld: usize,
    pub offset: &'a mut [T],
}

compiled! {
    /// See [`LinearisedInterval`].
    LinearisedIntervalCompiled: LinearisedInterval<'r, T>
}

impl<T: Real> LinearisedInterval<'_, T> {
    pub fn write(self) {
        T::run_precompiled::<LinearisedIntervalCompiled>(self);
    }
}

impl<T: Real> Registers<T> for LinearisedInterval<'_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let Self { columns: [a, b], end_state: next, point, matrix, ld, offset } = self;
        let nx = next.len();
        let n = nx + b.len() / nx.max(1);
        // Column `j` of `[A B]` from element `i` on.
        let column_from_row = |i: usize, j: usize| {
            let (columns, j) = if j < nx { (a, j) } else { (b, j - nx) };
            columns.get(j * nx + i..).unwrap_or_default()
        };
        let vector_rows = nx - nx % E::LANES;
        let end = if vector_rows + MAX_SCALAR_ROWS < nx && nx >= E::LANES { nx } else { vector_rows };
        let mut tile: [E::Cell; MAX_LANES] = Zeroable::zeroed();
        let Some(tile) = tile.get_mut(..E::LANES) else { return };
        for i in (0..end).step_by(E::LANES) {
            // The last rows are written together with some rows that were written before.
            let i = i.min(nx - E::LANES);
            let Some(next) = E::cells(part(next, i, E::LANES)).first() else { return };
            let mut sum = E::load(next);
            for j in (0..n).step_by(E::LANES) {
                let mut columns = [E::from_f64(0.0); MAX_LANES];
                // A constant count for the optimiser.
                for (l, column) in columns.iter_mut().enumerate().take(E::LANES) {
                    if j + l < n
                        && let Some(cell) = E::cells(part(column_from_row(i, j + l), 0, E::LANES)).first()
                        && let Some(&v) = point.get(j + l)
                    {
                        *column = E::load(cell);
                        sum = sum.minus_product(*column, splat(v));
                    }
                }
                E::transpose(&columns[..E::LANES], tile);
                let rows = matrix.get_mut(i * ld..).unwrap_or_default().chunks_mut(ld.max(1));
                for (row, from) in rows.zip(&*tile) {
                    // Padding is overwritten with zeros.
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
                *to = column_from_row(i, j).first().copied().unwrap_or(T::ZERO);
                sum = sum - *to * v;
            }
            if let Some(offset) = offset.get_mut(i) {
                *offset = sum;
            }
        }
    }
}

/// Which terms of the QP the intervals have.
pub(in crate::ocp) struct IntervalContributions {
    /// Whether Hessians consist of costs at nodes only.
    pub has_node_costs_only: bool,
    /// Whether intervals add to costs, either all or none. If not, costs at nodes clear gradient
    /// and Hessian first.
    pub adds_to_costs: bool,
}

impl IntervalContributions {
    /// Writes an interval to its stage.
    pub fn write_interval<P: Formulation<T>, T: Real>(
        &mut self,
        step: &IntervalResult<'_, T>,
        free: FreeParametersView<'_>,
        Arrays { ld, matrix, hessian, gradient, offset, .. }: Arrays<'_, T>,
        point: &[T],
    ) {
        let nx = P::Shape::NX;
        if free.count() > 0 {
            let n = stage_variable_count::<P::Shape>(free.count());
            write_with_free_parameters(step, free, (matrix, ld), offset, part(point, 0, n));
        } else {
            LinearisedInterval { columns: [step.dx, step.du], end_state: step.x, point, matrix, ld, offset }
                .write();
        }
        let IntegralTerms { x, u, p, hessian: blocks, hessian_p: blocks_p, .. } = step.cost;
        self.has_node_costs_only &= blocks.iter().chain(&step.hessian).all(|block| block.is_empty());
        if self.has_node_costs_only && x.is_empty() && u.is_empty() {
            return;
        }
        self.adds_to_costs = true;
        let mut terms = QuadraticTerms { free, gradient, hessian, ld };
        terms.hessian.fill(T::ZERO);
        terms.gradient.fill(T::ZERO);
        x.iter().enumerate().for_each(|(i, &slope)| terms.add_gradient(i, slope));
        (nx + free.count()..).zip(u).for_each(|(i, &slope)| terms.add_gradient(i, slope));
        free.free_elements(p).for_each(|(w, slope)| terms.add_gradient(nx + w, slope));
        add_blocks(&mut terms, nx, blocks, blocks_p);
        add_blocks(&mut terms, nx, step.hessian, step.hessian_p);
    }
}

/// Writes a [`LinearisedInterval`] with derivatives with respect to free parameters between those
/// of states and controls.
fn write_with_free_parameters<T: Real>(
    step: &IntervalResult<'_, T>,
    free: FreeParametersView<'_>,
    (matrix, ld): (&mut [T], usize),
    offset: &mut [T],
    point: &[T],
) {
    let nx = step.x.len();
    matrix.get_mut(..nx * ld).unwrap_or_default().fill(T::ZERO);
    let states = step.dx.chunks_exact(nx.max(1)).enumerate();
    let controls = (nx + free.count()..).zip(step.du.chunks_exact(nx.max(1)));
    let parameters = free.free_columns(step.dp, nx).map(|(w, column)| (nx + w, column));
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

    /// Numbers are integers, so that all sums are exact.
    #[test]
    fn linearised_intervals_of_every_size() {
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
            LinearisedInterval {
                columns,
                end_state: &next,
                point: &point,
                matrix: target,
                ld,
                offset: shift,
            }
            .write();
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
