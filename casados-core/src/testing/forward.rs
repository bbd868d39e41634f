//! Forward differentiation over any scalar: `Forward<Bounded>` gives bounds of the rounding errors
//! of first derivatives, `Forward<Forward<Bounded>>` those of second derivatives.

use crate::scalar::{Field, Rows, Scalar, own_cell};
use core::f64::consts::{LN_2, LN_10};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// A number and its derivative in one direction.
///
/// ```
/// use casados::testing::{Bounded, Forward};
///
/// // d(x²)/dx at 3.
/// let x = Forward { re: Bounded::exact(3.0), d: Bounded::exact(1.0) };
/// let square = x * x;
/// assert_eq!((square.re.value, square.d.value), (9.0, 6.0));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Forward<S> {
    /// The number.
    pub re: S,
    /// Its derivative.
    pub d: S,
}

impl<S: Scalar> Forward<S> {
    /// A function of one argument: value and derivative.
    fn chain(self, value: S, derivative: S) -> Self {
        Self { re: value, d: derivative * self.d }
    }
}

impl<S: Scalar> Add for Forward<S> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { re: self.re + other.re, d: self.d + other.d }
    }
}
impl<S: Scalar> Sub for Forward<S> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { re: self.re - other.re, d: self.d - other.d }
    }
}
impl<S: Scalar> Mul for Forward<S> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self { re: self.re * other.re, d: self.d * other.re + self.re * other.d }
    }
}
impl<S: Scalar> Div for Forward<S> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let square = other.re * other.re;
        Self { re: self.re / other.re, d: (self.d * other.re - self.re * other.d) / square }
    }
}
impl<S: Scalar> Neg for Forward<S> {
    type Output = Self;
    fn neg(self) -> Self {
        Self { re: -self.re, d: -self.d }
    }
}

/// Functions of one argument `a` with value `f`: the derivative.
macro_rules! functions {
    ($($name:ident($a:ident, $f:ident) = $derivative:expr;)*) => {
        $(
            fn $name(self) -> Self {
                let $a = self.re;
                let $f = $a.$name();
                self.chain($f, $derivative)
            }
        )*
    };
}

impl<S: Scalar> Field for Forward<S> {
    type Mask = S::Mask;

    fn from_f64(value: f64) -> Self {
        Self { re: S::from_f64(value), d: S::from_f64(0.0) }
    }
    fn is_smaller(self, other: Self) -> S::Mask {
        S::is_smaller(self.re, other.re)
    }
    fn select(mask: S::Mask, a: Self, b: Self) -> Self {
        Self { re: S::select(mask, a.re, b.re), d: S::select(mask, a.d, b.d) }
    }
    fn any(mask: S::Mask) -> bool {
        S::any(mask)
    }
}

impl<S: Scalar> Scalar for Forward<S> {
    own_cell!();

    functions! {
        sqrt(a, f) = from_constant::<S>(0.5) / f;
        cbrt(a, f) = f / (from_constant::<S>(3.0) * a);
        exp(a, f) = f;
        exp2(a, f) = from_constant::<S>(LN_2) * f;
        exp_m1(a, f) = a.exp();
        ln(a, f) = from_constant::<S>(1.0) / a;
        ln_1p(a, f) = from_constant::<S>(1.0) / (from_constant::<S>(1.0) + a);
        log2(a, f) = from_constant::<S>(1.0) / (a * from_constant::<S>(LN_2));
        log10(a, f) = from_constant::<S>(1.0) / (a * from_constant::<S>(LN_10));
        sin(a, f) = a.cos();
        cos(a, f) = -a.sin();
        tan(a, f) = from_constant::<S>(1.0) + f * f;
        asin(a, f) = from_constant::<S>(1.0) / (from_constant::<S>(1.0) - a * a).sqrt();
        acos(a, f) = from_constant::<S>(-1.0) / (from_constant::<S>(1.0) - a * a).sqrt();
        atan(a, f) = from_constant::<S>(1.0) / (from_constant::<S>(1.0) + a * a);
        sinh(a, f) = a.cosh();
        cosh(a, f) = a.sinh();
        tanh(a, f) = from_constant::<S>(1.0) - f * f;
        asinh(a, f) = from_constant::<S>(1.0) / (from_constant::<S>(1.0) + a * a).sqrt();
        acosh(a, f) = from_constant::<S>(1.0) / (a * a - from_constant::<S>(1.0)).sqrt();
        atanh(a, f) = from_constant::<S>(1.0) / (from_constant::<S>(1.0) - a * a);
    }
    fn look_up<R: Rows<K, C>, const K: usize, const C: usize>(a: [Self; K], rows: R) -> [Self; C] {
        S::look_up(a.map(|a| a.re), rows).map(|re| Self { re, d: from_constant::<S>(0.0) })
    }
    fn sin_cos(self) -> (Self, Self) {
        (self.sin(), self.cos())
    }
    fn atan2(self, other: Self) -> Self {
        let square = self.re * self.re + other.re * other.re;
        Self { re: self.re.atan2(other.re), d: (other.re * self.d - self.re * other.d) / square }
    }
    fn hypot(self, other: Self) -> Self {
        let value = self.re.hypot(other.re);
        Self { re: value, d: (self.re * self.d + other.re * other.d) / value }
    }
    fn powi(self, exponent: i32) -> Self {
        if exponent == 0 {
            return Self::from_f64(1.0);
        }
        self.chain(
            self.re.powi(exponent),
            from_constant::<S>(f64::from(exponent)) * self.re.powi(exponent - 1),
        )
    }
    fn powf(self, other: Self) -> Self {
        let value = self.re.powf(other.re);
        let zero = from_constant::<S>(0.0);
        // The logarithm does not exist for a negative base, for which the exponent is constant.
        let by_exponent = S::select(S::eq(other.d, zero), zero, value * self.re.ln() * other.d);
        Self {
            re: value,
            d: other.re * self.re.powf(other.re - from_constant::<S>(1.0)) * self.d + by_exponent,
        }
    }
    fn abs(self) -> Self {
        self.chain(self.re.abs(), self.re.signum())
    }
    fn signum(self) -> Self {
        Self { re: self.re.signum(), d: from_constant::<S>(0.0) }
    }
    fn lt(self, other: Self) -> S::Mask {
        S::lt(self.re, other.re)
    }
    fn le(self, other: Self) -> S::Mask {
        S::le(self.re, other.re)
    }
    fn eq(self, other: Self) -> S::Mask {
        S::eq(self.re, other.re)
    }
    fn and(a: S::Mask, b: S::Mask) -> S::Mask {
        S::and(a, b)
    }
    fn or(a: S::Mask, b: S::Mask) -> S::Mask {
        S::or(a, b)
    }
    fn not(a: S::Mask) -> S::Mask {
        S::not(a)
    }
}

/// A constant.
fn from_constant<S: Scalar>(value: f64) -> S {
    S::from_f64(value)
}
