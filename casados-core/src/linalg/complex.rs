//! Complex numbers, several side by side.

use crate::scalar::{Field, Real};
use bytemuck::Zeroable;
use core::array::from_fn;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// `L` complex numbers side by side: what elimination computes with where it solves `L` systems of one pattern at once.
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
pub struct Complex<T, const L: usize> {
    /// Real parts.
    pub re: [T; L],
    /// Imaginary parts.
    pub im: [T; L],
}

impl<T: Real, const L: usize> Complex<T, L> {
    /// `L` times zero.
    pub const ZERO: Self = Self { re: [T::ZERO; L], im: [T::ZERO; L] };

    /// Real numbers.
    #[inline(always)]
    pub fn real(re: [T; L]) -> Self {
        Self { re, im: [T::ZERO; L] }
    }

    /// `a z` with a real number `a`.
    #[inline(always)]
    pub fn scaled(self, a: T) -> Self {
        Self { re: self.re.map(|re| a * re), im: self.im.map(|im| a * im) }
    }

    /// Whether all parts are neither infinite nor NaN.
    #[inline(always)]
    pub fn is_finite(&self) -> bool {
        self.re.iter().chain(&self.im).fold(true, |finite, part| finite & part.is_finite())
    }

    /// `1/z`. Divided by its larger part first, so that no square of a part overflows.
    #[inline(always)]
    fn reciprocal(self) -> Self {
        let (mut re, mut im) = (self.re, self.im);
        for l in 0..L {
            let size = self.re[l].abs().max(self.im[l].abs());
            let (r, i) = (self.re[l] / size, self.im[l] / size);
            let square = self.re[l] * r + self.im[l] * i;
            (re[l], im[l]) = (r / square, -i / square);
        }
        Self { re, im }
    }
}

impl<T: Real, const L: usize> Add for Complex<T, L> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { re: from_fn(|l| self.re[l] + other.re[l]), im: from_fn(|l| self.im[l] + other.im[l]) }
    }
}

impl<T: Real, const L: usize> Sub for Complex<T, L> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { re: from_fn(|l| self.re[l] - other.re[l]), im: from_fn(|l| self.im[l] - other.im[l]) }
    }
}

impl<T: Real, const L: usize> Mul for Complex<T, L> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self {
            re: from_fn(|l| self.re[l] * other.re[l] - self.im[l] * other.im[l]),
            im: from_fn(|l| self.re[l] * other.im[l] + self.im[l] * other.re[l]),
        }
    }
}

impl<T: Real, const L: usize> Div for Complex<T, L> {
    type Output = Self;
    #[inline(always)]
    #[allow(clippy::suspicious_arithmetic_impl)] // There is no other quotient.
    fn div(self, other: Self) -> Self {
        self * other.reciprocal()
    }
}

impl<T: Real, const L: usize> Neg for Complex<T, L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { re: self.re.map(|re| -re), im: self.im.map(|im| -im) }
    }
}

impl<T: Real, const L: usize> Field for Complex<T, L> {
    type Mask = [bool; L];

    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Self::real([T::from_f64(value); L])
    }

    #[inline(always)]
    fn subtract_product(self, a: Self, b: Self) -> Self {
        Self {
            re: from_fn(|l| {
                self.re[l].subtract_product(a.re[l], b.re[l]).subtract_product(-a.im[l], b.im[l])
            }),
            im: from_fn(|l| self.im[l].subtract_product(a.re[l], b.im[l]).subtract_product(a.im[l], b.re[l])),
        }
    }

    /// By `|re| + |im|`.
    #[inline(always)]
    fn is_smaller(self, other: Self) -> Self::Mask {
        from_fn(|l| self.re[l].abs() + self.im[l].abs() < other.re[l].abs() + other.im[l].abs())
    }

    #[inline(always)]
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self {
        Self {
            re: from_fn(|l| if mask[l] { a.re[l] } else { b.re[l] }),
            im: from_fn(|l| if mask[l] { a.im[l] } else { b.im[l] }),
        }
    }

    #[inline(always)]
    fn any(mask: Self::Mask) -> bool {
        mask.contains(&true)
    }
}
