//! Elementary functions to about 100 bits: Taylor series in double-double arithmetic, and Newton's
//! method for inverses. Slow and simple, independent of the tested code.

use core::f64::consts::LN_2;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// `high + low`
#[derive(Clone, Copy, Debug)]
pub struct DoubleDouble {
    pub high: f64,
    pub low: f64,
}

/// π/2 and ln 2 to 159 bits. Digits: OEIS A019669, A002162; truncated by hand with 200 bits of
/// `mpmath`.
const PI_2: [f64; 3] = [core::f64::consts::FRAC_PI_2, 6.123233995736766e-17, -1.4973849048591698e-33];
const LN_2_PARTS: [f64; 3] = [LN_2, 2.3190468138462996e-17, 5.707708438416212e-34];
/// ln 10 to 106 bits, OEIS A002392
const LN_10: DoubleDouble = DoubleDouble { high: core::f64::consts::LN_10, low: -2.1707562233822494e-16 };

pub fn double_double(high: f64) -> DoubleDouble {
    DoubleDouble { high, low: 0.0 }
}

fn two_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    let part = high - a;
    DoubleDouble { high, low: (a - (high - part)) + (b - part) }
}

fn two_product(a: f64, b: f64) -> DoubleDouble {
    let high = a * b;
    DoubleDouble { high, low: a.mul_add(b, -high) }
}

/// The compensated sum of a few numbers with any cancellation: rounding errors are added
/// repeatedly.
fn accurate_sum<const K: usize>(mut terms: [f64; K]) -> DoubleDouble {
    for _ in 0..K {
        for i in 1..K {
            let s = two_sum(terms[i - 1], terms[i]);
            (terms[i], terms[i - 1]) = (s.high, s.low);
        }
    }
    let rest: f64 = terms[..K - 1].iter().sum();
    two_sum(terms[K - 1], rest)
}

impl Add for DoubleDouble {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let (s, t) = (two_sum(self.high, other.high), two_sum(self.low, other.low));
        let s = two_sum(s.high, s.low + t.high);
        two_sum(s.high, s.low + t.low)
    }
}
impl Neg for DoubleDouble {
    type Output = Self;
    fn neg(self) -> Self {
        Self { high: -self.high, low: -self.low }
    }
}
impl Sub for DoubleDouble {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}
impl Mul for DoubleDouble {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let p = two_product(self.high, other.high);
        two_sum(p.high, p.low + (self.high * other.low + self.low * other.high))
    }
}
impl Div for DoubleDouble {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        let rest = self - other * double_double(first);
        let second = rest.high / other.high;
        let rest = rest - other * double_double(second);
        two_sum(first, second) + double_double(rest.high / other.high)
    }
}

impl DoubleDouble {
    fn times_two_to_the(self, n: i32) -> Self {
        // In two factors: 2¹⁰²⁴ is no double.
        let (half, rest) = (2.0_f64.powi(n / 2), 2.0_f64.powi(n - n / 2));
        Self { high: self.high * half * rest, low: self.low * half * rest }
    }
    fn sqrt(self) -> Self {
        if self.high == 0.0 {
            return self;
        }
        let root = double_double(self.high.sqrt());
        (root + self / root) * double_double(0.5)
    }
    fn square(self) -> Self {
        self * self
    }
}

/// `eᵃ − 1` for `|a| ≤ 1`: Taylor series of a 512th, and `(1 + e)² − 1 = 2e + e²`.
fn exp_m1_small(a: DoubleDouble) -> DoubleDouble {
    let r = a.times_two_to_the(-9);
    let mut e = double_double(0.0);
    for k in (1..=14).rev() {
        e = (double_double(1.0) + e) * r / double_double(f64::from(k));
    }
    for _ in 0..9 {
        e = double_double(2.0) * e + e.square();
    }
    e
}

/// `(e, n)` with `eᵃ = (1 + e) 2ⁿ`
fn exp_with_exponent(a: DoubleDouble) -> (DoubleDouble, i32) {
    let n = (a.high / LN_2).round();
    let [p, q, r] = LN_2_PARTS.map(|part| two_product(n, part));
    let rest = accurate_sum([a.high, -p.high, a.low, -p.low, -q.high, -q.low, -r.high]);
    (exp_m1_small(rest), n as i32)
}

fn exp_m1_long(a: DoubleDouble) -> DoubleDouble {
    if a.high.abs() < 1.0 {
        return exp_m1_small(a);
    }
    let (e, n) = exp_with_exponent(a);
    (double_double(1.0) + e).times_two_to_the(n) - double_double(1.0)
}

/// `ln(1 + f)`: one step of Halley's method from the value of `f64`.
fn ln_1p_long(f: DoubleDouble) -> DoubleDouble {
    if f.high > 1e9 {
        return ln_long(double_double(1.0) + f);
    }
    let start = double_double(f.high.ln_1p());
    let c = f + exp_m1_long(-start) * (double_double(1.0) + f);
    start + double_double(2.0) * c / (double_double(2.0) + c)
}

fn ln_long(a: DoubleDouble) -> DoubleDouble {
    if (0.5..2.0).contains(&a.high) {
        return ln_1p_long(a - double_double(1.0));
    }
    let start = double_double(a.high.ln());
    let (e, n) = exp_with_exponent(-start);
    let half = |a: DoubleDouble| a.times_two_to_the(n / 2).times_two_to_the(n - n / 2);
    let c = half(a * (double_double(1.0) + e)) - double_double(1.0);
    start + double_double(2.0) * c / (double_double(2.0) + c)
}

/// `(sin a, cos a)` for `|a| < 10⁷`
fn sin_cos_long(a: DoubleDouble) -> (DoubleDouble, DoubleDouble) {
    let n = (a.high / PI_2[0]).round();
    let [p, q, r] = PI_2.map(|part| two_product(n, part));
    let rest = accurate_sum([a.high, -p.high, a.low, -p.low, -q.high, -q.low, -r.high]);
    let square = rest.square();
    let (mut sin, mut cos) = (double_double(1.0), double_double(1.0));
    for k in (1..=18).rev() {
        let k = f64::from(k);
        sin = double_double(1.0) - sin * square / double_double(2.0 * k * (2.0 * k + 1.0));
        cos = double_double(1.0) - cos * square / double_double(2.0 * k * (2.0 * k - 1.0));
    }
    sin = sin * rest;
    match n.rem_euclid(4.0) {
        0.0 => (sin, cos),
        1.0 => (cos, -sin),
        2.0 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// The angle of `(x, y)`: the value of `f64` plus the small remaining angle.
fn angle(y: DoubleDouble, x: DoubleDouble) -> DoubleDouble {
    let start = f64::atan2(y.high, x.high);
    let (sin, cos) = sin_cos_long(double_double(start));
    let rest = (y * cos - x * sin) / (x * cos + y * sin);
    double_double(start) + (rest - rest * rest.square() / double_double(3.0))
}

/// A function of two numbers (most ignore the second): `(value, n)` for the result `value · 2ⁿ`.
pub type ReferenceFunction = fn(f64, f64) -> (DoubleDouble, i32);

fn half_exponential_sum(a: f64, sign: f64) -> (DoubleDouble, i32) {
    let (e, n) = exp_with_exponent(double_double(a.abs()));
    let rising = double_double(1.0) + e;
    // For |a| > 40 the decaying exponential is below the last bit.
    let falling =
        if n < 60 { (double_double(1.0) / rising).times_two_to_the(-2 * n) } else { double_double(0.0) };
    (rising + falling * double_double(sign), n - 1)
}

fn unscaled(value: DoubleDouble) -> (DoubleDouble, i32) {
    (value, 0)
}

pub fn cbrt(a: f64, _: f64) -> (DoubleDouble, i32) {
    let root = double_double(a.cbrt());
    let square = root.square();
    unscaled(root - (square * root - double_double(a)) / (double_double(3.0) * square))
}
pub fn exp(a: f64, _: f64) -> (DoubleDouble, i32) {
    let (e, n) = exp_with_exponent(double_double(a));
    (double_double(1.0) + e, n)
}
pub fn exp2(a: f64, _: f64) -> (DoubleDouble, i32) {
    let n = a.round();
    (
        double_double(1.0)
            + exp_m1_small(DoubleDouble { high: LN_2, low: LN_2_PARTS[1] } * double_double(a - n)),
        n as i32,
    )
}
pub fn exp_m1(a: f64, _: f64) -> (DoubleDouble, i32) {
    if a > 100.0 { exp(a, 0.0) } else { unscaled(exp_m1_long(double_double(a))) }
}
pub fn ln(a: f64, _: f64) -> (DoubleDouble, i32) {
    unscaled(ln_long(double_double(a)))
}
pub fn ln_1p(a: f64, _: f64) -> (DoubleDouble, i32) {
    unscaled(ln_1p_long(double_double(a)))
}
pub fn log2(a: f64, _: f64) -> (DoubleDouble, i32) {
    unscaled(ln_long(double_double(a)) / DoubleDouble { high: LN_2, low: LN_2_PARTS[1] })
}
pub fn log10(a: f64, _: f64) -> (DoubleDouble, i32) {
    unscaled(ln_long(double_double(a)) / LN_10)
}
pub fn sin(a: f64, _: f64) -> (DoubleDouble, i32) {
    unscaled(sin_cos_long(double_double(a)).0)
}
pub fn cos(a: f64, _: f64) -> (DoubleDouble, i32) {
    unscaled(sin_cos_long(double_double(a)).1)
}
pub fn tan(a: f64, _: f64) -> (DoubleDouble, i32) {
    let (sin, cos) = sin_cos_long(double_double(a));
    unscaled(sin / cos)
}
pub fn asin(a: f64, _: f64) -> (DoubleDouble, i32) {
    unscaled(angle(double_double(a), (double_double(1.0) - double_double(a).square()).sqrt()))
}
pub fn acos(a: f64, _: f64) -> (DoubleDouble, i32) {
    unscaled(angle((double_double(1.0) - double_double(a).square()).sqrt(), double_double(a)))
}
pub fn atan(a: f64, _: f64) -> (DoubleDouble, i32) {
    unscaled(angle(double_double(a), double_double(1.0)))
}
pub fn atan2(y: f64, x: f64) -> (DoubleDouble, i32) {
    unscaled(angle(double_double(y), double_double(x)))
}
pub fn sinh(a: f64, _: f64) -> (DoubleDouble, i32) {
    let sign = double_double(a.signum());
    if a.abs() < 1.0 {
        let e = exp_m1_small(double_double(a.abs()));
        return unscaled((e + e / (double_double(1.0) + e)) * double_double(0.5) * sign);
    }
    let (value, n) = half_exponential_sum(a, -1.0);
    (value * sign, n)
}
pub fn cosh(a: f64, _: f64) -> (DoubleDouble, i32) {
    half_exponential_sum(a, 1.0)
}
pub fn tanh(a: f64, _: f64) -> (DoubleDouble, i32) {
    if a.abs() > 50.0 {
        return unscaled(double_double(a.signum()));
    }
    let e = exp_m1_long(double_double(2.0 * a));
    unscaled(e / (e + double_double(2.0)))
}
pub fn asinh(a: f64, _: f64) -> (DoubleDouble, i32) {
    let square = double_double(a).square();
    let f = double_double(a.abs()) + square / (double_double(1.0) + (double_double(1.0) + square).sqrt());
    unscaled(ln_1p_long(f) * double_double(a.signum()))
}
pub fn acosh(a: f64, _: f64) -> (DoubleDouble, i32) {
    let t = double_double(a) - double_double(1.0);
    unscaled(ln_1p_long(t + (t * (t + double_double(2.0))).sqrt()))
}
pub fn atanh(a: f64, _: f64) -> (DoubleDouble, i32) {
    unscaled(
        ln_1p_long(double_double(2.0) * double_double(a) / (double_double(1.0) - double_double(a)))
            * double_double(0.5),
    )
}
pub fn hypot(a: f64, b: f64) -> (DoubleDouble, i32) {
    unscaled((double_double(a).square() + double_double(b).square()).sqrt())
}
pub fn powf(a: f64, b: f64) -> (DoubleDouble, i32) {
    let (e, n) = exp_with_exponent(ln_long(double_double(a)) * double_double(b));
    (double_double(1.0) + e, n)
}
