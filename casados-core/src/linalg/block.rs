//! Kernels on s×s blocks and on rows of s×C right-hand sides.
//!
//! Generic over the scalar, so that the same code serves one number and registers of them.

use super::fused::Arithmetic;
use crate::scalar::Scalar;

/// An s×s matrix, row by row.
pub type Block<E, const S: usize> = [[E; S]; S];

/// `t − a b`
#[inline(always)]
pub fn subtract_product<A: Arithmetic, E: Scalar, const S: usize>(
    t: &Block<E, S>,
    a: &Block<E, S>,
    b: &Block<E, S>,
) -> Block<E, S> {
    let mut t = *t;
    for i in 0..S {
        for k in 0..S {
            for j in 0..S {
                t[i][j] = A::subtract(t[i][j], a[i][k], b[k][j]);
            }
        }
    }
    t
}

/// `a b`
#[inline(always)]
pub fn product<A: Arithmetic, E: Scalar, const S: usize>(a: &Block<E, S>, b: &Block<E, S>) -> Block<E, S> {
    let mut t = [[E::from_f64(0.0); S]; S];
    for i in 0..S {
        for k in 0..S {
            for j in 0..S {
                t[i][j] = A::subtract(t[i][j], -a[i][k], b[k][j]);
            }
        }
    }
    t
}

/// The inverse by Gauss-Jordan elimination with partial pivoting, without a branch on the values:
/// rows are exchanged lane by lane. A singular block gives entries that are not finite.
#[inline(always)]
pub fn inverse<A: Arithmetic, E: Scalar, const S: usize>(a: &Block<E, S>) -> Block<E, S> {
    let (zero, one) = (E::from_f64(0.0), E::from_f64(1.0));
    let mut a = *a;
    let mut inverse = [[zero; S]; S];
    for (i, row) in inverse.iter_mut().enumerate() {
        row[i] = one;
    }
    for k in 0..S {
        for i in k + 1..S {
            let larger = a[k][k].abs().lt(a[i][k].abs());
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
