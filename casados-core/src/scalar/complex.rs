//! Complex numbers as scalars, for derivatives by the complex step: `f'(a) = Im f(a + ih) / h`,
//! exact to rounding for `h = 1e-200`.
//!
//! Every function is the analytic continuation of the real one, in a formula that keeps the digits
//! of a tiny imaginary part and also holds far from the real axis. For piecewise functions (`abs`,
//! `signum`, `atan2`, `cbrt` and `powf` of negative numbers, comparisons) the real part selects the
//! piece. Inverse functions follow Kahan, "Branch cuts for complex elementary functions" (1987).

use super::{Field, Rows, Scalar, field::power, mask_logic, one_mask, own_cell};
use core::f64::consts::{FRAC_PI_2, LN_2, LN_10, PI};
use num_complex::Complex64;

/// `a + ib`
const fn complex(re: f64, im: f64) -> Complex64 {
    Complex64 { re, im }
}

/// `r (cos φ + i sin φ)`
fn polar(r: f64, angle: f64) -> Complex64 {
    let (s, c_) = angle.sin_cos();
    complex(r * c_, r * s)
}

impl Field for Complex64 {
    one_mask!();

    fn from_f64(value: f64) -> Self {
        complex(value, 0.0)
    }
    fn is_smaller(self, other: Self) -> bool {
        self.norm_sqr() < other.norm_sqr()
    }
}

impl Scalar for Complex64 {
    own_cell!();

    fn look_up<R: Rows<K, C>, const K: usize, const C: usize>(a: [Self; K], rows: R) -> [Self; C] {
        rows.row(a.map(|a| a.re)).map(|number| complex(number, 0.0))
    }

    fn sqrt(self) -> Self {
        if self.re == 0.0 && self.im == 0.0 {
            return complex(0.0, self.im);
        }
        // First the sum of like signs; the other part follows from √z² = z.
        let t = (0.5 * (self.re.abs() + f64::hypot(self.re, self.im))).sqrt();
        if self.re >= 0.0 {
            complex(t, self.im / (2.0 * t))
        } else {
            complex(self.im.abs() / (2.0 * t), t.copysign(self.im))
        }
    }
    fn cbrt(self) -> Self {
        if self.re < 0.0 {
            return -Scalar::cbrt(-self);
        }
        polar(f64::hypot(self.re, self.im).cbrt(), f64::atan2(self.im, self.re) / 3.0)
    }
    fn exp(self) -> Self {
        polar(self.re.exp(), self.im)
    }
    fn exp2(self) -> Self {
        polar(self.re.exp2(), LN_2 * self.im)
    }
    fn exp_m1(self) -> Self {
        let half = (0.5 * self.im).sin();
        complex(self.re.exp_m1() * self.im.cos() - 2.0 * half * half, self.re.exp() * self.im.sin())
    }
    fn ln(self) -> Self {
        complex(f64::hypot(self.re, self.im).ln(), f64::atan2(self.im, self.re))
    }
    fn ln_1p(self) -> Self {
        let (a, b) = (self.re, self.im);
        // |1 + z|² − 1 = a (a + 2) + b²
        let re =
            if a.abs() < 0.5 { 0.5 * (a * (a + 2.0) + b * b).ln_1p() } else { f64::hypot(1.0 + a, b).ln() };
        complex(re, f64::atan2(b, 1.0 + a))
    }
    fn log2(self) -> Self {
        complex(f64::hypot(self.re, self.im).log2(), f64::atan2(self.im, self.re) / LN_2)
    }
    fn log10(self) -> Self {
        complex(f64::hypot(self.re, self.im).log10(), f64::atan2(self.im, self.re) / LN_10)
    }
    fn sin(self) -> Self {
        complex(self.re.sin() * self.im.cosh(), self.re.cos() * self.im.sinh())
    }
    fn cos(self) -> Self {
        complex(self.re.cos() * self.im.cosh(), -self.re.sin() * self.im.sinh())
    }
    fn sin_cos(self) -> (Self, Self) {
        (Scalar::sin(self), Scalar::cos(self))
    }
    fn tan(self) -> Self {
        // (t + iτ)/(1 − itτ) with t = tan a, τ = tanh b
        let (t, hyperbolic, cosh) = (self.re.tan(), self.im.tanh(), self.im.cosh());
        let denominator = 1.0 + t * t * hyperbolic * hyperbolic;
        complex(t / (cosh * cosh * denominator), hyperbolic * (1.0 + t * t) / denominator)
    }
    fn asin(self) -> Self {
        let (minus, plus) = (Scalar::sqrt(1.0 - self), Scalar::sqrt(1.0 + self));
        complex(f64::atan2(self.re, (minus * plus).re), (minus.conj() * plus).im.asinh())
    }
    fn acos(self) -> Self {
        let (minus, plus) = (Scalar::sqrt(1.0 - self), Scalar::sqrt(1.0 + self));
        complex(2.0 * f64::atan2(minus.re, plus.re), (plus.conj() * minus).im.asinh())
    }
    fn atan(self) -> Self {
        // −i artanh(iz), written out
        let (a, b) = (self.re, self.im);
        complex(
            0.5 * f64::atan2(2.0 * a, (1.0 - b) * (1.0 + b) - a * a),
            -0.25 * (-4.0 * b / ((1.0 + b) * (1.0 + b) + a * a)).ln_1p(),
        )
    }
    fn atan2(self, other: Self) -> Self {
        if self.re.abs() > other.re.abs() {
            complex(FRAC_PI_2.copysign(self.re), 0.0) - Scalar::atan(other / self)
        } else if other.re.is_sign_negative() {
            complex(PI.copysign(self.re), 0.0) + Scalar::atan(self / other)
        } else {
            Scalar::atan(self / other)
        }
    }
    fn sinh(self) -> Self {
        complex(self.re.sinh() * self.im.cos(), self.re.cosh() * self.im.sin())
    }
    fn cosh(self) -> Self {
        complex(self.re.cosh() * self.im.cos(), self.re.sinh() * self.im.sin())
    }
    fn tanh(self) -> Self {
        // (τ + it)/(1 + itτ) with τ = tanh a, t = tan b
        let (hyperbolic, cosh, t) = (self.re.tanh(), self.re.cosh(), self.im.tan());
        let denominator = 1.0 + t * t * hyperbolic * hyperbolic;
        complex(hyperbolic * (1.0 + t * t) / denominator, t / (cosh * cosh * denominator))
    }
    fn asinh(self) -> Self {
        // −i arcsin(iz)
        let rotated = Scalar::asin(complex(-self.im, self.re));
        complex(rotated.im, -rotated.re)
    }
    fn acosh(self) -> Self {
        let (minus, plus) = (Scalar::sqrt(self - 1.0), Scalar::sqrt(self + 1.0));
        complex((minus.conj() * plus).re.asinh(), 2.0 * f64::atan2(minus.im, plus.re))
    }
    fn atanh(self) -> Self {
        if self.re < 0.0 {
            return -Scalar::atanh(-self);
        }
        let (a, b) = (self.re, self.im);
        complex(
            0.25 * (4.0 * a / ((1.0 - a) * (1.0 - a) + b * b)).ln_1p(),
            0.5 * f64::atan2(2.0 * b, (1.0 - a) * (1.0 + a) - b * b),
        )
    }
    fn hypot(self, other: Self) -> Self {
        let scale = [self, other].iter().fold(0.0, |scale, z| z.re.abs().max(z.im.abs()).max(scale));
        if scale == 0.0 || !scale.is_finite() {
            return Scalar::sqrt(self * self + other * other);
        }
        let (a, b) = (self / scale, other / scale);
        Scalar::sqrt(a * a + b * b) * scale
    }
    fn powi(self, n: i32) -> Self {
        power(self, n)
    }
    fn powf(self, other: Self) -> Self {
        if self.re < 0.0 && other.im == 0.0 {
            // Real for an integer exponent, undefined otherwise.
            let exponent = other.re;
            let sign = if exponent % 2.0 == 0.0 {
                1.0
            } else if exponent % 1.0 == 0.0 {
                -1.0
            } else {
                f64::NAN
            };
            return sign * Scalar::powf(-self, other);
        }
        if self.re == 0.0 && self.im == 0.0 {
            return complex(f64::powf(0.0, other.re), 0.0);
        }
        let (r, angle) = (f64::hypot(self.re, self.im), f64::atan2(self.im, self.re));
        polar(r.powf(other.re) * (-other.im * angle).exp(), other.im * r.ln() + other.re * angle)
    }
    fn abs(self) -> Self {
        if self.re.is_sign_negative() { -self } else { self }
    }
    fn signum(self) -> Self {
        complex(self.re.signum(), 0.0)
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Squares of `1e200` and `1e-200` overflow and underflow.
    #[test]
    fn hypotenuses_neither_overflow_nor_underflow() {
        for scale in [1e-200, 1.0, 1e200] {
            let (a, b) = (complex(3.0 * scale, 1e-8 * scale), complex(-4.0 * scale, 0.0));
            let root = Scalar::hypot(a, b);
            assert!((root.re / scale - 5.0).abs() <= 8.0 * f64::EPSILON, "{root}");
            assert!((root.im / scale - 0.6e-8).abs() <= 8e-8 * f64::EPSILON, "{root}");
        }
        assert_eq!(Scalar::hypot(complex(0.0, 0.0), complex(0.0, 0.0)).re, 0.0);
        assert_eq!(Scalar::hypot(complex(3.0, 0.0), complex(f64::INFINITY, 0.0)).re, f64::INFINITY);
    }
}
