//! Reverse mode: `∇(μᵀ f)` at the cost of a few evaluations of `f`.

use super::{Graph, Node, Op};

/// The gradient of `Σ seed · output` with respect to the variables `0..variables`.
pub fn gradient(graph: &mut Graph, outputs: &[(Node, Node)], variables: u32) -> Vec<Node> {
    let active = graph.active_nodes(outputs.iter().map(|output| output.0), variables);
    let adjoints = adjoints(graph, outputs, &active);
    (0..variables)
        .map(|index| {
            let variable = graph.variable(index);
            adjoints.get(variable.at()).copied().flatten().unwrap_or_else(|| graph.constant(0.0))
        })
        .collect()
}

/// The adjoints of all active nodes that outputs depend on.
pub fn adjoints(graph: &mut Graph, outputs: &[(Node, Node)], active: &[bool]) -> Vec<Option<Node>> {
    let mut adjoints: Vec<Option<Node>> = vec![None; active.len()];
    let add = |graph: &mut Graph, sum: &mut Option<Node>, term: Node| {
        *sum = Some(match *sum {
            Some(sum) => graph.simplified_add(sum, term),
            None => term,
        });
    };
    for &(output, seed) in outputs {
        if active[output.at()] {
            add(graph, &mut adjoints[output.at()], seed);
        }
    }
    for index in (0..active.len()).rev() {
        let Some(adjoint) = adjoints[index] else { continue };
        let parts = graph.pull_back(Node(index as u32), adjoint, |operand| active[operand.at()]);
        for (operand, term) in parts.into_iter().flatten() {
            add(graph, &mut adjoints[operand.at()], term);
        }
    }
    adjoints
}

impl Graph {
    /// For every node up to the last output, whether it depends on the variables `0..variables`
    /// differentiably.
    pub(super) fn active_nodes(&self, outputs: impl Iterator<Item = Node>, variables: u32) -> Vec<bool> {
        let len = outputs.map(|output| output.at() + 1).max().unwrap_or(0);
        let mut active = vec![false; len];
        for index in 0..len {
            active[index] = match self.op(Node(index as u32)) {
                Op::Variable(variable) => variable < variables,
                Op::Unary(super::Unary::Signum, _) => false,
                Op::Unary(_, a) | Op::Powi(a, _) => active[a.at()],
                Op::Binary(_, a, b) | Op::Select(_, a, b) => active[a.at()] || active[b.at()],
                _ => false,
            };
        }
        active
    }
}
