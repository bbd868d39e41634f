//! The numbers that model code and kernels are generic over.
//!
//! - [`Field`]: what can be added, multiplied, divided, and compared in size.
//! - [`Scalar`]: what models compute with: `f32`, `f64`, registers, duals, complex numbers.
//! - [`Lanes`]: one or more real numbers side by side, each of which can be read and written.
//! - [`Real`]: one real number, which can be compared: what decisions are made on.

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

/// Who has one runs where the instructions of fused kernels are: AVX2, FMA, if `WIDE` AVX-512.
///
/// Numbers are computed with in these registers without asking. The crate alone can make one, and
/// does so in kernels that it entered after detection; so no safe program reaches instructions that
/// the machine does not have.
#[doc(hidden)]
#[derive(Clone, Copy)]
pub struct Known<const WIDE: bool>(());

impl<const WIDE: bool> Known<WIDE> {
    /// Only for code that runs inside of `linalg::dispatch`, or after detection.
    #[inline(always)]
    pub(crate) fn assume_detected() -> Self {
        Self(())
    }
}

/// A piece of straight-line code on scalars of one type.
pub trait Piece {
    /// To be `#[inline(always)]`.
    fn run(self);
}

/// What model code is generic over.
///
/// Elementary functions have the meaning of the `f64` methods of the same name.
pub trait Scalar: Field {
    /// How a number lies in memory: as itself, or, for a register of `N` numbers, as `[f64; N]`.
    type Cell: Copy + 'static;

    /// A number from memory.
    fn load(cell: &Self::Cell) -> Self;
    /// A number to memory.
    fn store(self, cell: &mut Self::Cell);

    /// Runs a piece of code that is compiled for the instructions which this type consists of.
    /// Never inlined: pieces are long.
    #[inline(never)]
    fn vectorize<P: Piece>(piece: P) {
        piece.run();
    }

    /// Zeros, made with the fewest instructions outside of [`vectorize`](Scalar::vectorize) too.
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
    /// `a/c`. Where products are fused it is one, with the same bits, since
    /// [`dae`](https://docs.rs/casados-macros) asks for it only if they are: of the sum `1/c` of
    /// these two numbers, the larger one rounded towards zero.
    #[inline(always)]
    fn over(self, c: f64, _reciprocal: [f64; 2]) -> Self {
        self / Self::from_f64(c)
    }
    /// `aⁿ`, `n` an integer
    fn powi(self, n: i32) -> Self;
    /// `aᵇ`
    fn powf(self, other: Self) -> Self;
    /// An elementary function of two or four arguments that do not wait for each other: two in one
    /// register where there is one that is twice as wide, and abreast.
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
    /// What real parts lead to, each lane by itself: constants, as their derivatives are zero
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

/// A computation on `S` numbers of type `E` side by side.
pub trait SideBySide<E, const S: usize> {
    /// With a register of them. To be `#[inline(always)]`.
    fn call<R: Lanes<Cell = [E; S]>>(self);
}

/// What nobody else can name.
mod sealed {
    /// Numbers whose alignment tells kernels which registers hold them.
    #[diagnostic::on_unimplemented(
        message = "`{Self}` is a number type of another crate, which kernels cannot compute with",
        note = "integrators and solvers compute with `f64` or `f32`; models compute with every `Scalar`"
    )]
    pub trait Sealed {}
}
pub(crate) use sealed::Sealed;

/// One or more real numbers side by side: `f32`, `f64`, and registers of them.
///
/// No other type can be one: kernels are entered by the alignment of their numbers, with
/// instructions that a machine has for these. A number type of one's own is a [`Scalar`], which is
/// all that models ask for.
pub trait Lanes: Scalar<Cell: Plain> + Plain + Sealed {
    /// How many.
    const LANES: usize;
    /// The distance from one to the next larger number.
    const EPSILON: f64;
    /// `ε^(2/3)`: what no longer shrinks below this is a rounding error.
    const STAGNATION: f64;
    /// The smallest normal number: where numbers are smaller, rounding errors are not.
    const SMALLEST: f64;
    /// As many numbers with half of the digits, where that saves half of the operations: for what
    /// need not be exact.
    type Demoted: Lanes;
    /// Rounded to these, infinite beyond their largest number.
    fn demote(self) -> Self::Demoted;
    /// The same numbers.
    fn promote(demote: Self::Demoted) -> Self;
    /// One of them. `lane < LANES`
    fn lane(cell: &Self::Cell, lane: usize) -> f64;
    /// One of them set. `lane < LANES`
    fn set_lane(cell: &mut Self::Cell, lane: usize, value: f64);

    /// Neither infinite nor NaN.
    fn is_finite(self) -> Self::Mask;
    /// The larger one; `other` if one of them is NaN.
    fn max(self, other: Self) -> Self;
    /// Whether a mask is true in every lane.
    fn all(mask: Self::Mask) -> bool;
    /// The numbers of each lane beside each other, of at most as many registers as there are lanes:
    /// `to[lane][i] = from[i][lane]`.
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

    /// Runs a computation on `S` numbers like this one in one register.
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
    /// `self − a b`, rounded once where the machine has an instruction for it.
    fn minus_product(self, a: Self, b: Self) -> Self;
    /// The sum of the lanes.
    fn total(self) -> T;
    /// The sum of the lanes of each register, in a lane of its own. There are as many as lanes.
    fn totals(all: &[Self]) -> Self;
    /// The largest lane; any of them if one is NaN.
    fn largest(self) -> T;
}

/// A computation on slices that is made in registers of whatever width.
#[doc(hidden)]
pub trait Registers<T> {
    /// To be `#[inline(always)]`, with everything that it calls.
    fn run<E: Packed<T>>(self);
    /// So many lanes are of use: in a register of twice as many half of them would be padding.
    fn lanes(&self) -> usize {
        usize::MAX
    }
}

/// A computation that can be made with any register of numbers of type `T`.
#[doc(hidden)]
pub trait Widest<T> {
    /// Its result.
    type Output;
    /// With this one.
    fn call<E: Lanes<Cell: AsRef<[T]> + AsMut<[T]>>>(self) -> Self::Output;
}

/// A computation on slices that is compiled with this crate and not in each program again:
/// [`Real::compiled`] runs it, and the macro `compiled!` makes one. In single precision, which few
/// programs with `std` need, it is compiled where it is called, as all inlined functions are.
#[doc(hidden)]
pub trait Compiled {
    /// The computation.
    type Of<'r, 'a: 'r, 's: 'r, T: Real>: Registers<T>;
    /// In double precision.
    fn double<'r, 'a: 'r, 's: 'r>(computation: Self::Of<'r, 'a, 's, f64>);
    /// In single precision.
    fn single<'r, 'a: 'r, 's: 'r>(computation: Self::Of<'r, 'a, 's, f32>);
}

/// Makes a computation with the lifetimes `'r`, `'a` and `'s` and numbers `T` one that is
/// [`Compiled`] here. Programs without `std` have it inside, where the optimiser sees all of it.
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

/// One real number: `f32` or `f64`. No other type can be one, as no other can have [`Lanes`].
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
    /// As `f64`, exactly.
    fn to_f64(self) -> f64;

    /// The smaller one; `self` if one of them is NaN.
    #[inline(always)]
    #[must_use]
    fn min(self, other: Self) -> Self {
        if other < self { other } else { self }
    }

    /// Runs a computation of this crate that is compiled for this number type.
    #[doc(hidden)]
    fn run_precompiled<'r, 'a: 'r, 's: 'r, C: Compiled>(computation: C::Of<'r, 'a, 's, Self>);

    /// Runs a computation on slices, compiled for the widest registers that this machine has.
    #[doc(hidden)]
    fn registers<C: Registers<Self>>(computation: C) {
        computation.run::<Self>();
    }

    /// Runs a computation with the widest register of such numbers that this machine has and that
    /// is no wider than `lanes`; not with those of two numbers where there are any wider ones.
    ///
    /// # Errors
    /// The computation, if there is none.
    #[doc(hidden)]
    fn run_in_widest_register<C: Widest<Self>>(_lanes: usize, computation: C) -> Result<C::Output, C> {
        Err(computation)
    }
}
