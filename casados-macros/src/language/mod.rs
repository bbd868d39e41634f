//! From Rust tokens to a graph: the signature of a model, and the partial evaluator that executes its body.

mod arithmetic;
mod call;
mod closure;
mod environment;
mod evaluator;
mod expression;
mod items;
mod methods;
mod path;
mod pattern;
mod place;
mod select;
mod statement;
#[cfg(test)]
mod tests;
mod types;
mod value;

use crate::graph::{Graph, Node};
use proc_macro2::{Span, TokenStream};

/// Which attribute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// The function returns the residual `f(ẋ, x, u, z, p, t)`.
    Dae,
    /// The function returns `ẋ`; the graph's residual is `ẋ − g(x, u, p, t)`.
    Ode,
}

/// Where the generated items go.
#[derive(Clone, Debug)]
pub enum Place {
    /// Beside the item (a function).
    Beside,
    /// Inside the module, with a re-export beside it: `pub use name::Type;`.
    Inside,
}

/// What an attribute stands on, understood.
pub struct Source {
    /// The item as it was written, less attributes that are ours.
    pub item: TokenStream,
    /// Where the generated items go.
    pub place: Place,
    /// One model; several where the attribute lists values of const generics.
    pub models: Vec<Model>,
}

/// A model as a graph.
pub struct Model {
    /// Name of the type: that of the function or module in upper camel case.
    pub name: syn::Ident,
    /// Visibility of the function or module.
    pub visibility: syn::Visibility,
    /// Documentation attributes of the item.
    pub documentation: Vec<syn::Attribute>,
    /// Values of the const parameters, if the model has any: `impl Dae for Chain<9>`.
    pub instance: Vec<Instance>,
    /// Names of the variables.
    pub variables: Variables,
    /// The expressions.
    pub graph: Graph,
    /// `f`, one node per equation.
    pub residual: Vec<Node>,
    /// Where each equation was written: what errors about it point at.
    pub spans: Vec<Span>,
    /// Constants from outside, as Rust expressions of type `f64`; `Op::Opaque` is an index into this.
    pub opaque: Vec<TokenStream>,
    /// `use` items in the body, which the opaque constants may need.
    pub uses: Vec<syn::ItemUse>,
    /// Path of the crate: `::casados` unless the attribute says `crate = path`.
    pub krate: syn::Path,
}

/// A const parameter and its value in this model.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Its name.
    pub name: syn::Ident,
    /// Its type, `usize` as a rule.
    pub ty: syn::Type,
    /// Its value.
    pub value: u64,
}

/// Names of the variables, flattened: `x[3]`, `cart.position`. Their numbers are the dimensions.
/// Index in the graph: `ẋ`, `x`, `z`, `u`, `p`, `t`, one after the other; `t` is always the last, used or not.
#[derive(Clone, Debug, Default)]
pub struct Variables {
    /// Differential states (and their derivatives).
    pub x: Vec<String>,
    /// Algebraic states.
    pub z: Vec<String>,
    /// Controls.
    pub u: Vec<String>,
    /// Parameters.
    pub p: Vec<String>,
}

/// Reads an item.
pub fn read(_form: Form, _attribute: TokenStream, item: TokenStream) -> syn::Result<Source> {
    Err(syn::Error::new_spanned(item, "not written yet"))
}
