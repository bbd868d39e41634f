//! Substitution of variables by expressions.

use super::{Graph, Node, Op};
use std::collections::BTreeMap;

impl Graph {
    /// Outputs with variables replaced by expressions, simultaneously.
    pub fn substitute(&mut self, outputs: &[Node], by: &BTreeMap<u32, Node>) -> Vec<Node> {
        let nodes = self.reachable(outputs);
        let mut new: Vec<Node> = (0..nodes.last().map_or(0, |node| node.0 + 1)).map(Node).collect();
        for node in nodes {
            let op = self.op(node);
            // An unchanged operation keeps its node.
            if op.operands().all(|operand| new[operand.at()] == operand) {
                if let Op::Variable(index) = op
                    && let Some(&expression) = by.get(&index)
                {
                    new[node.at()] = expression;
                }
                continue;
            }
            new[node.at()] = self.rebuild(op, |operand| new[operand.at()]);
        }
        outputs.iter().map(|output| new[output.at()]).collect()
    }

    /// An operation with replaced operands.
    pub fn rebuild(&mut self, op: Op, at: impl Fn(Node) -> Node) -> Node {
        match op {
            Op::Constant(bits) => self.constant(f64::from_bits(bits)),
            Op::Variable(index) => self.variable(index),
            Op::Opaque(index) => self.opaque(index),
            Op::Seed(index) => self.seed(index),
            Op::Unary(function, a) => self.unary(function, at(a)),
            Op::Binary(function, a, b) => self.binary(function, at(a), at(b)),
            Op::Powi(a, n) => self.powi(at(a), n),
            Op::Select(condition, a, b) => self.select(at(condition), at(a), at(b)),
            Op::Compare(comparison, a, b) => self.compare(comparison, at(a), at(b)),
            Op::And(a, b) => self.and(at(a), at(b)),
            Op::Or(a, b) => self.or(at(a), at(b)),
            Op::Not(a) => self.not(at(a)),
        }
    }
}
