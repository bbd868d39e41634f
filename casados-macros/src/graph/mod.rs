//! A hash-consed expression graph: equal expressions are one node.
//!
//! Nodes are in topological order: operands have smaller indices. Constructors apply
//! simplifications that preserve the bits of the result, except for the sign of a zero (constant
//! folding, `a + 0`, `a · 1`, `−(−a)`), and structural zeros (`0 · a = 0`, `a − a = 0`, for every
//! value of `a`). Derivative code uses the operations of `algebra`, which may also round
//! differently.
//!
//! Functions do not recurse along the graph, which may be deeper than the stack.

mod algebra;
mod count;
mod elimination;
mod evaluate;
mod hash;
mod hessian;
mod jacobian;
#[cfg(test)]
mod print;
mod reverse;
mod rules;
mod signs;
mod simplify;
mod sparsity;
mod substitute;
mod table;
mod tangent;
#[cfg(test)]
mod tests;

pub use evaluate::EvaluationPoint;
pub use hessian::hessian;
pub use jacobian::jacobian;
pub use reverse::gradient;
pub use sparsity::Degree;
pub use table::Table;
pub use tangent::tangent;

use std::collections::HashMap;

/// A node of a graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Node(pub u32);

/// An entry of a sparse matrix: row, column, value.
pub type Entry = (u32, u32, Node);

/// The operation of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Op {
    /// A constant, by its bits.
    Constant(u64),
    /// A variable of the model, by its index in `(ẋ, x, z, u, p, t)`.
    Variable(u32),
    /// A constant defined outside of the macro's input, by its index in the model's list.
    Opaque(u32),
    /// An adjoint seed `μ_r`.
    Seed(u32),
    /// A function of one argument.
    Unary(Unary, Node),
    /// A function of two arguments.
    Binary(Binary, Node, Node),
    /// An integer power.
    Powi(Node, i32),
    /// `if condition { a } else { b }`
    Select(Node, Node, Node),
    /// A condition: `a < b`, `a ≤ b` or `a = b`.
    Compare(Compare, Node, Node),
    /// A conjunction of conditions.
    And(Node, Node),
    /// A disjunction of conditions.
    Or(Node, Node),
    /// A negated condition.
    Not(Node),
}

/// Functions of one argument, named as the methods of `f64`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum Unary {
    Neg,
    Sqrt,
    Cbrt,
    Exp,
    Exp2,
    ExpM1,
    Ln,
    Ln1p,
    Log2,
    Log10,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Asinh,
    Acosh,
    Atanh,
    Abs,
    Signum,
    /// A derivative of a table.
    Table(Table<1>),
}

/// Functions of two arguments, named as the operators and methods of `f64`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum Binary {
    Add,
    Sub,
    Mul,
    Div,
    Powf,
    Atan2,
    Hypot,
    /// A derivative of a table.
    Table(Table<2>),
}

/// Comparisons; the others follow by exchange of operands and negation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum Compare {
    Lt,
    Le,
    Eq,
}

impl Op {
    /// The operands.
    pub fn operands(self) -> impl Iterator<Item = Node> {
        let operands = match self {
            Op::Constant(_) | Op::Variable(_) | Op::Opaque(_) | Op::Seed(_) => [None; 3],
            Op::Unary(_, a) | Op::Powi(a, _) | Op::Not(a) => [Some(a), None, None],
            Op::Binary(_, a, b) | Op::Compare(_, a, b) | Op::And(a, b) | Op::Or(a, b) => {
                [Some(a), Some(b), None]
            }
            Op::Select(condition, a, b) => [Some(condition), Some(a), Some(b)],
        };
        operands.into_iter().flatten()
    }
}

impl Node {
    /// The index into an array with one element per node.
    pub fn at(self) -> usize {
        self.0 as usize
    }
}

/// The expression graph.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    ops: Vec<Op>,
    index: HashMap<Op, Node, hash::BuildHasher>,
}

impl Graph {
    /// The operation of a node.
    pub fn op(&self, node: Node) -> Op {
        self.ops[node.at()]
    }

    /// The number of nodes.
    pub fn len(&self) -> usize {
        self.ops.len()
    }

    /// The node of an operation: an existing or a new one.
    fn node(&mut self, op: Op) -> Node {
        if let Some(&node) = self.index.get(&op) {
            return node;
        }
        let node = Node(u32::try_from(self.ops.len()).expect("graph size is bounded by the evaluator"));
        self.ops.push(op);
        self.index.insert(op, node);
        node
    }

    /// A constant.
    pub fn constant(&mut self, value: f64) -> Node {
        self.node(Op::Constant(value.to_bits()))
    }

    /// The value of a node, if it is a constant.
    pub fn value(&self, node: Node) -> Option<f64> {
        match self.op(node) {
            Op::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// A variable of the model.
    pub fn variable(&mut self, index: u32) -> Node {
        self.node(Op::Variable(index))
    }

    /// A constant from outside.
    pub fn opaque(&mut self, index: u32) -> Node {
        self.node(Op::Opaque(index))
    }

    /// An adjoint seed.
    pub fn seed(&mut self, row: u32) -> Node {
        self.node(Op::Seed(row))
    }
}
