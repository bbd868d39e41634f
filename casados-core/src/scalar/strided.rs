//! Numbers in memory, interleaved with those of other stages.
//!
//! The values of a variable at all stages are contiguous, `[E; S]`. If no register holds them, a
//! model is evaluated stage by stage at the first number of each cell; arrays that start at another
//! stage evaluate that stage.

use super::lanes::functions::Elementary;
use super::{Field, Lanes, Piece, Rows, Scalar, Sealed};
use crate::shape::Plain;
use bytemuck::Zeroable;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// The first of `S` numbers.
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
pub struct Strided<E, const S: usize>(E);

macro_rules! operators {
    ($($trait:ident $method:ident)*) => { $(
        impl<E: Field, const S: usize> $trait for Strided<E, S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0))
            }
        }
    )* };
}
operators!(Add add Sub sub Mul mul Div div);

impl<E: Field, const S: usize> Neg for Strided<E, S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl<E: Field, const S: usize> Field for Strided<E, S> {
    type Mask = E::Mask;

    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Self(E::from_f64(value))
    }
    #[inline(always)]
    fn from_whole(value: usize) -> Self {
        Self(E::from_whole(value))
    }
    #[inline(always)]
    fn reciprocal(self) -> Self {
        Self(self.0.reciprocal())
    }
    #[inline(always)]
    fn subtract_product(self, a: Self, b: Self) -> Self {
        Self(self.0.subtract_product(a.0, b.0))
    }
    #[inline(always)]
    fn is_smaller(self, other: Self) -> E::Mask {
        self.0.is_smaller(other.0)
    }
    #[inline(always)]
    fn select(mask: E::Mask, a: Self, b: Self) -> Self {
        Self(E::select(mask, a.0, b.0))
    }
    #[inline(always)]
    fn any(mask: E::Mask) -> bool {
        E::any(mask)
    }
}

/// Methods of the number itself.
macro_rules! methods {
    (unary: $($unary:ident)*; binary: $($binary:ident)*; compare: $($compare:ident)*; combine: $($combine:ident)*) => {
        $(
            #[inline(always)]
            fn $unary(self) -> Self {
                Self(self.0.$unary())
            }
        )*
        $(
            #[inline(always)]
            fn $binary(self, other: Self) -> Self {
                Self(self.0.$binary(other.0))
            }
        )*
        $(
            #[inline(always)]
            fn $compare(self, other: Self) -> E::Mask {
                self.0.$compare(other.0)
            }
        )*
        $(
            #[inline(always)]
            fn $combine(a: E::Mask, b: E::Mask) -> E::Mask {
                E::$combine(a, b)
            }
        )*
    };
}

impl<E: Scalar + Plain, const S: usize> Scalar for Strided<E, S> {
    type Cell = [E; S];

    #[inline(always)]
    fn load(cell: &Self::Cell) -> Self {
        Self(cell[0])
    }
    #[inline(always)]
    fn store(self, cell: &mut Self::Cell) {
        cell[0] = self.0;
    }
    #[inline(always)]
    fn vectorize<P: Piece>(piece: P) {
        E::vectorize(piece);
    }
    #[inline(always)]
    fn zeros<const N: usize>() -> [Self; N] {
        E::zeros().map(Self)
    }
    #[inline(always)]
    fn together<F: Elementary<K, R>, const K: usize, const R: usize, const N: usize>(
        a: [[Self; K]; N],
    ) -> [[Self; R]; N] {
        E::together::<F, K, R, N>(a.map(|a| a.map(|a| a.0))).map(|results| results.map(Self))
    }
    #[inline(always)]
    fn look_up<R: Rows<K, C>, const K: usize, const C: usize>(a: [Self; K], rows: R) -> [Self; C] {
        E::look_up(a.map(|a| a.0), rows).map(Self)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.0.sin_cos();
        (Self(sin), Self(cos))
    }
    #[inline(always)]
    fn over(self, c: f64, reciprocal: [f64; 2]) -> Self {
        Self(self.0.over(c, reciprocal))
    }
    #[inline(always)]
    fn powi(self, n: i32) -> Self {
        Self(self.0.powi(n))
    }
    #[inline(always)]
    fn not(a: E::Mask) -> E::Mask {
        E::not(a)
    }
    methods! {
        unary: sqrt cbrt exp exp2 exp_m1 ln ln_1p log2 log10 sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh abs signum;
        binary: atan2 hypot powf;
        compare: lt le eq;
        combine: and or
    }
}

impl<E: Lanes, const S: usize> Sealed for Strided<E, S> {}

impl<E: Lanes, const S: usize> Lanes for Strided<E, S> {
    const LANES: usize = E::LANES;
    const EPSILON: f64 = E::EPSILON;
    const STAGNATION: f64 = E::STAGNATION;
    const SMALLEST: f64 = E::SMALLEST;
    type Demoted = Strided<E::Demoted, S>;
    #[inline(always)]
    fn demote(self) -> Self::Demoted {
        Strided(self.0.demote())
    }
    #[inline(always)]
    fn promote(demote: Self::Demoted) -> Self {
        Self(E::promote(demote.0))
    }

    #[inline(always)]
    fn lane(cell: &Self::Cell, lane: usize) -> f64 {
        let mut own: E::Cell = Zeroable::zeroed();
        cell[0].store(&mut own);
        E::lane(&own, lane)
    }
    #[inline(always)]
    fn set_lane(cell: &mut Self::Cell, lane: usize, value: f64) {
        let mut own: E::Cell = Zeroable::zeroed();
        cell[0].store(&mut own);
        E::set_lane(&mut own, lane, value);
        cell[0] = E::load(&own);
    }
    #[inline(always)]
    fn is_finite(self) -> E::Mask {
        self.0.is_finite()
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(self.0.max(other.0))
    }
    #[inline(always)]
    fn all(mask: E::Mask) -> bool {
        E::all(mask)
    }
}
