//! Conditions that may change within an interval.

use super::{accepted, model, mul, sub};
use crate::graph::{Binary, Compare, EvaluationPoint, Graph, Node, Op, Table, Unary};
use crate::language::Model;

/// The number of branches at a point `(ẋ, x, u, p, t)` of a model with one of each.
fn branch_numbers(model: Model, points: &[[f64; 5]]) -> (usize, Vec<f64>) {
    let analysis = accepted(model);
    let found = analysis.branches.expect("conditions");
    let value = |variables: &[f64; 5]| {
        let point = EvaluationPoint { variables, opaque: &[], seeds: &[] };
        analysis.model.graph.evaluate(&[found.kinks], point)[0]
    };
    (found.count, points.iter().map(value).collect())
}

/// `ẋ − right side`
fn ode(right: impl Fn(&mut Graph, &[Node]) -> Node) -> Model {
    model([1, 0, 1, 1], |g, v| {
        let right = right(g, v);
        vec![sub(g, v[0], right)]
    })
}

#[test]
fn each_condition_has_a_power_of_two() {
    // |x| + (if t < 1 { x² } else { 0 }): the sign of x, and whether t < 1.
    let switched = ode(|g, v| {
        let (zero, one) = (g.constant(0.0), g.constant(1.0));
        let (size, square) = (g.unary(Unary::Abs, v[1]), mul(g, v[1], v[1]));
        let early = g.compare(Compare::Lt, v[4], one);
        let pushed = g.select(early, square, zero);
        g.binary(Binary::Add, size, pushed)
    });
    let at = |x, t| [0.0, x, 0.0, 0.0, t];
    let (count, numbers) =
        branch_numbers(switched, &[at(1.0, 2.0), at(-1.0, 2.0), at(1.0, 0.0), at(-1.0, 0.0)]);
    assert_eq!(count, 2);
    assert_eq!(numbers[0], 0.0);
    assert_eq!(numbers[1] + numbers[2], 3.0);
    assert_eq!(numbers[3], 3.0);
}

#[test]
fn input_conditions_do_not_count() {
    // if u < p { x } else { |p| x }
    let fixed = ode(|g, v| {
        let condition = g.compare(Compare::Lt, v[2], v[3]);
        let size = g.unary(Unary::Abs, v[3]);
        let other = mul(g, size, v[1]);
        g.select(condition, v[1], other)
    });
    assert!(accepted(fixed).branches.is_none());
    assert!(accepted(ode(|_, v| v[1])).branches.is_none());
}

#[test]
fn tables_have_pieces() {
    let table = Unary::Table(Table { index: 0, orders: [0], degree: 3 });
    let analysis = accepted(ode(|g, v| g.unary(table, v[1])));
    let found = analysis.branches.expect("a table");
    assert_eq!(found.count, 1);
    let pieces = [found.kinks, found.knots].map(|node| analysis.model.graph.op(node));
    let orders = pieces.map(|op| if let Op::Unary(Unary::Table(table), _) = op { table.orders } else { [0] });
    assert_eq!(orders, [[254], [255]]);
}
