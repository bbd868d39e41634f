//! Derivatives of every operation.

use super::{Binary, Graph, Node, Op, Unary, tangent};
use std::f64::consts::{LN_2, LOG2_E, LOG10_E};

/// The operands of a node with a term each; every operand occurs once.
pub type OperandTerms = [Option<(Node, Node)>; 2];

impl Graph {
    /// `∂c/∂a` of a function `c` of one argument `a`, in forms without cancellation and overflow
    /// where these are cheap.
    fn unary_partial(&mut self, function: Unary, a: Node, c: Node) -> Node {
        let one = self.constant(1.0);
        match function {
            Unary::Neg => self.constant(-1.0),
            Unary::Sqrt => {
                let half = self.constant(0.5);
                self.simplified_div(half, c)
            }
            Unary::Cbrt => {
                let (third, square) = (self.constant(1.0 / 3.0), self.simplified_mul(c, c));
                self.simplified_div(third, square)
            }
            Unary::Exp => c,
            Unary::Exp2 => {
                let ln2 = self.constant(LN_2);
                self.simplified_mul(ln2, c)
            }
            // c + 1 would cancel for very negative a.
            Unary::ExpM1 => self.unary(Unary::Exp, a),
            Unary::Ln => self.simplified_div(one, a),
            Unary::Ln1p => {
                let sum = self.simplified_add(one, a);
                self.simplified_div(one, sum)
            }
            Unary::Log2 => {
                let factor = self.constant(LOG2_E);
                self.simplified_div(factor, a)
            }
            Unary::Log10 => {
                let factor = self.constant(LOG10_E);
                self.simplified_div(factor, a)
            }
            Unary::Sin => self.unary(Unary::Cos, a),
            Unary::Cos => {
                let sin = self.unary(Unary::Sin, a);
                self.simplified_neg(sin)
            }
            Unary::Tan => {
                let square = self.simplified_mul(c, c);
                self.simplified_add(one, square)
            }
            Unary::Asin => {
                let (_, root) = self.one_minus_square(a);
                self.simplified_div(one, root)
            }
            Unary::Acos => {
                let ((_, root), minus_one) = (self.one_minus_square(a), self.constant(-1.0));
                self.simplified_div(minus_one, root)
            }
            Unary::Atan => {
                let square = self.simplified_mul(a, a);
                let sum = self.simplified_add(one, square);
                self.simplified_div(one, sum)
            }
            Unary::Sinh => self.unary(Unary::Cosh, a),
            Unary::Cosh => self.unary(Unary::Sinh, a),
            Unary::Tanh => {
                let square = self.simplified_mul(c, c);
                self.simplified_sub(one, square)
            }
            // If a² overflows this is zero, which is negligible beside any other number.
            Unary::Asinh => {
                let square = self.simplified_mul(a, a);
                let sum = self.simplified_add(one, square);
                let root = self.unary(Unary::Sqrt, sum);
                self.simplified_div(one, root)
            }
            Unary::Acosh => {
                let (below, above) = (self.simplified_sub(a, one), self.simplified_add(a, one));
                let (below, above) = (self.unary(Unary::Sqrt, below), self.unary(Unary::Sqrt, above));
                let root = self.simplified_mul(below, above);
                self.simplified_div(one, root)
            }
            Unary::Atanh => {
                let (difference, _) = self.one_minus_square(a);
                self.simplified_div(one, difference)
            }
            Unary::Abs => self.unary(Unary::Signum, a),
            Unary::Signum => self.constant(0.0),
            Unary::Table(table) => self.table_slope(table, a),
        }
    }

    /// `1 − a²` as `(1 − a)(1 + a)`, without cancellation near `|a| = 1`, and its square root.
    fn one_minus_square(&mut self, a: Node) -> (Node, Node) {
        let one = self.constant(1.0);
        let (below, above) = (self.simplified_sub(one, a), self.simplified_add(one, a));
        let product = self.simplified_mul(below, above);
        (product, self.unary(Unary::Sqrt, product))
    }

    /// `∂c/∂a` (`first`) or `∂c/∂b` of a function `c` of two arguments.
    fn binary_partial(&mut self, function: Binary, a: Node, b: Node, c: Node, first: bool) -> Node {
        let one = self.constant(1.0);
        match (function, first) {
            (Binary::Add, _) | (Binary::Sub, true) => one,
            (Binary::Sub, false) => self.constant(-1.0),
            (Binary::Mul, true) => b,
            (Binary::Mul, false) => a,
            (Binary::Div, true) => self.simplified_div(one, b),
            (Binary::Div, false) => {
                let reciprocal = self.simplified_div(one, b);
                let product = self.simplified_mul(c, reciprocal);
                self.simplified_neg(product)
            }
            (Binary::Powf, true) => match self.value(b) {
                Some(n) if is_small_integer(n) => {
                    let power = self.powi(a, n as i32 - 1);
                    self.simplified_mul(b, power)
                }
                Some(n) => {
                    let ratio = self.power_ratio(n, a, c);
                    self.zero_at_zero(n > 1.0, a, ratio)
                }
                None => {
                    let lower = self.simplified_sub(b, one);
                    let power = self.binary(Binary::Powf, a, lower);
                    self.simplified_mul(b, power)
                }
            },
            // At a = 0 the function does not depend on b, but the logarithm is infinite.
            (Binary::Powf, false) => {
                let ln = self.unary(Unary::Ln, a);
                let product = self.simplified_mul(c, ln);
                self.zero_at_zero(true, a, product)
            }
            (Binary::Atan2, _) => {
                let (aa, bb) = (self.simplified_mul(a, a), self.simplified_mul(b, b));
                let sum = self.simplified_add(aa, bb);
                let above = if first { b } else { self.simplified_neg(a) };
                self.simplified_div(above, sum)
            }
            (Binary::Hypot, true) => self.simplified_div(a, c),
            (Binary::Hypot, false) => self.simplified_div(b, c),
            (Binary::Table(table), first) => self.table_partial(table, a, b, first),
        }
    }

    /// `n aⁿ⁻¹` as `n c / a` with `c = aⁿ`: a division, which costs a tenth of another power. NaN
    /// at `a = 0`, where the limit is zero or infinite.
    fn power_ratio(&mut self, n: f64, a: Node, c: Node) -> Node {
        let (n, ratio) = (self.constant(n), self.simplified_div(c, a));
        self.simplified_mul(n, ratio)
    }

    /// Zero at `a = 0`, if that is the limit; otherwise the value.
    fn zero_at_zero(&mut self, zero_is_limit: bool, a: Node, value: Node) -> Node {
        if !zero_is_limit {
            return value;
        }
        let zero = self.constant(0.0);
        let at_zero = self.compare(super::Compare::Eq, a, zero);
        self.select(at_zero, zero, value)
    }

    /// The operands of a node that satisfy a predicate, with the partial derivatives.
    pub(super) fn partials(&mut self, node: Node, active: impl Fn(Node) -> bool) -> OperandTerms {
        let zero = self.constant(0.0);
        let one = self.constant(1.0);
        let both = match self.op(node) {
            Op::Unary(function, a) if active(a) => [Some((a, self.unary_partial(function, a, node))), None],
            Op::Powi(a, n) if active(a) => {
                let (factor, power) = (self.constant(f64::from(n)), self.powi(a, n.saturating_sub(1)));
                [Some((a, self.simplified_mul(factor, power))), None]
            }
            Op::Binary(function, a, b) => [
                active(a).then(|| (a, self.binary_partial(function, a, b, node, true))),
                active(b).then(|| (b, self.binary_partial(function, a, b, node, false))),
            ],
            Op::Select(condition, a, b) => [
                active(a).then(|| (a, self.select(condition, one, zero))),
                active(b).then(|| (b, self.select(condition, zero, one))),
            ],
            _ => [None, None],
        };
        match both {
            [Some((a, p)), Some((b, q))] if a == b => [Some((a, self.simplified_add(p, q))), None],
            both => both.map(|part| part.filter(|&(_, partial)| partial != zero)),
        }
    }

    /// The operands of a node that satisfy a predicate, with `w` times the partial derivatives.
    pub(super) fn pull_back(&mut self, node: Node, w: Node, active: impl Fn(Node) -> bool) -> OperandTerms {
        match self.op(node) {
            Op::Binary(Binary::Div, a, b) if a != b => {
                let quotient = self.simplified_div(w, b);
                [
                    active(a).then_some((a, quotient)),
                    active(b).then(|| {
                        let product = self.simplified_mul(node, quotient);
                        (b, self.simplified_neg(product))
                    }),
                ]
            }
            _ => self
                .partials(node, active)
                .map(|part| part.map(|(operand, p)| (operand, self.simplified_mul(w, p)))),
        }
    }

    /// `w` times the second partial derivatives of a node with respect to the operands that satisfy
    /// a predicate: `(j, k, value)`, each pair of operands once.
    pub(super) fn second_partials(
        &mut self,
        node: Node,
        w: Node,
        active: impl Fn(Node) -> bool + Copy,
    ) -> Vec<(Node, Node, Node)> {
        let two = self.constant(2.0);
        match self.op(node) {
            Op::Unary(Unary::Neg | Unary::Abs | Unary::Signum, _)
            | Op::Binary(Binary::Add | Binary::Sub, ..)
            | Op::Select(..) => Vec::new(),
            Op::Binary(Binary::Mul, a, b) if a == b && active(a) => vec![(a, a, self.simplified_mul(two, w))],
            Op::Binary(Binary::Mul, a, b) if active(a) && active(b) => vec![(a, b, w)],
            Op::Binary(Binary::Mul, ..) => Vec::new(),
            Op::Binary(Binary::Div, a, b) if a != b => {
                let [_, Some((_, partial))] = self.pull_back(node, w, active) else { return Vec::new() };
                let one = self.constant(1.0);
                let reciprocal = self.simplified_div(one, b);
                let mut arcs = Vec::new();
                if active(a) {
                    let quotient = self.simplified_div(w, b);
                    let product = self.simplified_mul(quotient, reciprocal);
                    arcs.push((a, b, self.simplified_neg(product)));
                }
                let minus_two = self.constant(-2.0);
                let twice = self.simplified_mul(minus_two, reciprocal);
                arcs.push((b, b, self.simplified_mul(twice, partial)));
                arcs
            }
            Op::Unary(Unary::Sqrt, a) if active(a) => {
                let [Some((_, first)), _] = self.pull_back(node, w, active) else { return Vec::new() };
                let minus_half = self.constant(-0.5);
                let factor = self.simplified_div(minus_half, a);
                vec![(a, a, self.simplified_mul(first, factor))]
            }
            Op::Unary(Unary::Ln, a) if active(a) => {
                let [Some((_, first)), _] = self.pull_back(node, w, active) else { return Vec::new() };
                let partial = self.unary_partial(Unary::Ln, a, node);
                let product = self.simplified_mul(first, partial);
                vec![(a, a, self.simplified_neg(product))]
            }
            op => match op {
                Op::Binary(Binary::Powf, a, b) => match self.value(b) {
                    Some(n) if active(a) && !is_small_integer(n) => {
                        vec![(a, a, self.second_of_power(n, a, node, w))]
                    }
                    _ => self.second_by_rules(op, w, active),
                },
                _ => self.second_by_rules(op, w, active),
            },
        }
    }

    /// `w n (n − 1) aⁿ⁻²` of `c = aⁿ`.
    fn second_of_power(&mut self, n: f64, a: Node, c: Node, w: Node) -> Node {
        let ratio = self.power_ratio(n, a, c);
        let (first, n_minus_one) = (self.simplified_mul(w, ratio), self.constant(n - 1.0));
        let factor = self.simplified_div(n_minus_one, a);
        let second = self.simplified_mul(first, factor);
        self.zero_at_zero(n > 2.0, a, second)
    }

    /// Applies the rules to the partial derivatives, on a separate graph whose variables are the
    /// operands, so that the operands are not differentiated.
    fn second_by_rules(&mut self, op: Op, w: Node, active: impl Fn(Node) -> bool) -> Vec<(Node, Node, Node)> {
        let operands: Vec<Node> = op.operands().collect();
        let mut scratch = Graph::default();
        let places: Vec<Node> = (0..)
            .zip(&operands)
            .map(|(index, &operand)| match self.value(operand) {
                Some(value) => scratch.constant(value),
                None => scratch.variable(index),
            })
            .collect();
        let is_active = |place: usize| active(operands[place]);
        let node = match op {
            Op::Unary(function, _) => scratch.unary(function, places[0]),
            Op::Powi(_, n) => scratch.powi(places[0], n),
            Op::Binary(function, ..) => scratch.binary(function, places[0], places[1]),
            _ => return Vec::new(),
        };
        let mut arcs: Vec<(Node, Node, Node)> = Vec::new();
        for j in 0..operands.len() {
            for k in 0..=j {
                if !is_active(j) || !is_active(k) {
                    continue;
                }
                let Some((_, partial)) =
                    scratch.partials(node, |node| node == places[j]).into_iter().flatten().next()
                else {
                    continue;
                };
                let one = scratch.constant(1.0);
                let rate = |index| (index as usize == k).then_some(one);
                let second = tangent(&mut scratch, &[partial], rate)[0];
                if scratch.is_zero(second) {
                    continue;
                }
                let second = self.copy_from_graph(&scratch, second, &operands);
                let mut value = self.simplified_mul(w, second);
                if j != k && operands[j] == operands[k] {
                    value = self.simplified_add(value, value);
                }
                match arcs.iter_mut().find(|arc| arc.0 == operands[j] && arc.1 == operands[k]) {
                    Some(arc) => arc.2 = self.simplified_add(arc.2, value),
                    None => arcs.push((operands[j], operands[k], value)),
                }
            }
        }
        arcs
    }

    /// Copies an expression of another graph, with `variables` as its variables.
    fn copy_from_graph(&mut self, from: &Graph, node: Node, variables: &[Node]) -> Node {
        let mut image = vec![node; node.at() + 1];
        for node in from.reachable(&[node]) {
            image[node.at()] = match from.op(node) {
                Op::Variable(index) => variables[index as usize],
                op => self.rebuild(op, |operand| image[operand.at()]),
            };
        }
        image[node.at()]
    }
}

/// Whether multiplications are cheaper than a power with this exponent.
fn is_small_integer(n: f64) -> bool {
    n == n.trunc() && n.abs() <= 64.0
}
