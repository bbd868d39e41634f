//! Kernels on s×s blocks and on rows of s×C right-hand sides.
//!
//! Generic over the scalar, so that the same code serves one number and registers of them.

use super::fused::Arithmetic;
use crate::scalar::Field;

/// An s×s matrix, row by row.
pub type Block<E, const S: usize> = [[E; S]; S];

/// `s` rows of `W` columns: the stages of a slot in a right-hand side, or, with `W = s`, a block.
pub type Packet<E, const S: usize, const W: usize> = [[E; W]; S];

/// `packet − block · other`
#[inline(always)]
pub fn subtract<A: Arithmetic, E: Field, const S: usize, const W: usize>(
    packet: &mut Packet<E, S, W>,
    block: &Block<E, S>,
    other: &Packet<E, S, W>,
) {
    for i in 0..S {
        for k in 0..S {
            for w in 0..W {
                packet[i][w] = A::subtract(packet[i][w], block[i][k], other[k][w]);
            }
        }
    }
}

/// `block · packet`
#[inline(always)]
pub fn multiply<A: Arithmetic, E: Field, const S: usize, const W: usize>(
    block: &Block<E, S>,
    packet: &Packet<E, S, W>,
) -> Packet<E, S, W> {
    let mut product = [[E::from_f64(0.0); W]; S];
    for i in 0..S {
        for k in 0..S {
            for w in 0..W {
                product[i][w] = A::subtract(product[i][w], -block[i][k], packet[k][w]);
            }
        }
    }
    product
}

/// The rows as columns.
#[inline(always)]
pub fn transposed<E: Copy, const S: usize>(block: &Block<E, S>) -> Block<E, S> {
    core::array::from_fn(|i| core::array::from_fn(|j| block[j][i]))
}

/// The inverse by Gauss-Jordan elimination with partial pivoting, without a branch on the values:
/// rows are exchanged lane by lane. A singular block gives entries that are not finite.
#[inline(always)]
pub fn inverse<A: Arithmetic, E: Field, const S: usize>(a: &Block<E, S>) -> Block<E, S> {
    let (zero, one) = (E::from_f64(0.0), E::from_f64(1.0));
    let mut a = *a;
    let mut inverse = [[zero; S]; S];
    for (i, row) in inverse.iter_mut().enumerate() {
        row[i] = one;
    }
    for k in 0..S {
        for i in k + 1..S {
            let larger = a[k][k].is_smaller(a[i][k]);
            for j in 0..S {
                let (p, q) = (a[k][j], a[i][j]);
                a[k][j] = E::select(larger, q, p);
                a[i][j] = E::select(larger, p, q);
                let (p, q) = (inverse[k][j], inverse[i][j]);
                inverse[k][j] = E::select(larger, q, p);
                inverse[i][j] = E::select(larger, p, q);
            }
        }
        let scale = one / a[k][k];
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
