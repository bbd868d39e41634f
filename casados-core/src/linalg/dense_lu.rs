//! `P A = L U` of the whole matrix with partial pivoting, for the dense fallback.
//!
//! It is executed rarely: its loops over slices are compiled once for all models and numbers of
//! stages of a program, and are not unrolled.

use super::kernel::vector::{axpy, divide};
use crate::model::{ArrayK, Dae};
use crate::scalar::{Lanes, Real};
use crate::shape::{Array, InBounds, Plain, copy};
use bytemuck::Zeroable;

/// A matrix over the unknowns of all stages; after [`DenseLu::factor`] its factors.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct DenseLu<M: Dae, T: Plain, const S: usize> {
    /// Rows of `A`; after the factorisation those of `L` (with a unit diagonal, which is not
    /// stored) and `U`.
    rows: ArrayK<M, [ArrayK<M, [T; S]>; S]>,
    /// The row that was swapped with row `k` in step `k`.
    pivots: ArrayK<M, [u32; S]>,
    /// Scaling factors of the rows, 1 / largest element, in pivot order.
    scales: ArrayK<M, [T; S]>,
}

copy!([M: Dae, T: Plain, const S: usize] DenseLu<M, T, S>);

impl<M: Dae, T: Real, const S: usize> DenseLu<M, T, S> {
    /// `A = 0`
    pub fn clear(&mut self) {
        for row in self.rows.as_mut().as_flattened_mut() {
            row.as_mut().as_flattened_mut().fill(T::ZERO);
        }
    }

    /// Adds an entry of an equation and an unknown at the same stage.
    #[inline(always)]
    pub fn add(&mut self, equation: usize, unknown: usize, stage: usize, value: T) {
        if let Some(block) = self.block(equation, unknown, stage)
            && let Some(element) = block.get_mut(stage).in_bounds()
        {
            *element = *element + value;
        }
    }

    /// Adds entries of an equation at one stage and an unknown at all stages: `factor · row`.
    #[inline(always)]
    pub fn add_row(&mut self, equation: usize, unknown: usize, stage: usize, factor: T, row: &[T; S]) {
        if let Some(block) = self.block(equation, unknown, stage) {
            axpy(factor, row, block);
        }
    }

    /// The entries of an equation at one stage and an unknown at all stages.
    #[inline(always)]
    fn block(&mut self, equation: usize, unknown: usize, stage: usize) -> Option<&mut [T; S]> {
        self.rows.as_mut().get_mut(equation)?.get_mut(stage)?.as_mut().get_mut(unknown)
    }

    /// Replaces the matrix by its factors; see [`factor`].
    ///
    /// # Errors
    /// The column `(unknown, stage)` without a pivot.
    pub fn factor(&mut self) -> Result<(), (usize, usize)> {
        let rows = Array::flat_mut(self.rows.as_mut().as_flattened_mut()).as_flattened_mut();
        let (pivots, scales) = (self.pivots.as_mut(), self.scales.as_mut());
        factor(rows, pivots.as_flattened_mut(), scales.as_flattened_mut()).map_err(|k| (k / S, k % S))
    }
}

impl<M: Dae, E: Lanes, const S: usize> DenseLu<M, E, S> {
    /// Solves `A X = B` in place, all columns of `B` at once.
    pub fn solve<R: Array<E>>(&self, b: &mut ArrayK<M, [R; S]>) {
        self.factors().solve(R::flat_mut(b.as_mut().as_flattened_mut()), R::LEN);
    }

    /// Solves `Aᵀ X = B` in place, all columns of `B` at once.
    pub fn solve_transposed<R: Array<E>>(&self, b: &mut ArrayK<M, [R; S]>) {
        self.factors().solve_transposed(R::flat_mut(b.as_mut().as_flattened_mut()), R::LEN);
    }

    fn factors(&self) -> LuFactors<'_, E> {
        LuFactors {
            rows: Array::flat(self.rows.as_ref().as_flattened()).as_flattened(),
            pivots: self.pivots.as_ref().as_flattened(),
            scales: self.scales.as_ref().as_flattened(),
        }
    }
}

/// Replaces a matrix in row-major order by its factors.
///
/// Pivots are compared relative to the largest element of their row, so that the choice is
/// invariant under scaling of equations. A pivot counts as zero if it does not exceed its rounding
/// errors, `n ε Σ_j |l_ij u_jk|`, which is invariant under scaling of equations and unknowns.
///
/// # Errors
/// The column without a pivot.
#[inline(never)]
fn factor<T: Real>(rows: &mut [T], pivots: &mut [u32], scales: &mut [T]) -> Result<(), usize> {
    let n = scales.len();
    if n == 0 {
        return Ok(());
    }
    for (scale, row) in scales.iter_mut().zip(rows.chunks_exact_mut(n)) {
        let largest = row.iter().fold(T::ZERO, |largest, a| a.abs().max(largest));
        *scale = if largest > T::ZERO { T::from_f64(1.0) / largest } else { T::from_f64(1.0) };
        for a in row {
            *a = *a * *scale;
        }
    }
    for (k, pivot_row) in pivots.iter_mut().enumerate() {
        let (mut best, mut pivot_index) = (T::ZERO, k);
        for (i, row) in rows.chunks_exact(n).enumerate().skip(k) {
            let size = row.get(k).in_bounds().map_or(T::ZERO, |element| element.abs());
            if size > best {
                (best, pivot_index) = (size, i);
            }
        }
        swap_rows(rows, n, k, pivot_index);
        swap_rows(scales, 1, k, pivot_index);
        *pivot_row = pivot_index as u32;
        let Some((upper, lower)) = rows.split_at_mut_checked((k + 1) * n) else { return Err(k) };
        let Some((above, row)) = upper.split_at_checked(k * n) else { return Err(k) };
        let Some((&pivot, row_after)) = row.get(k..).in_bounds().and_then(|row| row.split_first()) else {
            return Err(k);
        };
        let singular = !(best > T::ZERO && pivot.is_finite())
            || best * best < T::from_f64(T::EPSILON) && {
                let mut sum = T::ZERO;
                for (above, l) in above.chunks_exact(n).zip(row) {
                    sum = sum + (*l * above.get(k).in_bounds().copied().unwrap_or(T::ZERO)).abs();
                }
                pivot.abs() <= T::from_whole(n) * T::from_f64(T::EPSILON) * sum
            };
        if singular {
            return Err(k);
        }
        for lower in lower.chunks_exact_mut(n) {
            let Some((l, after)) = lower.get_mut(k..).in_bounds().and_then(|row| row.split_first_mut())
            else {
                continue;
            };
            *l = *l / pivot;
            if *l != T::ZERO {
                axpy(-*l, row_after, after);
            }
        }
    }
    Ok(())
}

/// Swaps two rows of `width` elements. The bounds check remains, since the compiler cannot prove
/// that pivots are rows.
fn swap_rows<T>(rows: &mut [T], width: usize, i: usize, j: usize) {
    let (first, second) = (i.min(j), i.max(j));
    if first == second {
        return;
    }
    if let Some((upper, lower)) = rows.split_at_mut_checked(second * width) {
        for (a, b) in upper.iter_mut().skip(first * width).take(width).zip(lower) {
            core::mem::swap(a, b);
        }
    }
}

/// The factors, with the pivot order and the scaling of the rows.
struct LuFactors<'a, E> {
    rows: &'a [E],
    pivots: &'a [u32],
    scales: &'a [E],
}

impl<E: Lanes> LuFactors<'_, E> {
    /// Solves `A X = B` with `width` columns.
    #[inline(never)]
    fn solve(&self, b: &mut [E], width: usize) {
        let (n, zero) = (self.scales.len(), E::from_f64(0.0));
        if n == 0 || width == 0 {
            return;
        }
        for (k, pivot) in self.pivots.iter().enumerate() {
            swap_rows(b, width, k, *pivot as usize);
        }
        self.scale(b, width);
        for (i, row) in self.rows.chunks_exact(n).enumerate() {
            let Some((before, here)) = b.split_at_mut_checked(i * width) else { return };
            let Some(here) = here.get_mut(..width).in_bounds() else { return };
            for (l, x) in row.iter().zip(before.chunks_exact(width)) {
                if *l != zero {
                    axpy(-*l, x, here);
                }
            }
        }
        for (i, row) in self.rows.chunks_exact(n).enumerate().rev() {
            let Some((here, after)) = b.split_at_mut_checked((i + 1) * width) else { return };
            let (Some(current), Some((pivot, row))) = (
                here.get_mut(i * width..).in_bounds(),
                row.get(i..).in_bounds().and_then(|row| row.split_first()),
            ) else {
                return;
            };
            for (u, x) in row.iter().zip(after.chunks_exact(width)) {
                if *u != zero {
                    axpy(-*u, x, current);
                }
            }
            divide(current, *pivot);
        }
    }

    /// Scales the rows of `b`, which are not empty, by the factors of the matrix.
    #[inline(always)]
    fn scale(&self, b: &mut [E], width: usize) {
        for (row, scale) in b.chunks_exact_mut(width).zip(self.scales) {
            for b in row {
                *b = *b * *scale;
            }
        }
    }

    /// Solves `Aᵀ X = B` with `width` columns.
    #[inline(never)]
    fn solve_transposed(&self, b: &mut [E], width: usize) {
        let (n, zero) = (self.scales.len(), E::from_f64(0.0));
        if n == 0 || width == 0 {
            return;
        }
        for (i, row) in self.rows.chunks_exact(n).enumerate() {
            let Some((here, after)) = b.split_at_mut_checked((i + 1) * width) else { return };
            let (Some(current), Some((pivot, row))) = (
                here.get_mut(i * width..).in_bounds(),
                row.get(i..).in_bounds().and_then(|row| row.split_first()),
            ) else {
                return;
            };
            divide(current, *pivot);
            for (u, x) in row.iter().zip(after.chunks_exact_mut(width)) {
                if *u != zero {
                    axpy(-*u, current, x);
                }
            }
        }
        for (i, row) in self.rows.chunks_exact(n).enumerate().rev() {
            let Some((before, here)) = b.split_at_mut_checked(i * width) else { return };
            let Some(here) = here.get(..width).in_bounds() else { return };
            for (l, x) in row.iter().zip(before.chunks_exact_mut(width)) {
                if *l != zero {
                    axpy(-*l, here, x);
                }
            }
        }
        self.scale(b, width);
        for (k, pivot) in self.pivots.iter().enumerate().rev() {
            swap_rows(b, width, k, *pivot as usize);
        }
    }
}
