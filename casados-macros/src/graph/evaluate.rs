//! Evaluation of nodes in `f64`.

use super::{Binary, Compare, Graph, Node, Op, Unary};

/// The values of variables, constants and seeds. Missing ones are NaN.
#[derive(Clone, Copy, Debug, Default)]
pub struct EvaluationPoint<'a> {
    /// `(ẋ, x, z, u, p, t)`
    pub variables: &'a [f64],
    /// Constants from outside.
    pub opaque: &'a [f64],
    /// `μ`
    pub seeds: &'a [f64],
}

impl Graph {
    /// The values of nodes at a point. Conditions are 1 or 0.
    pub fn evaluate(&self, nodes: &[Node], point: EvaluationPoint) -> Vec<f64> {
        let given = |values: &[f64], index: u32| values.get(index as usize).copied().unwrap_or(f64::NAN);
        let truth = |truth: bool| f64::from(u8::from(truth));
        let mut values = vec![0.0; self.len()];
        for node in self.reachable(nodes) {
            let at = |node: Node| values[node.at()];
            values[node.at()] = match self.op(node) {
                Op::Constant(bits) => f64::from_bits(bits),
                Op::Variable(index) => given(point.variables, index),
                Op::Opaque(index) => given(point.opaque, index),
                Op::Seed(index) => given(point.seeds, index),
                Op::Unary(function, a) => unary_value(function, at(a)),
                Op::Binary(function, a, b) => binary_value(function, at(a), at(b)),
                Op::Powi(a, n) => at(a).powi(n),
                Op::Select(condition, a, b) => at(if at(condition) != 0.0 { a } else { b }),
                Op::Compare(comparison, a, b) => truth(compare_value(comparison, at(a), at(b))),
                Op::And(a, b) => truth(at(a) != 0.0 && at(b) != 0.0),
                Op::Or(a, b) => truth(at(a) != 0.0 || at(b) != 0.0),
                Op::Not(a) => truth(at(a) == 0.0),
            };
        }
        nodes.iter().map(|node| values[node.at()]).collect()
    }
}

/// A function of one argument.
pub fn unary_value(function: Unary, a: f64) -> f64 {
    match function {
        Unary::Neg => -a,
        Unary::Sqrt => a.sqrt(),
        Unary::Cbrt => a.cbrt(),
        Unary::Exp => a.exp(),
        Unary::Exp2 => a.exp2(),
        Unary::ExpM1 => a.exp_m1(),
        Unary::Ln => a.ln(),
        Unary::Ln1p => a.ln_1p(),
        Unary::Log2 => a.log2(),
        Unary::Log10 => a.log10(),
        Unary::Sin => a.sin(),
        Unary::Cos => a.cos(),
        Unary::Tan => a.tan(),
        Unary::Asin => a.asin(),
        Unary::Acos => a.acos(),
        Unary::Atan => a.atan(),
        Unary::Sinh => a.sinh(),
        Unary::Cosh => a.cosh(),
        Unary::Tanh => a.tanh(),
        Unary::Asinh => a.asinh(),
        Unary::Acosh => a.acosh(),
        Unary::Atanh => a.atanh(),
        Unary::Abs => a.abs(),
        Unary::Signum => a.signum(),
        Unary::Table(table) => table.sample_value([a]),
    }
}

/// A function of two arguments.
pub fn binary_value(function: Binary, a: f64, b: f64) -> f64 {
    match function {
        Binary::Add => a + b,
        Binary::Sub => a - b,
        Binary::Mul => a * b,
        Binary::Div => a / b,
        Binary::Powf => a.powf(b),
        Binary::Atan2 => a.atan2(b),
        Binary::Hypot => a.hypot(b),
        Binary::Table(table) => table.sample_value([a, b]),
    }
}

/// A comparison.
#[allow(clippy::float_cmp)]
pub fn compare_value(comparison: Compare, a: f64, b: f64) -> bool {
    match comparison {
        Compare::Lt => a < b,
        Compare::Le => a <= b,
        Compare::Eq => a == b,
    }
}
