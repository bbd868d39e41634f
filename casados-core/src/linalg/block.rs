//! Kernels for s×s blocks and for panel rows of s×W right-hand sides.
//!
//! Generic over the scalar: the same code serves single numbers and SIMD registers. Blocks are
//! stored by columns, which are vectors over the stages, for products with one right-hand side.

use crate::linalg::kernel::arithmetic::{Arithmetic, Block};
use crate::scalar::{Field, each};

/// The stages of a slot in `W` columns of right-hand sides, in row-major order.
pub type PanelRow<E, const S: usize, const W: usize> = [[E; W]; S];

/// `−hA` of a tableau: the negative derivatives of the stages `ξ` by the slopes `k`.
#[cfg_attr(not(debug_assertions), inline(always))]
pub fn minus_ha<E: Field, const S: usize>(a: &[[E; S]; S], h: E) -> Block<E, S> {
    let mut block = [[h; S]; S];
    for (i, row) in a.iter().enumerate() {
        for (column, &a) in block.iter_mut().zip(row) {
            column[i] = -(h * a);
        }
    }
    block
}

/// `left · right`
#[cfg_attr(not(debug_assertions), inline(always))]
pub fn product<A: Arithmetic, E: Field, const S: usize>(
    left: &Block<E, S>,
    right: &Block<E, S>,
) -> Block<E, S> {
    let mut product = [[E::from_f64(0.0); S]; S];
    let mut negative = *left;
    negate(&mut negative);
    A::subtract_blocks(&mut product, &negative, right);
    product
}

/// `−panel row`
#[cfg_attr(not(debug_assertions), inline(always))]
pub fn negate<E: Field, const S: usize, const W: usize>(panel_row: &mut PanelRow<E, S, W>) {
    for row in panel_row {
        for element in row {
            *element = -*element;
        }
    }
}

/// `panel_row − block · other`
#[cfg_attr(not(debug_assertions), inline(always))]
pub fn subtract_product<A: Arithmetic, E: Field, const S: usize, const W: usize>(
    panel_row: &mut PanelRow<E, S, W>,
    block: &Block<E, S>,
    other: &PanelRow<E, S, W>,
) {
    if const { W == 1 } {
        let (mut target, mut x) = ([E::from_f64(0.0); S], [E::from_f64(0.0); S]);
        target.copy_from_slice(panel_row.as_flattened());
        x.copy_from_slice(other.as_flattened());
        A::subtract_columns(&mut target, block, &x);
        panel_row.as_flattened_mut().copy_from_slice(&target);
        return;
    }
    each!(k < S => {
        each!(i < S => { A::subtract_row(&mut panel_row[i], block[k][i], &other[k]); });
    });
}

/// `panel_row − diag(scale) · other`
#[cfg_attr(not(debug_assertions), inline(always))]
pub fn subtract_diagonal<A: Arithmetic, E: Field, const S: usize, const W: usize>(
    panel_row: &mut PanelRow<E, S, W>,
    scale: &[E; S],
    other: &PanelRow<E, S, W>,
) {
    if const { W == 1 } {
        let (mut target, mut x) = ([E::from_f64(0.0); S], [E::from_f64(0.0); S]);
        target.copy_from_slice(panel_row.as_flattened());
        x.copy_from_slice(other.as_flattened());
        A::subtract_products(&mut target, scale, &x);
        panel_row.as_flattened_mut().copy_from_slice(&target);
        return;
    }
    each!(i < S => { A::subtract_row(&mut panel_row[i], scale[i], &other[i]); });
}

/// `panel_row − blockᵀ · other`
#[cfg_attr(not(debug_assertions), inline(always))]
pub fn subtract_transposed<A: Arithmetic, E: Field, const S: usize, const W: usize>(
    panel_row: &mut PanelRow<E, S, W>,
    block: &Block<E, S>,
    other: &PanelRow<E, S, W>,
) {
    each!(i < S => {
        each!(j < S => { A::subtract_row(&mut panel_row[i], block[i][j], &other[j]); });
    });
}

/// Returns the inverse by Gauss-Jordan elimination with partial pivoting. Rows are swapped for each
/// lane separately. The inverse of a singular block is not finite.
#[cfg_attr(not(debug_assertions), inline(always))]
pub fn inverse<A: Arithmetic, E: Field, const S: usize>(block: &Block<E, S>) -> Block<E, S> {
    let (zero, one) = (E::from_f64(0.0), E::from_f64(1.0));
    if const { S == 1 } {
        let mut inverse = *block;
        for element in inverse.as_flattened_mut() {
            *element = element.reciprocal();
        }
        return inverse;
    }
    if const { size_of::<E>() > 8 && S > 2 && S <= MAX_STEPS } {
        return inverse_in_registers::<A, E, S>(block);
    }
    // Eliminates the transposed matrix, so that row operations are vector operations in memory.
    let mut a = *block;
    let mut inverse = [[zero; S]; S];
    for (i, row) in inverse.iter_mut().enumerate() {
        row[i] = one;
    }
    for k in 0..S {
        for i in k + 1..S {
            let larger = a[k][k].is_smaller(a[i][k]);
            if E::any(larger) {
                for j in 0..S {
                    let (p, q) = (a[k][j], a[i][j]);
                    a[k][j] = E::select(larger, q, p);
                    a[i][j] = E::select(larger, p, q);
                    let (p, q) = (inverse[k][j], inverse[i][j]);
                    inverse[k][j] = E::select(larger, q, p);
                    inverse[i][j] = E::select(larger, p, q);
                }
            }
        }
        let scale = a[k][k].reciprocal();
        for j in 0..S {
            a[k][j] = a[k][j] * scale;
            inverse[k][j] = inverse[k][j] * scale;
        }
        for i in 0..S {
            if i != k {
                let factor = a[i][k];
                for j in 0..S {
                    a[i][j] = A::subtract(a[i][j], factor, a[k][j]);
                    inverse[i][j] = A::subtract(inverse[i][j], factor, inverse[k][j]);
                }
            }
        }
    }
    inverse
}

/// Maximal number of elimination steps that are unrolled.
const MAX_STEPS: usize = 4;

/// Inverts in place: registers hold the block without a unit matrix. The steps are unrolled, since
/// indices that the optimiser does not know would move the block to memory.
#[inline(always)]
fn inverse_in_registers<A: Arithmetic, E: Field, const S: usize>(block: &Block<E, S>) -> Block<E, S> {
    let zero = E::from_f64(0.0);
    let mut a = *block;
    let (mut row_exchanges, mut exchanged) = ([[zero.is_smaller(zero); S]; S], false);
    macro_rules! steps {
        ($($k:literal)*) => {
            $(if const { $k < S } {
                exchanged |= eliminate::<A, E, S>(&mut a, $k, &mut row_exchanges);
            })*
        };
    }
    const { assert!(MAX_STEPS == 4) };
    steps!(0 1 2 3);
    // Row swaps of the block are column swaps of the inverse.
    if exchanged {
        for k in (0..S).rev() {
            for i in (k + 1..S).rev() {
                for row in &mut a {
                    let (p, q) = (row[k], row[i]);
                    row[k] = E::select(row_exchanges[k][i], q, p);
                    row[i] = E::select(row_exchanges[k][i], p, q);
                }
            }
        }
    }
    a
}

/// One elimination step; returns whether rows were swapped.
#[inline(always)]
// Loops over indices of a fixed number are unrolled more reliably.
#[allow(clippy::needless_range_loop)]
fn eliminate<A: Arithmetic, E: Field, const S: usize>(
    a: &mut Block<E, S>,
    k: usize,
    exchanges: &mut [[E::Mask; S]; S],
) -> bool {
    let mut exchanged = false;
    for i in k + 1..S {
        let larger = a[k][k].is_smaller(a[i][k]);
        if E::any(larger) {
            (exchanges[k][i], exchanged) = (larger, true);
            for j in 0..S {
                let (p, q) = (a[k][j], a[i][j]);
                a[k][j] = E::select(larger, q, p);
                a[i][j] = E::select(larger, p, q);
            }
        }
    }
    // The eliminated column is replaced by a column of the inverse.
    let scale = a[k][k].reciprocal();
    for j in 0..S {
        a[k][j] = if j == k { scale } else { a[k][j] * scale };
    }
    for i in 0..S {
        if i != k {
            let factor = a[i][k];
            for j in 0..S {
                a[i][j] = if j == k { -(factor * scale) } else { A::subtract(a[i][j], factor, a[k][j]) };
            }
        }
    }
    exchanged
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::kernel::arithmetic::Unfused;
    use crate::linalg::transformed::complex::Complex;

    /// Two complex numbers and a real one: three independent systems.
    type Three = Complex<f64, 5>;

    /// Perturbed permutation matrices, a different one in each system: the pivots of the systems
    /// are in different rows.
    fn block<const S: usize>(seed: usize) -> Block<Three, S> {
        let wave = |k: usize| 0.05 * ((seed * 37 + k) as f64).sin();
        let mut block = [[Complex { parts: [0.0; 5] }; S]; S];
        for (j, column) in block.iter_mut().enumerate() {
            for (i, element) in column.iter_mut().enumerate() {
                let k = 5 * (i + S * j);
                *element = Complex { parts: [wave(k), wave(k + 1), wave(k + 2), wave(k + 3), wave(k + 4)] };
                // `i ↦ m i + n` modulo `S`, with `m = ±1`.
                for (system, m) in [1, S - 1, S - 1].into_iter().enumerate() {
                    if (m * i + seed + system) % S == j {
                        let part = [2, 1, 4][system];
                        element.parts[part] += 1.0;
                    }
                }
            }
        }
        block
    }

    /// Checks the inverses of blocks with condition numbers below two in the infinity norm. The
    /// bound counts `S²` products and as many sums, for products from both sides.
    fn inverts<const S: usize>() {
        for seed in 0..8 * S {
            let block = block::<S>(seed);
            let inverse = inverse::<Unfused, _, S>(&block);
            for (left, right) in [(&block, &inverse), (&inverse, &block)] {
                for (j, column) in product::<Unfused, _, S>(left, right).iter().enumerate() {
                    for (i, element) in column.iter().enumerate() {
                        let error = *element - Complex::real(if i == j { 1.0 } else { 0.0 });
                        let bound = 2.0 * 4.0 * (S * S) as f64 * f64::EPSILON;
                        assert!(
                            error.parts.iter().all(|part| part.abs() <= bound),
                            "{seed} {i} {j} {error:?}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn each_system_has_pivots_of_its_own() {
        inverts::<2>();
        inverts::<3>();
        inverts::<4>();
        inverts::<5>();
    }

    #[test]
    fn singular_blocks_are_not_finite() {
        let mut singular = block::<4>(1);
        singular[2] = singular[0];
        assert!(!inverse::<Unfused, _, 4>(&singular).as_flattened().iter().all(Complex::is_finite));
        assert!(
            !inverse::<Unfused, _, 4>(&[[Three::zero(); 4]; 4]).as_flattened().iter().all(Complex::is_finite)
        );
    }
}
