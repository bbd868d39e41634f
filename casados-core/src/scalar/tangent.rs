//! A number with its derivative in one direction: evaluates `∂f/∂v v'` together with `f(v)` by
//! model code that is generic over the scalar.
//!
//! This is more accurate than the product of the Jacobian with `v'`: if terms of one or two
//! equations cancel, entries of the Jacobian are rounded sums that have lost small terms. Here
//! shared terms are rounded once, and cancel exactly.

use super::{Field, Piece, Rows, Scalar, own_cell};
use bytemuck::Zeroable;
use core::f64::consts::{LN_2, LN_10};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// `a + ε a'` with `ε² = 0`
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
pub struct Tangent<S> {
    /// `a`
    pub value: S,
    /// `a'`
    pub derivative: S,
}

impl<S: Scalar> Tangent<S> {
    /// A function value `f(a)` with the slope `f'(a)`.
    #[inline(always)]
    fn chain(self, value: S, slope: S) -> Self {
        Self { value, derivative: slope * self.derivative }
    }

    /// A number without a derivative.
    #[inline(always)]
    fn constant(value: S) -> Self {
        Self { value, derivative: S::from_f64(0.0) }
    }
}

impl<S: Scalar> Add for Tangent<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, derivative: self.derivative + other.derivative }
    }
}

impl<S: Scalar> Sub for Tangent<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, derivative: self.derivative - other.derivative }
    }
}

impl<S: Scalar> Mul for Tangent<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            derivative: self.derivative * other.value + self.value * other.derivative,
        }
    }
}

impl<S: Scalar> Div for Tangent<S> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Self { value, derivative: (self.derivative - value * other.derivative) / other.value }
    }
}

impl<S: Scalar> Neg for Tangent<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, derivative: -self.derivative }
    }
}

impl<S: Scalar> Field for Tangent<S> {
    type Mask = S::Mask;

    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Self::constant(S::from_f64(value))
    }
    #[inline(always)]
    fn is_smaller(self, other: Self) -> S::Mask {
        self.value.is_smaller(other.value)
    }
    #[inline(always)]
    fn select(mask: S::Mask, a: Self, b: Self) -> Self {
        Self {
            value: S::select(mask, a.value, b.value),
            derivative: S::select(mask, a.derivative, b.derivative),
        }
    }
    #[inline(always)]
    fn any(mask: S::Mask) -> bool {
        S::any(mask)
    }
}

/// Functions of one argument: the value, and the slope from the argument `a` and the value `f`.
macro_rules! functions {
    ($($name:ident($a:ident, $f:ident) = $slope:expr;)*) => {$(
        #[inline(always)]
        fn $name(self) -> Self {
            let $a = self.value;
            let $f = $a.$name();
            self.chain($f, $slope)
        }
    )*};
}

/// A constant.
#[inline(always)]
fn constant<S: Scalar>(value: f64) -> S {
    S::from_f64(value)
}

impl<S: Scalar> Scalar for Tangent<S> {
    own_cell!();

    #[inline(always)]
    fn vectorize<P: Piece>(piece: P) {
        S::vectorize(piece);
    }

    functions! {
        sqrt(_a, f) = constant::<S>(0.5) / f;
        cbrt(a, f) = f / (constant::<S>(3.0) * a);
        exp(_a, f) = f;
        exp2(_a, f) = f * constant(LN_2);
        exp_m1(a, _f) = a.exp();
        ln(a, _f) = constant::<S>(1.0) / a;
        ln_1p(a, _f) = constant::<S>(1.0) / (constant::<S>(1.0) + a);
        log2(a, _f) = constant::<S>(1.0 / LN_2) / a;
        log10(a, _f) = constant::<S>(1.0 / LN_10) / a;
        tan(_a, f) = constant::<S>(1.0) + f * f;
        asin(a, _f) = constant::<S>(1.0) / ((constant::<S>(1.0) - a) * (constant::<S>(1.0) + a)).sqrt();
        acos(a, _f) = constant::<S>(-1.0) / ((constant::<S>(1.0) - a) * (constant::<S>(1.0) + a)).sqrt();
        atan(a, _f) = constant::<S>(1.0) / (constant::<S>(1.0) + a * a);
        sinh(a, _f) = a.cosh();
        cosh(a, _f) = a.sinh();
        tanh(_a, f) = (constant::<S>(1.0) - f) * (constant::<S>(1.0) + f);
        asinh(a, _f) = constant::<S>(1.0) / a.hypot(constant(1.0));
        acosh(a, _f) = constant::<S>(1.0) / ((a - constant(1.0)) * (a + constant(1.0))).sqrt();
        atanh(a, _f) = constant::<S>(1.0) / ((constant::<S>(1.0) - a) * (constant::<S>(1.0) + a));
        abs(a, _f) = a.signum();
    }

    #[inline(always)]
    fn look_up<R: Rows<K, C>, const K: usize, const C: usize>(a: [Self; K], rows: R) -> [Self; C] {
        S::look_up(a.map(|a| a.value), rows).map(Self::constant)
    }

    #[inline(always)]
    fn sin(self) -> Self {
        self.sin_cos().0
    }
    #[inline(always)]
    fn cos(self) -> Self {
        self.sin_cos().1
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.value.sin_cos();
        (self.chain(sin, cos), self.chain(cos, -sin))
    }
    #[inline(always)]
    fn atan2(self, other: Self) -> Self {
        // (x y' − y x') / r², by quotients that do not overflow.
        let r = self.value.hypot(other.value);
        let (sin, cos) = (self.value / r, other.value / r);
        Self {
            value: self.value.atan2(other.value),
            derivative: (cos * self.derivative - sin * other.derivative) / r,
        }
    }
    #[inline(always)]
    fn hypot(self, other: Self) -> Self {
        let value = self.value.hypot(other.value);
        let (first, second) = (self.value / value, other.value / value);
        Self { value, derivative: first * self.derivative + second * other.derivative }
    }
    #[inline(always)]
    fn powi(self, n: i32) -> Self {
        match n {
            0 => Self::from_f64(1.0),
            i32::MIN => self.powf(Self::from_f64(f64::from(n))),
            _ => self.chain(self.value.powi(n), constant::<S>(f64::from(n)) * self.value.powi(n - 1)),
        }
    }
    #[inline(always)]
    fn powf(self, other: Self) -> Self {
        let (zero, one) = (constant::<S>(0.0), constant::<S>(1.0));
        let value = self.value.powf(other.value);
        // Skips powers of zero that are not needed, and the logarithm for a constant exponent.
        let by_base = other.value * self.value.powf(other.value - one) * self.derivative;
        let by_exponent = value * self.value.ln() * other.derivative;
        let by_base = S::select(other.value.eq(zero), zero, by_base);
        Self { value, derivative: by_base + S::select(other.derivative.eq(zero), zero, by_exponent) }
    }
    #[inline(always)]
    fn signum(self) -> Self {
        Self::constant(self.value.signum())
    }
    #[inline(always)]
    fn lt(self, other: Self) -> S::Mask {
        self.value.lt(other.value)
    }
    #[inline(always)]
    fn le(self, other: Self) -> S::Mask {
        self.value.le(other.value)
    }
    #[inline(always)]
    fn eq(self, other: Self) -> S::Mask {
        self.value.eq(other.value)
    }
    #[inline(always)]
    fn and(a: S::Mask, b: S::Mask) -> S::Mask {
        S::and(a, b)
    }
    #[inline(always)]
    fn or(a: S::Mask, b: S::Mask) -> S::Mask {
        S::or(a, b)
    }
    #[inline(always)]
    fn not(a: S::Mask) -> S::Mask {
        S::not(a)
    }
}
