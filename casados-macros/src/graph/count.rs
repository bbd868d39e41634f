//! The nodes and operations that outputs require.

use super::{Graph, Node, Op};

impl Graph {
    /// The nodes on which outputs depend, themselves included, operands first.
    pub fn reachable(&self, outputs: &[Node]) -> Vec<Node> {
        let Some(&last) = outputs.iter().max() else { return Vec::new() };
        let mut needed = vec![false; last.at() + 1];
        for output in outputs {
            needed[output.at()] = true;
        }
        let mut nodes = Vec::new();
        for index in (0..=last.0).rev().map(Node) {
            if needed[index.at()] {
                nodes.push(index);
                for operand in self.op(index).operands() {
                    needed[operand.at()] = true;
                }
            }
        }
        nodes.reverse();
        nodes
    }

    /// The number of operations for all outputs; an elementary function counts as one.
    pub fn operation_count(&self, outputs: &[Node]) -> u32 {
        let leaf = |node: &&Node| {
            matches!(self.op(**node), Op::Constant(_) | Op::Variable(_) | Op::Opaque(_) | Op::Seed(_))
        };
        let nodes = self.reachable(outputs);
        (nodes.len() - nodes.iter().filter(leaf).count()) as u32
    }
}
