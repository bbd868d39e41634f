//! The state of an evaluation, and what everything else asks of it.

use super::place::{Place, Projection};
use super::types::Type;
use super::value::{Integer, Value};
use crate::graph::{Graph, Node};
use proc_macro2::TokenStream;
use quote::ToTokens;
use syn::Result;

/// The tokens an error points at.
pub type At<'a> = &'a dyn ToTokens;

/// An error at the user's tokens: one lower-case sentence that says what, and the way out.
pub fn error(at: At, message: impl std::fmt::Display) -> syn::Error {
    syn::Error::new_spanned(at, message)
}

/// An error about what a graph model cannot express: `what` is the subject of the sentence.
pub fn unsupported(at: At, what: impl std::fmt::Display) -> syn::Error {
    error(
        at,
        format!(
            "{what} is outside of what a graph model can express: rewrite it, or make the model generic, \
             `fn f<T: DualNum<f64> + Copy>(...)`, where any Rust is allowed"
        ),
    )
}

/// Executes functions symbolically.
#[derive(Default)]
pub struct Evaluator {
    /// The expressions.
    pub graph: Graph,
    /// Constants from outside: `Op::Opaque` is an index into this.
    pub opaque: Vec<TokenStream>,
    /// `use` items in bodies, which the opaque constants may need.
    pub uses: Vec<syn::ItemUse>,
}

/// Binary operators that yield numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Operator {
    Add,
    Sub,
    Mul,
    Div,
    Rem,
    BitXor,
    BitAnd,
    BitOr,
    Shl,
    Shr,
}

/// Comparisons.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Comparison {
    Eq,
    Ne,
    Lt,
    Le,
    Gt,
    Ge,
}

impl Evaluator {
    /// Calls a closure, a function or a constructor.
    pub fn call(&mut self, _function: &Value, _arguments: Vec<Value>, _at: At) -> Result<Value> {
        todo!()
    }

    /// The value as a number. Opaque constants become one here.
    pub fn real(&mut self, _value: &Value, _at: At) -> Result<Node> {
        todo!()
    }

    /// The value as a known integer.
    pub fn integer(&mut self, _value: &Value, _at: At) -> Result<Integer> {
        todo!()
    }

    /// The value as a known index or length.
    pub fn usize(&mut self, _value: &Value, _at: At) -> Result<usize> {
        todo!()
    }

    /// `a ∘ b` of any two values that have it, elementwise and user-defined operators included.
    pub fn binary(&mut self, _operator: Operator, _a: &Value, _b: &Value, _at: At) -> Result<Value> {
        todo!()
    }

    /// `-a`
    pub fn negate(&mut self, _a: &Value, _at: At) -> Result<Value> {
        todo!()
    }

    /// A comparison: a `Bool` where it is known, a `Condition` where it is not.
    pub fn compare(&mut self, _comparison: Comparison, _a: &Value, _b: &Value, _at: At) -> Result<Value> {
        todo!()
    }

    /// `if condition { a } else { b }`, elementwise.
    pub fn select(&mut self, _condition: Node, _a: &Value, _b: &Value, _at: At) -> Result<Value> {
        todo!()
    }

    /// The value in a place.
    pub fn read(&mut self, _place: &Place, _at: At) -> Result<Value> {
        todo!()
    }

    /// Writes to a place.
    pub fn write(&mut self, _place: &Place, _value: Value, _at: At) -> Result<()> {
        todo!()
    }

    /// A part of a place; its bounds are checked. Slices of slices, and elements of slices and blocks, are resolved.
    pub fn project(&mut self, _place: &Place, _projection: Projection, _at: At) -> Result<Place> {
        todo!()
    }

    /// The value as one of the type: opaque constants are taken apart, integers get their type, `&mut`
    /// is followed. An error if the shapes do not fit.
    pub fn coerce(&mut self, _value: Value, _ty: &Type, _at: At) -> Result<Value> {
        todo!()
    }

    /// A value of the type, whose numbers are made by `leaf` from their names (`name[3].position`).
    pub fn instantiate(
        &mut self,
        _ty: &Type,
        _name: String,
        _leaf: &mut dyn FnMut(&mut Evaluator, String) -> Result<Node>,
        _at: At,
    ) -> Result<Value> {
        todo!()
    }
}
