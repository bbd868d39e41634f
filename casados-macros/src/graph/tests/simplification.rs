//! Constructors preserve bits, and simplify as documented.

use super::expression::{E, Random};
use crate::graph::evaluate::{binary_value, unary_value};
use crate::graph::{Binary, Compare, EvaluationPoint, Graph, Unary};
use std::cell::RefCell;

/// Random expressions with many zeros, ones, negations and powers of two against the same
/// operations on numbers, bit by bit.
#[test]
fn bits_are_kept() {
    let functions = [Unary::Neg, Unary::Neg, Unary::Neg, Unary::Abs, Unary::Sin, Unary::Tanh, Unary::Signum];
    let operators = [Binary::Add, Binary::Sub, Binary::Mul, Binary::Div, Binary::Hypot, Binary::Powf];
    let mut random = Random(1);
    let mut compared = 0;
    for _ in 0..400 {
        let graph = RefCell::new(Graph::default());
        let mut expressions = E::variables(&graph, 4);
        let mut values: Vec<f64> = (0..4).map(|_| random.between(-3.0, 3.0)).collect();
        for constant in [0.0, 1.0, -1.0, 2.0, -0.25, 3.0, 0.3] {
            expressions.push(expressions[0].of(constant));
            values.push(constant);
        }
        for _ in 0..60 {
            let (i, j) = (random.below(values.len()), random.below(values.len()));
            let (a, b) = (values[i], values[j]);
            let (expression, value) = match random.below(12) {
                0..4 => {
                    let function = functions[random.below(functions.len())];
                    // The sign of a zero is not preserved.
                    if function == Unary::Signum && a == 0.0 {
                        continue;
                    }
                    (expressions[i].unary(function), unary_value(function, a))
                }
                4 => {
                    let n = random.below(7) as i32 - 3;
                    (expressions[i].powi(n), a.powi(n))
                }
                5 => {
                    let less = if a < b { b } else { a };
                    (expressions[i].if_less(expressions[j], expressions[j], expressions[i]), less)
                }
                _ => {
                    let operator = operators[random.below(operators.len())];
                    (expressions[i].binary(operator, expressions[j]), binary_value(operator, a, b))
                }
            };
            // Structural zeros differ for infinite values and NaN; magnitudes are limited, so that
            // nothing overflows or is subnormal.
            if value == 0.0 || (1e-9..1e9).contains(&value.abs()) {
                expressions.push(expression);
                values.push(value);
            }
        }
        let variables: Vec<f64> = values[..4].to_vec();
        let nodes: Vec<_> = expressions.iter().map(|expression| expression.1).collect();
        let graph = graph.into_inner();
        let point = EvaluationPoint { variables: &variables, ..EvaluationPoint::default() };
        for (simplified, direct) in graph.evaluate(&nodes, point).into_iter().zip(values) {
            assert_eq!((simplified + 0.0).to_bits(), (direct + 0.0).to_bits(), "{simplified} {direct}");
            compared += 1;
        }
    }
    assert!(compared > 10_000);
}

#[test]
fn neutral_elements_and_signs() {
    let graph = RefCell::new(Graph::default());
    let [a, b] = E::variables(&graph, 2)[..] else { unreachable!() };
    let same = |x: E, y: E| assert_eq!(x.1, y.1);
    same(a + 0.0, a);
    same(0.0 + a, a);
    same(a - 0.0, a);
    same(0.0 - a, -a);
    same(a - a, a.of(0.0));
    same(a * 1.0, a);
    same(a * -1.0, -a);
    same(0.0 * a, a.of(0.0));
    same(a / 1.0, a);
    same(a / 4.0, a * 0.25);
    same(0.0 / a, a.of(0.0));
    same(-(-a), a);
    same(-(a - b), b - a);
    same(a - (-b), a + b);
    same(-a + b, b - a);
    same(a + b, b + a);
    same(a * b, b * a);
    same((-a) * b, -(a * b));
    same((-a) * (-b), a * b);
    same(a / (-b), -(a / b));
    same(-(2.0 * a), -2.0 * a);
    same((-a).unary(Unary::Abs), a.unary(Unary::Abs));
    same(a.powi(0), a.of(1.0));
    same(a.powi(1), a);
    same(a.powi(2), a * a);
    same(a.powi(-1), 1.0 / a);
    same(a.of(2.0).sqrt(), a.of(2f64.sqrt()));
    // 1/3 is not exact: the division remains.
    assert_ne!((a / 3.0).1, (a * (1.0 / 3.0)).1);
    // Subtraction does not commute.
    assert_ne!((a - b).1, (b - a).1);
}

#[test]
fn conditions_are_folded() {
    let mut g = Graph::default();
    let (a, b) = (g.variable(0), g.variable(1));
    let (one, two) = (g.constant(1.0), g.constant(2.0));
    let open = g.compare(Compare::Lt, a, b);
    assert_eq!(g.known_condition(open), None);
    for (comparison, x, y, truth) in [
        (Compare::Lt, one, two, true),
        (Compare::Lt, two, one, false),
        (Compare::Le, one, one, true),
        (Compare::Eq, one, one, true),
        (Compare::Eq, one, two, false),
        (Compare::Lt, a, a, false),
    ] {
        let condition = g.compare(comparison, x, y);
        assert_eq!(g.known_condition(condition), Some(truth));
        assert_eq!(g.select(condition, a, b), if truth { a } else { b });
        let not = g.not(condition);
        assert_eq!(g.known_condition(not), Some(!truth));
        let (and, or) = (g.and(condition, open), g.or(open, condition));
        assert_eq!(and, if truth { open } else { condition });
        assert_eq!(or, if truth { condition } else { open });
    }
    // A comparison of a number with itself is false for NaN: only `<` is known.
    let itself = g.compare(Compare::Le, a, a);
    assert_eq!(g.known_condition(itself), None);
    assert_eq!(g.select(open, a, a), a);
    let not = g.not(open);
    assert_eq!(g.not(not), open);
    let select = g.select(open, b, a);
    assert_eq!(g.select(not, a, b), select);
    assert_eq!(g.select(open, select, a), select);
    assert_eq!(g.select(open, b, select), select);
}

#[test]
fn printed() {
    let mut g = Graph::default();
    let (a, b) = (g.variable(0), g.seed(1));
    let half = g.constant(0.5);
    let root = g.unary(Unary::Sqrt, a);
    let _unused = g.powi(a, 3);
    let product = g.binary(Binary::Mul, half, root);
    let condition = g.compare(Compare::Le, product, b);
    let select = g.select(condition, product, b);
    assert_eq!(
        g.print(&[select]),
        "#0 = v[0]\n#1 = mu[1]\n#2 = 0.5\n#3 = Sqrt #0\n#5 = Mul #2 #3\n#6 = Le #5 #1\n#7 = Select #6 #5 #1\n"
    );
    assert_eq!(g.operation_count(&[select]), 4);
    assert_eq!(g.dependencies(&[select, b]), [vec![0], vec![]]);
}
