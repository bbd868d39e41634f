//! Jacobians, gradients and Hessians of random graphs against each other and against differences.

use super::expression::{E, Random};
use super::models::{aircraft, chain};
use crate::graph::elimination::Order;
use crate::graph::hessian::hessian_in_order;
use crate::graph::jacobian::jacobian_in_order;
use crate::graph::{Binary, Degree, Entry, EvaluationPoint, Graph, Node, Unary, gradient, hessian, jacobian};
use std::cell::RefCell;

const ORDERS: [Order; 3] = [Order::Reverse, Order::Forward, Order::Markowitz];

/// Random functions of moderate magnitude: every node is within [-8, 8] for variables in [-1, 1].
fn random_graph(random: &mut Random, variables: u32, size: usize, outputs: usize) -> (Graph, Vec<Node>) {
    let graph = RefCell::new(Graph::default());
    let mut nodes = E::variables(&graph, variables);
    let bounded = [Unary::Sin, Unary::Cos, Unary::Tanh, Unary::Atan];
    while nodes.len() < size + variables as usize {
        // Recent nodes are preferred, so that the graph becomes deep.
        let pick = |random: &mut Random| {
            let range = if random.below(3) == 0 { nodes.len() } else { nodes.len().min(12) };
            nodes[nodes.len() - 1 - random.below(range)]
        };
        let (a, b) = (pick(random), pick(random));
        let c = random.between(-1.5, 1.5);
        nodes.push(match random.below(12) {
            0..2 => a.unary(bounded[random.below(4)]),
            2..4 => 0.5 * (a + b),
            4 => c * a - 0.3 * b,
            5 => (a * b).unary(Unary::Tanh),
            6 => 0.1 * a * b,
            7 => a / (1.5 + b * b),
            8 => (1.0 + a * a).sqrt() - 1.0,
            9 => (0.1 * a).unary(Unary::Exp) - b * 0.2,
            10 => a.if_less(b, 0.5 * a * b, b.unary(Unary::Sin)),
            _ => a.binary(Binary::Atan2, 2.0 + b * b),
        });
    }
    let outputs = nodes[nodes.len() - outputs..].iter().map(|node| node.1).collect();
    (graph.into_inner(), outputs)
}

fn dense(entries: &[Entry], values: &[f64], rows: usize, columns: usize) -> Vec<Vec<f64>> {
    let mut matrix = vec![vec![0.0; columns]; rows];
    for (&(row, column, _), &value) in entries.iter().zip(values) {
        assert_eq!(matrix[row as usize][column as usize], 0.0, "an entry occurs once");
        matrix[row as usize][column as usize] = value;
    }
    matrix
}

fn values(graph: &Graph, entries: &[Entry], point: EvaluationPoint) -> Vec<f64> {
    graph.evaluate(&entries.iter().map(|entry| entry.2).collect::<Vec<_>>(), point)
}

fn with_seeds(graph: &mut Graph, outputs: &[Node]) -> Vec<(Node, Node)> {
    (0..).zip(outputs).map(|(row, &f)| (f, graph.seed(row))).collect()
}

fn size<'a>(values: impl IntoIterator<Item = &'a f64>) -> f64 {
    values.into_iter().fold(1.0, |size, value| value.abs().max(size))
}

fn assert_close(a: &[Vec<f64>], b: &[Vec<f64>], tolerance: f64, what: &str) {
    let scale = size(a.iter().flatten());
    for (i, (a, b)) in a.iter().zip(b).enumerate() {
        for (j, (a, b)) in a.iter().zip(b).enumerate() {
            assert!((a - b).abs() <= tolerance * scale, "{what} ({i}, {j}): {a} and {b}");
        }
    }
}

/// Compares all derivatives of a function at one point, by all methods. Entries are sums over paths
/// of products of partial derivatives; a few hundred operations without growth have rounding errors
/// of some hundred ulps of the largest entry.
fn check_against_each_other(graph: &Graph, f: &[Node], variables: u32, point: EvaluationPoint) {
    const ROUNDING_TOLERANCE: f64 = 2048.0 * f64::EPSILON;
    let n = variables as usize;
    let mut g = graph.clone();
    let seeds = with_seeds(&mut g, f);
    let gradient_nodes = gradient(&mut g, &seeds, variables);
    let exact = g.evaluate(&gradient_nodes, point);

    let chosen = jacobian(&mut g, f, variables);
    let reference = dense(&chosen, &values(&g, &chosen, point), f.len(), n);
    assert!(chosen.iter().all(|entry| !g.is_zero(entry.2)));
    assert!(chosen.is_sorted_by_key(|entry| (entry.0, entry.1)));
    for (entries, dependencies) in chosen
        .chunk_by(|a, b| a.0 == b.0)
        .zip(graph.dependencies(f).iter().filter(|set| set.iter().any(|&variable| variable < variables)))
    {
        assert!(entries.iter().all(|entry| dependencies.contains(&entry.1)));
    }
    for order in ORDERS {
        let mut g = graph.clone();
        let (entries, _) = jacobian_in_order(&mut g, f, variables, order, usize::MAX).unwrap();
        let matrix = dense(&entries, &values(&g, &entries, point), f.len(), n);
        assert_close(&reference, &matrix, ROUNDING_TOLERANCE, "Jacobian");
    }
    // μᵀ J
    let product: Vec<f64> =
        (0..n).map(|j| reference.iter().zip(point.seeds).map(|(row, mu)| row[j] * mu).sum()).collect();
    assert_close(&[exact], &[product], ROUNDING_TOLERANCE * size(reference.iter().flatten()), "gradient");

    // The Hessian is the Jacobian of the gradient.
    let rows = jacobian_in_order(&mut g, &gradient_nodes, variables, Order::Markowitz, usize::MAX).unwrap().0;
    let rows = dense(&rows, &values(&g, &rows, point), n, n);
    let check = |g: &Graph, entries: &[Entry]| {
        let mut matrix = dense(entries, &values(g, entries, point), n, n);
        for &(row, column, value) in entries {
            assert!(row >= column && !g.is_zero(value));
            matrix[column as usize][row as usize] = matrix[row as usize][column as usize];
        }
        assert!(entries.is_sorted_by_key(|entry| (entry.0, entry.1)));
        assert_close(&rows, &matrix, ROUNDING_TOLERANCE, "Hessian");
    };
    for order in ORDERS {
        let mut g = graph.clone();
        let seeds = with_seeds(&mut g, f);
        let (entries, _) = hessian_in_order(&mut g, &seeds, variables, order, usize::MAX).unwrap();
        check(&g, &entries);
    }
    let entries = hessian(&mut g, &seeds, variables);
    check(&g, &entries);
}

#[test]
fn random_graphs_agree() {
    let mut random = Random(7);
    for round in 0..60 {
        let (variables, size) = (2 + round % 6, 10 + 2 * round as usize);
        let (graph, f) = random_graph(&mut random, variables, size, 1 + round as usize % 4);
        let point: Vec<f64> = (0..variables).map(|_| random.between(-1.0, 1.0)).collect();
        let seeds: Vec<f64> = f.iter().map(|_| random.between(-1.0, 1.0)).collect();
        let point = EvaluationPoint { variables: &point, seeds: &seeds, ..EvaluationPoint::default() };
        // The last variable represents time: no derivatives with respect to it.
        check_against_each_other(&graph, &f, variables - 1, point);
        check_against_each_other(&graph, &f, variables, point);
    }
}

#[test]
fn models_agree() {
    let mut random = Random(3);
    let mut check = |(graph, f, variables): (Graph, Vec<Node>, u32), around: &[f64]| {
        let point: Vec<f64> = around.iter().map(|value| value + random.between(-0.1, 0.1)).collect();
        let seeds: Vec<f64> = f.iter().map(|_| random.between(-1.0, 1.0)).collect();
        check_against_each_other(
            &graph,
            &f,
            variables,
            EvaluationPoint { variables: &point, seeds: &seeds, ..EvaluationPoint::default() },
        );
    };
    let around: Vec<f64> = (0..45).map(|i| f64::from(i) * 0.3 % 2.0).collect();
    check(chain(5), &around);
    let mut around = [0.0; 51];
    around[23..32].copy_from_slice(&[300.0, 100.0, 250.0, -5.0, 20.0, 10.0, 0.1, -0.2, 0.3]);
    around[32] = 1.0;
    around[36] = 1.0;
    around[40] = 1.0;
    check(aircraft(), &around);
}

/// Differences of the value and of the gradient, independent of every rule. The step is 1/64, the
/// order 8; the functions are analytic in a strip whose width is of order one, reduced by their
/// depth.
#[test]
fn random_graphs_against_differences() {
    let mut random = Random(11);
    let weights = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
    let h = 1.0 / 512.0;
    for _ in 0..40 {
        let (graph, f) = random_graph(&mut random, 4, 24, 2);
        let center: Vec<f64> = (0..4).map(|_| random.between(-1.0, 1.0)).collect();
        let mut g = graph.clone();
        let seeds = with_seeds(&mut g, &f);
        let first = gradient(&mut g, &seeds, 4);
        let second = hessian(&mut g, &seeds, 4);
        let mu = [0.7, -0.4];
        let at = |variables: &[f64]| {
            let point = EvaluationPoint { variables, seeds: &mu, ..EvaluationPoint::default() };
            let values = g.evaluate(&f, point);
            let mut all = vec![mu[0] * values[0] + mu[1] * values[1]];
            all.extend(g.evaluate(&first, point));
            all
        };
        let exact = at(&center);
        let point = EvaluationPoint { variables: &center, seeds: &mu, ..EvaluationPoint::default() };
        let lower = dense(&second, &values(&g, &second, point), 4, 4);
        for j in 0..4 {
            let mut sum = [0.0; 5];
            let shifted = |steps: f64| {
                let mut shifted = center.clone();
                shifted[j] += steps * h;
                at(&shifted)
            };
            for (k, weight) in (1..).zip(weights) {
                let (right, left) = (shifted(f64::from(k)), shifted(-f64::from(k)));
                sum.iter_mut().zip(right.iter().zip(left)).for_each(|(s, (r, l))| *s += weight * (r - l) / h);
            }
            let row: Vec<f64> = (0..4).map(|k| lower[j.max(k)][j.min(k)]).collect();
            let scale = size(&exact).max(size(&row));
            // Rounding: 2.1 ε / h and some operations.
            let tolerance = 64.0 * f64::EPSILON / h * scale + 1e-10 * scale;
            assert!((sum[0] - exact[1 + j]).abs() <= tolerance, "f_{j}: {} and {}", exact[1 + j], sum[0]);
            for k in 0..4 {
                assert!(
                    (sum[1 + k] - row[k]).abs() <= tolerance,
                    "({j}, {k}): {} and {}",
                    row[k],
                    sum[1 + k]
                );
            }
        }
    }
}

#[test]
fn entries_that_cancel_are_dropped_and_constant_ones_are_constants() {
    let graph = RefCell::new(Graph::default());
    let v = E::variables(&graph, 3);
    let f = [(v[0] + v[1]) - (v[0] - v[1]) * 1.0, 2.0 * v[0] + v[2] * v[1], 3.0 * (v[0] - v[0])];
    let f: Vec<Node> = f.iter().map(|f| f.1).collect();
    let mut g = graph.into_inner();
    let entries = jacobian(&mut g, &f, 2);
    let entries: Vec<_> =
        entries.iter().map(|&(row, variable, value)| (row, variable, g.value(value))).collect();
    // v[2] is time: the last entry varies.
    assert_eq!(entries, [(0, 1, Some(2.0)), (1, 0, Some(2.0)), (1, 1, None)]);
    assert_eq!(g.degrees(&f, |variable| variable < 2), [Degree::Linear, Degree::Linear, Degree::Constant]);
    assert_eq!(g.degrees(&f[1..2], |_| true), [Degree::Nonlinear]);
    let seeds = with_seeds(&mut g, &f);
    assert_eq!(hessian(&mut g, &seeds, 2), []);
}

#[test]
fn linear_entries_are_constant() {
    let graph = RefCell::new(Graph::default());
    let v = E::variables(&graph, 3);
    let cases = [
        (v[0] + 2.0 * v[1] - 3.0, Degree::Linear),
        (v[2].unary(Unary::Sin) * v[0] / v[2], Degree::Linear),
        (v[2].if_less(v[2] * 2.0, v[0], -v[1]), Degree::Linear),
        (v[0].if_less(v[1], v[0], v[1]), Degree::Nonlinear),
        (v[0] * v[1], Degree::Nonlinear),
        (v[2] / v[0], Degree::Nonlinear),
        (v[0].unary(Unary::Abs), Degree::Nonlinear),
        (v[2].powi(3), Degree::Constant),
    ];
    let g = graph.borrow();
    for (expression, degree) in cases {
        assert_eq!(g.degrees(&[expression.1], |variable| variable < 2), [degree]);
    }
}

/// Derivatives exclude branches that are not taken, even within many nested selections.
#[test]
fn deep_selections() {
    let mut graph = Graph::default();
    let x = graph.variable(0);
    let (start, step) = (graph.constant(19.0), graph.constant(1.0));
    let inside = graph.binary(Binary::Sub, x, start);
    let root = graph.unary(Unary::Sqrt, inside);
    let mut y = graph.binary(Binary::Mul, root, x);
    for border in (1..20).rev() {
        let border = graph.constant(f64::from(border));
        let below = graph.compare(crate::graph::Compare::Lt, x, border);
        let constant = graph.binary(Binary::Add, border, step);
        y = graph.select(below, constant, y);
    }
    let seeds = with_seeds(&mut graph, &[y]);
    let slope = gradient(&mut graph, &seeds, 1);
    let curvature = hessian(&mut graph, &seeds, 1);
    let nodes = [slope[0], curvature[0].2];
    let at = |x: f64| graph.evaluate(&nodes, EvaluationPoint { variables: &[x], seeds: &[1.0], opaque: &[] });
    for x in [0.5, 8.5, 18.5, 18.999] {
        assert_eq!(at(x), [0.0, 0.0]);
    }
    // (√(x − 19) x)′ = √(x − 19) + x / (2 √(x − 19)), its derivative 1 / √(x − 19) − x / (4 √³).
    assert_eq!(at(20.0), [11.0, -4.0]);
}
