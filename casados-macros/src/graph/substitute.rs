//! Expressions in the place of variables.

use super::{Graph, Node, Op};
use std::collections::BTreeMap;

impl Graph {
    /// Outputs with expressions in the place of variables, all at once.
    pub fn substitute(&mut self, outputs: &[Node], by: &BTreeMap<u32, Node>) -> Vec<Node> {
        let nodes = self.reachable(outputs);
        let mut new: Vec<Node> = (0..nodes.last().map_or(0, |node| node.0 + 1)).map(Node).collect();
        for node in nodes {
            let at = |node: Node| new[node.at()];
            let op = self.op(node);
            // What does not change keeps its node.
            if op.operands().all(|operand| at(operand) == operand) {
                if let Op::Variable(index) = op
                    && let Some(&expression) = by.get(&index)
                {
                    new[node.at()] = expression;
                }
                continue;
            }
            new[node.at()] = match op {
                Op::Constant(_) | Op::Variable(_) | Op::Opaque(_) | Op::Seed(_) => node,
                Op::Unary(function, a) => self.unary(function, at(a)),
                Op::Binary(function, a, b) => self.binary(function, at(a), at(b)),
                Op::Powi(a, n) => self.powi(at(a), n),
                Op::Select(condition, a, b) => self.select(at(condition), at(a), at(b)),
                Op::Compare(comparison, a, b) => self.compare(comparison, at(a), at(b)),
                Op::And(a, b) => self.and(at(a), at(b)),
                Op::Or(a, b) => self.or(at(a), at(b)),
                Op::Not(a) => self.not(at(a)),
            };
        }
        outputs.iter().map(|output| new[output.at()]).collect()
    }
}
