//! Unevaluated sums `high + low` of two doubles, about 106 bits: Dekker, "A floating-point
//! technique for extending the available precision" (1971); Ogita, Rump and Oishi, "Accurate sum
//! and dot product" (2005).

use super::Double;
use crate::scalar::{fast_two_sum, two_sum};

/// `high + low`, with `|low|` at most a few units in the last place of `high`.
#[derive(Clone, Copy)]
pub struct DoubleDouble<D> {
    pub high: D,
    pub low: D,
}

/// A constant.
#[inline(always)]
pub fn constant<D: Double>(value: f64) -> D {
    D::from_f64(value)
}

/// A bit pattern.
#[inline(always)]
pub fn bit_pattern<D: Double>(bits: u64) -> D {
    D::from_f64(f64::from_bits(bits))
}

/// `a + b`, exactly.
#[inline(always)]
pub fn exact_sum<D: Double>(a: D, b: D) -> DoubleDouble<D> {
    let [high, low] = two_sum(a, b);
    DoubleDouble { high, low }
}

/// `a + b`, exact if `a = 0` or `|a| ≥ |b|`.
#[inline(always)]
pub fn exact_ordered_sum<D: Double>(a: D, b: D) -> DoubleDouble<D> {
    let [high, low] = fast_two_sum(a, b);
    DoubleDouble { high, low }
}

/// `a b`, exact without overflow or underflow.
#[inline(always)]
pub fn exact_product<D: Double>(a: D, b: D) -> DoubleDouble<D> {
    let high = a * b;
    if D::FUSED {
        return DoubleDouble { high, low: a.mul_add(b, -high) };
    }
    let ((a1, a2), (b1, b2)) = (veltkamp_split(a), veltkamp_split(b));
    DoubleDouble { high, low: a2 * b2 - (((high - a1 * b1) - a2 * b1) - a1 * b2) }
}

/// The upper and the lower half of the digits (Veltkamp).
#[inline(always)]
fn veltkamp_split<D: Double>(a: D) -> (D, D) {
    let scaled = a * constant(134_217_729.0);
    let upper = scaled - (scaled - a);
    (upper, a - upper)
}

impl<D: Double> DoubleDouble<D> {
    /// `a` itself.
    #[inline(always)]
    pub fn new(a: D) -> Self {
        Self { high: a, low: constant(0.0) }
    }
    /// A constant and its rounding error.
    #[inline(always)]
    pub fn constant(high: f64, low: f64) -> Self {
        Self { high: constant(high), low: constant(low) }
    }
    /// `mask ? a : b`
    #[inline(always)]
    pub fn select(mask: D::Mask, a: Self, b: Self) -> Self {
        Self { high: D::select(mask, a.high, b.high), low: D::select(mask, a.low, b.low) }
    }
    /// Rounds to a double.
    #[inline(always)]
    pub fn round(self) -> D {
        self.high + self.low
    }
    /// The same number with the smallest `low`.
    #[inline(always)]
    pub fn normalise(self) -> Self {
        exact_ordered_sum(self.high, self.low)
    }
    /// The negative number.
    #[inline(always)]
    pub fn negate(self) -> Self {
        Self { high: -self.high, low: -self.low }
    }
    /// The sum.
    #[inline(always)]
    pub fn add(self, other: Self) -> Self {
        let s = exact_sum(self.high, other.high);
        Self { high: s.high, low: s.low + (self.low + other.low) }.normalise()
    }
    /// The sum; `self` is zero or has the larger magnitude.
    #[inline(always)]
    pub fn add_smaller(self, other: Self) -> Self {
        let s = exact_ordered_sum(self.high, other.high);
        Self { high: s.high, low: s.low + (self.low + other.low) }
    }
    /// The product.
    #[inline(always)]
    pub fn mul(self, other: Self) -> Self {
        let p = exact_product(self.high, other.high);
        Self { high: p.high, low: self.low.mul_add(other.high, self.high.mul_add(other.low, p.low)) }
    }
    /// The product with a double.
    #[inline(always)]
    pub fn scale(self, factor: D) -> Self {
        let p = exact_product(self.high, factor);
        Self { high: p.high, low: self.low.mul_add(factor, p.low) }
    }
    /// The product with a power of two, including ½.
    #[inline(always)]
    pub fn scale_by_power_of_two(self, power: D) -> Self {
        Self { high: self.high * power, low: self.low * power }
    }
    /// The quotient of a double.
    #[inline(always)]
    pub fn quotient(a: D, b: Self) -> Self {
        if D::FUSED {
            let reciprocal = constant::<D>(1.0) / b.high;
            let quotient = a * reciprocal;
            let rest = (-quotient).mul_add(b.low, (-quotient).mul_add(b.high, a));
            return Self { high: quotient, low: rest * reciprocal };
        }
        Self::new(a).div(b)
    }
    /// The quotient.
    #[inline(always)]
    pub fn div(self, other: Self) -> Self {
        // One division: the quotient may be wrong by two units, which the rest corrects.
        let reciprocal = constant::<D>(1.0) / other.high;
        let quotient = self.high * reciprocal;
        let rest = if D::FUSED {
            // The remainder of the first product fits a double.
            let rest = (-quotient).mul_add(other.high, self.high);
            (-quotient).mul_add(other.low, rest + self.low)
        } else {
            let p = exact_product(quotient, other.high);
            ((self.high - p.high) - p.low) + (self.low - quotient * other.low)
        };
        Self { high: quotient, low: rest * reciprocal }
    }
    /// The square root; of zero it is zero.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        let root = self.high.sqrt();
        let p = exact_product(root, root);
        let rest = ((self.high - p.high) - p.low) + self.low;
        let low = rest / (root + root);
        Self { high: root, low: D::select(root.eq(constant(0.0)), root, low) }
    }
}

/// `c[0] + c[1] x + ..`, with the even and odd powers interleaved.
#[inline(always)]
pub fn polynomial<D: Double, const K: usize>(x: D, coefficients: [f64; K]) -> D {
    let square = x * x;
    let mut sums: [D; 2] = [constant(coefficients[K - 1]), constant(coefficients[K - 2])];
    for k in (0..K - 2).rev() {
        sums = [sums[1], sums[0].mul_add(square, constant(coefficients[k]))];
    }
    sums[0].mul_add(x, sums[1])
}
