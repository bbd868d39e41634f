//! Kernels on s×s blocks and on rows of s×C right-hand sides.
//!
//! Generic over the scalar, so that the same code serves one number and registers of them. Blocks
//! lie column after column: a column is a vector over the stages, which is what one right-hand side
//! wants.

use crate::linalg::kernel::arithmetic::{Arithmetic, Block};
use crate::scalar::{Field, each};

/// `s` rows of `W` columns, row after row: the stages of a slot in a right-hand side.
pub type PanelRow<E, const S: usize, const W: usize> = [[E; W]; S];

/// `−hA` of a tableau: what states at the stages have of the derivatives there, with another sign.
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

/// The inverse by Gauss-Jordan elimination with partial pivoting: rows are exchanged lane by lane,
/// where any lane wants it. A singular block gives elements that are not finite.
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
    // On the transposed matrix, so that what is done to rows is done to vectors of the memory.
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

/// So many steps of an elimination can be written one after the other.
const MAX_STEPS: usize = 4;

/// The same in place: registers hold the block, but not the unit matrix beside it. The steps are
/// written one after the other, or indices that the optimiser does not know would keep the block in
/// the memory.
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
    // What was done to rows is undone to columns of the inverse.
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

/// A step of it. Whether rows were exchanged.
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
    // The column that is eliminated gives its place to one of the inverse.
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

    /// Two complex numbers and a real one, each a system of its own.
    type Three = Complex<f64, 5>;

    /// Permutations, another one in each system, and a little of everything else: what is largest
    /// is never where the others have it.
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

    /// Blocks with conditions below two, in infinity norms: `S²` products and as many sums,
    /// rounded, both ways.
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
