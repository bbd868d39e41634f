//! Tables: functions whose numbers only the compiler knows. A derivative of a table is the table
//! with another order.

use super::{Binary, Graph, Node, Unary};
use std::f64::consts::FRAC_PI_2;

/// A derivative of a table of `K` variables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Table<const K: usize> {
    /// Its index in the model's list.
    pub index: u32,
    /// The order of the derivative with respect to each variable.
    pub orders: [u8; K],
    /// Derivatives of higher order with respect to one variable are zero.
    pub degree: u8,
}

/// The order that identifies the piece if the first derivative jumps between pieces, and is zero
/// otherwise.
const KINKS: u8 = 254;
/// The order that identifies the piece if a higher derivative jumps.
const KNOTS: u8 = 255;

impl<const K: usize> Table<K> {
    /// The numbers that identify the pieces of a table with kinks, and of a smoother one. Only the
    /// compiler knows which of both the table is.
    pub fn piece_indicators(self) -> [Self; 2] {
        [KINKS, KNOTS].map(|order| Self { orders: [order; K], ..self })
    }

    /// The derivative with respect to a variable, unless it is zero.
    fn derivative(mut self, variable: usize) -> Option<Self> {
        self.orders[variable] += 1;
        (self.orders[variable] <= self.degree).then_some(self)
    }

    /// Values at sample points, which replace the unknown numbers: those of a product of sines,
    /// with consistent derivatives.
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

    /// The derivative of a table of two variables with respect to the first or the second one.
    pub(super) fn table_partial(&mut self, table: Table<2>, a: Node, b: Node, first: bool) -> Node {
        match table.derivative(usize::from(!first)) {
            Some(table) => self.binary(Binary::Table(table), a, b),
            None => self.constant(0.0),
        }
    }
}
