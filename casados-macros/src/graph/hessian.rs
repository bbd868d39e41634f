//! The sparse Hessian of `μᵀ f`.

use super::elimination::{LinearisedGraph, Order};
use super::jacobian::{VertexNumbering, cheapest_order};
use super::reverse::adjoints;
use super::{Entry, Graph, Node};

/// The structural non-zeros `(j, k, value)`, `j ≥ k`, of the Hessian of `Σ seed · output` with
/// respect to the variables `0..variables`, by row, then column. The cheaper of two elimination
/// orders.
pub fn hessian(graph: &mut Graph, outputs: &[(Node, Node)], variables: u32) -> Vec<Entry> {
    cheapest_order(graph, &[Order::Reverse, Order::Markowitz], &[], |graph, order, budget| {
        hessian_in_order(graph, outputs, variables, order, budget)
    })
}

/// The Hessian by one elimination order, and its number of products; `None` if it exceeds `budget`.
///
/// Second derivatives arise at the operands of nonlinear nodes, weighted with the adjoints of these
/// nodes, and are pushed from there to the variables.
pub fn hessian_in_order(
    graph: &mut Graph,
    outputs: &[(Node, Node)],
    variables: u32,
    order: Order,
    budget: usize,
) -> Option<(Vec<Entry>, usize)> {
    let active = graph.active_nodes(outputs.iter().map(|output| output.0), variables);
    let adjoints = adjoints(graph, outputs, &active);
    let is_active = |node: Node| active[node.at()];
    let mut arcs = Vec::new();
    for (node, adjoint) in (0..).map(Node).zip(&adjoints) {
        if let Some(adjoint) = *adjoint {
            arcs.extend(graph.second_partials(node, adjoint, is_active));
        }
    }
    // Only vertices below an arc are needed.
    let mut needed = vec![false; active.len()];
    for &(j, k, _) in &arcs {
        needed[j.at()] = true;
        needed[k.at()] = true;
    }
    for node in (0..active.len() as u32).rev().map(Node) {
        if needed[node.at()] {
            graph.op(node).operands().filter(|&operand| is_active(operand)).for_each(|operand| {
                needed[operand.at()] = true;
            });
        }
    }
    let nodes: Vec<Node> = (0..active.len() as u32).map(Node).filter(|node| needed[node.at()]).collect();
    let vertices = VertexNumbering::new(graph, &nodes, variables, active.len());
    let mut linearised = LinearisedGraph::new(vertices.count as usize);
    for &node in &nodes {
        for (operand, partial) in graph.partials(node, is_active).into_iter().flatten() {
            linearised.add_edge(graph, vertices.of(operand), vertices.of(node), partial);
        }
    }
    for (j, k, value) in arcs {
        linearised.add_arc(graph, vertices.of(j), vertices.of(k), value);
    }
    let products = linearised.eliminate(graph, variables..vertices.count, order, budget)?;
    let rows = &linearised.arcs[..variables as usize];
    let entries = (0..)
        .zip(rows)
        .flat_map(|(row, entries)| entries.range(..=row).map(move |(&column, &value)| (row, column, value)));
    Some((entries.collect(), products))
}
