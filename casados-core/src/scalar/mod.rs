//! The number types of model code and kernels.
//!
//! - [`Field`]: addition, multiplication, division, and comparison of magnitudes.
//! - [`Scalar`]: the numbers of models: `f32`, `f64`, registers, duals, complex numbers.
//! - [`Lanes`]: one or more real numbers, each of which can be read and written.
//! - [`Real`]: one real number, which can be compared for decisions.

#[cfg(feature = "testing")]
mod complex;
#[cfg(not(feature = "std"))]
mod double;
#[cfg(feature = "num-dual")]
mod dual;
mod each;
mod field;
mod float;
pub(crate) mod lanes;
mod number;
mod real;
mod rows;
#[cfg(all(feature = "libm", any(test, not(feature = "std"))))]
mod single;
mod strided;
mod tangent;

pub(crate) use each::each;
pub use field::Field;
pub(crate) use field::{fast_two_sum, transposed, two_sum};
#[doc(hidden)]
pub use float::Float;
#[doc(hidden)]
pub use lanes::functions as elementary;
pub(crate) use number::{as_it_is, mask_logic, one_mask, own_cell};
#[doc(hidden)]
pub use rows::Rows;
pub(crate) use strided::Strided;
pub use tangent::Tangent;

use crate::shape::Plain;
use bytemuck::Zeroable;

/// A proof that the instructions of fused kernels are available: AVX2, FMA, and AVX-512 if `WIDE`.
///
/// With it these registers are used without a check. Only the crate can create one, in kernels
/// entered after detection: safe programs never execute instructions that the machine lacks.
#[doc(hidden)]
#[derive(Clone, Copy)]
pub struct Known<const WIDE: bool>(());

impl<const WIDE: bool> Known<WIDE> {
    /// Only for code inside of `linalg::dispatch`, or after detection.
    #[inline(always)]
    pub(crate) fn assume_detected() -> Self {
        Self(())
    }
}

/// Straight-line code on scalars of one type.
pub trait Piece {
    /// Implementations are `#[inline(always)]`.
    fn run(self);
}

/// The scalar type of model code.
///
/// Elementary functions have the meaning of the `f64` methods of the same name.
pub trait Scalar: Field {
    /// The representation in memory: the number itself or, for a register of `N` numbers,
    /// `[f64; N]`.
    type Cell: Copy + 'static;

    /// Loads a number from memory.
    fn load(cell: &Self::Cell) -> Self;
    /// Stores a number to memory.
    fn store(self, cell: &mut Self::Cell);

    /// Runs code that is compiled for the instructions of this type. Never inlined, since the code
    /// is long.
    #[inline(never)]
    fn vectorize<P: Piece>(piece: P) {
        piece.run();
    }

    /// Zeros, created with few instructions even outside of [`vectorize`](Scalar::vectorize).
    #[doc(hidden)]
    #[inline(always)]
    fn zeros<const N: usize>() -> [Self; N] {
        [Self::from_f64(0.0); N]
    }

    /// `√a`
    fn sqrt(self) -> Self;
    /// `∛a`
    fn cbrt(self) -> Self;
    /// `eᵃ`
    fn exp(self) -> Self;
    /// `2ᵃ`
    fn exp2(self) -> Self;
    /// `eᵃ − 1`
    fn exp_m1(self) -> Self;
    /// natural logarithm
    fn ln(self) -> Self;
    /// `ln(1 + a)`
    fn ln_1p(self) -> Self;
    /// logarithm to base 2
    fn log2(self) -> Self;
    /// logarithm to base 10
    fn log10(self) -> Self;
    /// `sin a`
    fn sin(self) -> Self;
    /// `cos a`
    fn cos(self) -> Self;
    /// `(sin a, cos a)`
    fn sin_cos(self) -> (Self, Self);
    /// `tan a`
    fn tan(self) -> Self;
    /// `arcsin a`
    fn asin(self) -> Self;
    /// `arccos a`
    fn acos(self) -> Self;
    /// `arctan a`
    fn atan(self) -> Self;
    /// the angle of `(x, y) = (other, self)`
    fn atan2(self, other: Self) -> Self;
    /// `sinh a`
    fn sinh(self) -> Self;
    /// `cosh a`
    fn cosh(self) -> Self;
    /// `tanh a`
    fn tanh(self) -> Self;
    /// `arsinh a`
    fn asinh(self) -> Self;
    /// `arcosh a`
    fn acosh(self) -> Self;
    /// `artanh a`
    fn atanh(self) -> Self;
    /// `√(a² + b²)` without overflow
    fn hypot(self, other: Self) -> Self;
    /// `a/c` for a constant. With fused products it is computed by the sum of these two numbers,
    /// `1/c` with the larger one rounded towards zero; [`dae`](https://docs.rs/casados-macros)
    /// emits it only if the result is bitwise equal to the division.
    #[inline(always)]
    fn over(self, c: f64, _reciprocal: [f64; 2]) -> Self {
        self / Self::from_f64(c)
    }
    /// `aⁿ`, `n` an integer
    fn powi(self, n: i32) -> Self;
    /// `aᵇ`
    fn powf(self, other: Self) -> Self;
    /// An elementary function of two or four independent arguments: two in one register if there is
    /// one twice as wide, and interleaved.
    #[doc(hidden)]
    #[inline(always)]
    fn together<F: elementary::Elementary<K, R>, const K: usize, const R: usize, const N: usize>(
        a: [[Self; K]; N],
    ) -> [[Self; R]; N] {
        let mut results = [[Self::from_f64(0.0); R]; N];
        each!(n < N => {
            results[n] = F::of(a[n]);
        });
        results
    }
    /// Looks up constants by the real parts, for each lane separately; their derivatives are zero
    /// wherever they exist.
    fn look_up<R: Rows<K, C>, const K: usize, const C: usize>(a: [Self; K], rows: R) -> [Self; C];
    /// `|a|`
    fn abs(self) -> Self;
    /// `±1`, with the sign of `a`
    fn signum(self) -> Self;

    /// `a < b`
    fn lt(self, other: Self) -> Self::Mask;
    /// `a ≤ b`
    fn le(self, other: Self) -> Self::Mask;
    /// `a = b`
    fn eq(self, other: Self) -> Self::Mask;
    /// both
    fn and(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// one or both
    fn or(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// not
    fn not(a: Self::Mask) -> Self::Mask;
}

/// A computation on `S` numbers of type `E` in one register.
pub trait SideBySide<E, const S: usize> {
    /// Runs it with a register type. Implementations are `#[inline(always)]`.
    fn call<R: Lanes<Cell = [E; S]>>(self);
}

/// Seals the traits: cannot be named outside of the crate.
mod sealed {
    /// Numbers whose alignment determines the registers of kernels.
    #[diagnostic::on_unimplemented(
        message = "`{Self}` is a number type of another crate, which kernels cannot compute with",
        note = "integrators and solvers compute with `f64` or `f32`; models compute with every `Scalar`"
    )]
    pub trait Sealed {}
}
pub(crate) use sealed::Sealed;

/// One or more real numbers: `f32`, `f64`, and registers of them.
///
/// Sealed, since kernels select their instructions by the type and alignment of the numbers. Other
/// number types implement [`Scalar`], which suffices for models.
pub trait Lanes: Scalar<Cell: Plain> + Plain + Sealed {
    /// The number of lanes.
    const LANES: usize;
    /// The distance from one to the next larger number.
    const EPSILON: f64;
    /// `ε^(2/3)`: increments below this that no longer shrink are rounding errors.
    const STAGNATION: f64;
    /// The smallest normal number: rounding errors of smaller numbers do not shrink.
    const SMALLEST: f64;
    /// As many numbers with half of the digits, if that halves the operations: for approximate
    /// computations.
    type Demoted: Lanes;
    /// Rounds to demoted numbers; infinite beyond their largest number.
    fn demote(self) -> Self::Demoted;
    /// Converts demoted numbers without rounding.
    fn promote(demote: Self::Demoted) -> Self;
    /// The number in a lane; `lane < LANES`.
    fn lane(cell: &Self::Cell, lane: usize) -> f64;
    /// Sets the number in a lane; `lane < LANES`.
    fn set_lane(cell: &mut Self::Cell, lane: usize, value: f64);

    /// Whether the numbers are neither infinite nor NaN.
    fn is_finite(self) -> Self::Mask;
    /// The larger one; `other` if one is NaN.
    fn max(self, other: Self) -> Self;
    /// Whether a mask is true in every lane.
    fn all(mask: Self::Mask) -> bool;
    /// Transposes at most as many registers as there are lanes: `to[lane][i] = from[i][lane]`.
    #[inline(always)]
    fn transpose(from: &[Self], to: &mut [Self::Cell]) {
        for (i, from) in from.iter().enumerate() {
            let mut cell: Self::Cell = Zeroable::zeroed();
            from.store(&mut cell);
            for (lane, to) in to.iter_mut().enumerate() {
                Self::set_lane(to, i, Self::lane(&cell, lane));
            }
        }
    }

    /// Runs a computation on `S` numbers of this type in one register.
    ///
    /// # Errors
    /// The computation, if this machine has no such register.
    #[inline(always)]
    fn side_by_side<const S: usize, C: SideBySide<Self, S>>(computation: C) -> Result<(), C> {
        Err(computation)
    }
}

/// Whole registers over slices of numbers of type `T`.
#[doc(hidden)]
pub trait Packed<T>: Lanes {
    /// The whole registers of a slice.
    fn cells(numbers: &[T]) -> &[Self::Cell];
    /// The whole registers of a slice.
    fn cells_mut(numbers: &mut [T]) -> &mut [Self::Cell];
    /// `self − a b`, rounded once if the machine supports it.
    fn minus_product(self, a: Self, b: Self) -> Self;
    /// The sum of the lanes.
    fn total(self) -> T;
    /// The largest lane; any lane if one is NaN.
    fn largest(self) -> T;
}

/// A computation on slices in registers of any width.
#[doc(hidden)]
pub trait Registers<T> {
    /// Implementations are `#[inline(always)]`, with everything that they call.
    fn run<E: Packed<T>>(self);
}

/// A computation with any register of numbers of type `T`.
#[doc(hidden)]
pub trait Widest<T> {
    /// Its result.
    type Output;
    /// Runs it with a register type.
    fn call<E: Lanes<Cell: AsRef<[T]> + AsMut<[T]>>>(self) -> Self::Output;
}

/// A computation on slices that is compiled once, with this crate: [`Real::run_precompiled`] runs
/// it, and the macro `compiled!` defines it. In single precision, which few programs with `std`
/// need, it is compiled by the caller, as all inlined functions are.
#[doc(hidden)]
pub trait Compiled {
    /// The computation.
    type Of<'r, 'a: 'r, 's: 'r, T: Real>: Registers<T>;
    /// In double precision.
    fn double<'r, 'a: 'r, 's: 'r>(computation: Self::Of<'r, 'a, 's, f64>);
    /// In single precision.
    fn single<'r, 'a: 'r, 's: 'r>(computation: Self::Of<'r, 'a, 's, f32>);
}

/// Defines a [`Compiled`] computation with the lifetimes `'r`, `'a` and `'s` and numbers `T`.
/// Without `std` it is inlined, so that the optimiser sees all of it.
macro_rules! compiled {
    ($(#[$text:meta])* $visibility:vis $name:ident: $computation:ty) => {
        $(#[$text])*
        $visibility struct $name;
        impl $crate::scalar::Compiled for $name {
            type Of<'r, 'a: 'r, 's: 'r, T: $crate::scalar::Real> = $computation;
            #[cfg_attr(feature = "std", inline(never))]
            #[cfg_attr(not(feature = "std"), inline(always))]
            fn double<'r, 'a: 'r, 's: 'r>(computation: Self::Of<'r, 'a, 's, f64>) {
                <f64 as $crate::scalar::Real>::registers(computation);
            }
            #[cfg_attr(feature = "std", inline)]
            #[cfg_attr(not(feature = "std"), inline(always))]
            fn single<'r, 'a: 'r, 's: 'r>(computation: Self::Of<'r, 'a, 's, f32>) {
                <f32 as $crate::scalar::Real>::registers(computation);
            }
        }
    };
}
pub(crate) use compiled;

/// One real number: `f32` or `f64`. Sealed, as [`Lanes`].
///
/// ```
/// use casados::Real;
///
/// /// In whatever precision.
/// fn mean<T: Real>(a: T, b: T) -> T {
///     T::from_f64(0.5) * (a + b)
/// }
/// assert_eq!(mean(1.0_f64, 2.0), 1.5);
/// assert_eq!(mean(1.0_f32, 2.0).to_f64(), 1.5);
/// ```
pub trait Real: Lanes<Cell = Self, Mask = bool> + Packed<Self> + PartialOrd + Default {
    /// Zero.
    const ZERO: Self;
    /// One.
    const ONE: Self;
    /// Converts to `f64`, exactly.
    fn to_f64(self) -> f64;

    /// The smaller one; `self` if one is NaN.
    #[inline(always)]
    #[must_use]
    fn min(self, other: Self) -> Self {
        if other < self { other } else { self }
    }

    /// Runs a precompiled computation of this crate.
    #[doc(hidden)]
    fn run_precompiled<'r, 'a: 'r, 's: 'r, C: Compiled>(computation: C::Of<'r, 'a, 's, Self>);

    /// Runs a computation on slices in the widest registers of this machine.
    #[doc(hidden)]
    fn registers<C: Registers<Self>>(computation: C) {
        computation.run::<Self>();
    }

    /// Runs a computation in the widest register of this machine with at most `lanes` numbers;
    /// registers of two numbers are skipped if there are wider ones.
    ///
    /// # Errors
    /// The computation, if there is no such register.
    #[doc(hidden)]
    fn run_in_widest_register<C: Widest<Self>>(_lanes: usize, computation: C) -> Result<C::Output, C> {
        Err(computation)
    }
}
