//! What can be known about a model before it runs: structural index, explicit form, linear rows, and the
//! derivatives that the engine will ask for, as graphs.

use crate::graph::Node;
use crate::language::Model;

/// A model with its derivatives and its structure.
pub struct Analysis {
    /// The model; its graph holds the derivatives too.
    pub model: Model,
    /// Non-zeros of the Jacobian `(equation, variable, value)`, by block (ẋ, x, z, u, p), row, column.
    pub jacobian: Vec<(u32, u32, Node)>,
    /// Where each block begins in `jacobian`, and its end.
    pub blocks: [usize; 6],
    /// `∇(μᵀ f)` over `(ẋ, x, z, u, p)`.
    pub gradient: Vec<Node>,
    /// Non-zeros of the lower triangle of `∇²(μᵀ f)`, `(variable, variable, value)`.
    pub hessian: Vec<(u32, u32, Node)>,
    /// Equations that are linear in `(ẋ, x, z, u, p)` jointly.
    pub linear: Vec<bool>,
    /// For an explicit model: for each state its row and coefficient.
    pub explicit: Option<Vec<(u32, f64)>>,
}

/// Derives everything, or says why the model is no index-1 DAE.
pub fn analyse(_model: Model) -> syn::Result<Analysis> {
    todo!()
}
