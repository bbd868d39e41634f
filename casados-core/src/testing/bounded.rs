//! Running error analysis: a number with a bound of its rounding error.
//!
//! Every operation adds its own rounding error and propagates those of its arguments, to first
//! order (Wilkinson; Higham, "Accuracy and Stability of Numerical Algorithms", section 3.3). For
//! emitted code the bound is the condition number times epsilon for every entry, which gives the
//! tolerances of comparisons.

use crate::scalar::{Field, Lanes, Rows, Scalar, Sealed, mask_logic, one_mask, own_cell};
use bytemuck::Zeroable;
use core::f64::consts::{LN_2, LN_10};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// Unit roundoff.
const UNIT_ROUNDOFF: f64 = 0.5 * f64::EPSILON;
/// Error of elementary functions of the standard library: less than one unit in the last place.
const FUNCTION_ERROR: f64 = 2.0 * UNIT_ROUNDOFF;

/// A number with a bound of its rounding error.
///
/// ```
/// use casados::testing::Bounded;
///
/// // 1/3 is rounded, and what is left of the difference is that rounding.
/// let third = Bounded::exact(1.0) / Bounded::exact(3.0);
/// let rest = third - Bounded::exact(0.3333333333333333);
/// assert!(rest.value == 0.0 && rest.error > 1e-17 && rest.error < 1e-16);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
pub struct Bounded {
    /// The number, as `f64` computes it.
    pub value: f64,
    /// A bound of its rounding error, to first order.
    pub error: f64,
}

impl Bounded {
    /// An exact number.
    #[must_use]
    pub const fn exact(value: f64) -> Self {
        Self { value, error: 0.0 }
    }

    /// A function of one argument: its value and the magnitude of its derivative.
    fn function(self, value: f64, derivative: f64) -> Self {
        Self { value, error: propagated_error(derivative, self.error) + FUNCTION_ERROR * value.abs() }
    }
}

/// The propagated error of an argument; an exact argument stays exact even for an infinite
/// derivative.
fn propagated_error(derivative: f64, error: f64) -> f64 {
    if error == 0.0 { 0.0 } else { derivative.abs() * error }
}

/// The bound of a rounding error: zero if `lost` is zero, so that exact numbers stay exact.
fn rounding_error(value: f64, lost: f64) -> f64 {
    if lost == 0.0 { 0.0 } else { UNIT_ROUNDOFF * value.abs() }
}

impl Add for Bounded {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let value = self.value + other.value;
        // The rounding error of the sum (Knuth's TwoSum).
        let other_part = value - self.value;
        let lost = (self.value - (value - other_part)) + (other.value - other_part);
        Self { value, error: self.error + other.error + rounding_error(value, lost) }
    }
}

impl Sub for Bounded {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Bounded {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let value = self.value * other.value;
        let carried =
            self.value.abs() * other.error + other.value.abs() * self.error + self.error * other.error;
        let lost = self.value.mul_add(other.value, -value);
        Self { value, error: carried + rounding_error(value, lost) }
    }
}

impl Div for Bounded {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        let left = (other.value.abs() - other.error).max(0.0);
        let carried = self.error + value.abs() * other.error;
        let carried = if carried == 0.0 { 0.0 } else { carried / left };
        let lost = value.mul_add(-other.value, self.value);
        Self { value, error: carried + rounding_error(value, lost) }
    }
}

impl Neg for Bounded {
    type Output = Self;
    fn neg(self) -> Self {
        Self { value: -self.value, error: self.error }
    }
}

/// Functions of one argument `a` with value `f`: the derivative.
macro_rules! functions {
    ($($name:ident($a:ident, $f:ident) = $derivative:expr;)*) => {
        $(
            fn $name(self) -> Self {
                let $a = self.value;
                let $f = $a.$name();
                self.function($f, $derivative)
            }
        )*
    };
}

impl Field for Bounded {
    one_mask!();

    fn from_f64(value: f64) -> Self {
        Self::exact(value)
    }
    fn is_smaller(self, other: Self) -> bool {
        self.value.abs() < other.value.abs()
    }
}

impl Scalar for Bounded {
    own_cell!();

    functions! {
        sqrt(a, f) = 0.5 / f;
        cbrt(a, f) = f / (3.0 * a);
        exp(a, f) = f;
        exp2(a, f) = LN_2 * f;
        exp_m1(a, f) = f + 1.0;
        ln(a, f) = 1.0 / a;
        ln_1p(a, f) = 1.0 / (1.0 + a);
        log2(a, f) = 1.0 / (a * LN_2);
        log10(a, f) = 1.0 / (a * LN_10);
        sin(a, f) = a.cos();
        cos(a, f) = a.sin();
        tan(a, f) = 1.0 + f * f;
        asin(a, f) = 1.0 / (1.0 - a * a).sqrt();
        acos(a, f) = 1.0 / (1.0 - a * a).sqrt();
        atan(a, f) = 1.0 / (1.0 + a * a);
        sinh(a, f) = a.cosh();
        cosh(a, f) = a.sinh();
        tanh(a, f) = 1.0 - f * f;
        asinh(a, f) = 1.0 / (1.0 + a * a).sqrt();
        acosh(a, f) = 1.0 / (a * a - 1.0).sqrt();
        atanh(a, f) = 1.0 / (1.0 - a * a);
    }
    fn look_up<R: Rows<K, C>, const K: usize, const C: usize>(a: [Self; K], rows: R) -> [Self; C] {
        rows.row(a.map(|a| a.value)).map(Self::exact)
    }
    fn sin_cos(self) -> (Self, Self) {
        (self.sin(), self.cos())
    }
    fn atan2(self, other: Self) -> Self {
        let value = self.value.atan2(other.value);
        let square = self.value * self.value + other.value * other.value;
        Self {
            value,
            error: propagated_error(other.value / square, self.error)
                + propagated_error(self.value / square, other.error)
                + FUNCTION_ERROR * value.abs(),
        }
    }
    fn hypot(self, other: Self) -> Self {
        let value = self.value.hypot(other.value);
        Self { value, error: self.error + other.error + FUNCTION_ERROR * value }
    }
    // Square and multiply: at most as many roundings as the exponent.
    fn powi(self, n: i32) -> Self {
        let value = self.value.powi(n);
        let derivative = f64::from(n) * self.value.powi(n - 1);
        Self {
            value,
            error: propagated_error(derivative, self.error)
                + f64::from(n.unsigned_abs()) * UNIT_ROUNDOFF * value.abs(),
        }
    }
    fn powf(self, other: Self) -> Self {
        let value = self.value.powf(other.value);
        let error = propagated_error(other.value * self.value.powf(other.value - 1.0), self.error)
            + propagated_error(value * self.value.ln(), other.error);
        Self { value, error: error + FUNCTION_ERROR * value.abs() }
    }
    fn abs(self) -> Self {
        Self { value: self.value.abs(), error: self.error }
    }
    fn signum(self) -> Self {
        Self::exact(self.value.signum())
    }
    fn lt(self, other: Self) -> bool {
        self.value < other.value
    }
    fn le(self, other: Self) -> bool {
        self.value <= other.value
    }
    fn eq(self, other: Self) -> bool {
        self.value == other.value
    }
    mask_logic!();
}

impl Sealed for Bounded {}

impl Lanes for Bounded {
    const LANES: usize = 1;
    const EPSILON: f64 = f64::EPSILON;
    const STAGNATION: f64 = <f64 as Lanes>::STAGNATION;
    const SMALLEST: f64 = <f64 as Lanes>::SMALLEST;
    crate::scalar::as_it_is!();
    fn lane(cell: &Self, _: usize) -> f64 {
        cell.value
    }
    // A number from code that does not propagate the bound has at least a rounding error.
    fn set_lane(cell: &mut Self, _: usize, value: f64) {
        *cell = Self { value, error: f64::EPSILON * value.abs() };
    }
    fn is_finite(self) -> bool {
        self.value.is_finite()
    }
    fn max(self, other: Self) -> Self {
        if self.value > other.value { self } else { other }
    }
    fn all(mask: bool) -> bool {
        mask
    }
}
