//! Moves negations into constants: `−(x (2 y))` becomes `x (−2 y)`, whose factor other entries may
//! share. Rounding does not depend on signs, so that only the sign of a zero changes.

use super::{Binary, Entry, Graph, Node, Op, Unary};

/// Maximum depth to which a sign is moved, which keeps the work linear.
const MAX_SIGN_DEPTH: usize = 4;

impl Graph {
    /// Entries with negations moved into constants, if that reduces the operations of entries and
    /// `beside`; otherwise unchanged.
    pub(super) fn with_folded_signs(&mut self, entries: Vec<Entry>, beside: &[Node]) -> Vec<Entry> {
        let signed: Vec<Entry> = entries
            .iter()
            .map(|&(row, column, value)| match self.op(value) {
                Op::Unary(Unary::Neg, inner) => {
                    (row, column, self.negate_without_cost(inner, MAX_SIGN_DEPTH).unwrap_or(value))
                }
                _ => (row, column, value),
            })
            .collect();
        let operations = |entries: &[Entry]| {
            let nodes: Vec<Node> =
                beside.iter().copied().chain(entries.iter().map(|entry| entry.2)).collect();
            self.operation_count(&nodes)
        };
        if operations(&signed) < operations(&entries) { signed } else { entries }
    }

    /// `−a` without an additional operation.
    fn negate_without_cost(&mut self, a: Node, depth: usize) -> Option<Node> {
        let depth = depth.checked_sub(1)?;
        match self.op(a) {
            Op::Constant(bits) => Some(self.constant(-f64::from_bits(bits))),
            Op::Unary(Unary::Neg, inner) => Some(inner),
            Op::Binary(Binary::Sub, x, y) => Some(self.binary(Binary::Sub, y, x)),
            Op::Binary(Binary::Add, x, y) => {
                if let Some(x) = self.negate_without_cost(x, depth) {
                    return Some(self.binary(Binary::Sub, x, y));
                }
                let y = self.negate_without_cost(y, depth)?;
                Some(self.binary(Binary::Sub, y, x))
            }
            Op::Binary(function @ (Binary::Mul | Binary::Div), x, y) => {
                if let Some(x) = self.negate_without_cost(x, depth) {
                    return Some(self.binary(function, x, y));
                }
                let y = self.negate_without_cost(y, depth)?;
                Some(self.binary(function, x, y))
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::EvaluationPoint;

    #[test]
    fn signs_go_where_they_are_free() {
        let mut g = Graph::default();
        let [x, y, z] = [0, 1, 2].map(|index| g.variable(index));
        let (two, half) = (g.constant(2.0), g.constant(0.3));
        let (twice, part) = (g.binary(Binary::Mul, two, y), g.binary(Binary::Mul, half, z));
        let product = g.binary(Binary::Mul, x, twice);
        let other = g.binary(Binary::Mul, z, x);
        let sum = g.binary(Binary::Add, product, other);
        let quotient = g.binary(Binary::Div, part, x);
        let values = [product, sum, quotient].map(|value| g.unary(Unary::Neg, value));
        let entries: Vec<Entry> = (0..).zip(values).map(|(row, value)| (row, 0, value)).collect();
        let before: Vec<Node> = entries.iter().map(|entry| entry.2).collect();
        let signed = g.with_folded_signs(entries, &[]);
        let after: Vec<Node> = signed.iter().map(|entry| entry.2).collect();
        assert_eq!((g.operation_count(&before), g.operation_count(&after)), (9, 6));
        let at = [0.7, -1.3, 0.9];
        let point = EvaluationPoint { variables: &at, ..Default::default() };
        assert_eq!(g.evaluate(&before, point), g.evaluate(&after, point));

        // No constant to absorb the sign.
        let negative = g.unary(Unary::Neg, other);
        assert_eq!(g.with_folded_signs(vec![(0, 0, negative)], &[]), [(0, 0, negative)]);
    }
}
