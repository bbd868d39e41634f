//! A graph as text: one node in each line, operands first.

use super::{Graph, Node, Op};
use std::fmt::Write;

impl Graph {
    /// The nodes on which outputs depend; `#7` is node 7.
    pub fn print(&self, outputs: &[Node]) -> String {
        let mut text = String::new();
        for node in self.reachable(outputs) {
            let id = |node: Node| format!("#{}", node.0);
            let right = match self.op(node) {
                Op::Constant(bits) => format!("{:?}", f64::from_bits(bits)),
                Op::Variable(index) => format!("v[{index}]"),
                Op::Opaque(index) => format!("constant[{index}]"),
                Op::Seed(index) => format!("mu[{index}]"),
                Op::Powi(a, n) => format!("Powi #{} {n}", a.0),
                op => {
                    let name = match op {
                        Op::Unary(function, _) => format!("{function:?}"),
                        Op::Binary(function, ..) => format!("{function:?}"),
                        Op::Compare(comparison, ..) => format!("{comparison:?}"),
                        Op::Select(..) => "Select".into(),
                        Op::And(..) => "And".into(),
                        Op::Or(..) => "Or".into(),
                        _ => "Not".into(),
                    };
                    format!("{name} {}", op.operands().map(id).collect::<Vec<_>>().join(" "))
                }
            };
            // Writing to a string does not fail.
            let _ = writeln!(text, "{} = {right}", id(node));
        }
        text
    }
}
