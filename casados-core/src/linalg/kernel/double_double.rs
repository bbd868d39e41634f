//! Double-double sums: a number and its rounding error (T. J. Dekker; D. Knuth).

use crate::linalg::kernel::arithmetic::Arithmetic;
use crate::scalar::{Field, two_sum};

/// Returns `a b`, rounded, and its rounding error; zero on machines without fused multiply-add.
#[inline(always)]
pub fn two_product<A: Arithmetic, E: Field>(a: E, b: E) -> [E; 2] {
    let product = a * b;
    [product, -A::subtract(product, a, b)]
}

/// `Σ_j a_j b_j`
#[inline(always)]
pub fn dot_compensated<'a, A: Arithmetic, E: Field>(factors: impl Iterator<Item = (&'a E, &'a E)>) -> [E; 2] {
    let mut sum = [E::from_f64(0.0); 2];
    for (&a, &b) in factors {
        let [product, rounded] = two_product::<A, E>(a, b);
        let [high, lost] = two_sum(sum[0], product);
        sum = [high, sum[1] + (rounded + lost)];
    }
    sum
}

/// `x + h d`
#[inline(always)]
pub fn axpy_compensated<A: Arithmetic, E: Field>(x: [E; 2], h: E, d: [E; 2]) -> [E; 2] {
    let [change, rounded] = two_product::<A, E>(h, d[0]);
    let [high, lost] = two_sum(x[0], change);
    two_sum(high, lost + (x[1] + (rounded + h * d[1])))
}
