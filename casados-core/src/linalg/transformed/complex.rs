//! Vectors of complex numbers.

use crate::scalar::{Field, Known, Lanes};
use bytemuck::Zeroable;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// `⌊N/2⌋` complex numbers, and a real one if `N` is odd: the numbers of an elimination of several
/// systems with one pattern.
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
#[repr(transparent)] // Adjacent parts, so that they may be one register.
pub struct Complex<T, const N: usize> {
    /// Real parts, then imaginary parts, then the real number.
    pub parts: [T; N],
}

impl<T: Lanes, const N: usize> Complex<T, N> {
    /// Number of complex numbers.
    pub const PAIRS: usize = N / 2;

    /// Zeros.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { parts: [T::from_f64(0.0); N] }
    }

    /// The same real number in all places.
    #[inline(always)]
    pub fn real(value: T) -> Self {
        Self::zero().plus(value)
    }

    /// `z + a` with a real number `a`.
    #[inline(always)]
    pub fn plus(mut self, a: T) -> Self {
        for l in 0..Self::PAIRS {
            self.parts[l] = self.parts[l] + a;
        }
        if const { N % 2 == 1 } {
            self.parts[N - 1] = self.parts[N - 1] + a;
        }
        self
    }

    /// `a z` with a real number `a`.
    #[inline(always)]
    pub fn scaled(mut self, a: T) -> Self {
        for part in &mut self.parts {
            *part = a * *part;
        }
        self
    }

    /// Returns the real and the imaginary part of number `l`.
    #[inline(always)]
    pub fn get(&self, l: usize) -> (T, T) {
        (self.parts[l], self.parts[Self::PAIRS + l])
    }

    /// Sets number `l`.
    #[inline(always)]
    pub fn set(&mut self, l: usize, (re, im): (T, T)) {
        (self.parts[l], self.parts[Self::PAIRS + l]) = (re, im);
    }

    /// Whether all parts are finite.
    #[inline(always)]
    pub fn is_finite(&self) -> bool {
        let mut finite = true;
        for part in self.parts {
            finite &= T::all(part.is_finite());
        }
        finite
    }
}

impl<T: Lanes, const N: usize> Add for Complex<T, N> {
    type Output = Self;
    #[inline(always)]
    fn add(mut self, other: Self) -> Self {
        for (part, other) in self.parts.iter_mut().zip(other.parts) {
            *part = *part + other;
        }
        self
    }
}

impl<T: Lanes, const N: usize> Sub for Complex<T, N> {
    type Output = Self;
    #[inline(always)]
    fn sub(mut self, other: Self) -> Self {
        for (part, other) in self.parts.iter_mut().zip(other.parts) {
            *part = *part - other;
        }
        self
    }
}

impl<T: Lanes, const N: usize> Mul for Complex<T, N> {
    type Output = Self;
    #[inline(always)]
    fn mul(mut self, other: Self) -> Self {
        for l in 0..Self::PAIRS {
            let ((a, b), (c, d)) = (self.get(l), other.get(l));
            self.set(l, (a * c - b * d, a * d + b * c));
        }
        if const { N % 2 == 1 } {
            self.parts[N - 1] = self.parts[N - 1] * other.parts[N - 1];
        }
        self
    }
}

impl<T: Lanes, const N: usize> Div for Complex<T, N> {
    type Output = Self;
    #[inline(always)]
    #[allow(clippy::suspicious_arithmetic_impl)] // The only definition of a quotient.
    fn div(self, other: Self) -> Self {
        self * other.reciprocal()
    }
}

impl<T: Lanes, const N: usize> Neg for Complex<T, N> {
    type Output = Self;
    #[inline(always)]
    fn neg(mut self) -> Self {
        for part in &mut self.parts {
            *part = -*part;
        }
        self
    }
}

impl<T: Lanes, const N: usize> Field for Complex<T, N> {
    /// One mask per part.
    type Mask = [T::Mask; N];

    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Self::real(T::from_f64(value))
    }

    /// Divides by the larger part first, so that squares do not overflow.
    #[inline(always)]
    fn reciprocal(mut self) -> Self {
        for l in 0..Self::PAIRS {
            let (re, im) = self.get(l);
            let scale = T::from_f64(1.0) / re.abs().max(im.abs());
            let (r, i) = (re * scale, im * scale);
            let square = T::from_f64(1.0) / (re * r + im * i);
            self.set(l, (r * square, -i * square));
        }
        if const { N % 2 == 1 } {
            self.parts[N - 1] = T::from_f64(1.0) / self.parts[N - 1];
        }
        self
    }

    #[inline(always)]
    fn subtract_product(mut self, a: Self, b: Self) -> Self {
        // Only kernels use numbers of this type, on machines with the instructions.
        T::subtract_complex(&mut self.parts, &a.parts, &b.parts, Known::<false>::assume_detected());
        self
    }

    #[inline(always)]
    fn subtract_columns<const S: usize, const WIDE: bool>(
        target: &mut [Self; S],
        block: &[[Self; S]; S],
        x: &[Self; S],
        known: Known<WIDE>,
    ) {
        for (column, x) in block.iter().zip(x) {
            for (target, element) in target.iter_mut().zip(column) {
                T::subtract_complex(&mut target.parts, &element.parts, &x.parts, known);
            }
        }
    }

    /// Compares `|re| + |im|`.
    #[inline(always)]
    fn is_smaller(self, other: Self) -> Self::Mask {
        let zero = T::from_f64(0.0);
        let mut mask = [T::lt(zero, zero); N];
        for l in 0..Self::PAIRS {
            let ((a, b), (c, d)) = (self.get(l), other.get(l));
            let smaller = T::lt(a.abs() + b.abs(), c.abs() + d.abs());
            (mask[l], mask[Self::PAIRS + l]) = (smaller, smaller);
        }
        if const { N % 2 == 1 } {
            mask[N - 1] = T::lt(self.parts[N - 1].abs(), other.parts[N - 1].abs());
        }
        mask
    }

    #[inline(always)]
    fn select(mask: Self::Mask, a: Self, mut b: Self) -> Self {
        for ((b, a), mask) in b.parts.iter_mut().zip(a.parts).zip(mask) {
            *b = T::select(mask, a, *b);
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
