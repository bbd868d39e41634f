//! Sine, cosine, tangent and their inverses.
//!
//! `a = n π/2 + r` with `|r| ≤ π/4` by constants of 152 bits (Cody and Waite); larger arguments use
//! the function of one number. Minimax polynomials, whose leading terms are added in double-double
//! arithmetic.

use super::pair::{
    DoubleDouble, bit_pattern, constant, exact_ordered_sum, exact_product, exact_sum, polynomial,
};
use super::rounding::{ROUNDING_SHIFT, clamp, copy_sign};
use super::{Double, one, replace_special_lanes, replace_special_lanes_of_two};
use crate::scalar::Scalar;
use core::f64::consts::{FRAC_2_PI, FRAC_PI_4, PI};

/// `(sin r − r)/r³` in `r²`; `sin r` to 4.8e-19
const SIN_POLYNOMIAL: [f64; 7] = [
    -0.16666666666666666,
    0.008333333333332912,
    -0.00019841269840720416,
    2.755731891656437e-6,
    -2.5052024419622074e-8,
    1.6047920918038423e-10,
    -7.057422362727012e-13,
];

/// `(cos r − 1 + r²/2)/r⁴` in `r²`; `cos r` to 6.4e-19
const COS_POLYNOMIAL: [f64; 6] = [
    0.041666666666666664,
    -0.0013888888888887061,
    2.4801587298460744e-5,
    -2.7557317158684734e-7,
    2.0876127932306893e-9,
    -1.1381550818533404e-11,
];

/// π/2 in pieces of 33 bits, and the next 53.
const PI_2_PARTS: [f64; 4] =
    [1.5707963267341256, 6.077100506303966e-11, 2.0222662487111665e-21, 8.4784276603689e-32];
/// π/2 in pieces of 53 bits.
const PI_2_DOUBLES: [f64; 3] = [core::f64::consts::FRAC_PI_2, 6.123233995736766e-17, -1.4973849048591698e-33];

/// Integers up to `2²⁰` times a piece of 33 bits are exact.
const MAX_REDUCED_ARGUMENT: f64 = 1_647_000.0;

/// `(n + 1.5 · 2⁵², r)`
#[inline(always)]
fn reduce_modulo_pi_2<D: Double>(a: D) -> (D, DoubleDouble<D>) {
    let shifted = a * constant(FRAC_2_PI) + constant(ROUNDING_SHIFT);
    let n = shifted - constant(ROUNDING_SHIFT);
    if D::FUSED {
        // The first product is rounded after the cancellation, which is exact.
        let first = a.subtract_product(n, constant(PI_2_DOUBLES[0]));
        let second = exact_product(n, constant(PI_2_DOUBLES[1]));
        let r = exact_sum(first, -second.high);
        let low = (r.low - second.low).subtract_product(n, constant(PI_2_DOUBLES[2]));
        return (shifted, exact_ordered_sum(r.high, low));
    }
    let first = a - n * constant(PI_2_PARTS[0]);
    let second = exact_sum(first, -(n * constant(PI_2_PARTS[1])));
    let third = exact_sum(second.high, -(n * constant(PI_2_PARTS[2])));
    let low = (third.low + second.low) - n * constant(PI_2_PARTS[3]);
    (shifted, exact_ordered_sum(third.high, low))
}

/// `(sin r, cos r)`, `|r| ≤ π/4`
#[inline(always)]
fn sin_cos_reduced<D: Double>(r: DoubleDouble<D>) -> (DoubleDouble<D>, DoubleDouble<D>) {
    let exact = exact_product(r.high, r.high);
    let (square, half) = (exact.high, exact.high * constant(0.5));
    let low = r.low.subtract_product(r.low, half);
    let sin = DoubleDouble {
        high: r.high,
        low: (r.high * square).mul_add(polynomial(square, SIN_POLYNOMIAL), low),
    };
    let one = exact_ordered_sum(constant(1.0), -half);
    let lost = exact.low.mul_add(constant(0.5), r.high * r.low);
    let rest = (square * square).mul_add(polynomial(square, COS_POLYNOMIAL), -lost);
    (sin, DoubleDouble { high: one.high, low: one.low + rest })
}

/// Lanes in which `n` is odd, and the sign of the sine as a bit, for `n + 1.5 · 2⁵²`
#[inline(always)]
fn quadrant<D: Double>(shifted: D) -> (D::Mask, D) {
    let last = shifted.and_bits(bit_pattern(1)).or_bits(constant(1.0));
    let sign = shifted.and_bits(bit_pattern(2)).shift_left::<62>();
    (D::not(last.eq(constant(1.0))), sign)
}

/// The mask of arguments too large for the reduction, and the arguments with zeros in their place.
#[inline(always)]
fn without_large_arguments<D: Double>(a: D) -> (D::Mask, D) {
    let usual = a.abs().lt(constant(MAX_REDUCED_ARGUMENT));
    (D::not(usual), D::select(usual, a.abs(), constant(0.0)))
}

/// `(sin a, cos a)`
#[inline(always)]
pub fn sin_cos<D: Double>(a: D) -> (D, D) {
    let (rare, magnitude) = without_large_arguments(a);
    let (shifted, r) = reduce_modulo_pi_2(magnitude);
    let (s, co) = sin_cos_reduced(r);
    let (s, co) = (s.round(), co.round());
    let (odd, sign) = quadrant(shifted);
    let (_, sign_of_cos) = quadrant(shifted + constant(1.0));
    let mut sin = D::select(odd, co, s).xor_bits(sign).xor_bits(a.and_bits(constant(-0.0)));
    let mut cos = D::select(odd, s, co).xor_bits(sign_of_cos);
    replace_special_lanes(rare, a, &mut sin, one::sin);
    replace_special_lanes(rare, a, &mut cos, one::cos);
    (sin, cos)
}

/// `sin a`
#[inline(always)]
pub fn sin<D: Double>(a: D) -> D {
    let (rare, magnitude) = without_large_arguments(a);
    let (shifted, r) = reduce_modulo_pi_2(magnitude);
    let (s, co) = sin_cos_reduced(r);
    let (odd, sign) = quadrant(shifted);
    let mut sin =
        DoubleDouble::select(odd, co, s).round().xor_bits(sign).xor_bits(a.and_bits(constant(-0.0)));
    replace_special_lanes(rare, a, &mut sin, one::sin);
    sin
}

/// `cos a`
#[inline(always)]
pub fn cos<D: Double>(a: D) -> D {
    let (rare, magnitude) = without_large_arguments(a);
    let (shifted, r) = reduce_modulo_pi_2(magnitude);
    let (s, co) = sin_cos_reduced(r);
    let (odd, sign) = quadrant(shifted + constant(1.0));
    let mut cos = DoubleDouble::select(odd, co, s).round().xor_bits(sign);
    replace_special_lanes(rare, a, &mut cos, one::cos);
    cos
}

/// `tan a`
#[inline(always)]
pub fn tan<D: Double>(a: D) -> D {
    let (rare, magnitude) = without_large_arguments(a);
    let (shifted, r) = reduce_modulo_pi_2(magnitude);
    let (s, co) = sin_cos_reduced(r);
    let (s, co) = (s.normalise(), co.normalise());
    let (odd, _) = quadrant(shifted);
    let quotient = DoubleDouble::select(odd, co, s).div(DoubleDouble::select(odd, s.negate(), co)).round();
    // A number this small equals its tangent, and its products would underflow.
    let result = D::select(magnitude.lt(constant(1e-9)), magnitude, quotient);
    let mut result = result.xor_bits(a.and_bits(constant(-0.0)));
    replace_special_lanes(rare, a, &mut result, one::tan);
    result
}

/// `(arctan q − q)/q³` in `q²`, `|q| ≤ tan(π/8)`; `arctan q` to 6.8e-20
const ATAN_POLYNOMIAL: [f64; 12] = [
    -0.3333333333333333,
    0.19999999999998921,
    -0.142857142855268,
    0.11111111095898457,
    -0.09090908395377724,
    0.07692287906151182,
    -0.06666296214864703,
    0.05877647086749932,
    -0.05222125030562937,
    0.045176025583888044,
    -0.033779706472767,
    0.015485553133661487,
];
const TAN_PI_8: f64 = 0.41421356237309503;
/// π/4 minus its double.
const PI_4_LOW: f64 = 3.061616997868383e-17;

/// The angle of the point `(x, y)`, whose coordinates are not negative and not both zero; mirrored
/// where `x_is_negative`.
#[inline(always)]
fn angle<D: Double>(y: DoubleDouble<D>, x: DoubleDouble<D>, x_is_negative: D::Mask) -> D {
    let steep = x.high.lt(y.high);
    let (long, short) = (DoubleDouble::select(steep, y, x), DoubleDouble::select(steep, x, y));
    // Beyond π/8 the angle relative to the diagonal: tan(φ − π/4) = (tan φ − 1)/(tan φ + 1).
    let diagonal = (long.high * constant(TAN_PI_8)).lt(short.high);
    let zero = constant(0.0);
    let numerator = DoubleDouble::select(diagonal, short.add(long.negate()), short);
    let denominator = DoubleDouble::select(diagonal, long.add_smaller(short).normalise(), long);
    let q = numerator.div(denominator);
    let square = q.high * q.high;
    let low =
        (q.high * square).mul_add(polynomial(square, ATAN_POLYNOMIAL), q.low.subtract_product(q.low, square));
    let base = D::select(diagonal, constant(FRAC_PI_4), zero);
    let base = DoubleDouble { high: base, low: D::select(diagonal, constant(PI_4_LOW), zero) };
    let angle = base.add_smaller(DoubleDouble { high: q.high, low });
    let right = DoubleDouble::constant(2.0 * FRAC_PI_4, 2.0 * PI_4_LOW).add_smaller(angle.negate());
    let angle = DoubleDouble::select(steep, right, angle);
    let mirrored = DoubleDouble::constant(PI, 4.0 * PI_4_LOW).add_smaller(angle.negate());
    DoubleDouble::select(x_is_negative, mirrored, angle).round()
}

/// `arctan a`
#[inline(always)]
pub fn atan<D: Double>(a: D) -> D {
    let magnitude = clamp(a.abs(), 0.0, 1e20);
    let never = magnitude.lt(constant(0.0));
    let result = angle(DoubleDouble::new(magnitude), DoubleDouble::new(constant(1.0)), never);
    copy_sign(D::select(magnitude.lt(constant(1e-9)), magnitude, result), a)
}

/// the angle of `(x, y)`
#[inline(always)]
pub fn atan2<D: Double>((y, x): (D, D)) -> D {
    let (along, up) = (x.abs(), y.abs());
    let longer = along.max(up);
    let size = |a: D| D::and(constant::<D>(1e-130).lt(a), a.lt(constant(1e130)));
    let fits = |a: D| D::or(size(a), a.eq(constant(0.0)));
    let usual = D::and(size(longer), D::and(fits(along), fits(up)));
    let along = D::select(usual, along, constant(1.0));
    let up = D::select(usual, up, constant(0.0));
    let mut result =
        copy_sign(angle(DoubleDouble::new(up), DoubleDouble::new(along), x.lt(constant(0.0))), y);
    replace_special_lanes_of_two(D::not(usual), y, x, &mut result, <f64 as Scalar>::atan2);
    result
}

/// `√(1 − a²)`
#[inline(always)]
fn sqrt_one_minus_square<D: Double>(a: D) -> DoubleDouble<D> {
    DoubleDouble::new(constant(1.0)).add(exact_product(a, a).negate()).sqrt()
}

/// `arcsin a`, the angle of `(√(1 − a²), a)`
#[inline(always)]
pub fn asin<D: Double>(a: D) -> D {
    let magnitude = a.abs();
    let never = magnitude.lt(constant(0.0));
    let result = copy_sign(angle(DoubleDouble::new(magnitude), sqrt_one_minus_square(magnitude), never), a);
    let result = D::select(magnitude.lt(constant(1e-9)), a, result);
    D::select(magnitude.le(constant(1.0)), result, constant(f64::NAN))
}

/// `arccos a`, the angle of `(a, √(1 − a²))`
#[inline(always)]
pub fn acos<D: Double>(a: D) -> D {
    let magnitude = a.abs();
    let result = angle(sqrt_one_minus_square(magnitude), DoubleDouble::new(magnitude), a.lt(constant(0.0)));
    D::select(magnitude.le(constant(1.0)), result, constant(f64::NAN))
}
