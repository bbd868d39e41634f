//! Elementary functions of registers, written once for all kinds of them.

use crate::scalar::{Lanes, Scalar};
use bytemuck::Zeroable;

/// A register of doubles, with what elementary functions do to the bits of it. Bit patterns are written as
/// doubles.
pub trait Double: Lanes {
    /// Whether [`mul_add`](Self::mul_add) rounds once.
    const FUSED: bool;

    /// `self b + c`, in one instruction if there is one, else rounded twice.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// bitwise and
    fn and_bits(self, other: Self) -> Self;
    /// bitwise or
    fn or_bits(self, other: Self) -> Self;
    /// bitwise exclusive or
    fn xor_bits(self, other: Self) -> Self;
    /// The sum of both as 64-bit integers.
    fn add_bits(self, other: Self) -> Self;
    /// The difference of both as 64-bit integers.
    fn sub_bits(self, other: Self) -> Self;
    /// The 12 lowest bits moved to the top.
    fn shift_left_52(self) -> Self;
    /// The 12 highest bits moved to the bottom.
    fn shift_right_52(self) -> Self;
    /// The lanes of a mask, one bit each.
    fn bits_of(mask: Self::Mask) -> u32;
}

/// A register of `f32`, whose functions are computed in two registers of doubles.
pub trait Single: Lanes {
    /// The register of doubles.
    type Double: Double;
    /// The lower and the upper half.
    fn widen(self) -> [Self::Double; 2];
    /// The number that has these halves, rounded.
    fn narrow(low: Self::Double, high: Self::Double) -> Self;
}

/// Replaces the lanes of `result` that are rare by what the function of one number gives.
#[inline(always)]
fn repair<D: Double>(rare: D::Mask, a: D, result: &mut D, f: fn(f64) -> f64) {
    if D::bits_of(rare) != 0 {
        each(rare, a, a, result, f, |f, a, _| f(a));
    }
}

/// The same for a function of two numbers.
#[inline(always)]
fn repair2<D: Double>(rare: D::Mask, a: D, b: D, result: &mut D, f: fn(f64, f64) -> f64) {
    if D::bits_of(rare) != 0 {
        each(rare, a, b, result, f, |f, a, b| f(a, b));
    }
}

#[cold]
fn each<D: Double, F: Copy>(rare: D::Mask, a: D, b: D, result: &mut D, f: F, apply: fn(F, f64, f64) -> f64) {
    let lanes = D::bits_of(rare);
    let (mut left, mut right, mut values) = (D::Cell::zeroed(), D::Cell::zeroed(), D::Cell::zeroed());
    a.store(&mut left);
    b.store(&mut right);
    result.store(&mut values);
    for lane in 0..D::LANES {
        if lanes >> lane & 1 == 1 {
            D::set_lane(&mut values, lane, apply(f, D::lane(&left, lane), D::lane(&right, lane)));
        }
    }
    *result = D::load(&values);
}

macro_rules! by_lane {
    ($($unary:ident)*; $($binary:ident)*) => {
        $(
            #[inline(always)]
            pub fn $unary<D: Double>(a: D) -> D {
                let mut result = a;
                repair(a.eq(a), a, &mut result, <f64 as Scalar>::$unary);
                result
            }
        )*
        $(
            #[inline(always)]
            pub fn $binary<D: Double>((a, b): (D, D)) -> D {
                let mut result = a;
                let all = a.eq(a);
                repair2(D::or(all, D::not(all)), a, b, &mut result, <f64 as Scalar>::$binary);
                result
            }
        )*
    };
}

/// Functions of registers of doubles.
pub mod doubles {
    use super::*;
    by_lane!(cbrt exp exp2 exp_m1 ln ln_1p log2 log10 sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh;
        atan2 hypot powf);

    #[inline(always)]
    pub fn sin_cos<D: Double>(a: D) -> (D, D) {
        (sin(a), cos(a))
    }
}

/// Functions of registers of `f32`: those of doubles, rounded.
pub mod singles {
    use super::{Single, doubles};

    macro_rules! rounded {
        ($($unary:ident)*; $($binary:ident)*) => {
            $(
                #[inline(always)]
                pub fn $unary<S: Single>(a: S) -> S {
                    let [low, high] = a.widen();
                    S::narrow(doubles::$unary(low), doubles::$unary(high))
                }
            )*
            $(
                #[inline(always)]
                pub fn $binary<S: Single>((a, b): (S, S)) -> S {
                    let ([a_low, a_high], [b_low, b_high]) = (a.widen(), b.widen());
                    S::narrow(doubles::$binary((a_low, b_low)), doubles::$binary((a_high, b_high)))
                }
            )*
        };
    }
    rounded!(cbrt exp exp2 exp_m1 ln ln_1p log2 log10 sin cos tan asin acos atan sinh cosh tanh asinh acosh
        atanh; atan2 hypot powf);

    #[inline(always)]
    pub fn sin_cos<S: Single>(a: S) -> (S, S) {
        let [low, high] = a.widen();
        let ((sin_low, cos_low), (sin_high, cos_high)) = (doubles::sin_cos(low), doubles::sin_cos(high));
        (S::narrow(sin_low, sin_high), S::narrow(cos_low, cos_high))
    }
}
