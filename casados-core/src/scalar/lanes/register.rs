//! The types: one number type over each kind of register.

use super::functions::{self, Doubles, Single};
#[cfg(target_arch = "aarch64")]
use super::neon::{neon_f32 as base_f32, neon_f64 as base_f64};
#[cfg(target_arch = "x86_64")]
use super::together::{Abreast, Wider, abreast, ends, of_eights, of_fours, results};
#[cfg(target_arch = "x86_64")]
use super::x86::{avx2_f32, avx2_f64, avx512_f32, avx512_f64, sse_f32 as base_f32, sse2_f64 as base_f64};
#[cfg(target_arch = "x86_64")]
use super::{Level, functions::Elementary, level};
use crate::scalar::{Field, Lanes, Packed, Piece, Scalar, Sealed, as_it_is};
use bytemuck::Zeroable;
use core::fmt::{self, Debug, Formatter};
use core::ops::{Add, Div, Mul, Neg, Sub};

macro_rules! operators {
    ($name:ident, $ops:ident: $($trait:ident $method:ident $function:ident),*) => { $(
        impl<const N: usize> $trait for $name<N> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self($ops::$function(self.0, other.0))
            }
        }
    )* };
}

/// A register with all its lanes, for functions that are the same whatever part of it is used.
macro_rules! whole {
    ($name:ident, $ops:ident, $a:expr) => {
        $name::<{ $ops::WIDTH }>($a.0)
    };
}

/// The elementary functions of doubles.
macro_rules! of_doubles {
    ($name:ident, $ops:ident: $($unary:ident)*; $($binary:ident)*) => {
        $(
            #[inline(always)]
            fn $unary(self) -> Self {
                Self($ops::enter::<functions::$unary, _>(whole!($name, $ops, self)).0)
            }
        )*
        $(
            #[inline(always)]
            fn $binary(self, other: Self) -> Self {
                let arguments = (whole!($name, $ops, self), whole!($name, $ops, other));
                Self($ops::enter::<functions::$binary, _>(arguments).0)
            }
        )*
        #[inline(always)]
        fn over(self, c: f64, [high, low]: [f64; 2]) -> Self {
            if const { !$ops::FUSED } {
                return self / Self::splat(c);
            }
            let low = $ops::mul(self.0, $ops::splat(low));
            Self($ops::mul_add(self.0, $ops::splat(high), low))
        }
        #[inline(always)]
        fn sin_cos(self) -> (Self, Self) {
            let (sin, cos) = $ops::enter::<functions::sin_cos, _>(whole!($name, $ops, self));
            (Self(sin.0), Self(cos.0))
        }
    };
}

/// Both in one register, inside of a function for AVX-512.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub(super) fn join(a: F64x4<4>, b: F64x4<4>) -> F64x8<8> {
    F64x8(avx512_f64::join(a.0, b.0))
}

/// Both halves.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub(super) fn apart(joined: F64x8<8>) -> [F64x4<4>; 2] {
    avx512_f64::halves(joined.0).map(F64x4)
}

/// The elementary functions of `f32`: those of doubles, rounded.
macro_rules! of_singles {
    ($name:ident, $ops:ident: $($unary:ident)*; $($binary:ident)*) => {
        $(
            #[inline(always)]
            fn $unary(self) -> Self {
                let [low, high] = whole!($name, $ops, self).widen();
                Self($name::narrow(Scalar::$unary(low), Scalar::$unary(high)).0)
            }
        )*
        $(
            #[inline(always)]
            fn $binary(self, other: Self) -> Self {
                let [low, high] = whole!($name, $ops, self).widen();
                let [other_low, other_high] = whole!($name, $ops, other).widen();
                let low = Scalar::$binary(low, other_low);
                Self($name::narrow(low, Scalar::$binary(high, other_high)).0)
            }
        )*
        #[inline(always)]
        fn sin_cos(self) -> (Self, Self) {
            let [low, high] = whole!($name, $ops, self).widen();
            let ((sin_low, cos_low), (sin_high, cos_high)) = (low.sin_cos(), high.sin_cos());
            (Self($name::narrow(sin_low, sin_high).0), Self($name::narrow(cos_low, cos_high).0))
        }
    };
}

/// Eight `f64`, whose coarse numbers take half a register.
#[cfg(target_arch = "x86_64")]
macro_rules! in_half_a_register {
    () => {
        type Coarse = F32x8<N>;
        #[inline(always)]
        fn coarse(self) -> F32x8<N> {
            F32x8(avx512_f64::coarse(self.0))
        }
        #[inline(always)]
        fn fine(coarse: F32x8<N>) -> Self {
            Self(avx512_f64::fine(coarse.0))
        }
    };
}

/// A type of numbers: its documentation, its name, the type of one lane, the module of its
/// instructions, the macro of its elementary functions, and that of its coarse numbers.
macro_rules! register {
    ($(#[$attribute:meta])* $name:ident, $element:ident, $ops:ident, $functions:ident, $coarse:ident) => {
        $(#[$attribute])*
        #[derive(Clone, Copy)]
        #[repr(transparent)]
        pub struct $name<const N: usize>($ops::Register);

        // SAFETY: a register is numbers and nothing else, all of them zero if its bits are.
        #[allow(unsafe_code)]
        unsafe impl<const N: usize> Zeroable for $name<N> {}

        impl<const N: usize> $name<N> {
            /// The lanes that are used, one bit each.
            // Types with more numbers than the register holds are named in code that is never
            // reached.
            const USED: u32 = if N >= 1 && N <= $ops::WIDTH { ((1u64 << N) - 1) as u32 } else { 0 };

            /// A number in every lane.
            #[inline(always)]
            pub fn splat(value: $element) -> Self {
                Self($ops::splat(value))
            }
            /// The numbers of the lanes that are used.
            #[inline(always)]
            pub fn to_array(self) -> [$element; N] {
                let mut array = [0.0; N];
                Scalar::store(self, &mut array);
                array
            }
        }

        impl<const N: usize> Debug for $name<N> {
            fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
                self.to_array().fmt(f)
            }
        }

        impl<const N: usize> PartialEq for $name<N> {
            fn eq(&self, other: &Self) -> bool {
                Self::all(Scalar::eq(*self, *other))
            }
        }

        operators!($name, $ops: Add add add, Sub sub sub, Mul mul mul, Div div div);

        impl<const N: usize> Neg for $name<N> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self($ops::xor(self.0, $ops::splat(-0.0)))
            }
        }

        impl<const N: usize> Field for $name<N> {
            type Mask = $ops::Mask;

            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                Self::splat(value as $element)
            }
            #[inline(always)]
            fn subtract_product(self, a: Self, b: Self) -> Self {
                Self($ops::subtract_product(self.0, a.0, b.0))
            }
            #[inline(always)]
            fn is_smaller(self, other: Self) -> Self::Mask {
                Scalar::lt(Scalar::abs(self), Scalar::abs(other))
            }
            #[inline(always)]
            fn select(mask: Self::Mask, a: Self, b: Self) -> Self {
                Self($ops::select(mask, a.0, b.0))
            }
            #[inline(always)]
            fn any(mask: Self::Mask) -> bool {
                $ops::bits(mask) & Self::USED != 0
            }
        }

        impl<const N: usize> Scalar for $name<N> {
            type Cell = [$element; N];

            #[inline(always)]
            fn load(cell: &Self::Cell) -> Self {
                Self($ops::load(cell))
            }
            #[inline(always)]
            fn store(self, cell: &mut Self::Cell) {
                $ops::store(self.0, cell);
            }
            #[inline(always)]
            fn vectorize<P: Piece>(piece: P) {
                $ops::enter::<functions::Run, _>(piece);
            }
            // All bits are zero, which the compiler sees where it may not use the register.
            #[inline(always)]
            fn zeros<const LENGTH: usize>() -> [Self; LENGTH] {
                [Zeroable::zeroed(); LENGTH]
            }

            #[inline(always)]
            fn sqrt(self) -> Self {
                Self($ops::sqrt(self.0))
            }
            #[inline(always)]
            fn abs(self) -> Self {
                Self($ops::and(self.0, $ops::splat($element::from_bits(!(-0.0 as $element).to_bits()))))
            }
            #[inline(always)]
            fn signum(self) -> Self {
                let sign = $ops::and(self.0, $ops::splat(-0.0));
                Self($ops::select($ops::eq(self.0, self.0), $ops::or(sign, $ops::splat(1.0)), self.0))
            }
            // As `f64` does it: square and multiply, and of a negative exponent the reciprocal.
            #[inline(always)]
            fn powi(self, n: i32) -> Self {
                let (mut base, mut left) = (self, n.unsigned_abs());
                let mut power = if left & 1 == 1 { base } else { Self::splat(1.0) };
                left >>= 1;
                while left > 0 {
                    base = base * base;
                    if left & 1 == 1 {
                        power = power * base;
                    }
                    left >>= 1;
                }
                if n < 0 { Self::splat(1.0) / power } else { power }
            }
            $functions!($name, $ops: cbrt exp exp2 exp_m1 ln ln_1p log2 log10 sin cos tan asin acos atan sinh
                cosh tanh asinh acosh atanh; atan2 hypot powf);

            #[inline(always)]
            fn lt(self, other: Self) -> Self::Mask {
                $ops::lt(self.0, other.0)
            }
            #[inline(always)]
            fn le(self, other: Self) -> Self::Mask {
                $ops::le(self.0, other.0)
            }
            #[inline(always)]
            fn eq(self, other: Self) -> Self::Mask {
                $ops::eq(self.0, other.0)
            }
            #[inline(always)]
            fn and(a: Self::Mask, b: Self::Mask) -> Self::Mask {
                $ops::mask_and(a, b)
            }
            #[inline(always)]
            fn or(a: Self::Mask, b: Self::Mask) -> Self::Mask {
                $ops::mask_or(a, b)
            }
            #[inline(always)]
            fn not(a: Self::Mask) -> Self::Mask {
                $ops::mask_not(a)
            }
        }

        impl Packed<$element> for $name<{ $ops::WIDTH }> {
            #[inline(always)]
            fn cells(numbers: &[$element]) -> &[Self::Cell] {
                numbers.as_chunks().0
            }
            #[inline(always)]
            fn cells_mut(numbers: &mut [$element]) -> &mut [Self::Cell] {
                numbers.as_chunks_mut().0
            }
            #[inline(always)]
            fn minus_product(self, a: Self, b: Self) -> Self {
                self.subtract_product(a, b)
            }
            #[inline(always)]
            fn total(self) -> $element {
                $ops::total(self.0)
            }
            #[inline(always)]
            fn largest(self) -> $element {
                $ops::largest(self.0)
            }
        }

        impl<const N: usize> Sealed for $name<N> {}

        impl<const N: usize> Lanes for $name<N> {
            const LANES: usize = N;
            const EPSILON: f64 = <$element as Lanes>::EPSILON;
            const STAGNATION: f64 = <$element as Lanes>::STAGNATION;
            const SMALLEST: f64 = <$element as Lanes>::SMALLEST;
            $coarse!();

            #[inline(always)]
            fn lane(cell: &Self::Cell, lane: usize) -> f64 {
                cell[lane] as f64
            }
            #[inline(always)]
            fn set_lane(cell: &mut Self::Cell, lane: usize, value: f64) {
                cell[lane] = value as $element;
            }
            #[inline(always)]
            fn is_finite(self) -> Self::Mask {
                $ops::lt(Scalar::abs(self).0, $ops::splat($element::INFINITY))
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                Self($ops::max(self.0, other.0))
            }
            #[inline(always)]
            fn all(mask: Self::Mask) -> bool {
                $ops::bits(mask) & Self::USED == Self::USED
            }
            #[inline(always)]
            fn transpose(from: &[Self], to: &mut [Self::Cell]) {
                let mut rows = [$ops::splat(0.0); $ops::WIDTH];
                for (row, from) in rows.iter_mut().zip(from) {
                    *row = from.0;
                }
                for (to, column) in to.iter_mut().zip($ops::transpose(rows)) {
                    $ops::store(column, to);
                }
            }
        }
    };
}

macro_rules! double {
    ($name:ident, $ops:ident) => {
        impl Doubles for $name<{ $ops::WIDTH }> {
            const FUSED: bool = $ops::FUSED;

            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                Self($ops::mul_add(self.0, b.0, c.0))
            }
            #[inline(always)]
            fn and_bits(self, other: Self) -> Self {
                Self($ops::and(self.0, other.0))
            }
            #[inline(always)]
            fn or_bits(self, other: Self) -> Self {
                Self($ops::or(self.0, other.0))
            }
            #[inline(always)]
            fn xor_bits(self, other: Self) -> Self {
                Self($ops::xor(self.0, other.0))
            }
            #[inline(always)]
            fn add_bits(self, other: Self) -> Self {
                Self($ops::add_bits(self.0, other.0))
            }
            #[inline(always)]
            fn sub_bits(self, other: Self) -> Self {
                Self($ops::sub_bits(self.0, other.0))
            }
            #[inline(always)]
            fn shift_left<const BITS: i32>(self) -> Self {
                Self($ops::shift_left::<BITS>(self.0))
            }
            #[inline(always)]
            fn shift_right<const BITS: i32>(self) -> Self {
                Self($ops::shift_right::<BITS>(self.0))
            }
            #[inline(always)]
            fn bits_of(mask: Self::Mask) -> u32 {
                $ops::bits(mask)
            }
        }
    };
}

macro_rules! single {
    ($name:ident, $ops:ident, $double:ident) => {
        impl Single for $name<{ $ops::WIDTH }> {
            type Double = $double<{ $ops::doubles::WIDTH }>;

            #[inline(always)]
            fn widen(self) -> [Self::Double; 2] {
                $ops::widen(self.0).map($double)
            }
            #[inline(always)]
            fn narrow(low: Self::Double, high: Self::Double) -> Self {
                Self($ops::narrow([low.0, high.0]))
            }
        }
    };
}

/// Complex numbers, real parts in the lower half of a register and imaginary ones in the upper.
#[cfg(target_arch = "x86_64")]
macro_rules! complex {
    ($name:ident, $element:ident, $ops:ident) => {
        impl $name<{ $ops::WIDTH }> {
            /// `target − a b` of the numbers at the beginning of arrays, half as many as the
            /// register has elements.
            #[inline(always)]
            pub fn subtract_complex<const N: usize>(
                target: &mut [$element; N],
                a: &[$element; N],
                b: &[$element; N],
            ) {
                let (Some(target), Some(a), Some(b)) =
                    (target.first_chunk_mut(), a.first_chunk(), b.first_chunk())
                else {
                    return;
                };
                let numbers = Self::load(b);
                // `i b`: what several products have in common is made once.
                let turned = Self($ops::xor($ops::swap_halves(numbers.0), $ops::signs_below()));
                let difference = Self::load(target).subtract_product(Self::twice(a, 0), numbers);
                difference.subtract_product(Self::twice(a, $ops::WIDTH / 2), turned).store(target);
            }
            /// `target − a b`, element by element, as far as all go.
            #[inline(always)]
            pub fn subtract_each(target: &mut [$element], a: &[$element], b: &[$element]) {
                let length = target.len().min(a.len()).min(b.len());
                let (target, target_rest) = target[..length].as_chunks_mut();
                let ((a, a_rest), (b, b_rest)) = (a[..length].as_chunks(), b[..length].as_chunks());
                for ((target, a), b) in target.iter_mut().zip(a).zip(b) {
                    Self::load(target).subtract_product(Self::load(a), Self::load(b)).store(target);
                }
                for ((target, &a), &b) in target_rest.iter_mut().zip(a_rest).zip(b_rest) {
                    *target = target.subtract_product(a, b);
                }
            }
            /// Half of the elements, in both halves.
            #[inline(always)]
            fn twice(elements: &[$element; $ops::WIDTH], begin: usize) -> Self {
                let mut all = [0.0; $ops::WIDTH];
                let half = &elements[begin..begin + $ops::WIDTH / 2];
                let (low, high) = all.split_at_mut($ops::WIDTH / 2);
                low.copy_from_slice(half);
                high.copy_from_slice(half);
                Self::load(&all)
            }
        }
    };
}

/// What blocks of four stages are multiplied with.
#[cfg(target_arch = "x86_64")]
macro_rules! fours {
    ($name:ident, $element:ident, $ops:ident) => {
        impl $name<{ $ops::WIDTH }> {
            /// The same four numbers again and again.
            #[inline(always)]
            pub fn repeat_four(numbers: &[$element; 4]) -> Self {
                Self($ops::repeat_four(numbers))
            }
            /// Of each four numbers the first in all four places, the second, the third, the
            /// fourth.
            #[inline(always)]
            pub fn each_of_four(self) -> [Self; 4] {
                let [a, b, c, d] = $ops::each_of_four(self.0);
                [Self(a), Self(b), Self(c), Self(d)]
            }
        }
    };
}

register! {
    /// Up to two `f64`, in a register that every machine of the kind has.
    F64x2, f64, base_f64, of_doubles, as_it_is
}
register! {
    /// Up to four `f32`, in a register that every machine of the kind has.
    F32x4, f32, base_f32, of_singles, as_it_is
}
double!(F64x2, base_f64);
single!(F32x4, base_f32, F64x2);

#[cfg(target_arch = "x86_64")]
register! {
    /// Up to four `f64`, AVX2 and FMA.
    F64x4, f64, avx2_f64, of_fours, as_it_is
}
#[cfg(target_arch = "x86_64")]
register! {
    /// Up to eight `f32`, AVX2 and FMA.
    F32x8, f32, avx2_f32, of_singles, as_it_is
}
#[cfg(target_arch = "x86_64")]
double!(F64x4, avx2_f64);
#[cfg(target_arch = "x86_64")]
single!(F32x8, avx2_f32, F64x4);

#[cfg(target_arch = "x86_64")]
register! {
    /// Up to eight `f64`, AVX-512.
    F64x8, f64, avx512_f64, of_eights, in_half_a_register
}
#[cfg(target_arch = "x86_64")]
register! {
    /// Up to sixteen `f32`, AVX-512.
    F32x16, f32, avx512_f32, of_singles, as_it_is
}
#[cfg(target_arch = "x86_64")]
double!(F64x8, avx512_f64);
#[cfg(target_arch = "x86_64")]
complex!(F64x4, f64, avx2_f64);
#[cfg(target_arch = "x86_64")]
complex!(F64x8, f64, avx512_f64);
#[cfg(target_arch = "x86_64")]
complex!(F32x8, f32, avx2_f32);
#[cfg(target_arch = "x86_64")]
complex!(F32x16, f32, avx512_f32);
#[cfg(target_arch = "x86_64")]
fours!(F64x8, f64, avx512_f64);
#[cfg(target_arch = "x86_64")]
fours!(F32x16, f32, avx512_f32);
#[cfg(target_arch = "x86_64")]
single!(F32x16, avx512_f32, F64x8);
