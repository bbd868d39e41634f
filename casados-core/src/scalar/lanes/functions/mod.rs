//! Elementary functions of registers, written once for all kinds of them.
//!
//! No branch depends on the numbers, but for one: where a lane is *rare* (listed below), the
//! function of one number is called for that lane, and only that lane takes its result and its
//! accuracy. A zero keeps its sign, and infinities and NaN come out where they do for one number.
//!
//! Bounds of the error in units in the last place of the exact result, for all registers of `f64`,
//! with fused products or without. They are measured, not proved: the largest error in 2 million
//! arguments of each function and each kind of register, of all magnitudes, dense where the
//! reductions change, was below them; the tests repeat it on fewer.
//!
//! | function | bound | rare |
//! | --- | --- | --- |
//! | `sqrt` | 0.5 | |
//! | `sin`, `cos`, `sin_cos` | 0.80 | `|a| > 1.6 · 10⁶` |
//! | `tan` | 0.90 | the same |
//! | `exp`, `exp2` | 0.80 | |
//! | `cosh` | 0.70 | |
//! | `exp_m1` | 0.65 | |
//! | `sinh` | 0.90 | |
//! | `tanh` | 0.60 | |
//! | `ln` | 0.65 | not normal and positive |
//! | `log2`, `log10` | 0.51 | the same |
//! | `ln_1p` | 0.51 | `a ≤ −1`, `a > 10³⁰⁰` |
//! | `powf` | 0.70 | a base that is not normal and positive, a result beyond `e^±700`, an exponent beyond `10¹⁰⁰` |
//! | `asin`, `acos`, `atan` | 0.70 | |
//! | `atan2` | 0.70 | both zero, or one beyond `10^±130` and not zero |
//! | `asinh`, `acosh` | 0.51 | |
//! | `atanh` | 0.51 | `|a| ≥ 1` |
//! | `cbrt` | 0.51 | zero, not normal |
//! | `hypot` | 0.51 | the larger one beyond `10^±130` |
//!
//! Functions of `f32` are those of `f64`, rounded: 0.5 + 2⁻²⁹ units.

mod abreast;
mod exponential;
mod logarithm;
#[cfg(any(test, not(feature = "std")))]
mod number;
mod pair;
mod root;
mod rounding;
mod trigonometric;

use crate::scalar::{Field, Lanes, Piece, Scalar};
pub use abreast::{Double, Two};
use bytemuck::Zeroable;

/// A register of doubles with operations on its bits, for elementary functions. Bit patterns are
/// written as doubles.
pub trait DoubleRegister: Lanes {
    /// Whether [`mul_add`](Self::mul_add) rounds once.
    const FUSED: bool;

    /// `self b + c`, in one instruction if available, otherwise rounded twice.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// bitwise and
    fn and_bits(self, other: Self) -> Self;
    /// bitwise or
    fn or_bits(self, other: Self) -> Self;
    /// bitwise exclusive or
    fn xor_bits(self, other: Self) -> Self;
    /// The sum of both as 64-bit integers.
    fn add_bits(self, other: Self) -> Self;
    /// Shifts the bits up; zeros enter below.
    fn shift_left<const BITS: i32>(self) -> Self;
    /// Shifts the bits down; zeros enter above.
    fn shift_right<const BITS: i32>(self) -> Self;
    /// The lanes of a mask, one bit each.
    fn bits_of(mask: Self::Mask) -> u32;
}

/// A register of `f32`, whose functions are computed in two registers of doubles.
pub trait Single: Lanes {
    /// The register of doubles.
    type Double: DoubleRegister;
    /// The lower and the upper half.
    fn widen(self) -> [Self::Double; 2];
    /// The register with these halves, rounded.
    fn narrow(low: Self::Double, high: Self::Double) -> Self;
}

/// Functions of one number for rare lanes, where those of a scalar are the functions below.
mod one {
    macro_rules! one {
        ($($name:ident)*) => { $(
            pub fn $name(a: f64) -> f64 {
                #[cfg(feature = "std")]
                return a.$name();
                #[cfg(not(feature = "std"))]
                return libm::$name(a);
            }
        )* };
    }
    one!(sin cos tan);
}

/// Replaces the rare lanes of `result` by the value of the function of one number.
#[inline(always)]
fn replace_special_lanes<D: Double>(rare: D::Mask, a: D, result: &mut D, f: fn(f64) -> f64) {
    D::replace(rare, [a, a], result, f, |f, a, _| f(a));
}

/// As [`replace_special_lanes`], for a function of two numbers.
#[inline(always)]
fn replace_special_lanes_of_two<D: Double>(
    rare: D::Mask,
    a: D,
    b: D,
    result: &mut D,
    f: fn(f64, f64) -> f64,
) {
    D::replace(rare, [a, b], result, f, |f, a, b| f(a, b));
}

#[cold]
fn each<D: DoubleRegister, F: Copy>(
    rare: <D as Field>::Mask,
    [a, b]: [D; 2],
    result: &mut D,
    f: F,
    apply: fn(F, f64, f64) -> f64,
) {
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

/// A function, called with its argument. (A trait, since calls through a value of type `fn` may not
/// be inlined.)
pub trait Call<A> {
    /// Its result.
    type Output;
    /// `#[inline(always)]`
    fn call(argument: A) -> Self::Output;
}

/// As [`Call`], with four arguments.
pub trait CallWithFour<A> {
    /// Its result.
    type Output;
    /// `#[inline(always)]`
    fn call(a: [A; 4]) -> Self::Output;
}

/// As [`Call`], with eight arguments.
pub trait CallWithEight<A> {
    /// Its result.
    type Output;
    /// `#[inline(always)]`
    fn call(a: [A; 8]) -> Self::Output;
}

/// An elementary function of `K` numbers with `R` results.
pub trait Elementary<const K: usize, const R: usize> {
    /// The method of a scalar.
    fn of<S: Scalar>(arguments: [S; K]) -> [S; R];
    /// The implementation for registers of doubles. `#[inline(always)]`
    fn inside<D: Double>(arguments: [D; K]) -> [D; R];
}

/// A piece of code as a function.
pub struct Run;
impl<P: Piece> Call<P> for Run {
    type Output = ();
    #[inline(always)]
    fn call(piece: P) {
        piece.run();
    }
}

/// Defines the elementary functions by the names of their methods, with their numbers of arguments
/// and results.
macro_rules! calls {
    ($($module:ident::$name:ident[$K:literal, $R:literal]($($argument:ident),*) -> ($($result:ident),*);)*) => { $(
        #[doc = concat!("[`Scalar::", stringify!($name), "`]")]
        #[allow(non_camel_case_types)]
        #[derive(Clone, Copy, Debug)]
        pub struct $name;
        #[allow(unused_parens)] // A single number is no tuple.
        impl<D: Double> Call<($(one_of!(D $argument)),*)> for $name {
            type Output = ($(one_of!(D $result)),*);
            #[inline(always)]
            fn call(argument: ($(one_of!(D $argument)),*)) -> Self::Output {
                $module::$name(argument)
            }
        }
        #[allow(unused_parens)]
        impl Elementary<$K, $R> for $name {
            #[inline(always)]
            fn of<S: Scalar>([$($argument),*]: [S; $K]) -> [S; $R] {
                let ($($result),*) = S::$name($($argument),*);
                [$($result),*]
            }
            #[inline(always)]
            fn inside<D: Double>([$($argument),*]: [D; $K]) -> [D; $R] {
                let ($($result),*) = $module::$name(($($argument),*));
                [$($result),*]
            }
        }
    )* };
}
/// A type for each name.
macro_rules! one_of {
    ($type:ident $name:ident) => {
        $type
    };
}
calls! {
    exponential::exp[1, 1](a) -> (b);
    exponential::exp2[1, 1](a) -> (b);
    exponential::exp_m1[1, 1](a) -> (b);
    exponential::sinh[1, 1](a) -> (b);
    exponential::cosh[1, 1](a) -> (b);
    exponential::tanh[1, 1](a) -> (b);
    exponential::powf[2, 1](a, exponent) -> (b);
    logarithm::ln[1, 1](a) -> (b);
    logarithm::ln_1p[1, 1](a) -> (b);
    logarithm::log2[1, 1](a) -> (b);
    logarithm::log10[1, 1](a) -> (b);
    logarithm::asinh[1, 1](a) -> (b);
    logarithm::acosh[1, 1](a) -> (b);
    logarithm::atanh[1, 1](a) -> (b);
    trigonometric::sin[1, 1](a) -> (b);
    trigonometric::cos[1, 1](a) -> (b);
    trigonometric::tan[1, 1](a) -> (b);
    trigonometric::asin[1, 1](a) -> (b);
    trigonometric::acos[1, 1](a) -> (b);
    trigonometric::atan[1, 1](a) -> (b);
    trigonometric::atan2[2, 1](y, x) -> (b);
    trigonometric::sin_cos[1, 2](a) -> (s, c);
    root::cbrt[1, 1](a) -> (b);
    root::hypot[2, 1](x, y) -> (b);
}
