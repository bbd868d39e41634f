//! Copies second derivatives from the lower triangle over all directions with influence to the
//! matrices of results. Diagonal blocks of `w = (x₀, u, p)` get both triangles; off-diagonal blocks
//! lie completely in the lower triangle.

use super::products::StridedMatrix;
use crate::irk::directions::column_of;
use crate::linalg::{Arithmetic, Kernel, dispatch};
use crate::model::Dae;
use crate::plan::{Plan, count_before};
use crate::result::Hessian;
use crate::scalar::Lanes;
use crate::shape::{InBounds, Matrix};
use crate::structure::Structure;

/// The lower triangle of a symmetric matrix.
pub(in crate::irk) struct HessianTriangle<'a, M, E> {
    pub plan: M,
    pub rows: StridedMatrix<'a, E>,
    /// The lower triangle of the second derivatives of an integrand, over all directions.
    pub integrand_hessian: Option<&'a [E]>,
}

impl<M: Plan, E: Lanes> HessianTriangle<'_, M, E> {
    /// Writes the matrices of a result. Returns zero if all of them are finite, otherwise NaN.
    pub fn write<D: Dae>(&self, to: &mut Hessian<D, E>) -> E {
        let total = self.write_block::<X, X>(to.h_xx.as_mut_slice())
            + self.write_block::<U, U>(to.h_uu.as_mut_slice())
            + self.write_block::<P, P>(to.h_pp.as_mut_slice())
            + self.write_block::<X, U>(to.h_xu.as_mut_slice())
            + self.write_block::<X, P>(to.h_xp.as_mut_slice())
            + self.write_block::<U, P>(to.h_up.as_mut_slice());
        // Zero times a non-finite number is NaN.
        E::from_f64(0.0) * total
    }

    /// Writes the block of the rows of one part of `w` and the columns of the same or a later part.
    /// Returns the sum, which is finite only if all elements are.
    fn write_block<const OF_ROWS: usize, const OF_COLUMNS: usize>(&self, columns: &mut [E]) -> E {
        if columns.is_empty() {
            return E::from_f64(0.0);
        }
        dispatch(BlockKernel::<_, E, OF_ROWS, OF_COLUMNS> { triangle: self, columns })
    }
}

/// Indices of the parts of `w`.
const X: usize = 0;
const U: usize = 1;
const P: usize = 2;

/// The first element of a part of `w`.
const fn block_begin(structure: &Structure, part: usize) -> usize {
    match part {
        X => 0,
        U => structure.x.len(),
        P => structure.x.len() + structure.u.len(),
        _ => structure.column_of_direction.len(),
    }
}

/// The range of columns of the triangle for the directions with influence in a part.
const fn active_columns(structure: &Structure, part: usize) -> [usize; 2] {
    let directions = structure.directions;
    [
        count_before(directions, block_begin(structure, part)),
        count_before(directions, block_begin(structure, part + 1)),
    ]
}

/// See [`HessianTriangle::write_block`].
struct BlockKernel<'a, M, E, const OF_ROWS: usize, const OF_COLUMNS: usize> {
    triangle: &'a HessianTriangle<'a, M, E>,
    columns: &'a mut [E],
}

impl<M: Plan, E: Lanes, const OF_ROWS: usize, const OF_COLUMNS: usize> Kernel
    for BlockKernel<'_, M, E, OF_ROWS, OF_COLUMNS>
{
    type Number = E;
    type Output = E;
    #[inline(always)]
    fn run<A: Arithmetic>(self) -> E {
        let Self { triangle: HessianTriangle { plan, rows, integrand_hessian: more }, columns } = self;
        let (zero, structure, nw) = (E::from_f64(0.0), plan.structure(), plan.nw());
        let (row, column) = (block_begin(structure, OF_ROWS), block_begin(structure, OF_COLUMNS));
        let count_of_rows = block_begin(structure, OF_ROWS + 1) - row;
        let all_active = structure.directions.len() == structure.column_of_direction.len();
        // The directions of these rows that have influence.
        let known = const {
            match M::KNOWN_STRUCTURE {
                Some(structure) => Some(active_columns(structure, OF_ROWS)),
                None => None,
            }
        };
        let [first, end] = known.unwrap_or_else(|| active_columns(structure, OF_ROWS));
        let directions = structure.directions.get(first..end).in_bounds().unwrap_or_default();
        let mut total = zero;
        for (c, to) in columns.chunks_exact_mut(count_of_rows.max(1)).enumerate() {
            let column_values =
                column_of(*plan, column + c).and_then(|c| rows.row(c, first)?.get(..end - first));
            let column_values = column_values.unwrap_or_default();
            // Number of rows that the triangle contains.
            let count = if const { OF_ROWS == OF_COLUMNS } { c + 1 } else { count_of_rows };
            let Some(to) = to.get_mut(..count) else { continue };
            match column_values.get(..count) {
                Some(of_c) if all_active => to.copy_from_slice(of_c),
                _ => {
                    to.fill(zero);
                    for (&direction, &value) in directions.iter().zip(column_values) {
                        if let Some(to) = to.get_mut((direction as usize).wrapping_sub(row)) {
                            *to = value;
                        }
                    }
                }
            }
            let integrand_range = (column + c) * nw + row..(column + c + 1) * nw;
            if let Some(more) = more.and_then(|more| more.get(integrand_range).in_bounds()) {
                for (to, &more) in to.iter_mut().zip(more) {
                    *to = *to + more;
                }
            }
            if const { OF_ROWS != OF_COLUMNS } {
                for &value in &*to {
                    total = total + value;
                }
            }
        }
        if const { OF_ROWS == OF_COLUMNS } { mirror_triangle::<A, E>(columns, count_of_rows) } else { total }
    }
}

/// Number of rows and columns of a block that is transposed in registers.
const TRANSPOSE_SIZE: usize = 4;

/// Mirrors the triangle of an `n × n` matrix that consists of the first elements of its columns;
/// returns the sum of its elements.
#[cfg_attr(not(debug_assertions), inline(always))]
fn mirror_triangle<A: Arithmetic, E: Lanes>(columns: &mut [E], n: usize) -> E {
    let zero = E::from_f64(0.0);
    let (mut sums, mut begin) = ([zero; TRANSPOSE_SIZE], 0);
    while begin < n {
        let Some((before, own)) = columns.split_at_mut_checked(begin * n) else { break };
        let count = TRANSPOSE_SIZE.min(n - begin);
        if count == TRANSPOSE_SIZE {
            // Blocks of preceding columns are whole squares.
            for (square, to) in before.chunks_exact_mut(TRANSPOSE_SIZE * n).enumerate() {
                let mut numbers = [[zero; TRANSPOSE_SIZE]; TRANSPOSE_SIZE];
                for (numbers, own) in numbers.iter_mut().zip(own.chunks_exact(n)) {
                    if let Some(own) = own.as_chunks::<TRANSPOSE_SIZE>().0.get(square) {
                        *numbers = *own;
                    }
                }
                for (to, numbers) in to.chunks_exact_mut(n).zip(&A::transposed(&numbers)) {
                    for (sum, &number) in sums.iter_mut().zip(numbers) {
                        *sum = *sum + number;
                    }
                    if let Some(to) = to.get_mut(begin..begin + TRANSPOSE_SIZE) {
                        to.copy_from_slice(numbers);
                    }
                }
            }
        } else {
            for (r, to) in before.chunks_exact_mut(n).enumerate() {
                for (to, own) in to.iter_mut().skip(begin).zip(own.chunks_exact(n)) {
                    if let Some(&number) = own.get(r) {
                        sums[0] = sums[0] + number;
                        *to = number;
                    }
                }
            }
        }
        for c in 0..count {
            for r in 0..=c {
                let Some(&number) = own.get(c * n + begin + r) else { continue };
                sums[1] = sums[1] + number;
                if let Some(to) = own.get_mut(r * n + begin + c) {
                    *to = number;
                }
            }
        }
        begin += TRANSPOSE_SIZE;
    }
    let [a, b, c, d] = sums;
    (a + b) + (c + d)
}
