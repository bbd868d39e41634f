//! Second derivatives, which are found as the lower triangle of a matrix over all directions that
//! have any influence, to the matrices of results: those over one part of `w = (x₀, u, p)` have
//! both triangles, those over two parts lie whole in the one that was found.

use crate::irk::directions::{ArrayC, Identity, before};
use crate::linalg::{Arithmetic, Kernel, dispatch};
use crate::model::{ArrayW, Dae};
use crate::result::Hessian;
use crate::scalar::Lanes;
use crate::shape::{Matrix, Plain, Shape};
use core::marker::PhantomData;

/// A lower triangle.
pub(in crate::irk) struct Triangle<'a, M: Dae, E: Plain> {
    pub rows: &'a [ArrayC<M, E>],
    /// What an integrand adds, over all directions: a lower triangle, too.
    pub more: Option<&'a [ArrayW<M, E>]>,
}

impl<M: Dae, E: Lanes> Triangle<'_, M, E> {
    /// Writes the matrices of a result. Zero if all of them are finite, else NaN.
    pub fn write(&self, to: &mut Hessian<M, E>) -> E {
        let total = self.part::<_, X, X>(&mut to.h_xx)
            + self.part::<_, U, U>(&mut to.h_uu)
            + self.part::<_, P, P>(&mut to.h_pp)
            + self.part::<_, X, U>(&mut to.h_xu)
            + self.part::<_, X, P>(&mut to.h_xp)
            + self.part::<_, U, P>(&mut to.h_up);
        // Nothing times what is not finite is not a number.
        E::from_f64(0.0) * total
    }

    /// Its part over the directions of one part of `w` and those of another, which is not before
    /// it; the sum, which is finite only if all of it is.
    fn part<B: Matrix<E>, const OF_ROWS: usize, const OF_COLUMNS: usize>(&self, to: &mut B) -> E {
        let columns = to.as_mut_slice();
        if columns.is_empty() {
            return E::from_f64(0.0);
        }
        dispatch(Part::<M, E, B, OF_ROWS, OF_COLUMNS> { of: self, columns, model: PhantomData })
    }
}

/// The parts of `w`.
const X: usize = 0;
const U: usize = 1;
const P: usize = 2;

/// Where a part of `w` begins.
const fn begin<M: Dae>(part: usize) -> usize {
    match part {
        X => 0,
        U => M::Shape::NX,
        _ => M::Shape::NX + M::Shape::NU,
    }
}

/// See [`Triangle::part`].
struct Part<'a, M: Dae, E: Plain, B, const OF_ROWS: usize, const OF_COLUMNS: usize> {
    of: &'a Triangle<'a, M, E>,
    columns: &'a mut [E],
    model: PhantomData<B>,
}

impl<M: Dae, E: Lanes, B: Matrix<E>, const OF_ROWS: usize, const OF_COLUMNS: usize> Kernel
    for Part<'_, M, E, B, OF_ROWS, OF_COLUMNS>
{
    type Number = E;
    type Output = E;
    #[inline(always)]
    fn run<A: Arithmetic>(self) -> E {
        let Self { of: Triangle { rows, more }, columns, .. } = self;
        let zero = E::from_f64(0.0);
        let (row, column) = const { (begin::<M>(OF_ROWS), begin::<M>(OF_COLUMNS)) };
        let all = const { M::STRUCTURE.directions.len() == M::STRUCTURE.column_of_direction.len() };
        // The directions of these rows that have any influence.
        let range = const {
            let (directions, begin) = (M::STRUCTURE.directions, begin::<M>(OF_ROWS));
            before(directions, begin)..before(directions, begin + B::ROWS)
        };
        let directions = M::STRUCTURE.directions.get(range.clone()).unwrap_or_default();
        let mut total = zero;
        for (c, to) in columns.chunks_exact_mut(B::ROWS.max(1)).enumerate() {
            let of_c =
                Identity::<M>::column(column + c).and_then(|c| rows.get(c)?.as_ref().get(range.clone()));
            let of_c = of_c.unwrap_or_default();
            // What is in the triangle.
            let count = if const { OF_ROWS == OF_COLUMNS } { c + 1 } else { B::ROWS };
            let Some(to) = to.get_mut(..count) else { continue };
            match of_c.get(..count) {
                Some(of_c) if all => to.copy_from_slice(of_c),
                _ => {
                    to.fill(zero);
                    for (&direction, &value) in directions.iter().zip(of_c) {
                        if let Some(to) = to.get_mut((direction as usize).wrapping_sub(row)) {
                            *to = value;
                        }
                    }
                }
            }
            if let Some(more) = more.and_then(|more| more.get(column + c)?.as_ref().get(row..)) {
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
        if const { OF_ROWS == OF_COLUMNS } { mirror::<A, E>(columns, B::ROWS) } else { total }
    }
}

/// So many rows or columns are exchanged at a time.
const SQUARE: usize = 4;

/// Writes one triangle of a matrix of so many rows, the first elements of its columns, to the other
/// one; the sum of the former.
#[cfg_attr(not(debug_assertions), inline(always))]
fn mirror<A: Arithmetic, E: Lanes>(columns: &mut [E], n: usize) -> E {
    let zero = E::from_f64(0.0);
    let (mut sums, mut begin) = ([zero; SQUARE], 0);
    while begin < n {
        let Some((before, own)) = columns.split_at_mut_checked(begin * n) else { break };
        let count = SQUARE.min(n - begin);
        if count == SQUARE {
            // Those of the columns before, which are whole squares.
            for (square, to) in before.chunks_exact_mut(SQUARE * n).enumerate() {
                let mut numbers = [[zero; SQUARE]; SQUARE];
                for (numbers, own) in numbers.iter_mut().zip(own.chunks_exact(n)) {
                    if let Some(own) = own.as_chunks::<SQUARE>().0.get(square) {
                        *numbers = *own;
                    }
                }
                for (to, numbers) in to.chunks_exact_mut(n).zip(&A::transposed(&numbers)) {
                    for (sum, &number) in sums.iter_mut().zip(numbers) {
                        *sum = *sum + number;
                    }
                    if let Some(to) = to.get_mut(begin..begin + SQUARE) {
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
        begin += SQUARE;
    }
    let [a, b, c, d] = sums;
    (a + b) + (c + d)
}
