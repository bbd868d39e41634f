//! Complex numbers, several side by side.

use crate::scalar::{Field, Lanes};
use bytemuck::Zeroable;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// `L` complex numbers side by side: what elimination computes with where it solves `L` systems of one pattern at once.
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
#[repr(C)] // Both parts beside each other, so that they may be one register.
pub struct Complex<T, const L: usize> {
    /// Real parts.
    pub re: [T; L],
    /// Imaginary parts.
    pub im: [T; L],
}

impl<T: Lanes, const L: usize> Complex<T, L> {
    /// So many of them are computed. Where a number is a register by itself nothing is gained by filling one: systems that repeat
    /// another, the second half of those of a tableau, are left out.
    pub(super) const USED: usize = if size_of::<T>() <= 8 { L } else { L.div_ceil(2) };

    /// `L` times zero.
    #[inline(always)]
    pub fn zero() -> Self {
        Self::real([T::from_f64(0.0); L])
    }

    /// Real numbers.
    #[inline(always)]
    pub fn real(re: [T; L]) -> Self {
        Self { re, im: [T::from_f64(0.0); L] }
    }

    /// `a z` with a real number `a`.
    #[inline(always)]
    pub fn scaled(self, a: T) -> Self {
        let Self { mut re, mut im } = self;
        for l in 0..Self::USED {
            (re[l], im[l]) = (a * re[l], a * im[l]);
        }
        Self { re, im }
    }

    /// `self − a b`, fused.
    #[inline(always)]
    fn subtract<const WIDE: bool>(&mut self, a: &Self, b: &Self) {
        if const { Self::USED == L } {
            T::subtract_complex::<L, WIDE>([&mut self.re, &mut self.im], [&a.re, &a.im], [&b.re, &b.im]);
            return;
        }
        let Self { re, im } = self;
        for l in 0..Self::USED {
            re[l] = re[l].subtract_product(a.re[l], b.re[l]).subtract_product(-a.im[l], b.im[l]);
            im[l] = im[l].subtract_product(a.re[l], b.im[l]).subtract_product(a.im[l], b.re[l]);
        }
    }

    /// Whether all parts are neither infinite nor NaN.
    #[inline(always)]
    pub fn is_finite(&self) -> bool {
        let mut finite = true;
        for part in self.re.iter().take(Self::USED).chain(self.im.iter().take(Self::USED)) {
            finite &= T::all(part.is_finite());
        }
        finite
    }
}

impl<T: Lanes, const L: usize> Add for Complex<T, L> {
    type Output = Self;
    #[inline(always)]
    fn add(mut self, other: Self) -> Self {
        for l in 0..Self::USED {
            (self.re[l], self.im[l]) = (self.re[l] + other.re[l], self.im[l] + other.im[l]);
        }
        self
    }
}

impl<T: Lanes, const L: usize> Sub for Complex<T, L> {
    type Output = Self;
    #[inline(always)]
    fn sub(mut self, other: Self) -> Self {
        for l in 0..Self::USED {
            (self.re[l], self.im[l]) = (self.re[l] - other.re[l], self.im[l] - other.im[l]);
        }
        self
    }
}

impl<T: Lanes, const L: usize> Mul for Complex<T, L> {
    type Output = Self;
    #[inline(always)]
    fn mul(mut self, other: Self) -> Self {
        for l in 0..Self::USED {
            let re = self.re[l] * other.re[l] - self.im[l] * other.im[l];
            (self.re[l], self.im[l]) = (re, self.re[l] * other.im[l] + self.im[l] * other.re[l]);
        }
        self
    }
}

impl<T: Lanes, const L: usize> Div for Complex<T, L> {
    type Output = Self;
    #[inline(always)]
    #[allow(clippy::suspicious_arithmetic_impl)] // There is no other quotient.
    fn div(self, other: Self) -> Self {
        self * other.reciprocal()
    }
}

impl<T: Lanes, const L: usize> Neg for Complex<T, L> {
    type Output = Self;
    #[inline(always)]
    fn neg(mut self) -> Self {
        for l in 0..Self::USED {
            (self.re[l], self.im[l]) = (-self.re[l], -self.im[l]);
        }
        self
    }
}

impl<T: Lanes, const L: usize> Field for Complex<T, L> {
    type Mask = [T::Mask; L];

    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Self::real([T::from_f64(value); L])
    }

    /// Divided by its larger part first, so that no square of a part overflows.
    #[inline(always)]
    fn reciprocal(self) -> Self {
        let (mut re, mut im) = (self.re, self.im);
        for l in 0..Self::USED {
            let size = self.re[l].abs().max(self.im[l].abs());
            let scale = T::from_f64(1.0) / size;
            let (r, i) = (self.re[l] * scale, self.im[l] * scale);
            let square = T::from_f64(1.0) / (self.re[l] * r + self.im[l] * i);
            (re[l], im[l]) = (r * square, -i * square);
        }
        Self { re, im }
    }

    #[inline(always)]
    fn subtract_product(mut self, a: Self, b: Self) -> Self {
        self.subtract::<false>(&a, &b);
        self
    }

    #[inline(always)]
    fn subtract_columns<const S: usize, const WIDE: bool>(
        target: &mut [Self; S],
        block: &[[Self; S]; S],
        x: &[Self; S],
    ) {
        for (column, x) in block.iter().zip(x) {
            for (target, element) in target.iter_mut().zip(column) {
                target.subtract::<WIDE>(element, x);
            }
        }
    }

    /// By `|re| + |im|`.
    #[inline(always)]
    fn is_smaller(self, other: Self) -> Self::Mask {
        let zero = T::from_f64(0.0);
        let mut mask = [T::lt(zero, zero); L];
        for (l, mask) in mask.iter_mut().enumerate().take(Self::USED) {
            *mask = T::lt(self.re[l].abs() + self.im[l].abs(), other.re[l].abs() + other.im[l].abs());
        }
        mask
    }

    #[inline(always)]
    fn select(mask: Self::Mask, a: Self, mut b: Self) -> Self {
        for (l, &mask) in mask.iter().enumerate().take(Self::USED) {
            (b.re[l], b.im[l]) = (T::select(mask, a.re[l], b.re[l]), T::select(mask, a.im[l], b.im[l]));
        }
        b
    }

    #[inline(always)]
    fn any(mask: Self::Mask) -> bool {
        let mut any = false;
        for mask in mask {
            any |= T::any(mask);
        }
        any
    }
}
