//! Types, as far as they are needed: lengths and shapes flow from them into the values.

use super::value::{Definition, Generic, IntegerType};
use std::rc::Rc;

/// A type. References are transparent.
#[derive(Clone, Debug, Default)]
pub enum Type {
    /// To be inferred.
    #[default]
    Unknown,
    /// `f64`
    Real,
    /// An integer type.
    Integer(IntegerType),
    /// `bool`
    Bool,
    /// A tuple; the empty one is `()`.
    Tuple(Rc<Vec<Type>>),
    /// An array; of unknown length where it is `_`, or a slice.
    Array(Rc<Type>, Option<usize>),
    /// A struct or enum of the user with its generic arguments.
    Struct(Rc<Definition>, Rc<Vec<Generic>>),
    /// A nalgebra matrix or vector, with the rows and columns that are known.
    Matrix(Option<usize>, Option<usize>),
    /// An `Option`.
    Option(Rc<Type>),
}
