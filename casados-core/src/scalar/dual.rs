//! The dual numbers of `num-dual` as scalars: derivatives of emitted model code by an independent
//! implementation of the chain rule.
//!
//! Functions are those of `num-dual`, except for four, which it lacks, or computes wrongly on a
//! part of the domain or with a loss of digits:
//! - `atan2` divides by the larger argument, so that an argument may be zero;
//! - `hypot` is scaled by the larger argument;
//! - `powf` with a constant exponent also takes zero and negative bases to integer powers, and
//!   rounds once (`num-dual` multiplies `a^(n − 3)` by `a³`); with a variable exponent it is
//!   `exp(b ln a)`;
//! - `powi` of a zero base multiplies: `num-dual` divides by powers of the base.

use super::{Field, Rows, Scalar, field::power, mask_logic, one_mask, own_cell};
use num_dual::{Dual2_64, Dual64, DualNum, HyperDual64};

macro_rules! dual {
    ($t:ty, $constant:expr; $($name:ident)*) => {
        impl Field for $t {
            one_mask!();

            fn from_f64(value: f64) -> Self {
                Self::from(value)
            }
            fn is_smaller(self, other: Self) -> bool {
                self.re.abs() < other.re.abs()
            }
        }

        impl Scalar for $t {
            own_cell!();

            $(
                fn $name(self) -> Self {
                    DualNum::$name(&self)
                }
            )*
            fn sin_cos(self) -> (Self, Self) {
                DualNum::sin_cos(&self)
            }
            fn atan2(self, other: Self) -> Self {
                let angle = f64::atan2(self.re, other.re);
                let mut result = if self.re.abs() <= other.re.abs() {
                    DualNum::atan(&(self / other))
                } else {
                    -DualNum::atan(&(other / self))
                };
                result.re = angle;
                result
            }
            fn hypot(self, other: Self) -> Self {
                let scale = f64::max(self.re.abs(), other.re.abs());
                if scale == 0.0 || !scale.is_finite() {
                    return DualNum::sqrt(&(self * self + other * other));
                }
                let (a, b) = (self / scale, other / scale);
                DualNum::sqrt(&(a * a + b * b)) * scale
            }
            fn powi(self, n: i32) -> Self {
                if self.re == 0.0 && n >= 0 {
                    return power(self, n);
                }
                DualNum::powi(&self, n)
            }
            fn powf(self, other: Self) -> Self {
                let constant: fn(&Self) -> bool = $constant;
                if constant(&other) {
                    // Taylor's formula: the third power of the infinitesimal part is zero.
                    let (a, n) = (self.re, other.re);
                    let term = |factor: f64, exponent: f64| {
                        if factor == 0.0 { 0.0 } else { factor * a.powf(exponent) }
                    };
                    let d = self - Self::from(a);
                    d * d * term(0.5 * n * (n - 1.0), n - 2.0) + d * term(n, n - 1.0) + a.powf(n)
                } else {
                    DualNum::exp(&(other * DualNum::ln(&self)))
                }
            }
            fn look_up<R: Rows<K, C>, const K: usize, const C: usize>(a: [Self; K], rows: R) -> [Self; C] {
                rows.row(a.map(|a| a.re)).map(Self::from)
            }
            fn abs(self) -> Self {
                if self.re.is_sign_negative() { -self } else { self }
            }
            fn signum(self) -> Self {
                Self::from(self.re.signum())
            }
            fn lt(self, other: Self) -> bool {
                self.re < other.re
            }
            fn le(self, other: Self) -> bool {
                self.re <= other.re
            }
            fn eq(self, other: Self) -> bool {
                self.re == other.re
            }
            mask_logic!();
        }
    };
    ($t:ty, $constant:expr) => {
        dual!($t, $constant; sqrt cbrt exp exp2 exp_m1 ln ln_1p log2 log10 sin cos tan asin acos atan
            sinh cosh tanh asinh acosh atanh);
    };
}

dual!(Dual64, |a| a.eps == 0.0);
dual!(Dual2_64, |a| a.v1 == 0.0 && a.v2 == 0.0);
dual!(HyperDual64, |a| a.eps1 == 0.0 && a.eps2 == 0.0 && a.eps1eps2 == 0.0);
