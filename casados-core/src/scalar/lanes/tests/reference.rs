//! Elementary functions to about 100 bits: Taylor series in pairs of doubles, and Newton's method
//! for inverses. Slow and plain; nothing is shared with what they are the reference of.

use core::f64::consts::LN_2;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// `high + low`
#[derive(Clone, Copy, Debug)]
pub struct Long {
    pub high: f64,
    pub low: f64,
}

/// π/2 and ln 2 to 159 bits. Digits: OEIS A019669, A002162; cut by hand with 200 bits of `mpmath`.
const PI_2: [f64; 3] = [core::f64::consts::FRAC_PI_2, 6.123233995736766e-17, -1.4973849048591698e-33];
const LN_2_PARTS: [f64; 3] = [LN_2, 2.3190468138462996e-17, 5.707708438416212e-34];
/// ln 10 to 106 bits, OEIS A002392
const LN_10: Long = Long { high: core::f64::consts::LN_10, low: -2.1707562233822494e-16 };

pub fn long(high: f64) -> Long {
    Long { high, low: 0.0 }
}

fn two_sum(a: f64, b: f64) -> Long {
    let high = a + b;
    let part = high - a;
    Long { high, low: (a - (high - part)) + (b - part) }
}

fn two_product(a: f64, b: f64) -> Long {
    let high = a * b;
    Long { high, low: a.mul_add(b, -high) }
}

/// The sum of a few numbers, however they cancel: what every addition loses is added again.
fn sum_of<const K: usize>(mut terms: [f64; K]) -> Long {
    for _ in 0..K {
        for i in 1..K {
            let s = two_sum(terms[i - 1], terms[i]);
            (terms[i], terms[i - 1]) = (s.high, s.low);
        }
    }
    let rest: f64 = terms[..K - 1].iter().sum();
    two_sum(terms[K - 1], rest)
}

impl Add for Long {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let (s, t) = (two_sum(self.high, other.high), two_sum(self.low, other.low));
        let s = two_sum(s.high, s.low + t.high);
        two_sum(s.high, s.low + t.low)
    }
}
impl Neg for Long {
    type Output = Self;
    fn neg(self) -> Self {
        Self { high: -self.high, low: -self.low }
    }
}
impl Sub for Long {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}
impl Mul for Long {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let p = two_product(self.high, other.high);
        two_sum(p.high, p.low + (self.high * other.low + self.low * other.high))
    }
}
impl Div for Long {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        let rest = self - other * long(first);
        let second = rest.high / other.high;
        let rest = rest - other * long(second);
        two_sum(first, second) + long(rest.high / other.high)
    }
}

impl Long {
    fn times_two_to_the(self, n: i32) -> Self {
        // In two steps: 2¹⁰²⁴ is no double.
        let (half, rest) = (2.0_f64.powi(n / 2), 2.0_f64.powi(n - n / 2));
        Self { high: self.high * half * rest, low: self.low * half * rest }
    }
    fn sqrt(self) -> Self {
        if self.high == 0.0 {
            return self;
        }
        let root = long(self.high.sqrt());
        (root + self / root) * long(0.5)
    }
    fn square(self) -> Self {
        self * self
    }
}

/// `eᵃ − 1` for `|a| ≤ 1`: Taylor's series of a 512th, and `(1 + e)² − 1 = 2e + e²`.
fn exp_m1_near(a: Long) -> Long {
    let r = a.times_two_to_the(-9);
    let mut e = long(0.0);
    for k in (1..=14).rev() {
        e = (long(1.0) + e) * r / long(f64::from(k));
    }
    for _ in 0..9 {
        e = long(2.0) * e + e.square();
    }
    e
}

/// `(e, n)` with `eᵃ = (1 + e) 2ⁿ`
fn exp_parts(a: Long) -> (Long, i32) {
    let n = (a.high / LN_2).round();
    let [p, q, r] = LN_2_PARTS.map(|part| two_product(n, part));
    let rest = sum_of([a.high, -p.high, a.low, -p.low, -q.high, -q.low, -r.high]);
    (exp_m1_near(rest), n as i32)
}

fn exp_m1_long(a: Long) -> Long {
    if a.high.abs() < 1.0 {
        return exp_m1_near(a);
    }
    let (e, n) = exp_parts(a);
    (long(1.0) + e).times_two_to_the(n) - long(1.0)
}

/// `ln(1 + f)`: one step of Halley's method from what `f64` gives.
fn ln_1p_long(f: Long) -> Long {
    if f.high > 1e9 {
        return ln_long(long(1.0) + f);
    }
    let start = long(f.high.ln_1p());
    let c = f + exp_m1_long(-start) * (long(1.0) + f);
    start + long(2.0) * c / (long(2.0) + c)
}

fn ln_long(a: Long) -> Long {
    if (0.5..2.0).contains(&a.high) {
        return ln_1p_long(a - long(1.0));
    }
    let start = long(a.high.ln());
    let (e, n) = exp_parts(-start);
    let half = |a: Long| a.times_two_to_the(n / 2).times_two_to_the(n - n / 2);
    let c = half(a * (long(1.0) + e)) - long(1.0);
    start + long(2.0) * c / (long(2.0) + c)
}

/// `(sin a, cos a)` for `|a| < 10⁷`
fn sin_cos_long(a: Long) -> (Long, Long) {
    let n = (a.high / PI_2[0]).round();
    let [p, q, r] = PI_2.map(|part| two_product(n, part));
    let rest = sum_of([a.high, -p.high, a.low, -p.low, -q.high, -q.low, -r.high]);
    let square = rest.square();
    let (mut sin, mut cos) = (long(1.0), long(1.0));
    for k in (1..=18).rev() {
        let k = f64::from(k);
        sin = long(1.0) - sin * square / long(2.0 * k * (2.0 * k + 1.0));
        cos = long(1.0) - cos * square / long(2.0 * k * (2.0 * k - 1.0));
    }
    sin = sin * rest;
    match n.rem_euclid(4.0) {
        0.0 => (sin, cos),
        1.0 => (cos, -sin),
        2.0 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// The angle of `(x, y)`: what `f64` gives, and the small angle that is left.
fn angle(y: Long, x: Long) -> Long {
    let start = f64::atan2(y.high, x.high);
    let (sin, cos) = sin_cos_long(long(start));
    let rest = (y * cos - x * sin) / (x * cos + y * sin);
    long(start) + (rest - rest * rest.square() / long(3.0))
}

/// A function of two numbers (of which most use one): `(value, n)` for the result `value · 2ⁿ`.
pub type Function = fn(f64, f64) -> (Long, i32);

fn hyperbolic(a: f64, sign: f64) -> (Long, i32) {
    let (e, n) = exp_parts(long(a.abs()));
    let rising = long(1.0) + e;
    // Of |a| > 40, the falling exponential is less than the last bit.
    let falling = if n < 60 { (long(1.0) / rising).times_two_to_the(-2 * n) } else { long(0.0) };
    (rising + falling * long(sign), n - 1)
}

fn plain(value: Long) -> (Long, i32) {
    (value, 0)
}

pub fn cbrt(a: f64, _: f64) -> (Long, i32) {
    let root = long(a.cbrt());
    let square = root.square();
    plain(root - (square * root - long(a)) / (long(3.0) * square))
}
pub fn exp(a: f64, _: f64) -> (Long, i32) {
    let (e, n) = exp_parts(long(a));
    (long(1.0) + e, n)
}
pub fn exp2(a: f64, _: f64) -> (Long, i32) {
    let n = a.round();
    (long(1.0) + exp_m1_near(Long { high: LN_2, low: LN_2_PARTS[1] } * long(a - n)), n as i32)
}
pub fn exp_m1(a: f64, _: f64) -> (Long, i32) {
    if a > 100.0 { exp(a, 0.0) } else { plain(exp_m1_long(long(a))) }
}
pub fn ln(a: f64, _: f64) -> (Long, i32) {
    plain(ln_long(long(a)))
}
pub fn ln_1p(a: f64, _: f64) -> (Long, i32) {
    plain(ln_1p_long(long(a)))
}
pub fn log2(a: f64, _: f64) -> (Long, i32) {
    plain(ln_long(long(a)) / Long { high: LN_2, low: LN_2_PARTS[1] })
}
pub fn log10(a: f64, _: f64) -> (Long, i32) {
    plain(ln_long(long(a)) / LN_10)
}
pub fn sin(a: f64, _: f64) -> (Long, i32) {
    plain(sin_cos_long(long(a)).0)
}
pub fn cos(a: f64, _: f64) -> (Long, i32) {
    plain(sin_cos_long(long(a)).1)
}
pub fn tan(a: f64, _: f64) -> (Long, i32) {
    let (sin, cos) = sin_cos_long(long(a));
    plain(sin / cos)
}
pub fn asin(a: f64, _: f64) -> (Long, i32) {
    plain(angle(long(a), (long(1.0) - long(a).square()).sqrt()))
}
pub fn acos(a: f64, _: f64) -> (Long, i32) {
    plain(angle((long(1.0) - long(a).square()).sqrt(), long(a)))
}
pub fn atan(a: f64, _: f64) -> (Long, i32) {
    plain(angle(long(a), long(1.0)))
}
pub fn atan2(y: f64, x: f64) -> (Long, i32) {
    plain(angle(long(y), long(x)))
}
pub fn sinh(a: f64, _: f64) -> (Long, i32) {
    let sign = long(a.signum());
    if a.abs() < 1.0 {
        let e = exp_m1_near(long(a.abs()));
        return plain((e + e / (long(1.0) + e)) * long(0.5) * sign);
    }
    let (value, n) = hyperbolic(a, -1.0);
    (value * sign, n)
}
pub fn cosh(a: f64, _: f64) -> (Long, i32) {
    hyperbolic(a, 1.0)
}
pub fn tanh(a: f64, _: f64) -> (Long, i32) {
    if a.abs() > 50.0 {
        return plain(long(a.signum()));
    }
    let e = exp_m1_long(long(2.0 * a));
    plain(e / (e + long(2.0)))
}
pub fn asinh(a: f64, _: f64) -> (Long, i32) {
    let square = long(a).square();
    let f = long(a.abs()) + square / (long(1.0) + (long(1.0) + square).sqrt());
    plain(ln_1p_long(f) * long(a.signum()))
}
pub fn acosh(a: f64, _: f64) -> (Long, i32) {
    let t = long(a) - long(1.0);
    plain(ln_1p_long(t + (t * (t + long(2.0))).sqrt()))
}
pub fn atanh(a: f64, _: f64) -> (Long, i32) {
    plain(ln_1p_long(long(2.0) * long(a) / (long(1.0) - long(a))) * long(0.5))
}
pub fn hypot(a: f64, b: f64) -> (Long, i32) {
    plain((long(a).square() + long(b).square()).sqrt())
}
pub fn powf(a: f64, b: f64) -> (Long, i32) {
    let (e, n) = exp_parts(ln_long(long(a)) * long(b));
    (long(1.0) + e, n)
}
