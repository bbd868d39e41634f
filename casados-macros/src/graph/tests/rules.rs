//! Derivatives of every operation against closed values and differences.

use super::expression::E;
use crate::graph::elimination::Order;
use crate::graph::hessian::hessian_in_order;
use crate::graph::jacobian::jacobian_in_order;
use crate::graph::{Binary, EvaluationPoint, Graph, Node, Op, Unary, gradient, hessian};
use std::cell::RefCell;
use std::f64::consts::{E as EULER, LN_2, LOG2_E, LOG10_E};

/// A function of two variables: its value, gradient and Hessian `[aa, ab, bb]`.
struct BinaryCase {
    graph: Graph,
    outputs: [Node; 6],
}

impl BinaryCase {
    fn new(build: impl Fn(E, E) -> Node) -> Self {
        let graph = RefCell::new(Graph::default());
        let v = E::variables(&graph, 2);
        let f = build(v[0], v[1]);
        let mut graph = graph.into_inner();
        let one = graph.constant(1.0);
        let zero = graph.constant(0.0);
        let first = gradient(&mut graph, &[(f, one)], 2);
        let mut second = [zero; 3];
        for (row, column, value) in hessian(&mut graph, &[(f, one)], 2) {
            second[(row + column) as usize] = value;
        }
        Self { graph, outputs: [f, first[0], first[1], second[0], second[1], second[2]] }
    }

    /// `[f, f_a, f_b, f_aa, f_ab, f_bb]`
    fn values_at(&self, a: f64, b: f64) -> [f64; 6] {
        let values = self
            .graph
            .evaluate(&self.outputs, EvaluationPoint { variables: &[a, b], ..EvaluationPoint::default() });
        std::array::from_fn(|i| values[i])
    }
}

fn unary(function: Unary) -> BinaryCase {
    BinaryCase::new(|a, _| a.unary(function).1)
}

/// A central difference of order 8, and a bound of its rounding error for values of the given
/// magnitude.
fn difference(f: impl Fn(f64) -> f64, at: f64, h: f64) -> (f64, f64) {
    let weights = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
    let mut sum = 0.0;
    let mut size: f64 = 0.0;
    for (k, weight) in (1..).zip(weights) {
        let (right, left) = (f(at + f64::from(k) * h), f(at - f64::from(k) * h));
        sum += weight * (right - left);
        size = size.max(right.abs()).max(left.abs());
    }
    // An elementary function is within 2 ulp, the weights add up to 2.1.
    (sum / h, 8.0 * f64::EPSILON * size / h)
}

/// Compares all derivatives at a point with differences of the value and of the first derivatives.
/// `h` is small relative to the distance to the next singularity: with the ratio 1/100 the
/// truncation error of order 8 is below 1e-15 of the derivative times a factorial over 630, in
/// total below 1e-12.
fn check_differences(name: &str, function: &BinaryCase, a: f64, b: f64, h: f64) {
    let exact = function.values_at(a, b);
    let check = |what: &str, value: f64, (reference, rounding): (f64, f64)| {
        let error = (value - reference).abs();
        let bound = rounding + 1e-11 * value.abs().max(1.0);
        assert!(error <= bound, "{name} {what} at ({a}, {b}): {value} instead of {reference}");
    };
    check("f_a", exact[1], difference(|a| function.values_at(a, b)[0], a, h));
    check("f_aa", exact[3], difference(|a| function.values_at(a, b)[1], a, h));
    check("f_b", exact[2], difference(|b| function.values_at(a, b)[0], b, h));
    check("f_ab", exact[4], difference(|b| function.values_at(a, b)[1], b, h));
    check("f_bb", exact[5], difference(|b| function.values_at(a, b)[2], b, h));
}

#[test]
fn functions_of_one_argument_against_differences() {
    use Unary::*;
    let everywhere: &[f64] = &[-2.3, -0.7, 0.4, 1.9];
    let positive: &[f64] = &[0.3, 1.0, 2.7, 40.0];
    let unit: &[f64] = &[-0.8, -0.3, 0.2, 0.7];
    let nonzero: &[f64] = &[-3.0, -0.6, 0.5, 2.0];
    let cases: &[(Unary, &[f64])] = &[
        (Neg, everywhere),
        (Sqrt, positive),
        (Cbrt, nonzero),
        (Exp, everywhere),
        (Exp2, everywhere),
        (ExpM1, everywhere),
        (Ln, positive),
        (Ln1p, &[-0.6, 0.1, 3.0]),
        (Log2, positive),
        (Log10, positive),
        (Sin, everywhere),
        (Cos, everywhere),
        (Tan, &[-1.0, 0.3, 1.1, 2.5]),
        (Asin, unit),
        (Acos, unit),
        (Atan, everywhere),
        (Sinh, everywhere),
        (Cosh, everywhere),
        (Tanh, everywhere),
        (Asinh, everywhere),
        (Acosh, &[1.5, 2.0, 10.0]),
        (Atanh, unit),
        (Abs, nonzero),
        (Signum, nonzero),
    ];
    for &(function, points) in cases {
        for &a in points {
            check_differences(&format!("{function:?}"), &unary(function), a, 0.0, 1.0 / 512.0);
        }
    }
}

/// First and second derivatives against closed forms.
#[test]
fn functions_of_one_argument_against_closed_values() {
    use Unary::*;
    let cases = [
        (Neg, 3.0, -1.0, 0.0),
        (Sqrt, 4.0, 0.25, -1.0 / 32.0),
        (Sqrt, 1e-200, 5e99, -2.5e299),
        (Cbrt, 8.0, 1.0 / 12.0, -1.0 / 144.0),
        (Cbrt, -8.0, 1.0 / 12.0, 1.0 / 144.0),
        (Exp, 1.0, EULER, EULER),
        (Exp2, 3.0, 8.0 * LN_2, 8.0 * LN_2 * LN_2),
        (ExpM1, -50.0, (-50f64).exp(), (-50f64).exp()),
        (Ln, 4.0, 0.25, -1.0 / 16.0),
        (Ln1p, 3.0, 0.25, -1.0 / 16.0),
        (Log2, 8.0, LOG2_E / 8.0, -LOG2_E / 64.0),
        (Log10, 10.0, LOG10_E / 10.0, -LOG10_E / 100.0),
        (Sin, 0.0, 1.0, 0.0),
        (Cos, 0.0, 0.0, -1.0),
        (Tan, 0.0, 1.0, 0.0),
        (Tan, std::f64::consts::FRAC_PI_4, 2.0, 4.0),
        (Asin, 0.6, 1.25, 0.6 / 0.512),
        (Acos, 0.6, -1.25, -0.6 / 0.512),
        (Atan, 2.0, 0.2, -4.0 / 25.0),
        (Atan, 1e200, 0.0, 0.0),
        (Sinh, LN_2, 1.25, 0.75),
        (Cosh, LN_2, 0.75, 1.25),
        (Tanh, LN_2, 0.64, -0.768),
        (Asinh, 0.75, 0.8, -0.384),
        (Acosh, 1.25, 4.0 / 3.0, -80.0 / 27.0),
        (Atanh, 0.5, 4.0 / 3.0, 16.0 / 9.0),
        (Abs, -2.0, -1.0, 0.0),
        (Abs, 2.0, 1.0, 0.0),
        (Signum, -2.0, 0.0, 0.0),
    ];
    for (function, a, first, second) in cases {
        let [_, f_a, _, f_aa, _, _] = unary(function).values_at(a, 0.0);
        // A few operations, each within 2 ulp, without cancellation at these points.
        let close =
            |value: f64, reference: f64| (value - reference).abs() <= 16.0 * f64::EPSILON * reference.abs();
        assert!(close(f_a, first), "{function:?}' at {a}: {f_a} instead of {first}");
        assert!(close(f_aa, second), "{function:?}'' at {a}: {f_aa} instead of {second}");
    }
}

/// `1 − a²` would lose half of the digits here. `1 − a` is exact.
#[test]
fn no_cancellation_near_one() {
    let distance = 2f64.powi(-40);
    let a = 1.0 - distance;
    let close = |value: f64, reference: f64| (value / reference - 1.0).abs() < 16.0 * f64::EPSILON;
    let root = (distance * (2.0 - distance)).sqrt();
    assert!(close(unary(Unary::Asin).values_at(a, 0.0)[1], 1.0 / root));
    assert!(close(unary(Unary::Acos).values_at(a, 0.0)[1], -1.0 / root));
    assert!(close(unary(Unary::Atanh).values_at(a, 0.0)[1], 1.0 / (distance * (2.0 - distance))));
    let root = (distance * (2.0 + distance)).sqrt();
    assert!(close(unary(Unary::Acosh).values_at(1.0 + distance, 0.0)[1], 1.0 / root));
    assert!(close(unary(Unary::Acosh).values_at(1e200, 0.0)[1], 1e-200));
}

#[test]
fn functions_of_two_arguments() {
    let signs = [(0.7, 1.3), (-0.7, 1.3), (2.1, -0.4), (-1.1, -0.9)];
    let functions = [Binary::Add, Binary::Sub, Binary::Mul, Binary::Div, Binary::Atan2, Binary::Hypot];
    for function in functions {
        let derivatives = BinaryCase::new(|a, b| a.binary(function, b).1);
        for (a, b) in signs {
            check_differences(&format!("{function:?}"), &derivatives, a, b, 1.0 / 512.0);
        }
    }
    let power = BinaryCase::new(|a, b| a.binary(Binary::Powf, b).1);
    for (a, b) in [(0.7, 1.3), (2.0, -0.5), (3.0, 2.0)] {
        check_differences("Powf", &power, a, b, 1.0 / 512.0);
    }
}

/// Operands that are equal, that depend on each other, or of which one is constant.
#[test]
fn operands_that_are_not_independent() {
    type Build = fn(E, E) -> Node;
    let cases: [(&str, Build); 16] = [
        ("a + a", |a, _| (a + a).1),
        ("a a", |a, _| (a * a).1),
        ("a / a", |a, _| (a / a).1),
        ("sin a / a", |a, _| (a.unary(Unary::Sin) / a).1),
        ("a sin a", |a, _| (a.unary(Unary::Sin) * a).1),
        ("cos(−a)", |a, _| (-a).unary(Unary::Cos).1),
        ("√(3 a)", |a, _| (3.0 * a).sqrt().1),
        ("1 / (2 a)", |a, _| (1.0 / (2.0 * a)).1),
        ("a / 3", |a, _| (a / 3.0).1),
        ("aᵃ", |a, _| a.binary(Binary::Powf, a).1),
        ("2.5ᵃ", |a, _| a.of(2.5).binary(Binary::Powf, a).1),
        ("atan2(a, 2)", |a, _| a.binary(Binary::Atan2, a.of(2.0)).1),
        ("hypot(a, a)", |a, _| a.binary(Binary::Hypot, a).1),
        ("hypot(a b, b)", |a, b| (a * b).binary(Binary::Hypot, b).1),
        ("(a − b) (b − a)", |a, b| ((a - b) * (b - a)).1),
        ("(a b)² / (a + b)", |a, b| ((a * b) * (a * b) / (a + b)).1),
    ];
    for (name, build) in cases {
        for (a, b) in [(0.7, 1.3), (2.0, 0.4)] {
            check_differences(name, &BinaryCase::new(build), a, b, 1.0 / 512.0);
        }
    }
}

#[test]
fn powers() {
    for n in [-3, -2, -1, 0, 1, 2, 3, 4, 7] {
        for a in [-1.4, 0.6, 2.0] {
            let derivatives = BinaryCase::new(|a, _| a.powi(n).1);
            check_differences(&format!("powi {n}"), &derivatives, a, 0.0, 1.0 / 512.0);
        }
    }
    for exponent in [-1.5, -1.0, 0.15, 0.5, 1.0, 1.5, 2.0, 3.0, 4.2561, 12.5] {
        for a in [0.6, 1.0, 2.0] {
            let derivatives = BinaryCase::new(|a, _| a.powf(exponent).1);
            check_differences(&format!("powf {exponent}"), &derivatives, a, 0.0, 1.0 / 512.0);
        }
    }
    // Derivatives that are finite at zero are computed as finite numbers.
    assert_eq!(BinaryCase::new(|a, _| a.powf(2.5).1).values_at(0.0, 0.0), [0.0; 6]);
    assert_eq!(BinaryCase::new(|a, _| a.powf(1.5).1).values_at(0.0, 0.0)[..2], [0.0; 2]);
    assert_eq!(BinaryCase::new(|a, _| a.powi(3).1).values_at(0.0, 0.0), [0.0; 6]);
    assert_eq!(BinaryCase::new(|a, _| a.powf(2.0).1).values_at(0.0, 0.0)[3], 2.0);
    let power = BinaryCase::new(|a, b| a.binary(Binary::Powf, b).1).values_at(0.0, 3.0);
    assert_eq!(power, [0.0; 6]);
    // An infinite derivative is not finite.
    assert!(!BinaryCase::new(|a, _| a.powf(0.5).1).values_at(0.0, 0.0)[1].is_finite());
    assert!(!BinaryCase::new(|a, _| a.powf(1.5).1).values_at(0.0, 0.0)[3].is_finite());
    assert_eq!(BinaryCase::new(|a, _| a.powi(i32::MIN).1).values_at(1.0, 0.0)[1], f64::from(i32::MIN));
}

/// The branch not taken may be singular.
#[test]
fn selection_differentiates_the_branch_taken() {
    let piecewise = BinaryCase::new(|a, b| {
        let zero = a.of(0.0);
        zero.if_less(a, b * a.sqrt(), zero).1
    });
    assert_eq!(piecewise.values_at(0.0, 3.0), [0.0; 6]);
    assert_eq!(piecewise.values_at(-1.0, 3.0), [0.0; 6]);
    assert_eq!(piecewise.values_at(4.0, 3.0), [6.0, 0.75, 2.0, -3.0 / 32.0, 0.25, 0.0]);
    let nested = BinaryCase::new(|a, b| {
        let (zero, two) = (a.of(0.0), a.of(2.0));
        let inner = a.if_less(b, a / b, b.unary(Unary::Ln) / a);
        zero.if_less(a, inner, two * b / (a - 1.0)).1
    });
    // 2 b / (a − 1) at a = 0
    assert_eq!(nested.values_at(0.0, 3.0), [-6.0, -6.0, -2.0, -12.0, -2.0, 0.0]);
    check_differences("a / b", &nested, 0.5, 1.5, 1.0 / 512.0);
    check_differences("ln b / a", &nested, 2.0, 0.7, 1.0 / 512.0);
    check_differences("2 b / (a − 1)", &nested, -1.0, 0.7, 1.0 / 512.0);
    // One minimum, both of whose branches contain the variables.
    let minimum = BinaryCase::new(|a, b| {
        let product = a * b;
        product.if_less(a, product, a).sqrt().1
    });
    check_differences("√min(a b, a)", &minimum, 2.0, 0.7, 1.0 / 512.0);
    check_differences("√min(a b, a)", &minimum, 2.0, 1.7, 1.0 / 512.0);
}

/// The same for all orders of accumulation, and for a root guarded by two conditions.
#[test]
fn the_branch_not_taken_is_singular() {
    let graph = RefCell::new(Graph::default());
    let v = E::variables(&graph, 2);
    let (a, b) = (v[0], v[1]);
    let (zero, small) = (a.of(0.0), a.of(0.01));
    let root = a.sqrt();
    let one = zero.if_less(a, b / root, b);
    let both = zero.if_less(a, root, zero) - small.if_less(a, root * b, zero);
    let f = [one.1, (3.0 * both * b).1];
    let mut g = graph.into_inner();
    let point = EvaluationPoint { variables: &[0.0, 2.0], seeds: &[1.0, 1.0], ..EvaluationPoint::default() };
    for order in [Order::Reverse, Order::Forward, Order::Markowitz] {
        let entries = jacobian_in_order(&mut g, &f, 2, order, usize::MAX).map_or(Vec::new(), |j| j.0);
        let nodes: Vec<Node> = entries.iter().map(|entry| entry.2).collect();
        assert_eq!(g.evaluate(&nodes, point), [0.0, 1.0, 0.0, 0.0], "{order:?}");
        let seeds = [(f[0], g.seed(0)), (f[1], g.seed(1))];
        let entries = hessian_in_order(&mut g, &seeds, 2, order, usize::MAX).map_or(Vec::new(), |h| h.0);
        let nodes: Vec<Node> = entries.iter().map(|entry| entry.2).collect();
        assert_eq!(g.evaluate(&nodes, point), [0.0; 3], "{order:?}");
    }
}

/// Selections of constants, and conditions, have no derivatives.
#[test]
fn conditions_are_not_differentiated() {
    let step = BinaryCase::new(|a, b| a.if_less(b, a.of(1.0), a.of(-1.0)).1);
    for output in &step.outputs[1..] {
        assert_eq!(step.graph.op(*output), Op::Constant(0));
    }
}

/// Derivatives of tables are consistent: tables are represented by sines.
#[test]
fn tables_are_differentiated_by_their_orders() {
    use crate::graph::Table;
    let table = |orders| Table { index: 2, orders, degree: 3 };
    let one =
        BinaryCase::new(|a, b| (a * b).unary(Unary::Table(Table { index: 1, orders: [0], degree: 3 })).1);
    let two = BinaryCase::new(|a, b| (a * a).binary(Binary::Table(table([0, 0])), b).1);
    let linear = BinaryCase::new(|a, b| {
        let line = Table { index: 1, orders: [0], degree: 1 };
        (a.unary(Unary::Table(line)) * b).1
    });
    assert_eq!(linear.graph.value(linear.outputs[3]), Some(0.0));
    let (a, b) = (0.7, -0.4);
    let s = |order: u8| Table { index: 1, orders: [order], degree: 3 }.sample_value([a * b]);
    let t = |i, j| table([i, j]).sample_value([a * a, b]);
    let expected = [
        [s(0), b * s(1), a * s(1), b * b * s(2), s(1) + a * b * s(2), a * a * s(2)],
        [
            t(0, 0),
            2.0 * a * t(1, 0),
            t(0, 1),
            2.0 * t(1, 0) + 4.0 * a * a * t(2, 0),
            2.0 * a * t(1, 1),
            t(0, 2),
        ],
    ];
    for (function, expected) in [&one, &two].into_iter().zip(&expected) {
        for (found, expected) in function.values_at(a, b).into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        }
    }
    // Differences of the sines that represent tables.
    let h = 1e-5;
    let value = |a, b| two.values_at(a, b)[0];
    assert!(((value(a + h, b) - value(a - h, b)) / (2.0 * h) - expected[1][1]).abs() < 1e-9);
    assert!(((value(a, b + h) - value(a, b - h)) / (2.0 * h) - expected[1][2]).abs() < 1e-9);
}
