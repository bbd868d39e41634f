//! Cube roots and lengths.

use super::pair::{bit_pattern, constant, exact_ordered_sum, exact_product, polynomial};
use super::rounding::{copy_sign, power_of_two, round_to_integer};
use super::{Double, replace_special_lanes, replace_special_lanes_of_two};
use crate::scalar::Scalar;

/// `∛m`, `1 ≤ m ≤ 2`, to 1.2e-6
const CBRT_POLYNOMIAL: [f64; 6] = [
    0.47333067881193963,
    0.8381600343158935,
    -0.46922872065411486,
    0.20277723014701973,
    -0.05038653924373415,
    0.005348547584548955,
];

/// `∛a`: a polynomial and two steps of Newton's method, the second with the exact cube.
#[inline(always)]
pub fn cbrt<D: Double>(a: D) -> D {
    let magnitude = a.abs();
    let usual = D::and(constant::<D>(f64::MIN_POSITIVE).le(magnitude), magnitude.le(constant(f64::MAX)));
    let exponent = magnitude.shift_right::<52>().or_bits(constant(4_503_599_627_370_496.0))
        - constant(4_503_599_627_370_496.0 + 1023.0);
    let mantissa = magnitude.and_bits(bit_pattern(0x000F_FFFF_FFFF_FFFF)).or_bits(constant(1.0));
    // |a| = 2^(3k + j) m, j = 0, 1, 2
    let k = round_to_integer((exponent - constant(1.0)) * constant(1.0 / 3.0));
    let j = exponent - k * constant(3.0);
    let (one, two) = (j.eq(constant(1.0)), j.eq(constant(2.0)));
    let choose = |if_one: f64, if_two: f64| {
        D::select(one, constant(if_one), D::select(two, constant(if_two), constant(1.0)))
    };
    let cube = mantissa * choose(2.0, 4.0);
    let t = polynomial(mantissa, CBRT_POLYNOMIAL) * choose(1.2599210498948732, 1.5874010519681996);
    let square = t * t;
    let t = t - (square * t - cube) / (square * constant(3.0));
    let square = exact_product(t, t);
    let third = exact_product(square.high, t);
    let rest = (cube - third.high) - square.low.mul_add(t, third.low);
    let root = t + rest / (square.high * constant(3.0));
    let mut result = copy_sign(root * power_of_two(k), a);
    replace_special_lanes(D::not(usual), a, &mut result, <f64 as Scalar>::cbrt);
    result
}

/// `√(a² + b²)`
#[inline(always)]
pub fn hypot<D: Double>((a, b): (D, D)) -> D {
    let (a_, b_) = (a.abs(), b.abs());
    let larger = a_.lt(b_);
    let (long, short) = (D::select(larger, b_, a_), D::select(larger, a_, b_));
    let usual = D::and(D::and(constant::<D>(1e-130).lt(long), long.lt(constant(1e130))), short.le(long));
    let (p, q) = (exact_product(long, long), exact_product(short, short));
    let s = exact_ordered_sum(p.high, q.high);
    let root = super::pair::DoubleDouble { high: s.high, low: s.low + (p.low + q.low) }.sqrt();
    let mut result = root.round();
    replace_special_lanes_of_two(D::not(usual), a, b, &mut result, <f64 as Scalar>::hypot);
    result
}
