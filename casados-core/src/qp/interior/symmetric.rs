//! Factorisation of small symmetric indefinite matrices: `P A Pᵀ = L D Lᵀ` with pivots of one and
//! two rows.
//!
//! Bunch and Kaufman, "Some stable methods for calculating inertia and solving symmetric linear
//! systems", Math. Comp. 31 (1977).

use super::vector::add_scaled;
use crate::qp::element::set;
use crate::qp::layout::{part, part_mut};
use crate::scalar::Real;

/// `(1 + √17) / 8`
const ALPHA: f64 = 0.640_388_203_202_207_6;

/// The signs of the eigenvalues.
#[derive(Clone, Copy, Debug, Default)]
pub struct Inertia {
    /// The number of negative eigenvalues.
    pub negative: usize,
    /// The number of vanishing pivots, whose unknowns are set to zero.
    pub vanished: usize,
}

/// The factors, in the memory of the matrix, whose lower triangle is stored column after column.
#[derive(Clone, Copy, Debug)]
pub struct Symmetric<'a, T> {
    a: &'a [T],
    n: usize,
    /// For every pivot the index of the row it was exchanged with, counted from one; negative for
    /// pairs.
    exchanged: &'a [T],
}

/// A factorisation in progress.
struct BunchKaufman<'a, T> {
    a: &'a mut [T],
    n: usize,
    exchanged: &'a mut [T],
    inertia: Inertia,
}

/// Returns an element of the matrix.
fn element<T: Real>(a: &[T], n: usize, row: usize, column: usize) -> T {
    let (row, column) = if row < column { (column, row) } else { (row, column) };
    a.get(column * n + row).copied().unwrap_or(T::ZERO)
}

/// Returns the inverse of a block of two pivots times a vector.
fn solve_2x2_block<T: Real>(a: &[T], n: usize, k: usize, [x, y]: [T; 2]) -> [T; 2] {
    let at = |i, j| element(a, n, i, j);
    let (a, b, c) = (at(k, k), at(k + 1, k), at(k + 1, k + 1));
    // Division by `b` first avoids overflow of its square.
    let (a, c) = (a / b, c / b);
    let determinant = b * (a * c - T::ONE);
    [(c * x - y) / determinant, (a * y - x) / determinant]
}

impl<T: Real> BunchKaufman<'_, T> {
    /// Factorises; pivots below `noise` times the largest element vanish.
    fn factorise(&mut self, noise: T) {
        let n = self.n;
        let mut largest = T::ZERO;
        for j in 0..n {
            for i in j..n {
                largest = self.get(i, j).abs().max(largest);
            }
        }
        let small = noise * largest;
        let mut k = 0;
        while k < n {
            k += self.eliminate(k, small);
        }
    }

    fn get(&self, row: usize, column: usize) -> T {
        element(self.a, self.n, row, column)
    }

    fn set(&mut self, row: usize, column: usize, value: T) {
        let (row, column) = if row < column { (column, row) } else { (row, column) };
        set(self.a, column * self.n + row, value);
    }

    /// Returns the largest off-diagonal element of a column, from row `from` on, and its row.
    fn largest_off_diagonal(&self, column: usize, from: usize) -> (usize, T) {
        let mut found = (from, T::ZERO);
        for row in from..self.n {
            let size = self.get(row, column).abs();
            if row != column && size > found.1 {
                found = (row, size);
            }
        }
        found
    }

    /// Chooses and eliminates the next one or two pivots; returns their number.
    fn eliminate(&mut self, k: usize, small: T) -> usize {
        let alpha = T::from_f64(ALPHA);
        let (row, below) = self.largest_off_diagonal(k, k + 1);
        let size = self.get(k, k).abs();
        if size.max(below) <= small {
            self.inertia.vanished += 1;
            self.eliminate_1x1(k, k, true);
            return 1;
        }
        if size >= alpha * below {
            self.eliminate_1x1(k, k, false);
            return 1;
        }
        let (_, beside) = self.largest_off_diagonal(row, k);
        if size * beside >= alpha * below * below {
            self.eliminate_1x1(k, k, false);
            return 1;
        }
        if self.get(row, row).abs() >= alpha * beside {
            self.eliminate_1x1(k, row, false);
            return 1;
        }
        self.eliminate_2x2(k, row);
        2
    }

    /// Exchanges two unknowns, `k < other`, in the remaining matrix and in `L`.
    fn exchange(&mut self, k: usize, other: usize) {
        if k == other {
            return;
        }
        for j in 0..self.n {
            if j == k || j == other {
                continue;
            }
            let (a, b) = (self.get(k, j), self.get(other, j));
            // Left of the diagonal are rows of `L`, elsewhere elements of the matrix.
            self.set(k, j, b);
            self.set(other, j, a);
        }
        let (a, b) = (self.get(k, k), self.get(other, other));
        self.set(k, k, b);
        self.set(other, other, a);
    }

    /// Eliminates one pivot, that of `row`.
    fn eliminate_1x1(&mut self, k: usize, row: usize, vanished: bool) {
        self.exchange(k, row);
        set(self.exchanged, k, T::from_whole(row + 1));
        if vanished {
            for i in k + 1..self.n {
                self.set(i, k, T::ZERO);
            }
            self.set(k, k, T::ZERO);
            return;
        }
        let pivot = self.get(k, k);
        self.inertia.negative += usize::from(pivot < T::ZERO);
        let n = self.n;
        let (before, rest) = self.a.split_at_mut_checked((k + 1) * n).unwrap_or_default();
        let own = part(before, k * n, n);
        for (j, column) in rest.chunks_exact_mut(n.max(1)).enumerate().map(|(j, column)| (k + 1 + j, column))
        {
            let (own, column) = (part(own, j, n - j), part_mut(column, j, n - j));
            let Some(&first) = own.first() else { break };
            add_scaled(column, -(first / pivot), own);
        }
        for i in k + 1..self.n {
            let value = self.get(i, k) / pivot;
            self.set(i, k, value);
        }
    }

    /// Eliminates two pivots, `k` and `row`.
    fn eliminate_2x2(&mut self, k: usize, row: usize) {
        self.exchange(k + 1, row);
        set(self.exchanged, k, -T::from_whole(k + 1));
        set(self.exchanged, k + 1, -T::from_whole(row + 1));
        // The determinant is negative: one eigenvalue of each sign.
        self.inertia.negative += 1;
        let n = self.n;
        for j in k + 2..n {
            let [first, second] = solve_2x2_block(self.a, n, k, [self.get(j, k), self.get(j, k + 1)]);
            let (before, rest) = self.a.split_at_mut_checked(j * n).unwrap_or_default();
            let column = part_mut(rest, j, n - j);
            add_scaled(column, -first, part(before, k * n + j, n - j));
            add_scaled(column, -second, part(before, (k + 1) * n + j, n - j));
        }
        for i in k + 2..self.n {
            let [first, second] = solve_2x2_block(self.a, self.n, k, [self.get(i, k), self.get(i, k + 1)]);
            self.set(i, k, first);
            self.set(i, k + 1, second);
        }
    }
}

impl<'a, T: Real> Symmetric<'a, T> {
    /// Factorises a matrix, and returns its inertia. Pivots below `noise` times the largest element
    /// vanish.
    pub fn factor(a: &mut [T], n: usize, exchanged: &mut [T], noise: T) -> Inertia {
        let mut elimination = BunchKaufman { a, n, exchanged, inertia: Inertia::default() };
        elimination.factorise(noise);
        elimination.inertia
    }

    /// The factors that [`Symmetric::factor`] left in this memory.
    pub fn new(a: &'a [T], n: usize, exchanged: &'a [T]) -> Self {
        Self { a, n, exchanged }
    }

    fn get(&self, row: usize, column: usize) -> T {
        element(self.a, self.n, row, column)
    }

    /// Returns whether a pivot belongs to a pair.
    fn is_2x2_pivot(&self, k: usize) -> bool {
        self.exchanged.get(k).is_some_and(|&e| e < T::ZERO)
    }

    /// Returns the row that a pivot was exchanged with.
    fn exchanged_row(&self, k: usize) -> usize {
        self.exchanged.get(k).map_or(k, |e| (e.abs().to_f64() as usize).saturating_sub(1))
    }

    /// Solves for one right-hand side.
    pub fn solve(&self, x: &mut [T]) {
        let n = self.n;
        if x.len() < n {
            return;
        }
        for i in 0..n {
            x.swap(i, self.exchanged_row(i).min(n - 1));
        }
        let mut k = 0;
        while k < n {
            let size = 1 + usize::from(self.is_2x2_pivot(k));
            for j in k..k + size {
                let factor = x.get(j).copied().unwrap_or(T::ZERO);
                for i in k + size..n {
                    let value = x.get(i).copied().unwrap_or(T::ZERO) - self.get(i, j) * factor;
                    set(x, i, value);
                }
            }
            k += size;
        }
        let mut k = 0;
        while k < n {
            let at = |i: usize| x.get(i).copied().unwrap_or(T::ZERO);
            if self.is_2x2_pivot(k) {
                let [first, second] = solve_2x2_block(self.a, n, k, [at(k), at(k + 1)]);
                set(x, k, first);
                set(x, k + 1, second);
                k += 2;
            } else {
                let pivot = self.get(k, k);
                set(x, k, if pivot == T::ZERO { T::ZERO } else { at(k) / pivot });
                k += 1;
            }
        }
        let mut end = n;
        while end > 0 {
            let size = 1 + usize::from(end > 1 && self.is_2x2_pivot(end - 1));
            let begin = end - size;
            for j in begin..end {
                let mut value = x.get(j).copied().unwrap_or(T::ZERO);
                for i in end..n {
                    value = value - self.get(i, j) * x.get(i).copied().unwrap_or(T::ZERO);
                }
                set(x, j, value);
            }
            end = begin;
        }
        for i in (0..n).rev() {
            x.swap(i, self.exchanged_row(i).min(n - 1));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;
    use nalgebra::{DMatrix, DVector};

    /// Random symmetric matrices, also with zero diagonals: residuals, and inertia by eigenvalues.
    #[test]
    fn solves_and_counts() {
        let mut seed = 1u64;
        let mut random = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 33) as f64 / f64::from(1u32 << 30) - 1.0
        };
        for n in 1..14 {
            for case in 0..20 {
                let mut a = DMatrix::<f64>::zeros(n, n);
                for j in 0..n {
                    for i in j..n {
                        let value = if i == j && case % 3 == 0 { 0.0 } else { random() };
                        (a[(i, j)], a[(j, i)]) = (value, value);
                    }
                }
                if n == 1 {
                    a[(0, 0)] = -2.0;
                }
                let b = DVector::<f64>::from_fn(n, |_, _| random());
                let mut memory: Vec<f64> = a.as_slice().to_vec();
                let mut exchanged = alloc::vec![0.0; n];
                let inertia = Symmetric::factor(&mut memory, n, &mut exchanged, 1e-14);
                assert_eq!(inertia.vanished, 0);
                let negative = a.symmetric_eigenvalues().iter().filter(|&&l| l < 0.0).count();
                assert_eq!(inertia.negative, negative, "{n} {case}");
                let mut x = b.clone();
                Symmetric::new(&memory, n, &exchanged).solve(x.as_mut_slice());
                // Backward stable: growth is at most 2.57^(n-1), in practice a few units.
                let residual = (&a * &x - &b).amax() / (a.amax() * x.amax() * n as f64);
                assert!(residual < 1e-13, "{n} {case} {residual:e}");
            }
        }
    }
}
