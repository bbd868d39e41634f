//! The values of expressions in the symbolic execution of a model.
//!
//! Values are cheap to clone: aggregates are shared, and copied when an owner changes them. Shared
//! references are transparent: `&a` is the value of `a`. Only `&mut` is a separate value.

use super::environment::Scope;
use super::implementation::Implementation;
use super::methods::iterator::Iter;
use super::place::Place;
use super::types::Type;
use crate::graph::Node;
use proc_macro2::TokenStream;
use std::cell::OnceCell;
use std::rc::{Rc, Weak};

/// The value of an expression.
#[derive(Clone, Debug)]
pub enum Value {
    /// A variable that is declared, but not assigned.
    Uninitialised,
    /// An `f64`.
    Real(Node),
    /// An integer, always known.
    Integer(Integer),
    /// A known `bool`.
    Bool(bool),
    /// A `bool` that depends on model variables.
    Condition(Node),
    /// A tuple; the empty one is `()`.
    Tuple(Rc<Vec<Value>>),
    /// An array or a slice.
    Array(Rc<Vec<Value>>),
    /// A struct, or a variant of an enum, with its definition in the macro's input.
    Struct(Rc<Struct>),
    /// `a..b` and its relatives.
    Range(Rc<Range>),
    /// An iterator that has not been consumed.
    Iterator(Box<Iter>),
    /// A closure with its environment.
    Closure(Rc<Closure>),
    /// A function in the macro's input.
    Function(Rc<Function>),
    /// A function or method of the language named by path: `f64::sqrt`.
    Builtin(Rc<Builtin>),
    /// The constructor of a tuple struct or variant, as a function.
    Constructor(Type, usize),
    /// `&mut place`
    Reference(Place),
    /// A nalgebra matrix or vector.
    Matrix(Rc<Matrix>),
    /// An `Option`, known to be `Some` or `None`.
    Option(Option<Box<Value>>),
    /// A table of `casados::tables`.
    Table(Rc<Interpolation>),
    /// A constant defined outside of the macro's input. It becomes a number when used as one.
    Opaque(Rc<TokenStream>),
}

impl Value {
    /// `()`
    pub fn unit() -> Value {
        Value::Tuple(Rc::new(Vec::new()))
    }

    /// An array.
    pub fn array(elements: Vec<Value>) -> Value {
        Value::Array(Rc::new(elements))
    }

    /// A tuple.
    pub fn tuple(elements: Vec<Value>) -> Value {
        Value::Tuple(Rc::new(elements))
    }

    /// A `usize`.
    pub fn usize(value: usize) -> Value {
        Value::Integer(Integer { value: value as i128, ty: Some(IntegerType::Usize) })
    }

    /// A matrix, in column-major order.
    pub fn matrix(rows: usize, columns: usize, elements: Vec<Value>) -> Value {
        Value::Matrix(Rc::new(Matrix { rows, columns, elements }))
    }

    /// An iterator.
    pub fn iterator(iterator: Iter) -> Value {
        Value::Iterator(Box::new(iterator))
    }

    /// `Some(value)`
    pub fn some(value: Value) -> Value {
        Value::Option(Some(Box::new(value)))
    }

    /// A description for errors: "an integer".
    pub fn description(&self) -> &'static str {
        match self {
            Value::Uninitialised => "a variable without a value",
            Value::Real(_) => "an `f64`",
            Value::Integer(_) => "an integer",
            Value::Bool(_) => "a `bool`",
            Value::Condition(_) => "a `bool` that depends on model variables",
            Value::Tuple(elements) if elements.is_empty() => "`()`",
            Value::Tuple(_) => "a tuple",
            Value::Array(_) => "an array",
            Value::Struct(_) => "a struct",
            Value::Range(_) => "a range",
            Value::Iterator(_) => "an iterator",
            Value::Closure(_) => "a closure",
            Value::Function(_) | Value::Builtin(_) | Value::Constructor(..) => "a function",
            Value::Reference(_) => "a mutable reference",
            Value::Matrix(_) => "a matrix",
            Value::Option(_) => "an `Option`",
            Value::Table(_) => "a table",
            Value::Opaque(_) => "a constant that is defined outside of what the macro sees",
        }
    }
}

/// An integer and its type, if known (literals get it from their context).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Integer {
    /// The value, within the range of the type.
    pub value: i128,
    /// The type.
    pub ty: Option<IntegerType>,
}

/// The integer types of Rust.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum IntegerType {
    I8,
    I16,
    I32,
    I64,
    I128,
    Isize,
    U8,
    U16,
    U32,
    U64,
    Usize,
}

impl IntegerType {
    /// The type of a name: `usize`.
    pub fn by_name(name: &str) -> Option<IntegerType> {
        use IntegerType::*;
        Some(match name {
            "i8" => I8,
            "i16" => I16,
            "i32" => I32,
            "i64" => I64,
            "i128" => I128,
            "isize" => Isize,
            "u8" => U8,
            "u16" => U16,
            "u32" => U32,
            "u64" => U64,
            "usize" => Usize,
            _ => return None,
        })
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        use IntegerType::*;
        match self {
            I8 => "i8",
            I16 => "i16",
            I32 => "i32",
            I64 => "i64",
            I128 => "i128",
            Isize => "isize",
            U8 => "u8",
            U16 => "u16",
            U32 => "u32",
            U64 => "u64",
            Usize => "usize",
        }
    }

    /// The number of bits; that of a 64-bit machine for `usize`.
    pub fn bits(self) -> u32 {
        use IntegerType::*;
        match self {
            I8 | U8 => 8,
            I16 | U16 => 16,
            I32 | U32 => 32,
            I64 | U64 | Isize | Usize => 64,
            I128 => 128,
        }
    }

    /// Whether it has negative values.
    pub fn signed(self) -> bool {
        use IntegerType::*;
        matches!(self, I8 | I16 | I32 | I64 | I128 | Isize)
    }

    /// The smallest value.
    pub fn min(self) -> i128 {
        if self.signed() { i128::MIN >> (128 - self.bits()) } else { 0 }
    }

    /// The largest value.
    pub fn max(self) -> i128 {
        match self {
            _ if self.signed() => i128::MAX >> (128 - self.bits()),
            _ => (1i128 << self.bits()) - 1,
        }
    }
}

/// A value of a user's struct or enum.
#[derive(Clone, Debug)]
pub struct Struct {
    /// Its definition.
    pub definition: Rc<Definition>,
    /// Index of the variant; 0 for structs.
    pub variant: usize,
    /// Values of the fields in order of the definition.
    pub fields: Vec<Value>,
}

/// The definition of a struct or enum.
#[derive(Debug)]
pub struct Definition {
    /// Its name.
    pub name: String,
    /// Whether it is an enum.
    pub is_enum: bool,
    /// One variant for structs.
    pub variants: Vec<Variant>,
    /// Generic parameters.
    pub generics: syn::Generics,
    /// The enclosing scope, in which its field types are resolved. The evaluator keeps it alive.
    pub scope: OnceCell<Weak<Scope>>,
}

impl Definition {
    /// The enclosing scope.
    pub fn scope(&self) -> Rc<Scope> {
        self.scope.get().and_then(Weak::upgrade).unwrap_or_default()
    }
}

/// A variant of an enum, or the fields of a struct.
#[derive(Debug)]
pub struct Variant {
    /// The name of the variant, or of the struct.
    pub name: String,
    /// Names (`0`, `1` for tuple structs) and types of the fields.
    pub fields: Vec<(String, syn::Type)>,
    /// The unit of each field from its documentation, or an empty text.
    pub units: Vec<String>,
    /// The form of the constructor.
    pub style: Style,
    /// `= 3` of an enum.
    pub discriminant: Option<syn::Expr>,
}

/// The form of a struct.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// `S { a: f64 }`
    Named,
    /// `S(f64)`
    Tuple,
    /// `S`
    Unit,
}

/// A table of `casados::tables`.
#[derive(Debug)]
pub struct Interpolation {
    /// Its type.
    pub name: &'static str,
    /// The number of its variables.
    pub variables: usize,
    /// Derivatives of higher order with respect to one variable are zero.
    pub degree: u8,
    /// The call of its constructor.
    pub expression: TokenStream,
}

/// `start..end`, `start..=end` and their relatives.
#[derive(Clone, Debug)]
pub struct Range {
    /// The start.
    pub start: Option<Value>,
    /// The end.
    pub end: Option<Value>,
    /// Whether the end is included.
    pub inclusive: bool,
}

/// A closure and its scope (or the captured copies).
#[derive(Debug)]
pub struct Closure {
    /// As written.
    pub closure: Rc<syn::ExprClosure>,
    /// Its scope.
    pub scope: Rc<Scope>,
    /// The functions in execution at its definition.
    pub calls: Option<Rc<CallStack>>,
}

/// The functions in execution, innermost first.
#[derive(Debug)]
pub struct CallStack {
    /// The innermost function.
    pub function: Rc<syn::ItemFn>,
    /// Its callers.
    pub parent: Option<Rc<CallStack>>,
}

/// A function in the macro's input.
#[derive(Debug)]
pub struct Function {
    /// Signature and body.
    pub item: Rc<syn::ItemFn>,
    /// The enclosing scope.
    pub scope: Rc<Scope>,
    /// The explicit generic arguments.
    pub turbofish: Vec<Generic>,
    /// The `impl` block of the function, and the type by which it was named.
    pub owner: Option<(Rc<Implementation>, Type)>,
}

/// A function of the language that is named by path.
#[derive(Clone, Debug)]
pub struct Builtin {
    /// The type in front: `f64` in `f64::sqrt`, `Vector3<f64>` in `Vector3::new`.
    pub owner: Option<Type>,
    /// The path: `["core", "array", "from_fn"]`, `["f64", "sqrt"]`; local `use` items are resolved.
    pub path: Vec<String>,
    /// Generic arguments of the last segment.
    pub turbofish: Vec<Generic>,
}

/// A generic argument.
#[derive(Clone, Debug)]
pub enum Generic {
    /// A type.
    Type(Type),
    /// A constant.
    Const(Integer),
}

/// A nalgebra matrix, column-major.
#[derive(Clone, Debug)]
pub struct Matrix {
    /// Rows.
    pub rows: usize,
    /// Columns; 1 for vectors.
    pub columns: usize,
    /// Elements, column after column.
    pub elements: Vec<Value>,
}
