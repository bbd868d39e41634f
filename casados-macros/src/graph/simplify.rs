//! Constructors of expressions. They preserve the bits of the result, except for the sign of a
//! zero.

use super::evaluate::{binary_value, compare_value, unary_value};
use super::{Binary, Compare, Graph, Node, Op, Unary};

impl Graph {
    /// A function of one argument.
    pub fn unary(&mut self, function: Unary, a: Node) -> Node {
        match (function, self.op(a)) {
            (Unary::Table(_), _) => self.node(Op::Unary(function, a)),
            (_, Op::Constant(bits)) => self.constant(unary_value(function, f64::from_bits(bits))),
            (Unary::Neg, _) => self.negate(a),
            (Unary::Abs, Op::Unary(Unary::Neg, inner)) => self.unary(Unary::Abs, inner),
            (Unary::Abs, Op::Unary(Unary::Abs, _)) => a,
            _ => self.node(Op::Unary(function, a)),
        }
    }

    /// A function of two arguments.
    pub fn binary(&mut self, function: Binary, a: Node, b: Node) -> Node {
        let values = (self.value(a), self.value(b));
        if let (Some(a), Some(b)) = values
            && !matches!(function, Binary::Table(_))
        {
            return self.constant(binary_value(function, a, b));
        }
        match function {
            Binary::Add => self.add(a, b),
            Binary::Sub => self.sub(a, b),
            Binary::Mul => self.mul(a, b),
            Binary::Div => self.div(a, b),
            Binary::Powf if values.1 == Some(0.0) => self.constant(1.0),
            Binary::Powf if values.1 == Some(1.0) => a,
            Binary::Powf | Binary::Atan2 | Binary::Hypot | Binary::Table(_) => {
                self.node(Op::Binary(function, a, b))
            }
        }
    }

    /// `aⁿ`
    pub fn powi(&mut self, a: Node, n: i32) -> Node {
        if let Some(value) = self.value(a) {
            return self.constant(value.powi(n));
        }
        match n {
            0 => self.constant(1.0),
            1 => a,
            2 => self.mul(a, a),
            -1 => {
                let one = self.constant(1.0);
                self.div(one, a)
            }
            _ => self.node(Op::Powi(a, n)),
        }
    }

    /// The operand, if the node is a negation.
    fn operand_of_negation(&self, a: Node) -> Option<Node> {
        match self.op(a) {
            Op::Unary(Unary::Neg, inner) => Some(inner),
            _ => None,
        }
    }

    fn negate(&mut self, a: Node) -> Node {
        match self.op(a) {
            Op::Constant(bits) => self.constant(-f64::from_bits(bits)),
            Op::Unary(Unary::Neg, inner) => inner,
            Op::Binary(Binary::Sub, x, y) => self.sub(y, x),
            Op::Binary(function @ (Binary::Mul | Binary::Div), x, y) => {
                if let Some(value) = self.value(x) {
                    let x = self.constant(-value);
                    self.binary(function, x, y)
                } else if let Some(value) = self.value(y) {
                    let y = self.constant(-value);
                    self.binary(function, x, y)
                } else {
                    self.node(Op::Unary(Unary::Neg, a))
                }
            }
            _ => self.node(Op::Unary(Unary::Neg, a)),
        }
    }

    fn add(&mut self, a: Node, b: Node) -> Node {
        if self.value(a) == Some(0.0) {
            return b;
        }
        if self.value(b) == Some(0.0) {
            return a;
        }
        match (self.operand_of_negation(a), self.operand_of_negation(b)) {
            (_, Some(inner)) => self.sub(a, inner),
            (Some(inner), None) => self.sub(b, inner),
            (None, None) => self.node(Op::Binary(Binary::Add, a.min(b), a.max(b))),
        }
    }

    fn sub(&mut self, a: Node, b: Node) -> Node {
        if a == b {
            return self.constant(0.0);
        }
        if self.value(b) == Some(0.0) {
            return a;
        }
        if self.value(a) == Some(0.0) {
            return self.negate(b);
        }
        match (self.operand_of_negation(a), self.operand_of_negation(b)) {
            (_, Some(inner)) => self.add(a, inner),
            (Some(inner), None) => {
                let sum = self.add(inner, b);
                self.negate(sum)
            }
            (None, None) => self.node(Op::Binary(Binary::Sub, a, b)),
        }
    }

    fn mul(&mut self, a: Node, b: Node) -> Node {
        for (factor, other) in [(a, b), (b, a)] {
            let Some(value) = self.value(factor) else { continue };
            if value == 0.0 {
                return self.constant(0.0);
            } else if value == 1.0 {
                return other;
            } else if value == -1.0 {
                return self.negate(other);
            } else if let Some(inner) = self.operand_of_negation(other) {
                let factor = self.constant(-value);
                return self.mul(factor, inner);
            }
        }
        match (self.operand_of_negation(a), self.operand_of_negation(b)) {
            (Some(a), Some(b)) => self.mul(a, b),
            (Some(inner), None) => {
                let product = self.mul(inner, b);
                self.negate(product)
            }
            (None, Some(inner)) => {
                let product = self.mul(a, inner);
                self.negate(product)
            }
            (None, None) => self.node(Op::Binary(Binary::Mul, a.min(b), a.max(b))),
        }
    }

    fn div(&mut self, a: Node, b: Node) -> Node {
        if self.value(a) == Some(0.0) {
            return self.constant(0.0);
        }
        if let Some(value) = self.value(b) {
            if value == 1.0 {
                return a;
            } else if value == -1.0 {
                return self.negate(a);
            } else if let Some(reciprocal) = exact_reciprocal(value) {
                let reciprocal = self.constant(reciprocal);
                return self.mul(reciprocal, a);
            } else if let Some(inner) = self.operand_of_negation(a) {
                let b = self.constant(-value);
                return self.div(inner, b);
            }
        } else if let (Some(value), Some(inner)) = (self.value(a), self.operand_of_negation(b)) {
            let a = self.constant(-value);
            return self.div(a, inner);
        }
        match (self.operand_of_negation(a), self.operand_of_negation(b)) {
            (Some(a), Some(b)) => self.div(a, b),
            (Some(inner), None) => {
                let quotient = self.div(inner, b);
                self.negate(quotient)
            }
            (None, Some(inner)) => {
                let quotient = self.div(a, inner);
                self.negate(quotient)
            }
            (None, None) => self.node(Op::Binary(Binary::Div, a, b)),
        }
    }

    /// `if condition { a } else { b }`
    pub fn select(&mut self, condition: Node, a: Node, b: Node) -> Node {
        match self.known_condition(condition) {
            Some(true) => a,
            Some(false) => b,
            None if a == b => a,
            None => match (self.op(condition), self.op(a), self.op(b)) {
                (Op::Not(inner), ..) => self.select(inner, b, a),
                (_, Op::Select(same, x, _), _) if same == condition => self.select(condition, x, b),
                (_, _, Op::Select(same, _, y)) if same == condition => self.select(condition, a, y),
                _ => self.node(Op::Select(condition, a, b)),
            },
        }
    }

    /// A comparison of numbers. Of two constants it is folded: see [`Graph::known_condition`].
    pub fn compare(&mut self, comparison: Compare, a: Node, b: Node) -> Node {
        match (self.value(a), self.value(b)) {
            (Some(a), Some(b)) => self.constant_condition(compare_value(comparison, a, b)),
            _ if comparison == Compare::Lt && a == b => self.constant_condition(false),
            _ if comparison == Compare::Eq => self.node(Op::Compare(comparison, a.min(b), a.max(b))),
            _ => self.node(Op::Compare(comparison, a, b)),
        }
    }

    /// A conjunction.
    pub fn and(&mut self, a: Node, b: Node) -> Node {
        match (self.known_condition(a), self.known_condition(b)) {
            (Some(false), _) | (_, Some(true)) => a,
            (_, Some(false)) | (Some(true), _) => b,
            _ if a == b => a,
            _ => self.node(Op::And(a.min(b), a.max(b))),
        }
    }

    /// A disjunction.
    pub fn or(&mut self, a: Node, b: Node) -> Node {
        match (self.known_condition(a), self.known_condition(b)) {
            (Some(true), _) | (_, Some(false)) => a,
            (_, Some(true)) | (Some(false), _) => b,
            _ if a == b => a,
            _ => self.node(Op::Or(a.min(b), a.max(b))),
        }
    }

    /// A negation.
    pub fn not(&mut self, a: Node) -> Node {
        match (self.known_condition(a), self.op(a)) {
            (Some(truth), _) => self.constant_condition(!truth),
            (None, Op::Not(inner)) => inner,
            _ => self.node(Op::Not(a)),
        }
    }

    /// A constant condition: `0 = 0` or `0 < 0`.
    fn constant_condition(&mut self, truth: bool) -> Node {
        let zero = self.constant(0.0);
        self.node(Op::Compare(if truth { Compare::Eq } else { Compare::Lt }, zero, zero))
    }

    /// The value of a constant condition.
    pub fn known_condition(&self, condition: Node) -> Option<bool> {
        match self.op(condition) {
            Op::Compare(comparison, a, b) => Some(compare_value(comparison, self.value(a)?, self.value(b)?)),
            _ => None,
        }
    }
}

/// `1 / a`, if division by `a` and multiplication by it are equivalent: `a` is a power of two, and
/// neither number is subnormal.
fn exact_reciprocal(a: f64) -> Option<f64> {
    const MANTISSA: u64 = (1 << 52) - 1;
    let reciprocal = 1.0 / a;
    let exact = a.is_normal() && reciprocal.is_normal() && a.to_bits() & MANTISSA == 0;
    exact.then_some(reciprocal)
}
