//! The order in which a function computes: depth first from its outputs, so that values are used soon
//! after they are there and a compiler can keep them in registers.

use crate::graph::{Graph, Node, Op, Unary};
use std::collections::HashMap;

/// One statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Compute a node.
    Compute(Node),
    /// Compute the sine and the cosine of the same argument.
    SinCos(Node, Node),
    /// Store an output, by its index in the list of outputs.
    Store(usize),
}

/// The operands of an operation.
pub fn operands(op: Op) -> impl Iterator<Item = Node> {
    let list = match op {
        Op::Constant(_) | Op::Variable(_) | Op::Opaque(_) | Op::Seed(_) => [None; 3],
        Op::Unary(_, a) | Op::Powi(a, _) | Op::Not(a) => [Some(a), None, None],
        Op::Binary(_, a, b) | Op::Compare(_, a, b) | Op::And(a, b) | Op::Or(a, b) => [Some(a), Some(b), None],
        Op::Select(condition, a, b) => [Some(condition), Some(a), Some(b)],
    };
    list.into_iter().flatten()
}

/// Whether a node is there before anything is computed.
pub fn is_leaf(op: Op) -> bool {
    operands(op).next().is_none()
}

/// The statements that compute the outputs, each operand before its uses.
pub fn schedule(graph: &Graph, outputs: &[Node]) -> Vec<Step> {
    let Some(last) = outputs.iter().map(|node| node.0 as usize).max() else {
        return Vec::new();
    };
    let op = |index: usize| graph.op(Node(index as u32));

    let mut needed = vec![false; last + 1];
    for output in outputs {
        needed[output.0 as usize] = true;
    }
    for index in (0..=last).rev() {
        if needed[index] {
            operands(op(index)).for_each(|node| needed[node.0 as usize] = true);
        }
    }

    // Registers that a subtree needs (Sethi and Ullman): the hungrier operand comes first.
    let mut registers = vec![0u32; last + 1];
    let mut pairs: HashMap<Node, (Option<Node>, Option<Node>)> = HashMap::new();
    for index in (0..=last).filter(|&index| needed[index]) {
        let mut needs: Vec<u32> = operands(op(index)).map(|node| registers[node.0 as usize]).collect();
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
            let index = node.0 as usize;
            if done[index] {
                continue;
            }
            if !ready {
                stack.push((node, true));
                let mut list: Vec<Node> = operands(op(index)).filter(|node| !done[node.0 as usize]).collect();
                list.reverse();
                list.sort_by_key(|node| registers[node.0 as usize]);
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
                done[sin.0 as usize] = true;
                done[cos.0 as usize] = true;
                steps.push(Step::SinCos(sin, cos));
            } else {
                steps.push(Step::Compute(node));
            }
        }
        steps.push(Step::Store(number));
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::Binary;

    /// Every operand is computed before its use, every value once, every output stored once.
    fn check(graph: &Graph, outputs: &[Node]) -> Vec<Step> {
        let steps = schedule(graph, outputs);
        let mut computed = std::collections::HashSet::new();
        let mut stored = vec![false; outputs.len()];
        let ready = |computed: &std::collections::HashSet<Node>, node| {
            is_leaf(graph.op(node)) || computed.contains(&node)
        };
        for &step in &steps {
            match step {
                Step::Compute(node) => {
                    assert!(operands(graph.op(node)).all(|operand| ready(&computed, operand)));
                    assert!(computed.insert(node));
                }
                Step::SinCos(sin, cos) => {
                    assert!(operands(graph.op(sin)).all(|operand| ready(&computed, operand)));
                    assert!(computed.insert(sin) && computed.insert(cos));
                }
                Step::Store(output) => {
                    assert!(ready(&computed, outputs[output]));
                    assert!(!std::mem::replace(&mut stored[output], true));
                }
            }
        }
        assert!(stored.iter().all(|&stored| stored));
        steps
    }

    #[test]
    fn sine_and_cosine_of_one_argument_are_one_statement() {
        let mut g = Graph::default();
        let x = g.variable(0);
        let (s, c) = (g.unary(Unary::Sin, x), g.unary(Unary::Cos, x));
        let product = g.binary(Binary::Mul, s, c);
        assert_eq!(check(&g, &[product]), [Step::SinCos(s, c), Step::Compute(product), Step::Store(0)]);
        // The cosine alone is not accompanied by a sine that nobody asked for.
        assert_eq!(check(&g, &[c]), [Step::Compute(c), Step::Store(0)]);
    }

    #[test]
    fn unused_nodes_are_not_computed_and_leaves_are_no_statements() {
        let mut g = Graph::default();
        let x = g.variable(0);
        let unused = g.unary(Unary::Exp, x);
        let two = g.constant(2.0);
        assert_eq!(check(&g, &[x, two]), [Step::Store(0), Step::Store(1)]);
        assert!(!check(&g, &[x]).contains(&Step::Compute(unused)));
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
