//! The register types: one number type for each kind of register.

use super::functions::{self, DoubleRegister, Single};
#[cfg(target_arch = "aarch64")]
use super::neon::{neon_f32 as base_f32, neon_f64 as base_f64};
#[cfg(target_arch = "x86_64")]
use super::together::{Abreast, Wider, abreast, ends, of_eights, of_fours, results};
#[cfg(target_arch = "wasm32")]
use super::wasm::{wasm_f32 as base_f32, wasm_f64 as base_f64};
#[cfg(target_arch = "x86_64")]
use super::x86::{avx2_f32, avx2_f64, avx512_f32, avx512_f64, sse_f32 as base_f32, sse2_f64 as base_f64};
#[cfg(target_arch = "x86_64")]
use super::{Level, functions::Elementary, level, may_be_available};
use crate::scalar::{Field, Lanes, Packed, Piece, Rows, Scalar, Sealed, as_it_is, field::power};
use bytemuck::Zeroable;
use core::fmt::{self, Debug, Formatter};
use core::ops::{Add, Div, Mul, Neg, Sub};

#[macro_use]
mod parts;

/// Joins two halves, within a function for AVX-512.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub(super) fn join_halves(a: F64x4<4>, b: F64x4<4>) -> F64x8<8> {
    F64x8(avx512_f64::join(a.0, b.0))
}

/// Splits a register into its halves.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub(super) fn split_halves(joined: F64x8<8>) -> [F64x4<4>; 2] {
    avx512_f64::halves(joined.0).map(F64x4)
}

/// Defines a number type: its documentation, its name, the type of one lane, the module of its
/// instructions, the macro of its elementary functions, and that of its demoted numbers.
macro_rules! register {
    ($(#[$attribute:meta])* $name:ident, $element:ident, $ops:ident, $functions:ident, $demote:ident) => {
        $(#[$attribute])*
        #[derive(Clone, Copy)]
        #[repr(transparent)]
        pub struct $name<const N: usize>($ops::Register);

        // SAFETY: a register consists of numbers, and zero bits are zeros.
        #[allow(unsafe_code)]
        unsafe impl<const N: usize> Zeroable for $name<N> {}

        impl<const N: usize> $name<N> {
            /// The used lanes, one bit each.
            // Types with more numbers than the register holds are named in unreachable code.
            const USED: u32 = if N >= 1 && N <= $ops::WIDTH { ((1u64 << N) - 1) as u32 } else { 0 };

            /// A register with the number in every lane.
            #[inline(always)]
            pub fn splat(value: $element) -> Self {
                Self($ops::splat(value))
            }
            /// The numbers of the used lanes.
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
            // Zero bits, which the compiler recognises even without the register's instructions.
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
            // Bitwise equal to `powi` of `f64`.
            #[inline(always)]
            fn powi(self, n: i32) -> Self {
                power(self, n)
            }
            #[inline(always)]
            fn look_up<R: Rows<K, C>, const K: usize, const C: usize>(a: [Self; K], rows: R) -> [Self; C] {
                let (mut at, mut columns) = ([[0.0; N]; K], [[0.0; N]; C]);
                for (at, a) in at.iter_mut().zip(a) {
                    a.store(at);
                }
                for lane in 0..N {
                    let mut own = [0.0; K];
                    for (own, at) in own.iter_mut().zip(&at) {
                        *own = at[lane];
                    }
                    for (column, number) in columns.iter_mut().zip(rows.row::<$element>(own)) {
                        column[lane] = number;
                    }
                }
                let mut found = Self::zeros::<C>();
                for (found, column) in found.iter_mut().zip(&columns) {
                    *found = Self::load(column);
                }
                found
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
            $demote!();

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

register! {
    /// Up to two `f64`, in a register of the baseline instruction set.
    F64x2, f64, base_f64, of_doubles, as_it_is
}
register! {
    /// Up to four `f32`, in a register of the baseline instruction set.
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
slices!(F64x4, f64, avx2_f64);
#[cfg(target_arch = "x86_64")]
slices!(F32x8, f32, avx2_f32);
#[cfg(target_arch = "x86_64")]
fours!(F64x8, f64, avx512_f64);
#[cfg(target_arch = "x86_64")]
fours!(F32x16, f32, avx512_f32);
#[cfg(target_arch = "x86_64")]
single!(F32x16, avx512_f32, F64x8);
