//! A number type of one's own is a `Scalar`, which models compute with. Kernels go by the alignment
//! of numbers: they are for those of the library.

use bytemuck::Zeroable;
use casados::__private::{Known, Rows};
use casados::__private::{Field, Lanes, Scalar};
use std::ops::{Add, Div, Mul, Neg, Sub};

#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Zeroable)]
#[repr(align(64))]
struct Wide(f64);

macro_rules! operators {
    ($($trait:ident $method:ident)*) => { $(
        impl $trait for Wide {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0))
            }
        }
    )* };
}
operators!(Add add Sub sub Mul mul Div div);

impl Neg for Wide {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Field for Wide {
    type Mask = bool;
    fn from_f64(value: f64) -> Self {
        Self(value)
    }
    fn is_smaller(self, other: Self) -> bool {
        self.0.abs() < other.0.abs()
    }
    fn select(mask: bool, a: Self, b: Self) -> Self {
        if mask { a } else { b }
    }
    fn any(mask: bool) -> bool {
        mask
    }
}

macro_rules! functions {
    ($($unary:ident)*; $($binary:ident)*; $($compare:ident)*; $($combine:ident)*) => {
        $(fn $unary(self) -> Self { Self(Scalar::$unary(self.0)) })*
        $(fn $binary(self, other: Self) -> Self { Self(Scalar::$binary(self.0, other.0)) })*
        $(fn $compare(self, other: Self) -> bool { Scalar::$compare(self.0, other.0) })*
        $(fn $combine(a: bool, b: bool) -> bool { f64::$combine(a, b) })*
    };
}

impl Scalar for Wide {
    type Cell = Self;
    fn load(cell: &Self) -> Self {
        *cell
    }
    fn store(self, cell: &mut Self) {
        *cell = self;
    }
    fn look_up<R: Rows<K, C>, const K: usize, const C: usize>(a: [Self; K], rows: R) -> [Self; C] {
        rows.row(a.map(|a| a.0)).map(Self)
    }
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.0.sin_cos();
        (Self(sin), Self(cos))
    }
    fn powi(self, n: i32) -> Self {
        Self(self.0.powi(n))
    }
    fn not(a: bool) -> bool {
        !a
    }
    functions!(sqrt cbrt exp exp2 exp_m1 ln ln_1p log2 log10 sin cos tan asin acos atan sinh cosh tanh asinh acosh
        atanh abs signum; atan2 hypot powf; lt le eq; and or);
}

/// Code of a model.
fn rate<S: Scalar>(x: S) -> S {
    x.sin() - x
}

fn main() {
    println!("{:?}", rate(Wide(1.0)));
    // What runs in kernels cannot be called from elsewhere.
    f64::subtract_row(&mut [0.0; 8], 1.0, &[1.0; 8], Known::<true>::assume_detected());
}

impl Lanes for Wide {
    const LANES: usize = 1;
    const EPSILON: f64 = f64::EPSILON;
    const STAGNATION: f64 = 1e-10;
    const SMALLEST: f64 = f64::MIN_POSITIVE;
    type Demoted = f64;
    fn demote(self) -> f64 {
        self.0
    }
    fn promote(demote: f64) -> Self {
        Self(demote)
    }
    fn lane(cell: &Self, _: usize) -> f64 {
        cell.0
    }
    fn set_lane(cell: &mut Self, _: usize, value: f64) {
        cell.0 = value;
    }
    fn is_finite(self) -> bool {
        self.0.is_finite()
    }
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    fn all(mask: bool) -> bool {
        mask
    }
}
