//! The order of statements: depth first from the outputs, so that values are used soon after they
//! are computed, and stay in registers.

use crate::graph::{Graph, Node, Op, Unary};
use std::collections::HashMap;

/// One statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Statement {
    /// Compute a node.
    Compute(Node),
    /// Compute the sine and the cosine of the same argument.
    SinCos(Node, Node),
    /// Compute the same elementary function of two or four independent arguments.
    Together([Option<Values>; 4]),
    /// Store an output, by its index in the list of outputs.
    Store(usize),
}

/// The nodes of the values of an elementary function: one for most, two for sine and cosine.
pub type Values = (Node, Option<Node>);

/// Whether a node needs no computation.
pub fn is_leaf(op: Op) -> bool {
    op.operands().next().is_none()
}

/// The statements that compute the outputs, each operand before its uses.
pub fn schedule(graph: &Graph, outputs: &[Node]) -> Vec<Statement> {
    let Some(last) = outputs.iter().map(|node| node.at()).max() else {
        return Vec::new();
    };
    let op = |index: usize| graph.op(Node(index as u32));

    // The number of registers that a subtree needs (Sethi and Ullman): the operand with more
    // registers comes first.
    let mut registers = vec![0u32; last + 1];
    let mut pairs: HashMap<Node, (Option<Node>, Option<Node>)> = HashMap::new();
    for index in graph.reachable(outputs).into_iter().map(Node::at) {
        let mut needs: Vec<u32> = op(index).operands().map(|node| registers[node.at()]).collect();
        needs.sort_unstable_by(|a, b| b.cmp(a));
        registers[index] = (0..).zip(&needs).map(|(held, need)| held + need).max().unwrap_or(0).max(1);
        match op(index) {
            Op::Unary(Unary::Sin, a) => pairs.entry(a).or_default().0 = Some(Node(index as u32)),
            Op::Unary(Unary::Cos, a) => pairs.entry(a).or_default().1 = Some(Node(index as u32)),
            _ => {}
        }
    }

    let mut done = vec![false; last + 1];
    let mut steps = Vec::new();
    let mut stack = Vec::new();
    for (number, &output) in outputs.iter().enumerate() {
        stack.push((output, false));
        while let Some((node, ready)) = stack.pop() {
            let index = node.at();
            if done[index] {
                continue;
            }
            if !ready {
                stack.push((node, true));
                let mut list: Vec<Node> = op(index).operands().filter(|node| !done[node.at()]).collect();
                list.reverse();
                list.sort_by_key(|node| registers[node.at()]);
                stack.extend(list.into_iter().map(|node| (node, false)));
                continue;
            }
            done[index] = true;
            if is_leaf(op(index)) {
                continue;
            }
            let pair = match op(index) {
                Op::Unary(Unary::Sin | Unary::Cos, a) => pairs.get(&a).copied(),
                _ => None,
            };
            if let Some((Some(sin), Some(cos))) = pair {
                done[sin.at()] = true;
                done[cos.at()] = true;
                steps.push(Statement::SinCos(sin, cos));
            } else {
                steps.push(Statement::Compute(node));
            }
        }
        steps.push(Statement::Store(number));
    }
    steps
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::emit::chunk::read;
    use crate::graph::Binary;

    fn check(graph: &Graph, outputs: &[Node]) -> Vec<Statement> {
        let steps = schedule(graph, outputs);
        assert_complete(graph, outputs, &steps);
        steps
    }

    /// Checks that every operand is computed before its use, every value once, and every output
    /// stored once.
    pub fn assert_complete(graph: &Graph, outputs: &[Node], steps: &[Statement]) {
        let mut computed = std::collections::HashSet::new();
        let mut stored = vec![false; outputs.len()];
        let ready = |computed: &std::collections::HashSet<Node>, node| {
            is_leaf(graph.op(node)) || computed.contains(&node)
        };
        for &step in steps {
            assert!(read(graph, outputs, step).all(|node| ready(&computed, node)));
            assert!(crate::emit::chunk::computed(step).all(|node| computed.insert(node)));
            if let Statement::Store(output) = step {
                assert!(!std::mem::replace(&mut stored[output], true));
            }
        }
        assert!(stored.iter().all(|&stored| stored));
    }

    #[test]
    fn sine_and_cosine_of_one_argument_are_one_statement() {
        let mut g = Graph::default();
        let x = g.variable(0);
        let (s, c) = (g.unary(Unary::Sin, x), g.unary(Unary::Cos, x));
        let product = g.binary(Binary::Mul, s, c);
        assert_eq!(
            check(&g, &[product]),
            [Statement::SinCos(s, c), Statement::Compute(product), Statement::Store(0)]
        );
        // A cosine without a needed sine is computed alone.
        assert_eq!(check(&g, &[c]), [Statement::Compute(c), Statement::Store(0)]);
    }

    #[test]
    fn unused_nodes_are_not_computed_and_leaves_are_no_statements() {
        let mut g = Graph::default();
        let x = g.variable(0);
        let unused = g.unary(Unary::Exp, x);
        let two = g.constant(2.0);
        assert_eq!(check(&g, &[x, two]), [Statement::Store(0), Statement::Store(1)]);
        assert!(!check(&g, &[x]).contains(&Statement::Compute(unused)));
        assert_eq!(schedule(&g, &[]), []);
    }

    #[test]
    fn a_long_chain_does_not_recurse() {
        let mut g = Graph::default();
        let x = g.variable(0);
        let mut node = x;
        for _ in 0..100_000 {
            let next = g.unary(Unary::Atan, node);
            node = g.binary(Binary::Add, x, next);
        }
        assert_eq!(check(&g, &[node]).len(), 200_001);
    }
}
