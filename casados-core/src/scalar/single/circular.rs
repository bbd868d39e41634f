//! Sine, cosine, tangent, arcsine.
//!
//! `a = n π/2 + r` with `|r| ≤ π/4`: for `|a| < 3000` by π/2 in pieces of 12 bits (Cody and Waite),
//! for larger arguments by the digits of 2/π (Payne and Hanek). The remainder is a sum of two
//! numbers, so that its rounding error is negligible. Polynomials are those of FreeBSD's
//! `k_sinf.c`, `k_cosf.c` and `e_asinf.c`.

use super::{ROUNDING_SHIFT, exact_ordered_sum, exact_product, exact_sum, polynomial, sqrt};
use core::f32::consts::{FRAC_2_PI, FRAC_PI_2, FRAC_PI_4};

/// `(sin r − r)/r³` in `r²`
const SIN_POLYNOMIAL: [f32; 4] = [2.718_311_5e-6, -1.983_933_5e-4, 8.333_33e-3, -0.166_666_67];
/// `(cos r − 1 + r²/2)/r⁴` in `r²`
const COS_POLYNOMIAL: [f32; 3] = [2.439_044_9e-5, -1.388_676_4e-3, 0.041_666_623];

/// π/2 in three pieces of 12 bits, and the remainder; as bits, since they must be exact.
const PI_2_PARTS: [f32; 4] = [
    f32::from_bits(0x3FC9_0000),
    f32::from_bits(0x39FD_A000),
    f32::from_bits(0x33A2_2000),
    f32::from_bits(0x2C34_611A),
];

/// Integers below 2¹² times a piece of 12 bits are exact.
const MAX_REDUCED_ARGUMENT: f32 = 3000.0;

/// The digits of 2/π after 32 zeros.
const TWO_OVER_PI_DIGITS: [u32; 8] =
    [0, 0xA2F9_836E, 0x4E44_1529, 0xFC27_57D1, 0xF534_DDC0, 0xDB62_9599, 0x3C43_9041, 0xFE51_63AB];

/// `n` modulo 4 and `r` as a sum, for a finite `a ≥ 0`.
#[inline(always)]
fn reduce_modulo_pi_2(a: f32) -> (u32, (f32, f32)) {
    if a >= MAX_REDUCED_ARGUMENT {
        return reduce_large_argument(a);
    }
    let shifted = a * FRAC_2_PI + ROUNDING_SHIFT;
    let n = shifted - ROUNDING_SHIFT;
    let first = a - n * PI_2_PARTS[0];
    let second = exact_sum(first, -(n * PI_2_PARTS[1]));
    let third = exact_sum(second.0, -(n * PI_2_PARTS[2]));
    (shifted.to_bits(), exact_ordered_sum(third.0, (third.1 + second.1) - n * PI_2_PARTS[3]))
}

/// The product of the 24 digits of `a` with the relevant digits of 2/π: quarter turns in the upper
/// two bits of 64, followed by the fraction.
#[cold]
fn reduce_large_argument(a: f32) -> (u32, (f32, f32)) {
    let bits = a.to_bits();
    let mantissa = u64::from(bits & 0x007F_FFFF | 0x0080_0000);
    // Earlier digits of 2/π contribute whole turns only.
    let begin = (bits >> 23).saturating_sub(120);
    let word = |index: u32| u64::from(*TWO_OVER_PI_DIGITS.get(index as usize).unwrap_or(&0));
    let (first, shift) = (begin / 32, begin % 32);
    let digits = |index: u32| (word(first + index) << 32 | word(first + index + 1)) << shift >> 32;
    // The digits weigh 2⁻³², 2⁻⁶⁴ and 2⁻⁹⁶.
    let fraction = ((mantissa * digits(0)) << 32)
        .wrapping_add(mantissa * digits(1))
        .wrapping_add((mantissa * digits(2)) >> 32);
    let n = fraction.wrapping_add(1 << 61) >> 62;
    let rest = fraction.wrapping_sub(n << 62) as i64;
    let high = rest as f32;
    let low = (rest - high as i64) as f32;
    const FIXED_POINT_UNIT: f32 = 1.0 / (1_u64 << 62) as f32;
    let (r, error) = exact_product(high * FIXED_POINT_UNIT, FRAC_PI_2);
    let low = error + (high * FIXED_POINT_UNIT) * FRAC_PI_2_LOW + (low * FIXED_POINT_UNIT) * FRAC_PI_2;
    (n as u32, exact_ordered_sum(r, low))
}

/// π/2 minus its `f32`.
const FRAC_PI_2_LOW: f32 = -4.371_139e-8;

/// `(sin r, cos r)` as sums.
#[inline(always)]
fn sin_cos_reduced((r, low): (f32, f32)) -> ((f32, f32), (f32, f32)) {
    let square = r * r;
    let half = 0.5 * square;
    let sin = (r, r * square * polynomial(square, SIN_POLYNOMIAL) + (low - low * half));
    let one = exact_ordered_sum(1.0, -half);
    (sin, (one.0, one.1 + (square * square * polynomial(square, COS_POLYNOMIAL) - r * low)))
}

/// Changes the sign of a number if a bit of `n` is set.
#[inline(always)]
fn flip_sign_by_bit(a: f32, n: u32) -> f32 {
    f32::from_bits(a.to_bits() ^ (n & 2) << 30)
}

/// `(sin a, cos a)`
#[inline]
pub fn sin_cos(a: f32) -> (f32, f32) {
    if !a.is_finite() {
        return (f32::NAN, f32::NAN);
    }
    let (n, r) = reduce_modulo_pi_2(a.abs());
    let (sin, cos) = sin_cos_reduced(r);
    let (sin, cos) = (sin.0 + sin.1, cos.0 + cos.1);
    let (sin, cos) = if n & 1 == 0 { (sin, cos) } else { (cos, sin) };
    let sign = f32::from_bits(flip_sign_by_bit(sin, n).to_bits() ^ a.to_bits() & 0x8000_0000);
    (sign, flip_sign_by_bit(cos, n.wrapping_add(1)))
}

/// `sin a`
#[inline]
pub fn sin(a: f32) -> f32 {
    sin_cos(a).0
}

/// `cos a`
#[inline]
pub fn cos(a: f32) -> f32 {
    sin_cos(a).1
}

/// `tan a`
#[inline]
pub fn tan(a: f32) -> f32 {
    if !a.is_finite() {
        return f32::NAN;
    }
    // A number this small equals its tangent, and its products would underflow.
    if a.abs() < 1e-4 {
        return a + a * (a * a) * (1.0 / 3.0);
    }
    let (n, r) = reduce_modulo_pi_2(a.abs());
    let (sin, cos) = sin_cos_reduced(r);
    let (sin, cos) = (exact_ordered_sum(sin.0, sin.1), exact_ordered_sum(cos.0, cos.1));
    let (above, below) = if n & 1 == 0 { (sin, cos) } else { ((-cos.0, -cos.1), sin) };
    let quotient = above.0 / below.0;
    let (back, error) = exact_product(quotient, below.0);
    let rest = ((above.0 - back) - error) + (above.1 - quotient * below.1);
    let tan = quotient + rest / below.0;
    if a < 0.0 { -tan } else { tan }
}

/// `arcsin a`, beyond ½ by `arcsin a = π/2 − 2 arcsin √((1 − a)/2)`.
pub fn asin(a: f32) -> f32 {
    const ASIN_POLYNOMIAL: [f32; 3] = [-8.656_363e-3, -4.274_342e-2, 1.666_658_7e-1];
    let ratio = |z: f32| z * polynomial(z, ASIN_POLYNOMIAL) / (1.0 - 7.066_296e-1 * z);
    let magnitude = a.abs();
    if magnitude < 0.5 {
        return a + a * ratio(a * a);
    }
    // For arguments larger than one the root is NaN.
    let z = (1.0 - magnitude) * 0.5;
    let root = sqrt(z);
    let upper = f32::from_bits(root.to_bits() & 0xFFFF_F000);
    let lower = if root > 0.0 { (z - upper * upper) / (root + upper) } else { root };
    let p = 2.0 * root * ratio(z) - (FRAC_PI_2_LOW - 2.0 * lower);
    let angle = FRAC_PI_4 - (p - (FRAC_PI_4 - 2.0 * upper));
    angle.copysign(a)
}
