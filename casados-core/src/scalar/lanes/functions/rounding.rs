//! Parts of doubles: integers, powers of two, signs, bounds.

use super::Double;
use super::pair::constant;

/// `1.5 · 2⁵²`: adding and subtracting it rounds to an integer; adding it alone leaves the integer
/// in the last bits.
pub const ROUNDING_SHIFT: f64 = 6_755_399_441_055_744.0;
/// The first 42 bits of ln 2, and the next 53.
pub const LN_2_PARTS: [f64; 2] = [0.6931471805598903, 5.497923018708371e-14];

/// `2ⁿ` for an integer `−1022 ≤ n ≤ 1023`
#[inline(always)]
pub fn power_of_two<D: Double>(n: D) -> D {
    (n + constant(ROUNDING_SHIFT + 1023.0)).shift_left::<52>()
}

/// The nearest integer, `|a| < 2⁵¹`.
#[inline(always)]
pub fn round_to_integer<D: Double>(a: D) -> D {
    (a + constant(ROUNDING_SHIFT)) - constant(ROUNDING_SHIFT)
}

/// Clamps `a` to the bounds; NaN is returned.
#[inline(always)]
pub fn clamp<D: Double>(a: D, low: f64, high: f64) -> D {
    let a = D::select(constant::<D>(high).lt(a), constant(high), a);
    D::select(a.lt(constant(low)), constant(low), a)
}

/// A magnitude with the sign of `a`.
#[inline(always)]
pub fn copy_sign<D: Double>(magnitude: D, a: D) -> D {
    magnitude.or_bits(a.and_bits(constant(-0.0)))
}
