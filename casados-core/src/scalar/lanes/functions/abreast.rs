//! The operands of elementary functions: a register of doubles, or two interleaved ones.
//!
//! Nearly every operation of an elementary function depends on the one before. With two registers,
//! or two times two, each operation is applied to both before the next, so that the processor is
//! not idle. For separate functions the independent instructions would lie beyond its look-ahead.

use super::{DoubleRegister, each};
use crate::scalar::{Field, Lanes, Scalar};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// Two interleaved numbers.
#[derive(Clone, Copy)]
pub struct Two<D>(pub D, pub D);

macro_rules! operators {
    ($($trait:ident $method:ident)*) => { $(
        impl<D: Double> $trait for Two<D> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0), self.1.$method(other.1))
            }
        }
    )* };
}
operators!(Add add Sub sub Mul mul Div div);

impl<D: Double> Neg for Two<D> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}

/// Defines the trait of these operands, with its implementations for one register and for two.
macro_rules! operations {
    (
        unary { $($(#[$of_unary:meta])* $unary:ident = $by_unary:ident;)* }
        binary { $($(#[$of_binary:meta])* $binary:ident = $by_binary:ident;)* }
        ternary { $($(#[$of_ternary:meta])* $ternary:ident = $by_ternary:ident;)* }
        shift { $($(#[$of_shift:meta])* $shift:ident;)* }
        compare { $($(#[$of_compare:meta])* $compare:ident;)* }
        combine { $($(#[$of_combine:meta])* $combine:ident;)* }
    ) => {
        /// A number, or several interleaved ones. Bit patterns are written as doubles.
        pub trait Double:
            Copy
            + Add<Output = Self>
            + Sub<Output = Self>
            + Mul<Output = Self>
            + Div<Output = Self>
            + Neg<Output = Self>
        {
            /// The result of a comparison.
            type Mask: Copy;
            /// Whether [`mul_add`](Self::mul_add) rounds once.
            const FUSED: bool;

            /// A constant.
            fn from_f64(value: f64) -> Self;
            $($(#[$of_unary])* fn $unary(self) -> Self;)*
            $($(#[$of_binary])* fn $binary(self, other: Self) -> Self;)*
            $($(#[$of_ternary])* fn $ternary(self, a: Self, b: Self) -> Self;)*
            $($(#[$of_shift])* fn $shift<const BITS: i32>(self) -> Self;)*
            $($(#[$of_compare])* fn $compare(self, other: Self) -> Self::Mask;)*
            $($(#[$of_combine])* fn $combine(a: Self::Mask, b: Self::Mask) -> Self::Mask;)*
            /// Whether the number is neither infinite nor NaN.
            fn is_finite(self) -> Self::Mask;
            /// not
            fn not(mask: Self::Mask) -> Self::Mask;
            /// `if mask { a } else { b }`
            fn select(mask: Self::Mask, a: Self, b: Self) -> Self;
            /// Replaces rare lanes of `result` by the value of a function of one or two numbers.
            fn replace<F: Copy>(
                rare: Self::Mask,
                arguments: [Self; 2],
                result: &mut Self,
                f: F,
                apply: fn(F, f64, f64) -> f64,
            );
        }

        impl<D: DoubleRegister> Double for D {
            type Mask = <D as Field>::Mask;
            const FUSED: bool = <D as DoubleRegister>::FUSED;

            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                <D as Field>::from_f64(value)
            }
            $(
                #[inline(always)]
                fn $unary(self) -> Self {
                    <D as $by_unary>::$unary(self)
                }
            )*
            $(
                #[inline(always)]
                fn $binary(self, other: Self) -> Self {
                    <D as $by_binary>::$binary(self, other)
                }
            )*
            $(
                #[inline(always)]
                fn $ternary(self, a: Self, b: Self) -> Self {
                    <D as $by_ternary>::$ternary(self, a, b)
                }
            )*
            $(
                #[inline(always)]
                fn $shift<const BITS: i32>(self) -> Self {
                    <D as DoubleRegister>::$shift::<BITS>(self)
                }
            )*
            $(
                #[inline(always)]
                fn $compare(self, other: Self) -> Self::Mask {
                    <D as Scalar>::$compare(self, other)
                }
            )*
            $(
                #[inline(always)]
                fn $combine(a: Self::Mask, b: Self::Mask) -> Self::Mask {
                    <D as Scalar>::$combine(a, b)
                }
            )*
            #[inline(always)]
            fn is_finite(self) -> Self::Mask {
                <D as Lanes>::is_finite(self)
            }
            #[inline(always)]
            fn not(mask: Self::Mask) -> Self::Mask {
                <D as Scalar>::not(mask)
            }
            #[inline(always)]
            fn select(mask: Self::Mask, a: Self, b: Self) -> Self {
                <D as Field>::select(mask, a, b)
            }
            #[inline(always)]
            fn replace<F: Copy>(
                rare: Self::Mask,
                arguments: [Self; 2],
                result: &mut Self,
                f: F,
                apply: fn(F, f64, f64) -> f64,
            ) {
                if D::bits_of(rare) != 0 {
                    each(rare, arguments, result, f, apply);
                }
            }
        }

        impl<D: Double> Double for Two<D> {
            type Mask = Two<D::Mask>;
            const FUSED: bool = D::FUSED;

            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                Self(D::from_f64(value), D::from_f64(value))
            }
            $(
                #[inline(always)]
                fn $unary(self) -> Self {
                    Self(self.0.$unary(), self.1.$unary())
                }
            )*
            $(
                #[inline(always)]
                fn $binary(self, other: Self) -> Self {
                    Self(self.0.$binary(other.0), self.1.$binary(other.1))
                }
            )*
            $(
                #[inline(always)]
                fn $ternary(self, a: Self, b: Self) -> Self {
                    Self(self.0.$ternary(a.0, b.0), self.1.$ternary(a.1, b.1))
                }
            )*
            $(
                #[inline(always)]
                fn $shift<const BITS: i32>(self) -> Self {
                    Self(self.0.$shift::<BITS>(), self.1.$shift::<BITS>())
                }
            )*
            $(
                #[inline(always)]
                fn $compare(self, other: Self) -> Self::Mask {
                    Two(self.0.$compare(other.0), self.1.$compare(other.1))
                }
            )*
            $(
                #[inline(always)]
                fn $combine(a: Self::Mask, b: Self::Mask) -> Self::Mask {
                    Two(D::$combine(a.0, b.0), D::$combine(a.1, b.1))
                }
            )*
            #[inline(always)]
            fn is_finite(self) -> Self::Mask {
                Two(self.0.is_finite(), self.1.is_finite())
            }
            #[inline(always)]
            fn not(mask: Self::Mask) -> Self::Mask {
                Two(D::not(mask.0), D::not(mask.1))
            }
            #[inline(always)]
            fn select(mask: Self::Mask, a: Self, b: Self) -> Self {
                Self(D::select(mask.0, a.0, b.0), D::select(mask.1, a.1, b.1))
            }
            #[inline(always)]
            fn replace<F: Copy>(
                rare: Self::Mask,
                [a, b]: [Self; 2],
                result: &mut Self,
                f: F,
                apply: fn(F, f64, f64) -> f64,
            ) {
                D::replace(rare.0, [a.0, b.0], &mut result.0, f, apply);
                D::replace(rare.1, [a.1, b.1], &mut result.1, f, apply);
            }
        }
    };
}
operations! {
    unary {
    /// `√a`
    sqrt = Scalar;
    /// `|a|`
    abs = Scalar;
    }
    binary {
    /// The larger one; `other` if one is NaN.
    max = Lanes;
    /// bitwise and
    and_bits = DoubleRegister;
    /// bitwise or
    or_bits = DoubleRegister;
    /// bitwise exclusive or
    xor_bits = DoubleRegister;
    /// The sum of both as 64-bit integers.
    add_bits = DoubleRegister;
    }
    ternary {
    /// `self a + b`, in one instruction if available, otherwise rounded twice.
    mul_add = DoubleRegister;
    /// `self − a b`
    subtract_product = Field;
    }
    shift {
    /// Shifts the bits up; zeros enter below.
    shift_left;
    /// Shifts the bits down; zeros enter above.
    shift_right;
    }
    compare {
    /// `a < b`
    lt;
    /// `a ≤ b`
    le;
    /// `a = b`
    eq;
    }
    combine {
    /// both
    and;
    /// one or both
    or;
    }
}
