//! Logarithms.
//!
//! `a = 2ᵏ m` with `√½ ≤ m < √2`, and `ln m = 2 artanh s` with `s = (m − 1)/(m + 1)`, a minimax
//! polynomial in `s²`.

use super::pair::{
    DoubleDouble, bit_pattern, constant, exact_ordered_sum, exact_product, exact_sum, polynomial,
};
use super::rounding::{LN_2_PARTS, copy_sign};
use super::{Double, replace_special_lanes};
use crate::scalar::Scalar;

/// `(2 artanh(s)/s − 2)/s²` in `s²`, `|s| ≤ 0.1716`; the logarithm to 4.5e-18
const LN_POLYNOMIAL: [f64; 7] = [
    0.666666666666667,
    0.3999999999989928,
    0.28571428626210205,
    0.22222211090523236,
    0.18182892462869119,
    0.15331610842023538,
    0.14617797125892504,
];

/// `(2 artanh(s)/s − 2 − 2/3 s² − 2/5 s⁴)/s⁶` in `s²`; the logarithm to 9.6e-24
const LN_PAIR_POLYNOMIAL: [f64; 8] = [
    0.2857142857142857,
    0.22222222222224755,
    0.18181818180636122,
    0.15384615632666301,
    0.1333330571308603,
    0.11766449266919558,
    0.10463849026513972,
    0.10699178259914263,
];

const SQRT_HALF: u64 = 0x3FE6_A09E_667F_3BCD;
const MANTISSA_BITS: u64 = 0x000F_FFFF_FFFF_FFFF;

/// `(k, m)` of a normal positive number.
#[inline(always)]
fn split_exponent<D: Double>(a: D) -> (D, D) {
    let shifted = a.add_bits(bit_pattern(1.0_f64.to_bits() - SQRT_HALF));
    let biased = shifted.shift_right::<52>();
    // An integer below 2⁵² in the last bits of 2⁵² is the double 2⁵² plus that integer.
    let k = biased.or_bits(constant(4_503_599_627_370_496.0)) - constant(4_503_599_627_370_496.0 + 1023.0);
    (k, shifted.and_bits(bit_pattern(MANTISSA_BITS)).add_bits(bit_pattern(SQRT_HALF)))
}

/// `2⁻ᵏ`
#[inline(always)]
fn inverse_power<D: Double>(k: D) -> D {
    super::rounding::power_of_two(-k)
}

/// `ln(1 + f)` to about 65 bits, for `−0.3 ≤ f ≤ 0.42`
#[inline(always)]
fn ln_1p_reduced<D: Double>(f: DoubleDouble<D>) -> DoubleDouble<D> {
    twice_artanh(f.div(DoubleDouble::new(constant(2.0)).add_smaller(f)))
}

/// As [`ln_1p_reduced`], for a double.
#[inline(always)]
fn ln_1p_reduced_of_double<D: Double>(f: D) -> DoubleDouble<D> {
    twice_artanh(DoubleDouble::quotient(f, exact_ordered_sum(constant(2.0), f)))
}

/// `2 artanh s` to about 65 bits, for `|s| ≤ 0.1716`
#[inline(always)]
fn twice_artanh<D: Double>(s: DoubleDouble<D>) -> DoubleDouble<D> {
    let z = s.mul(s);
    // The rounding error is 2⁻⁶⁵ of the logarithm: `z` is at most 0.03.
    let inner = z.high.mul_add(polynomial(z.high, LN_PAIR_POLYNOMIAL), constant(0.4));
    let outer = DoubleDouble::constant(0.6666666666666666, 3.700743415417188e-17).add_smaller(z.scale(inner));
    s.scale_by_power_of_two(constant(2.0)).add_smaller(s.mul(z.mul(outer)))
}

/// `k ln 2 + fraction`
#[inline(always)]
fn add_exponent<D: Double>(k: D, fraction: DoubleDouble<D>) -> DoubleDouble<D> {
    DoubleDouble { high: k * constant(LN_2_PARTS[0]), low: k * constant(LN_2_PARTS[1]) }.add_smaller(fraction)
}

/// `ln a` of a normal positive number, to about 65 bits.
#[inline(always)]
pub fn ln_pair<D: Double>(a: D) -> DoubleDouble<D> {
    let (k, m) = split_exponent(a);
    add_exponent(k, ln_1p_reduced_of_double(m - constant(1.0)))
}

/// `ln(1 + a)` to about 65 bits, for `1 + a` normal.
#[inline(always)]
fn ln_1p_pair<D: Double>(a: DoubleDouble<D>) -> DoubleDouble<D> {
    let one = exact_sum(constant(1.0), a.high);
    let (k, m) = split_exponent(one.high);
    let power = inverse_power(k);
    let f = exact_sum(m - constant(1.0), one.low * power);
    add_exponent(k, ln_1p_reduced(DoubleDouble { high: f.high, low: f.low + a.low * power }))
}

/// Numbers that are not normal and positive.
#[inline(always)]
fn is_special<D: Double>(a: D) -> D::Mask {
    D::not(D::and(constant::<D>(f64::MIN_POSITIVE).le(a), a.le(constant(f64::MAX))))
}

/// natural logarithm
#[inline(always)]
pub fn ln<D: Double>(a: D) -> D {
    let (k, m) = split_exponent(a);
    let f = m - constant(1.0);
    let s = f / (constant::<D>(2.0) + f);
    let z = s * s;
    // ln(1 + f) = f − f²/2 + s (f²/2 + z L(z)): the large terms are exact.
    let half_square = exact_product(f * constant(0.5), f);
    let rest = s * z.mul_add(polynomial(z, LN_POLYNOMIAL), half_square.high) - half_square.low;
    let first = exact_ordered_sum(k * constant(LN_2_PARTS[0]), f);
    let second = exact_sum(first.high, -half_square.high);
    let mut result = second.high + (second.low + (first.low + k.mul_add(constant(LN_2_PARTS[1]), rest)));
    replace_special_lanes(is_special(a), a, &mut result, <f64 as Scalar>::ln);
    result
}

/// `ln(1 + a)`
#[inline(always)]
pub fn ln_1p<D: Double>(a: D) -> D {
    let usual = D::and(constant::<D>(-1.0).lt(a), a.le(constant(1e300)));
    let tiny = a.abs().lt(constant(1e-20));
    let mut result =
        D::select(tiny, a, ln_1p_pair(DoubleDouble::new(D::select(usual, a, constant(1.0)))).round());
    replace_special_lanes(D::not(usual), a, &mut result, <f64 as Scalar>::ln_1p);
    result
}

/// logarithm to base 2
#[inline(always)]
pub fn log2<D: Double>(a: D) -> D {
    let (k, m) = split_exponent(a);
    let fraction = ln_1p_reduced_of_double(m - constant(1.0));
    let log =
        fraction.mul(DoubleDouble::constant(core::f64::consts::LOG2_E, 2.0355273740931033e-17)).normalise();
    let mut result = DoubleDouble::new(k).add_smaller(log).round();
    replace_special_lanes(is_special(a), a, &mut result, <f64 as Scalar>::log2);
    result
}

/// logarithm to base 10
#[inline(always)]
pub fn log10<D: Double>(a: D) -> D {
    let (k, m) = split_exponent(a);
    let fraction = ln_1p_reduced_of_double(m - constant(1.0));
    let log =
        fraction.mul(DoubleDouble::constant(core::f64::consts::LOG10_E, 1.098319650216765e-17)).normalise();
    // The first constant has eleven zero bits for the product with k.
    let exponent =
        DoubleDouble { high: k * constant(0.30102999566395283), low: k * constant(2.8363394551044964e-14) };
    let mut result = exponent.add_smaller(log).round();
    replace_special_lanes(is_special(a), a, &mut result, <f64 as Scalar>::log10);
    result
}

/// Above this, `√(a² ± 1)` rounds to `a`.
const LARGE_ARGUMENT: f64 = 1.152921504606847e+18;

/// `ln 2a` for large `a`, otherwise `ln(1 + f)`.
#[inline(always)]
fn ln_2a_or_1p<D: Double>(a: D, f: DoubleDouble<D>) -> D {
    let large = constant::<D>(LARGE_ARGUMENT).lt(a);
    let ln_2 = DoubleDouble { high: constant(LN_2_PARTS[0]), low: constant(LN_2_PARTS[1]) };
    let far = ln_pair(D::select(large, a, constant(1.0))).add(ln_2).round();
    D::select(large, far, ln_1p_pair(f).round())
}

/// `arsinh a = ln(1 + a + a²/(1 + √(1 + a²)))`
#[inline(always)]
pub fn asinh<D: Double>(a: D) -> D {
    let magnitude = a.abs();
    let bounded = D::select(magnitude.lt(constant(LARGE_ARGUMENT)), magnitude, constant(1.0));
    let square = exact_product(bounded, bounded);
    let root = DoubleDouble::new(constant(1.0)).add(square).sqrt();
    let f = DoubleDouble::new(bounded).add(square.div(DoubleDouble::new(constant(1.0)).add(root)));
    let result = copy_sign(ln_2a_or_1p(magnitude, f), a);
    let ordinary = D::and(constant::<D>(1e-9).lt(magnitude), a.is_finite());
    D::select(ordinary, result, a)
}

/// `arcosh a = ln(1 + t + √(t² + 2t))`, `t = a − 1`
#[inline(always)]
pub fn acosh<D: Double>(a: D) -> D {
    let bounded = D::select(a.lt(constant(LARGE_ARGUMENT)), a, constant(1.0));
    let bounded = D::select(constant::<D>(1.0).le(a), bounded, constant(1.0));
    let minus = DoubleDouble::new(constant(-1.0));
    let root = exact_product(bounded, bounded).add(minus).sqrt();
    let f = DoubleDouble::new(bounded).add(minus).add(root);
    let result = ln_2a_or_1p(a, f);
    let result = D::select(a.le(constant(f64::MAX)), result, a);
    D::select(a.lt(constant(1.0)), constant(f64::NAN), result)
}

/// `artanh a = ½ ln(1 + 2a/(1 − a))`
#[inline(always)]
pub fn atanh<D: Double>(a: D) -> D {
    let magnitude = a.abs();
    let usual = magnitude.lt(constant(1.0));
    let bounded = D::select(usual, magnitude, constant(0.5));
    let f = DoubleDouble::new(bounded + bounded).div(exact_sum(constant(1.0), -bounded));
    let result = ln_1p_pair(f).round() * constant(0.5);
    let result = D::select(magnitude.lt(constant(1e-9)), magnitude, result);
    let mut result = copy_sign(result, a);
    replace_special_lanes(D::not(usual), a, &mut result, <f64 as Scalar>::atanh);
    result
}
