//! Forward mode: the derivative of nodes in one direction.

use super::{Graph, Node, Op};

/// The derivative of outputs along the rates of variables; variables without a rate are constant.
pub fn tangent(graph: &mut Graph, outputs: &[Node], rate: impl Fn(u32) -> Option<Node>) -> Vec<Node> {
    let nodes = graph.reachable(outputs);
    let mut rates: Vec<Option<Node>> = vec![None; nodes.last().map_or(0, |node| node.at() + 1)];
    for node in nodes {
        rates[node.at()] = match graph.op(node) {
            Op::Variable(index) => rate(index),
            _ => {
                let mut sum: Option<Node> = None;
                let moving: Vec<Node> =
                    graph.op(node).operands().filter(|operand| rates[operand.at()].is_some()).collect();
                let parts = if moving.is_empty() {
                    [None; 2]
                } else {
                    graph.partials(node, |operand| moving.contains(&operand))
                };
                for (operand, partial) in parts.into_iter().flatten() {
                    let Some(rate) = rates[operand.at()] else { continue };
                    let term = graph.simplified_mul(partial, rate);
                    sum = Some(sum.map_or(term, |sum| graph.simplified_add(sum, term)));
                }
                sum.filter(|&sum| !graph.is_zero(sum))
            }
        };
    }
    let zero = graph.constant(0.0);
    outputs.iter().map(|output| rates[output.at()].unwrap_or(zero)).collect()
}
