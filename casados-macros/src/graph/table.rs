//! Tables: functions of which only the compiler knows the numbers. A derivative of a table is the
//! table with another order.

use super::{Binary, Graph, Node, Unary};
use std::f64::consts::FRAC_PI_2;

/// A derivative of a table of `K` variables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Table<const K: usize> {
    /// Its index in the model's list.
    pub index: u32,
    /// How often it is differentiated by each variable.
    pub orders: [u8; K],
    /// Derivatives of higher order by one variable are zero.
    pub degree: u8,
}

/// An order that stands for a number of each piece, where the first derivative jumps between them,
/// and is zero where it does not.
const KINKS: u8 = 254;
/// The same where a higher derivative jumps.
const KNOTS: u8 = 255;

impl<const K: usize> Table<K> {
    /// What changes between the pieces of a table with kinks, and of one that is smoother. Which it
    /// is the compiler knows.
    pub fn piece_indicators(self) -> [Self; 2] {
        [KINKS, KNOTS].map(|order| Self { orders: [order; K], ..self })
    }

    /// Its derivative by a variable, unless that is zero.
    fn derivative(mut self, variable: usize) -> Option<Self> {
        self.orders[variable] += 1;
        (self.orders[variable] <= self.degree).then_some(self)
    }

    /// Values for sample points, in the place of numbers that are not known here: of a product of
    /// sines, whose derivatives fit to each other.
    pub fn sample_value(self, at: [f64; K]) -> f64 {
        let mut phase = 0.4 + f64::from(self.index);
        let mut product = 1.0;
        for (a, order) in at.into_iter().zip(self.orders) {
            product *= (a + phase + FRAC_PI_2 * f64::from(order)).sin();
            phase += 0.3;
        }
        product
    }
}

impl Graph {
    /// The derivative of a table of one variable.
    pub(super) fn table_slope(&mut self, table: Table<1>, a: Node) -> Node {
        match table.derivative(0) {
            Some(table) => self.unary(Unary::Table(table), a),
            None => self.constant(0.0),
        }
    }

    /// The derivative of a table of two variables by the first or the second one.
    pub(super) fn table_partial(&mut self, table: Table<2>, a: Node, b: Node, first: bool) -> Node {
        match table.derivative(usize::from(!first)) {
            Some(table) => self.binary(Binary::Table(table), a, b),
            None => self.constant(0.0),
        }
    }
}
