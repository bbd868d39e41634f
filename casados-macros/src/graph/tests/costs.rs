//! Numbers of operations, and work proportional to the size of a graph.

use super::expression::E;
use super::models::{aircraft, chain};
use crate::graph::elimination::Order;
use crate::graph::jacobian::jacobian_in_order;
use crate::graph::{Entry, Graph, Node, Unary, gradient, hessian, jacobian};
use std::cell::RefCell;
use std::time::{Duration, Instant};

fn nodes(entries: &[Entry]) -> Vec<Node> {
    entries.iter().map(|entry| entry.2).collect()
}

/// The operations of f, of f and Jacobian, gradient, Hessian, and the numbers of non-zeros.
fn operation_counts((mut graph, f, variables): (Graph, Vec<Node>, u32)) -> ([u32; 4], [usize; 2]) {
    let seeds: Vec<(Node, Node)> = (0..).zip(&f).map(|(row, &f)| (f, graph.seed(row))).collect();
    let first = jacobian(&mut graph, &f, variables);
    let gradient = gradient(&mut graph, &seeds, variables);
    let second = hessian(&mut graph, &seeds, variables);
    let both: Vec<Node> = f.iter().copied().chain(nodes(&first)).collect();
    let counts = [&f, &both, &gradient, &nodes(&second)].map(|nodes| graph.operation_count(nodes));
    (counts, [first.len(), second.len()])
}

/// The reference is CasADi 3.8.2 (SX, common subexpressions removed) for the same model, and its
/// sparsity.
#[test]
fn aircraft_takes_fewer_operations_than_casadi() {
    let (counts, non_zeros) = operation_counts(aircraft());
    assert_eq!(non_zeros, [302, 222]);
    for (count, reference) in counts.into_iter().zip([1035, 4376, 2501, 11626]) {
        assert!(count < reference, "{count} operations instead of {reference}");
    }
}

/// The selected order is the best one for a chain of masses (sparse rows) and for one long product
/// (a tree: one output of many variables, for which reverse mode is best and forward mode
/// quadratic).
#[test]
fn chosen_order_is_the_cheapest() {
    let tree = || {
        let graph = RefCell::new(Graph::default());
        let mut layer: Vec<E> =
            E::variables(&graph, 64).into_iter().map(|variable| variable.unary(Unary::Sin)).collect();
        while layer.len() > 1 {
            layer = layer.chunks(2).map(|pair| (pair[0] * pair[1]).unary(Unary::Tanh)).collect();
        }
        let root = layer[0].1;
        (graph.into_inner(), vec![root], 64)
    };
    for (name, (graph, f, variables)) in [("chain", chain(5)), ("tree", tree())] {
        let count = |order: Option<Order>| {
            let mut graph = graph.clone();
            let entries = match order {
                Some(order) => jacobian_in_order(&mut graph, &f, variables, order, usize::MAX)
                    .map_or(Vec::new(), |j| j.0),
                None => jacobian(&mut graph, &f, variables),
            };
            assert!(!entries.is_empty());
            graph.operation_count(&f.iter().copied().chain(nodes(&entries)).collect::<Vec<_>>())
        };
        let chosen = count(None);
        let (reverse, forward) = (count(Some(Order::Reverse)), count(Some(Order::Forward)));
        assert!(chosen <= reverse && chosen <= forward, "{name}: {chosen}, {reverse}, {forward}");
        if name == "tree" {
            assert!(reverse < forward, "{reverse}, {forward}");
        } else {
            assert!(chosen < reverse, "{chosen}, {reverse}");
        }
    }
}

/// Twice the masses take about twice the operations.
#[test]
fn large_chain() {
    let begin = Instant::now();
    let (small, _) = operation_counts(chain(17));
    let (large, _) = operation_counts(chain(33));
    assert!(begin.elapsed() < Duration::from_secs(20));
    for (small, large) in small.into_iter().zip(large) {
        assert!(f64::from(large) < 2.2 * f64::from(small), "{small}, {large}");
    }
}

/// A recurrence `s ← s + c v`, with a product and a sine in every tenth step.
fn recurrence(length: u32) -> (Graph, Node) {
    let graph = RefCell::new(Graph::default());
    let v = E::variables(&graph, 4);
    let mut sum = v[0];
    for i in 0..length {
        let term = v[1 + i as usize % 3];
        sum = if i % 10 == 0 { (sum * 0.5).unary(Unary::Sin) * term } else { sum + term * f64::from(i) };
    }
    let f = sum.1;
    (graph.into_inner(), f)
}

/// Graphs deeper than the stack.
#[test]
fn deep_graphs() {
    let (mut graph, f) = recurrence(100_000);
    let seed = graph.seed(0);
    assert_eq!(graph.dependencies(&[f]), [vec![0, 1, 2, 3]]);
    assert_eq!(gradient(&mut graph, &[(f, seed)], 4).len(), 4);
    assert!(graph.print(&[f]).lines().count() > 100_000);
    let (mut graph, f) = recurrence(8_000);
    let seed = graph.seed(0);
    assert_eq!(jacobian(&mut graph, &[f], 4).len(), 4);
    assert_eq!(hessian(&mut graph, &[(f, seed)], 4).len(), 10);
}

/// A sum of many variables: forward elimination would be quadratic.
#[test]
fn wide_graphs() {
    let begin = Instant::now();
    let graph = RefCell::new(Graph::default());
    let v = E::variables(&graph, 5_000);
    let f = v.iter().fold(v[0], |sum, &variable| sum + variable * variable).sqrt().1;
    let mut graph = graph.into_inner();
    assert_eq!(jacobian(&mut graph, &[f], 5_000).len(), 5_000);
    assert!(begin.elapsed() < Duration::from_secs(60));
}

/// Selections nested in selections.
#[test]
fn nested_selections() {
    let graph = RefCell::new(Graph::default());
    let v = E::variables(&graph, 2);
    let zero = v[0].of(0.0);
    let mut y = v[0];
    for i in 0..2_000 {
        y = v[1].if_less(v[0] * f64::from(i), y * v[1], zero);
    }
    let f = y.1;
    let mut graph = graph.into_inner();
    let seed = graph.seed(0);
    let before = graph.len();
    gradient(&mut graph, &[(f, seed)], 2);
    assert!(graph.len() < 40 * before, "{} of {before}", graph.len());
}
