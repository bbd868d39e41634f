//! Discontinuities of a model: numbers that change with a condition or the piece of a table.

use crate::graph::{Binary, Compare, Graph, Node, Op, Unary};

/// The number of conditions with a weight of their own, a power of two. Sums of weights are exact
/// in single precision up to sixteen times as many.
const MAX_CONDITION_WEIGHTS: usize = 20;

/// The discontinuities of a model's equations.
pub struct BranchIndicators {
    /// The number of conditions and tables.
    pub count: usize,
    /// `Σ 2ⁱ` over the conditions that hold, plus the pieces of linear tables.
    pub kinks: Node,
    /// The pieces of splines.
    pub knots: Node,
}

/// Finds the conditions of comparisons, of the signs in `abs` and `signum`, and the tables that may
/// change within an interval: `is_constant` tells which variables do not.
pub fn find(
    graph: &mut Graph,
    residual: &[Node],
    is_constant: impl Fn(u32) -> bool,
) -> Option<BranchIndicators> {
    let (mut conditions, mut kinks, mut knots) = (Vec::new(), Vec::new(), Vec::new());
    let zero = graph.constant(0.0);
    for node in graph.reachable(residual) {
        match graph.op(node) {
            Op::Compare(..) => conditions.push(node),
            Op::Unary(Unary::Abs | Unary::Signum, a) => conditions.push(graph.compare(Compare::Lt, a, zero)),
            Op::Unary(Unary::Table(table), a) => {
                let [kink, knot] = table.piece_indicators().map(|piece| graph.unary(Unary::Table(piece), a));
                kinks.push(kink);
                knots.push(knot);
            }
            Op::Binary(Binary::Table(table), a, b) => {
                let [kink, knot] =
                    table.piece_indicators().map(|piece| graph.binary(Binary::Table(piece), a, b));
                kinks.push(kink);
                knots.push(knot);
            }
            _ => {}
        }
    }
    let [conditions, kinks, knots] =
        [conditions, kinks, knots].map(|nodes| time_varying_nodes(graph, nodes, &is_constant));
    let count = conditions.len() + kinks.len();
    let mut weigh = |(index, condition): (usize, Node)| {
        let weight = graph.constant(f64::from(1u32 << (index % MAX_CONDITION_WEIGHTS)));
        graph.select(condition, weight, zero)
    };
    let weighted: Vec<Node> = conditions.into_iter().enumerate().map(&mut weigh).collect();
    let mut sum = |nodes: &[Node]| nodes.iter().fold(zero, |sum, &node| graph.binary(Binary::Add, sum, node));
    (count > 0).then(|| BranchIndicators {
        count,
        kinks: sum(&[weighted, kinks].concat()),
        knots: sum(&knots),
    })
}

/// The nodes that depend on varying variables, each once.
fn time_varying_nodes(graph: &Graph, mut nodes: Vec<Node>, is_constant: impl Fn(u32) -> bool) -> Vec<Node> {
    nodes.sort_unstable();
    nodes.dedup();
    let depend = graph.dependencies(&nodes);
    let changes = |on: &Vec<u32>| on.iter().any(|&variable| !is_constant(variable));
    nodes.into_iter().zip(depend).filter(|(_, on)| changes(on)).map(|(node, _)| node).collect()
}
