//! The dependence of nodes on variables, and its linearity.

use super::{Binary, Graph, Node, Op, Unary};

/// The dependence of a node on a set of variables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Degree {
    /// Independent of the variables.
    Constant,
    /// An affine function.
    Linear,
    /// Any other function.
    Nonlinear,
}

impl Graph {
    /// For each node the indices of the variables on which it depends, ascending.
    pub fn dependencies(&self, nodes: &[Node]) -> Vec<Vec<u32>> {
        let reachable = self.reachable(nodes);
        let variable = |node: &Node| match self.op(*node) {
            Op::Variable(index) => Some(index as usize),
            _ => None,
        };
        let Some(largest) = reachable.iter().filter_map(variable).max() else {
            return vec![Vec::new(); nodes.len()];
        };
        // One row of bits for each reachable node.
        let words = largest / 64 + 1;
        let mut row = vec![usize::MAX; self.len()];
        let mut bits = vec![0u64; words * reachable.len()];
        for (position, node) in reachable.iter().enumerate() {
            row[node.at()] = position;
            let (below, this) = bits.split_at_mut(position * words);
            if let Some(index) = variable(node) {
                this[index / 64] |= 1 << (index % 64);
            }
            for operand in self.op(*node).operands() {
                let from = &below[row[operand.at()] * words..][..words];
                this.iter_mut().zip(from).for_each(|(to, from)| *to |= from);
            }
        }
        let set = |node: &Node| {
            let bits = &bits[row[node.at()] * words..][..words];
            (0..words * 64).filter(|i| bits[i / 64] >> (i % 64) & 1 == 1).map(|i| i as u32).collect()
        };
        nodes.iter().map(set).collect()
    }

    /// For each node its joint dependence on the variables of a set.
    pub fn degrees(&self, nodes: &[Node], set: impl Fn(u32) -> bool) -> Vec<Degree> {
        use Degree::{Constant, Linear, Nonlinear};
        let mut degrees = vec![Constant; self.len()];
        for node in self.reachable(nodes) {
            let at = |node: Node| degrees[node.at()];
            let all = |op: Op| op.operands().map(at).max().unwrap_or(Constant);
            let op = self.op(node);
            degrees[node.at()] = match op {
                Op::Variable(index) if set(index) => Linear,
                Op::Unary(Unary::Neg, _) | Op::Binary(Binary::Add | Binary::Sub, ..) => all(op),
                Op::Binary(Binary::Mul, a, b) if at(a) == Constant || at(b) == Constant => all(op),
                Op::Binary(Binary::Div, a, b) if at(b) == Constant => at(a),
                Op::Select(condition, a, b) if at(condition) == Constant => at(a).max(at(b)),
                _ if all(op) == Constant => Constant,
                _ => Nonlinear,
            };
        }
        nodes.iter().map(|node| degrees[node.at()]).collect()
    }
}
