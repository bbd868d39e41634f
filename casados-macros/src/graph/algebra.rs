//! Arithmetic for derivative code: simplifications that save operations but may round differently,
//! and selections outside of products.
//!
//! The derivative of `if c { √x } else { 0 }` is `if c { w / (2 √x) } else { 0 }`, never
//! `(if c { w } else { 0 }) / (2 √x)`, which is `0 · ∞` at `x = 0`. A value that is zero in one
//! branch therefore remains a selection, and products are moved inside.

use super::{Binary, Graph, Node, Op, Unary};

/// Maximum nesting of selections, which keeps the work linear in their depth: deeper ones become
/// one selection with the conjunction of their conditions.
const MAX_SELECTION_DEPTH: usize = 8;

/// Sums of selections nested deeper than this are multiplied from outside.
const MAX_SUMMAND_DEPTH: usize = 3;

/// A condition, and the branch in which a value is not zero.
type Branch = (Node, bool);

impl Graph {
    pub(super) fn is_zero(&self, a: Node) -> bool {
        self.value(a) == Some(0.0)
    }

    /// The branch outside of which a value is zero, and the value in it.
    fn branch(&self, a: Node) -> Option<(Branch, Node)> {
        match self.op(a) {
            Op::Select(condition, x, y) if self.is_zero(y) => Some(((condition, true), x)),
            Op::Select(condition, x, y) if self.is_zero(x) => Some(((condition, false), y)),
            _ => None,
        }
    }

    /// Removes the selections outside of which a value is zero; appends their branches.
    fn strip_branches(&self, mut a: Node, branches: &mut Vec<Branch>) -> Node {
        for _ in 0..MAX_SELECTION_DEPTH {
            let Some((branch, inner)) = self.branch(a) else { break };
            branches.push(branch);
            a = inner;
        }
        a
    }

    /// Wraps a value into selections of branches.
    fn apply_branches(&mut self, mut a: Node, mut branches: Vec<Branch>) -> Node {
        let zero = self.constant(0.0);
        let mut left = Vec::new();
        while let Some((condition, taken)) = branches.pop() {
            if branches.contains(&(condition, !taken)) {
                return zero;
            }
            if !branches.contains(&(condition, taken)) {
                left.push((condition, taken));
            }
        }
        // Selections are at most as deep as `strip_branches` reaches: more become one.
        if left.len() > MAX_SELECTION_DEPTH {
            let mut all = None;
            for (condition, taken) in left {
                let condition = if taken { condition } else { self.not(condition) };
                all = Some(all.map_or(condition, |all| self.and(all, condition)));
            }
            return all.map_or(a, |all| self.select(all, a, zero));
        }
        for (condition, taken) in left {
            let (x, y) = if taken { (a, zero) } else { (zero, a) };
            a = self.select(condition, x, y);
        }
        a
    }

    /// `−a`
    pub(super) fn simplified_neg(&mut self, a: Node) -> Node {
        let mut branches = Vec::new();
        let a = self.strip_branches(a, &mut branches);
        let a = self.unary(Unary::Neg, a);
        self.apply_branches(a, branches)
    }

    /// `a + b`
    pub(super) fn simplified_add(&mut self, a: Node, b: Node) -> Node {
        if let (Some(((c, in_a), x)), Some(((d, in_b), y))) = (self.branch(a), self.branch(b))
            && c == d
        {
            let zero = self.constant(0.0);
            let (x, y) = match (in_a, in_b) {
                (true, false) => (x, y),
                (false, true) => (y, x),
                (true, true) => (self.add_within_branches(x, y), zero),
                (false, false) => (zero, self.add_within_branches(x, y)),
            };
            return self.select(c, x, y);
        }
        self.add_within_branches(a, b)
    }

    fn add_within_branches(&mut self, a: Node, b: Node) -> Node {
        let ((x, factor_a), (y, factor_b)) = (self.multiple(a), self.multiple(b));
        if x == y && self.value(x).is_none() {
            let factor = self.constant(factor_a + factor_b);
            return self.binary(Binary::Mul, factor, x);
        }
        self.binary(Binary::Add, a, b)
    }

    /// `a` as a multiple `(x, c)` of another node: `a = c x`.
    fn multiple(&self, a: Node) -> (Node, f64) {
        match self.op(a) {
            Op::Unary(Unary::Neg, x) => (x, -1.0),
            Op::Binary(Binary::Mul, x, y) => match (self.value(x), self.value(y)) {
                (Some(factor), _) => (y, factor),
                (_, Some(factor)) => (x, factor),
                _ => (a, 1.0),
            },
            _ => (a, 1.0),
        }
    }

    /// `a − b`
    pub(super) fn simplified_sub(&mut self, a: Node, b: Node) -> Node {
        let b = self.simplified_neg(b);
        self.simplified_add(a, b)
    }

    /// Whether a value is a sum of selections that are zero in one branch.
    fn is_sum_of_selections(&self, a: Node, depth: usize) -> bool {
        self.branch(a).is_some()
            || match self.op(a) {
                Op::Binary(Binary::Add | Binary::Sub, x, y) if depth > 0 => {
                    self.is_sum_of_selections(x, depth - 1) && self.is_sum_of_selections(y, depth - 1)
                }
                _ => false,
            }
    }

    /// `a · b`
    pub(super) fn simplified_mul(&mut self, a: Node, b: Node) -> Node {
        for (sum, factor) in [(a, b), (b, a)] {
            if let Op::Binary(function @ (Binary::Add | Binary::Sub), x, y) = self.op(sum)
                && self.is_sum_of_selections(sum, MAX_SUMMAND_DEPTH)
            {
                let (x, y) = (self.simplified_mul(x, factor), self.simplified_mul(y, factor));
                return if function == Binary::Add {
                    self.simplified_add(x, y)
                } else {
                    self.simplified_sub(x, y)
                };
            }
        }
        let mut branches = Vec::new();
        let (a, b) = (self.strip_branches(a, &mut branches), self.strip_branches(b, &mut branches));
        let product = self.mul_within_branches(a, b);
        self.apply_branches(product, branches)
    }

    fn mul_within_branches(&mut self, a: Node, b: Node) -> Node {
        for (factor, other) in [(a, b), (b, a)] {
            if let Some(value) = self.value(factor) {
                return self.scale_by_constant(value, other);
            }
        }
        // (x / y) y = x
        for (quotient, other) in [(a, b), (b, a)] {
            if let Op::Binary(Binary::Div, x, y) = self.op(quotient)
                && y == other
            {
                return x;
            }
        }
        self.binary(Binary::Mul, a, b)
    }

    /// A constant times a node, combined with constant factors of the node.
    fn scale_by_constant(&mut self, factor: f64, a: Node) -> Node {
        if let Op::Binary(function @ (Binary::Mul | Binary::Div), x, y) = self.op(a) {
            if let Some(value) = self.value(x) {
                let x = self.constant(factor * value);
                return self.binary(function, x, y);
            }
            if let Some(value) = self.value(y) {
                let y = if function == Binary::Mul { factor * value } else { factor / value };
                let y = self.constant(y);
                return self.binary(Binary::Mul, y, x);
            }
        }
        let factor = self.constant(factor);
        self.binary(Binary::Mul, factor, a)
    }

    /// `a / b`
    pub(super) fn simplified_div(&mut self, a: Node, b: Node) -> Node {
        let mut branches = Vec::new();
        let a = self.strip_branches(a, &mut branches);
        let quotient = match self.value(b) {
            Some(value) => self.scale_by_constant(1.0 / value, a),
            None => self.binary(Binary::Div, a, b),
        };
        self.apply_branches(quotient, branches)
    }
}
