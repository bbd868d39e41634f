//! Dependency tracking: a number type that records on which variables each number depends.

use alloc::vec;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::cmp::Ordering;
use core::fmt;
use core::iter::{Product, Sum};
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Rem, RemAssign, Sub, SubAssign};
use num_dual::{DualNum, DualStruct, Mappable};
use num_traits::{FromPrimitive, Inv, Num, One, Signed, Zero};

std::thread_local! {
    static TAPE: RefCell<DependencyTape> = const { RefCell::new(DependencyTape::empty()) };
}

/// The dependencies of the numbers of one run, and whether the run read the value of a number that
/// depends on a variable.
#[derive(Debug)]
pub(super) struct DependencyTape {
    /// The number of words of a set of variables.
    words_per_set: usize,
    /// One set for each number; the first is empty.
    sets: Vec<u64>,
    /// Symmetric: the pairs of variables with respect to which some number has a second derivative.
    interactions: Vec<u64>,
    value_was_read: bool,
}

/// A set of variables.
pub(super) struct VariableSet(Vec<u64>);

impl VariableSet {
    /// Whether a variable is in the set.
    pub(super) fn contains(&self, variable: usize) -> bool {
        has_bit(&self.0, variable)
    }
}

fn has_bit(words: &[u64], index: usize) -> bool {
    words.get(index / 64).is_some_and(|word| word >> (index % 64) & 1 == 1)
}

/// The structure of the second derivatives of a binary operation.
#[derive(Clone, Copy)]
enum Kind {
    Linear,
    /// Only `∂²/∂a∂b`.
    Product,
    /// All except `∂²/∂a²`.
    Quotient,
    General,
}

impl DependencyTape {
    const fn empty() -> Self {
        Self { words_per_set: 0, sets: Vec::new(), interactions: Vec::new(), value_was_read: false }
    }

    /// Records a run with this number of variables. Nested runs would replace the tape; they do not
    /// occur, since a model does not differentiate itself.
    pub(super) fn record(variables: usize, run: impl FnOnce()) -> Self {
        let words = variables.div_ceil(64);
        let tape = Self {
            words_per_set: words,
            sets: vec![0; words],
            interactions: vec![0; variables * words],
            value_was_read: false,
        };
        TAPE.with_borrow_mut(|current| *current = tape);
        run();
        TAPE.replace(Self::empty())
    }

    pub(super) fn depends_on_value(&self) -> bool {
        self.value_was_read
    }

    /// Whether a number has a second derivative with respect to two variables.
    pub(super) fn interacts(&self, a: usize, b: usize) -> bool {
        has_bit(self.interactions.get(a * self.words_per_set..).unwrap_or_default(), b)
    }

    fn dependencies_of(&self, node: usize) -> Vec<u64> {
        let start = node * self.words_per_set;
        self.sets.get(start..start + self.words_per_set).unwrap_or_default().to_vec()
    }

    fn push(&mut self, set: &[u64]) -> usize {
        self.sets.extend_from_slice(set);
        (self.sets.len() / self.words_per_set.max(1)).saturating_sub(1)
    }

    fn combine(&mut self, kind: Kind, a: usize, b: usize) -> usize {
        let (x, y) = (self.dependencies_of(a), self.dependencies_of(b));
        let union: Vec<u64> = x.iter().zip(&y).map(|(x, y)| x | y).collect();
        match kind {
            Kind::Linear => {}
            Kind::Product => self.mark_interactions(&x, &y),
            Kind::Quotient => self.mark_interactions(&union, &y),
            Kind::General => self.mark_interactions(&union, &union),
        }
        if a == b || b == 0 {
            a
        } else if a == 0 {
            b
        } else {
            self.push(&union)
        }
    }

    fn mark_interactions(&mut self, x: &[u64], y: &[u64]) {
        let variables = self.interactions.len() / self.words_per_set.max(1);
        for (x, y) in [(x, y), (y, x)] {
            for variable in (0..variables).filter(|&variable| has_bit(x, variable)) {
                let row = self.interactions.iter_mut().skip(variable * self.words_per_set);
                row.zip(y).for_each(|(pairs, y)| *pairs |= y);
            }
        }
    }
}

/// A number with its dependencies. Outside of a recorded run it is an ordinary number.
#[derive(Clone, Copy)]
pub struct Tracked {
    value: f64,
    /// The index of its set on the tape; zero is the empty set.
    node: usize,
}

impl Tracked {
    pub(super) fn variable(value: f64, index: usize) -> Self {
        let node = TAPE.with_borrow_mut(|tape| {
            let mut set = vec![0; tape.words_per_set];
            if let Some(word) = set.get_mut(index / 64) {
                *word |= 1 << (index % 64);
            }
            tape.push(&set)
        });
        Self { value, node }
    }

    pub(super) fn dependencies(self) -> VariableSet {
        TAPE.with_borrow(|tape| VariableSet(tape.dependencies_of(self.node)))
    }

    const fn constant(value: f64) -> Self {
        Self { value, node: 0 }
    }

    fn combine(kind: Kind, value: f64, a: Self, b: Self) -> Self {
        if a.node == 0 && b.node == 0 {
            return Self::constant(value);
        }
        Self { value, node: TAPE.with_borrow_mut(|tape| tape.combine(kind, a.node, b.node)) }
    }

    fn function(self, value: f64) -> Self {
        Self::combine(Kind::General, value, self, self)
    }

    fn linear_function(self, value: f64) -> Self {
        Self { value, node: self.node }
    }

    /// The value, read for a decision.
    fn decision_value(&self) -> f64 {
        if self.node != 0 {
            TAPE.with_borrow_mut(|tape| tape.value_was_read = true);
        }
        self.value
    }
}

macro_rules! operator {
    ($($trait:ident $method:ident, $assign:ident $assign_method:ident, $kind:ident;)*) => {$(
        impl $trait for Tracked {
            type Output = Self;
            fn $method(self, b: Self) -> Self {
                Self::combine(Kind::$kind, $trait::$method(self.value, b.value), self, b)
            }
        }
        impl $trait<&Tracked> for Tracked {
            type Output = Self;
            fn $method(self, b: &Self) -> Self {
                $trait::$method(self, *b)
            }
        }
        impl $trait<f64> for Tracked {
            type Output = Self;
            fn $method(self, b: f64) -> Self {
                $trait::$method(self, Self::constant(b))
            }
        }
        impl $assign for Tracked {
            fn $assign_method(&mut self, b: Self) {
                *self = $trait::$method(*self, b);
            }
        }
        impl $assign<f64> for Tracked {
            fn $assign_method(&mut self, b: f64) {
                *self = $trait::$method(*self, b);
            }
        }
    )*};
}

operator! {
    Add add, AddAssign add_assign, Linear;
    Sub sub, SubAssign sub_assign, Linear;
    Mul mul, MulAssign mul_assign, Product;
    Div div, DivAssign div_assign, Quotient;
    Rem rem, RemAssign rem_assign, General;
}

impl Neg for Tracked {
    type Output = Self;
    fn neg(self) -> Self {
        self.linear_function(-self.value)
    }
}

impl Neg for &Tracked {
    type Output = Tracked;
    fn neg(self) -> Tracked {
        -*self
    }
}

impl PartialEq for Tracked {
    fn eq(&self, other: &Self) -> bool {
        self.decision_value() == other.decision_value()
    }
}

impl PartialOrd for Tracked {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.decision_value().partial_cmp(&other.decision_value())
    }
}

impl PartialEq<f64> for Tracked {
    fn eq(&self, other: &f64) -> bool {
        self.decision_value() == *other
    }
}

impl PartialOrd<f64> for Tracked {
    fn partial_cmp(&self, other: &f64) -> Option<Ordering> {
        self.decision_value().partial_cmp(other)
    }
}

impl fmt::Display for Tracked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.decision_value(), f)
    }
}

impl fmt::Debug for Tracked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&self.decision_value(), f)
    }
}

impl From<f64> for Tracked {
    fn from(value: f64) -> Self {
        Self::constant(value)
    }
}

impl Zero for Tracked {
    fn zero() -> Self {
        Self::constant(0.0)
    }
    fn is_zero(&self) -> bool {
        self.decision_value() == 0.0
    }
}

impl One for Tracked {
    fn one() -> Self {
        Self::constant(1.0)
    }
}

impl Num for Tracked {
    type FromStrRadixErr = <f64 as Num>::FromStrRadixErr;
    fn from_str_radix(text: &str, radix: u32) -> Result<Self, Self::FromStrRadixErr> {
        f64::from_str_radix(text, radix).map(Self::constant)
    }
}

impl Signed for Tracked {
    fn abs(&self) -> Self {
        self.function(self.value.abs())
    }
    fn abs_sub(&self, other: &Self) -> Self {
        Self::combine(Kind::General, (self.value - other.value).max(0.0), *self, *other)
    }
    fn signum(&self) -> Self {
        self.function(self.value.signum())
    }
    fn is_positive(&self) -> bool {
        self.decision_value().is_sign_positive()
    }
    fn is_negative(&self) -> bool {
        self.decision_value().is_sign_negative()
    }
}

impl FromPrimitive for Tracked {
    fn from_i64(n: i64) -> Option<Self> {
        f64::from_i64(n).map(Self::constant)
    }
    fn from_u64(n: u64) -> Option<Self> {
        f64::from_u64(n).map(Self::constant)
    }
    fn from_f64(n: f64) -> Option<Self> {
        Some(Self::constant(n))
    }
}

impl Inv for Tracked {
    type Output = Self;
    fn inv(self) -> Self {
        DualNum::recip(&self)
    }
}

impl Sum for Tracked {
    fn sum<I: Iterator<Item = Self>>(iterator: I) -> Self {
        iterator.fold(Self::zero(), Add::add)
    }
}

impl Product for Tracked {
    fn product<I: Iterator<Item = Self>>(iterator: I) -> Self {
        iterator.fold(Self::one(), Mul::mul)
    }
}

impl DualStruct for Tracked {
    type Real = f64;
    type Inner = f64;
    fn re(&self) -> f64 {
        self.decision_value()
    }
    fn from_inner(inner: &f64) -> Self {
        Self::constant(*inner)
    }
}

impl Mappable<Self> for Tracked {
    type Output<O> = O;
    fn map_dual<M: Fn(Self) -> O, O>(self, f: M) -> O {
        f(self)
    }
}

macro_rules! functions {
    ($($name:ident)*) => {$(
        fn $name(&self) -> Self {
            self.function(DualNum::$name(&self.value))
        }
    )*};
}

impl DualNum for Tracked {
    type Primitive = f64;
    // Second derivatives are tracked as well.
    const NDERIV: usize = 2;
    type InnerDual = f64;

    fn from_re(re: f64) -> Self {
        Self::constant(re)
    }
    fn scale(self, factor: &f64) -> Self {
        self.linear_function(self.value * factor)
    }
    fn powi(&self, n: i32) -> Self {
        self.function(self.value.powi(n))
    }
    fn powf(&self, n: f64) -> Self {
        self.function(self.value.powf(n))
    }
    fn log(&self, base: f64) -> Self {
        self.function(self.value.log(base))
    }
    fn sin_cos(&self) -> (Self, Self) {
        (DualNum::sin(self), DualNum::cos(self))
    }
    fn atan2(&self, other: Self) -> Self {
        Self::combine(Kind::General, self.value.atan2(other.value), *self, other)
    }
    fn powd(&self, exponent: Self) -> Self {
        Self::combine(Kind::General, self.value.powf(exponent.value), *self, exponent)
    }
    functions!(recip sqrt cbrt exp exp2 exp_m1 ln log2 log10 ln_1p sin cos tan asin acos atan sinh cosh tanh
        asinh acosh atanh sph_j0 sph_j1 sph_j2);
}
