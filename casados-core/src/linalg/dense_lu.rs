//! `P A = L U` of the whole matrix, with partial pivoting: the way that needs no plan.

use super::kernel::vector::{axpy, divide};
use crate::model::{ArrayK, Dae};
use crate::scalar::{Lanes, Real};
use crate::shape::{Array, Plain};
use bytemuck::Zeroable;

/// A matrix over the unknowns of all stages, and after [`Dense::factor`] its factors.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct Dense<M: Dae, T: Plain, const S: usize> {
    /// Rows of `A`, then of `L` (its diagonal is one and not stored) and `U`.
    rows: ArrayK<M, [ArrayK<M, [T; S]>; S]>,
    /// The row that was exchanged with row `k` in step `k`.
    pivots: ArrayK<M, [u32; S]>,
    /// What each row is multiplied by: 1 / its largest element, in the order of the pivots.
    scales: ArrayK<M, [T; S]>,
}

impl<M: Dae, T: Plain, const S: usize> Clone for Dense<M, T, S> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<M: Dae, T: Plain, const S: usize> Copy for Dense<M, T, S> {}

impl<M: Dae, T: Real, const S: usize> Dense<M, T, S> {
    /// `A = 0`
    pub fn clear(&mut self) {
        for row in self.rows.as_mut().as_flattened_mut() {
            row.as_mut().as_flattened_mut().fill(T::ZERO);
        }
    }

    /// Adds a value that couples an equation with an unknown of the same stage.
    #[inline(always)]
    pub fn add(&mut self, equation: usize, unknown: usize, stage: usize, value: T) {
        if let Some(block) = self.block(equation, unknown, stage)
            && let Some(element) = block.get_mut(stage)
        {
            *element = *element + value;
        }
    }

    /// Adds values that couple an equation at one stage with an unknown at all stages:
    /// `factor · row`.
    #[inline(always)]
    pub fn add_row(&mut self, equation: usize, unknown: usize, stage: usize, factor: T, row: &[T; S]) {
        if let Some(block) = self.block(equation, unknown, stage) {
            axpy(factor, row, block);
        }
    }

    /// What couples an equation at one stage with an unknown at all stages.
    #[inline(always)]
    fn block(&mut self, equation: usize, unknown: usize, stage: usize) -> Option<&mut [T; S]> {
        self.rows.as_mut().get_mut(equation)?.get_mut(stage)?.as_mut().get_mut(unknown)
    }

    /// Replaces the matrix by its factors.
    ///
    /// Pivots are compared relative to the largest element of their row, so that the choice does
    /// not depend on the scaling of equations. A pivot is zero if it is not larger than the
    /// rounding errors that it carries, `n ε Σ_j |l_ij u_jk|`, whatever the scaling of equations
    /// and unknowns.
    ///
    /// # Errors
    /// The column `(unknown, stage)` that has no pivot.
    pub fn factor(&mut self) -> Result<(), (usize, usize)> {
        let rows = self.rows.as_mut().as_flattened_mut();
        let pivots = self.pivots.as_mut().as_flattened_mut();
        let scales = self.scales.as_mut().as_flattened_mut();
        let n = rows.len();
        for (scale, row) in scales.iter_mut().zip(rows.iter_mut()) {
            let row = row.as_mut().as_flattened_mut();
            let mut largest = T::ZERO;
            for a in row.iter() {
                largest = a.abs().max(largest);
            }
            *scale = if largest > T::ZERO { T::from_f64(1.0) / largest } else { T::from_f64(1.0) };
            for a in row {
                *a = *a * *scale;
            }
        }
        for k in 0..n {
            let (mut best, mut at) = (T::ZERO, k);
            for (i, row) in rows.iter().enumerate().skip(k) {
                let size = row.as_ref().as_flattened()[k].abs();
                if size > best {
                    (best, at) = (size, i);
                }
            }
            exchange(rows, k, at);
            exchange(scales, k, at);
            pivots[k] = at as u32;
            let (upper, lower) = rows.split_at_mut(k + 1);
            let (above, row) = upper.split_at(k);
            let Some(row) = row.first() else { return Err((k / S, k % S)) };
            let row = row.as_ref().as_flattened();
            let pivot = row[k];
            let singular = !(best > T::ZERO && pivot.is_finite())
                || best * best < T::from_f64(T::EPSILON) && {
                    let mut sum = T::ZERO;
                    for (above, l) in above.iter().zip(row) {
                        sum = sum + (*l * above.as_ref().as_flattened()[k]).abs();
                    }
                    pivot.abs() <= T::from_whole(n) * T::from_f64(T::EPSILON) * sum
                };
            if singular {
                return Err((k / S, k % S));
            }
            for lower in lower {
                let lower = lower.as_mut().as_flattened_mut();
                let l = lower[k] / pivot;
                lower[k] = l;
                if l != T::ZERO {
                    axpy(-l, &row[k + 1..], &mut lower[k + 1..]);
                }
            }
        }
        Ok(())
    }
}

/// Two rows in each other's place. The compiler does not know that pivots are rows.
fn exchange<R>(rows: &mut [R], i: usize, j: usize) {
    if i.max(j) < rows.len() {
        rows.swap(i, j);
    }
}

impl<M: Dae, E: Lanes, const S: usize> Dense<M, E, S> {
    /// Solves `A X = B` in place, all columns of `B` at once.
    pub fn solve<R: Array<E>>(&self, b: &mut ArrayK<M, [R; S]>) {
        let (rows, zero) = (self.rows.as_ref().as_flattened(), E::from_f64(0.0));
        let b = b.as_mut().as_flattened_mut();
        for (k, pivot) in self.pivots.as_ref().as_flattened().iter().enumerate() {
            exchange(b, k, *pivot as usize);
        }
        self.scale(b);
        for (i, row) in rows.iter().enumerate() {
            let (before, here) = b.split_at_mut(i);
            let Some(here) = here.first_mut() else { return };
            for (l, x) in row.as_ref().as_flattened().iter().zip(before.iter()) {
                if *l != zero {
                    axpy(-*l, x.as_ref(), here.as_mut());
                }
            }
        }
        for (i, row) in rows.iter().enumerate().rev() {
            let (here, after) = b.split_at_mut(i + 1);
            let Some(here) = here.last_mut() else { return };
            let row = row.as_ref().as_flattened();
            for (u, x) in row[i + 1..].iter().zip(after.iter()) {
                if *u != zero {
                    axpy(-*u, x.as_ref(), here.as_mut());
                }
            }
            divide(here.as_mut(), row[i]);
        }
    }

    /// Multiplies the rows as those of the matrix were.
    fn scale<R: Array<E>>(&self, b: &mut [R]) {
        for (row, scale) in b.iter_mut().zip(self.scales.as_ref().as_flattened()) {
            for b in row.as_mut() {
                *b = *b * *scale;
            }
        }
    }

    /// Solves `Aᵀ X = B` in place, all columns of `B` at once.
    pub fn solve_transposed<R: Array<E>>(&self, b: &mut ArrayK<M, [R; S]>) {
        let (rows, zero) = (self.rows.as_ref().as_flattened(), E::from_f64(0.0));
        let b = b.as_mut().as_flattened_mut();
        for (i, row) in rows.iter().enumerate() {
            let (here, after) = b.split_at_mut(i + 1);
            let Some(here) = here.last_mut() else { return };
            let row = row.as_ref().as_flattened();
            divide(here.as_mut(), row[i]);
            for (u, x) in row[i + 1..].iter().zip(after) {
                if *u != zero {
                    axpy(-*u, here.as_ref(), x.as_mut());
                }
            }
        }
        for (i, row) in rows.iter().enumerate().rev() {
            let (before, here) = b.split_at_mut(i);
            let Some(here) = here.first() else { return };
            for (l, x) in row.as_ref().as_flattened().iter().zip(before) {
                if *l != zero {
                    axpy(-*l, here.as_ref(), x.as_mut());
                }
            }
        }
        self.scale(b);
        for (k, pivot) in self.pivots.as_ref().as_flattened().iter().enumerate().rev() {
            exchange(b, k, *pivot as usize);
        }
    }
}
