//! Expressions with operators, for models in tests.

use crate::graph::{Binary, Compare, Graph, Node, Unary};
use std::cell::RefCell;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A node together with its graph.
#[derive(Clone, Copy)]
pub struct E<'g>(pub &'g RefCell<Graph>, pub Node);

impl<'g> E<'g> {
    pub fn variables(graph: &'g RefCell<Graph>, count: u32) -> Vec<Self> {
        (0..count).map(|index| E(graph, graph.borrow_mut().variable(index))).collect()
    }
    pub fn of(self, value: f64) -> Self {
        E(self.0, self.0.borrow_mut().constant(value))
    }
    pub fn unary(self, function: Unary) -> Self {
        E(self.0, self.0.borrow_mut().unary(function, self.1))
    }
    pub fn binary(self, function: Binary, other: Self) -> Self {
        E(self.0, self.0.borrow_mut().binary(function, self.1, other.1))
    }
    pub fn powi(self, n: i32) -> Self {
        E(self.0, self.0.borrow_mut().powi(self.1, n))
    }
    pub fn powf(self, exponent: f64) -> Self {
        self.binary(Binary::Powf, self.of(exponent))
    }
    pub fn sqrt(self) -> Self {
        self.unary(Unary::Sqrt)
    }
    /// `if self < other { a } else { b }`
    pub fn if_less(self, other: Self, a: Self, b: Self) -> Self {
        let mut graph = self.0.borrow_mut();
        let condition = graph.compare(Compare::Lt, self.1, other.1);
        E(self.0, graph.select(condition, a.1, b.1))
    }
}

impl Neg for E<'_> {
    type Output = Self;
    fn neg(self) -> Self {
        self.unary(Unary::Neg)
    }
}

macro_rules! operator {
    ($trait:ident, $name:ident) => {
        impl<'g> $trait for E<'g> {
            type Output = Self;
            fn $name(self, other: Self) -> Self {
                self.binary(Binary::$trait, other)
            }
        }
        impl<'g> $trait<f64> for E<'g> {
            type Output = Self;
            fn $name(self, other: f64) -> Self {
                self.binary(Binary::$trait, self.of(other))
            }
        }
        impl<'g> $trait<E<'g>> for f64 {
            type Output = E<'g>;
            fn $name(self, other: E<'g>) -> E<'g> {
                other.of(self).binary(Binary::$trait, other)
            }
        }
    };
}
operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

/// A small deterministic generator of numbers (splitmix64).
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
    /// Uniform in an interval.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }
}
