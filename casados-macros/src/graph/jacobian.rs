//! The sparse Jacobian.

use super::elimination::{LinearisedGraph, Order};
use super::{Entry, Graph, Node, Op};

/// The structural non-zeros `(output, variable, value)` of the Jacobian of outputs with respect to
/// the variables `0..variables`, by output, then variable. The elimination order with the fewest
/// operations for outputs and Jacobian.
pub fn jacobian(graph: &mut Graph, outputs: &[Node], variables: u32) -> Vec<Entry> {
    cheapest_order(
        graph,
        &[Order::Reverse, Order::Markowitz, Order::Forward],
        outputs,
        |graph, order, budget| jacobian_in_order(graph, outputs, variables, order, budget),
    )
}

/// Tries elimination orders on copies of the graph; returns the one with the fewest operations.
pub fn cheapest_order(
    graph: &mut Graph,
    orders: &[Order],
    beside: &[Node],
    derive: impl Fn(&mut Graph, Order, usize) -> Option<(Vec<Entry>, usize)>,
) -> Vec<Entry> {
    let mut best: Option<(u32, Graph, Vec<Entry>)> = None;
    let mut budget = usize::MAX;
    for &order in orders {
        let mut copy = graph.clone();
        let Some((entries, products)) = derive(&mut copy, order, budget) else { continue };
        // An order may take at most about twice the products of the best one.
        budget = budget.min(products.saturating_mul(2).saturating_add(1000));
        let entries = copy.with_folded_signs(entries, beside);
        let needed: Vec<Node> = beside.iter().copied().chain(entries.iter().map(|entry| entry.2)).collect();
        let operations = copy.operation_count(&needed);
        if best.as_ref().is_none_or(|best| operations < best.0) {
            best = Some((operations, copy, entries));
        }
    }
    let Some((_, copy, entries)) = best else { return Vec::new() };
    *graph = copy;
    entries
}

/// The Jacobian by one elimination order, and its number of products; `None` if it exceeds
/// `budget`.
pub fn jacobian_in_order(
    graph: &mut Graph,
    outputs: &[Node],
    variables: u32,
    order: Order,
    budget: usize,
) -> Option<(Vec<Entry>, usize)> {
    let active = graph.active_nodes(outputs.iter().copied(), variables);
    let nodes: Vec<Node> = graph.reachable(outputs).into_iter().filter(|node| active[node.at()]).collect();
    let vertices = VertexNumbering::new(graph, &nodes, variables, active.len());
    let mut linearised = LinearisedGraph::new(vertices.count as usize + outputs.len());
    for &node in &nodes {
        for (operand, partial) in graph.partials(node, |operand| active[operand.at()]).into_iter().flatten() {
            linearised.add_edge(graph, vertices.of(operand), vertices.of(node), partial);
        }
    }
    let one = graph.constant(1.0);
    for (row, &output) in (vertices.count..).zip(outputs) {
        if active[output.at()] {
            linearised.add_edge(graph, vertices.of(output), row, one);
        }
    }
    let products = linearised.eliminate(graph, variables..vertices.count, order, budget)?;
    let rows = &linearised.into[vertices.count as usize..];
    let entries = (0..)
        .zip(rows)
        .flat_map(|(row, entries)| entries.iter().map(move |(&variable, &value)| (row, variable, value)));
    Some((entries.collect(), products))
}

/// The numbering of vertices: variables keep their indices, intermediate nodes follow in
/// topological order.
pub struct VertexNumbering {
    of: Vec<u32>,
    /// The number of vertices.
    pub count: u32,
}

impl VertexNumbering {
    /// Numbers the variables and the given nodes.
    pub fn new(graph: &Graph, nodes: &[Node], variables: u32, len: usize) -> Self {
        let mut of = vec![u32::MAX; len];
        let mut count = variables;
        for &node in nodes {
            of[node.at()] = match graph.op(node) {
                Op::Variable(index) => index,
                _ => {
                    count += 1;
                    count - 1
                }
            };
        }
        Self { of, count }
    }

    /// The vertex of a node.
    pub fn of(&self, node: Node) -> u32 {
        self.of[node.at()]
    }
}
