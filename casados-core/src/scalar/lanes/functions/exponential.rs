//! `eᵃ` and functions based on it.
//!
//! `a = n ln 2 + r` with `|r| ≤ ln 2 / 2` (Cody and Waite), `eʳ = 1 + r + r² Q(r)` with a minimax
//! polynomial, whose leading terms are added in double-double arithmetic.

use super::pair::{DoubleDouble, constant, exact_ordered_sum, exact_product, exact_sum, polynomial};
use super::rounding::{LN_2_PARTS, clamp, copy_sign, power_of_two, round_to_integer};
use super::{Double, replace_special_lanes_of_two};
use crate::scalar::Scalar;

/// ln 2 as a pair.
const LN_2_PAIR: [f64; 2] = [core::f64::consts::LN_2, 2.3190468138462996e-17];

/// `(eʳ − 1 − r)/r²` for `|r| ≤ 0.35`; `eʳ` to 2.7e-19
const EXP_POLYNOMIAL: [f64; 11] = [
    0.5,
    0.1666666666666667,
    0.04166666666666668,
    0.008333333333325662,
    0.0013888888888876788,
    0.0001984126987656896,
    2.480158734321864e-5,
    2.7557253126287873e-6,
    2.755725600593144e-7,
    2.510617467419995e-8,
    2.0920747364903866e-9,
];

/// `(n, r)` with `a = n ln 2 + r`, for `|a| < 1500`
#[inline(always)]
fn reduce_modulo_ln_2<D: Double>(a: D) -> (D, DoubleDouble<D>) {
    let n = round_to_integer(a * constant(core::f64::consts::LOG2_E));
    // Both are exact: the first constant has eleven zero bits for the product with n.
    let first = a - n * constant(LN_2_PARTS[0]);
    let second = n * constant(LN_2_PARTS[1]);
    (n, exact_ordered_sum(first, -second))
}

/// The contribution of the lower part of `r` to `eʳ − 1`.
#[inline(always)]
fn low_part_correction<D: Double>(r: DoubleDouble<D>) -> D {
    r.low.mul_add(r.high, r.low)
}

/// `eʳ` to about 57 bits.
#[inline(always)]
fn exp_reduced<D: Double>(r: DoubleDouble<D>) -> DoubleDouble<D> {
    let one = exact_ordered_sum(constant(1.0), r.high);
    let square = r.high * r.high;
    DoubleDouble {
        high: one.high,
        low: one.low + square.mul_add(polynomial(r.high, EXP_POLYNOMIAL), low_part_correction(r)),
    }
}

/// `eʳ − 1` to about 57 bits.
#[inline(always)]
fn exp_m1_reduced<D: Double>(r: DoubleDouble<D>) -> DoubleDouble<D> {
    let [_, rest @ ..] = EXP_POLYNOMIAL;
    let square = exact_product(r.high, r.high).scale_by_power_of_two(constant(0.5));
    let e = exact_ordered_sum(r.high, square.high);
    let cube = (r.high * square.high) * constant(2.0);
    DoubleDouble {
        high: e.high,
        low: e.low + cube.mul_add(polynomial(r.high, rest), square.low + low_part_correction(r)),
    }
}

/// `a 2ⁿ`, rounded once, for a normal `a` near 1 and `|n| < 2000`
#[inline(always)]
fn scale_by_power_of_two<D: Double>(a: D, n: D) -> D {
    let half = round_to_integer(n * constant(0.5));
    (a * power_of_two(half)) * power_of_two(n - half)
}

/// `eᵃ`
#[inline(always)]
pub fn exp<D: Double>(a: D) -> D {
    let (n, r) = reduce_modulo_ln_2(clamp(a, -746.0, 710.0));
    scale_by_power_of_two(exp_reduced(r).round(), n)
}

/// `2ᵃ`
#[inline(always)]
pub fn exp2<D: Double>(a: D) -> D {
    let a = clamp(a, -1076.0, 1025.0);
    let n = round_to_integer(a);
    let r = DoubleDouble::constant(LN_2_PAIR[0], LN_2_PAIR[1]).scale(a - n).normalise();
    scale_by_power_of_two(exp_reduced(r).round(), n)
}

/// Half of `eᵃ − 1`, for `−60 ≤ a ≤ 709.9`
#[inline(always)]
fn half_exp_m1<D: Double>(a: D) -> DoubleDouble<D> {
    let (n, r) = reduce_modulo_ln_2(a);
    let power = power_of_two(n - constant(1.0));
    let e = exp_m1_reduced(r);
    let first = exact_sum(power, constant(-0.5));
    let second = exact_sum(first.high, power * e.high);
    DoubleDouble { high: second.high, low: second.low + (first.low + power * e.low) }.normalise()
}

/// `eᵃ − 1`
#[inline(always)]
pub fn exp_m1<D: Double>(a: D) -> D {
    let half = half_exp_m1(clamp(a, -60.0, 709.9)).round();
    // For a tiny number the result is the number itself, with its sign.
    D::select(a.abs().lt(constant(1e-20)), a, half + half)
}

/// `(sinh r − r)/r³` in `r²`, `|r| ≤ 1`; `sinh r` to 9.2e-19
const SINH_POLYNOMIAL: [f64; 7] = [
    0.16666666666666666,
    0.008333333333333567,
    0.00019841269841110008,
    2.755731926476937e-6,
    2.5052105469960146e-8,
    1.6058657399468799e-10,
    7.71610008115315e-13,
];

/// Half of `e^|a|` and half of its reciprocal.
#[inline(always)]
fn half_exponentials<D: Double>(magnitude: D) -> (DoubleDouble<D>, DoubleDouble<D>) {
    let (n, r) = reduce_modulo_ln_2(clamp(magnitude, 0.0, 711.0));
    let near = exp_reduced(r).normalise();
    // In two factors, because 2¹⁰²⁴ is no double. Values below 2⁻¹⁰⁰⁰ are negligible.
    let rising =
        near.scale_by_power_of_two(power_of_two(n - constant(2.0))).scale_by_power_of_two(constant(2.0));
    let falling = DoubleDouble::new(constant(0.5))
        .div(near)
        .scale_by_power_of_two(power_of_two(-clamp(n, 0.0, 1000.0)));
    (rising, falling)
}

/// `sinh a`
#[inline(always)]
pub fn sinh<D: Double>(a: D) -> D {
    let magnitude = a.abs();
    let (rising, falling) = half_exponentials(magnitude);
    let far = D::select(rising.high.is_finite(), rising.add_smaller(falling.negate()).round(), rising.high);
    let square = magnitude * magnitude;
    let near = (magnitude * square).mul_add(polynomial(square, SINH_POLYNOMIAL), magnitude);
    copy_sign(D::select(magnitude.lt(constant(1.0)), near, far), a)
}

/// `cosh a`
#[inline(always)]
pub fn cosh<D: Double>(a: D) -> D {
    let (rising, falling) = half_exponentials(a.abs());
    D::select(rising.high.is_finite(), rising.add_smaller(falling).round(), rising.high)
}

/// `tanh a = (e²ᵃ − 1)/(e²ᵃ + 1)`
#[inline(always)]
pub fn tanh<D: Double>(a: D) -> D {
    let magnitude = a.abs();
    let half = half_exp_m1(clamp(magnitude + magnitude, 0.0, 44.0));
    let above = exact_ordered_sum(half.high, half.low);
    let quotient = above.div(DoubleDouble::new(constant(1.0)).add(above)).round();
    let tiny = magnitude.lt(constant(1e-9));
    copy_sign(D::select(tiny, magnitude, quotient), a)
}

/// `aᵇ = exp(b ln a)`, with the logarithm to about 65 bits. Rare arguments use the function of one
/// number.
#[inline(always)]
pub fn powf<D: Double>((a, b): (D, D)) -> D {
    let usual = D::and(constant::<D>(f64::MIN_POSITIVE).le(a), a.le(constant(f64::MAX)));
    // Results of rare arguments and overflows are replaced below.
    let logarithm = super::logarithm::ln_pair(a);
    let exponent = exact_product(logarithm.high, b);
    let low = logarithm.low.mul_add(b, exponent.low);
    // The product of a zero logarithm and a large number has no lower part.
    let fits = D::and(exponent.high.abs().lt(constant(700.0)), b.abs().lt(constant(1e100)));
    let (n, r) = reduce_modulo_ln_2(exponent.high);
    let r = exact_ordered_sum(r.high, r.low + low);
    let mut result = exp_reduced(r).round() * power_of_two(n);
    replace_special_lanes_of_two(D::not(D::and(usual, fits)), a, b, &mut result, <f64 as Scalar>::powf);
    result
}
