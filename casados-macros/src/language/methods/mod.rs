//! Built-in methods and functions: those of `f64`, integers, arrays, iterators, nalgebra.

mod adapter;
mod algebra;
mod array;
mod block;
mod construction;
mod consume;
mod float;
mod function;
mod integer;
pub mod iterator;
mod matrix;
mod option;
mod table;

pub use matrix::field as matrix_field;

use super::evaluator::{Evaluator, TokenSpan, error};
use super::place::Place;
use super::types::Type;
use super::value::{Builtin, Generic, Value};
use syn::Result;

/// The receiver of a method: its place if it has one (`iter_mut`, `swap`, `next` change it), with
/// mutable references followed.
#[derive(Clone, Debug)]
pub enum Receiver {
    /// A place.
    Place(Place),
    /// Anything else.
    Value(Value),
}

impl Receiver {
    /// The value.
    pub fn value(&self, evaluator: &mut Evaluator, at: TokenSpan) -> Result<Value> {
        match self {
            Receiver::Place(place) => evaluator.read(place, at),
            Receiver::Value(value) => Ok(value.clone()),
        }
    }
}

/// A call.
pub struct Call<'a> {
    /// Name of the function or method.
    pub name: &'a str,
    /// Generic arguments: `sum::<f64>()`.
    pub turbofish: &'a [Generic],
    /// The arguments without the receiver.
    pub arguments: Vec<Value>,
    /// The expected type of the result, as far as it is known.
    pub expected: &'a Type,
    /// The tokens of errors.
    pub at: TokenSpan<'a>,
}

impl Call<'_> {
    /// Checks the number of arguments.
    fn expect_argument_count(&self, arguments: usize) -> Result<()> {
        if self.arguments.len() == arguments {
            return Ok(());
        }
        Err(error(
            self.at,
            format!("`{}` takes {arguments} arguments, but {} are given", self.name, self.arguments.len()),
        ))
    }

    /// The only argument of a call.
    fn only(&self) -> Result<&Value> {
        self.expect_argument_count(1)?;
        Ok(&self.arguments[0])
    }

    /// The length of a const argument: `from_fn::<_, 3, _>`.
    fn constant(&self) -> Option<i128> {
        self.turbofish.iter().find_map(|generic| match generic {
            Generic::Const(value) => Some(value.value),
            Generic::Type(_) => None,
        })
    }
}

/// A method call. `None` if there is no such method.
pub fn method(evaluator: &mut Evaluator, receiver: &Receiver, call: &Call) -> Result<Option<Value>> {
    let value = receiver.value(evaluator, call.at)?;
    let value = evaluator.follow_value(value, call.at)?;
    let special = match &value {
        Value::Real(node) => float::method(evaluator, *node, call)?,
        Value::Table(of) => table::method(evaluator, of, call)?,
        Value::Opaque(of) if table::is_method(call.name) => {
            Some(table::opaque_table_method(evaluator, of, call)?)
        }
        Value::Opaque(_) if is_common(call.name) => None,
        Value::Opaque(_) => {
            let node = evaluator.real(&value, call.at)?;
            float::method(evaluator, node, call)?
        }
        Value::Integer(integer) => integer::method(evaluator, *integer, call)?,
        Value::Array(_) => array::method(evaluator, receiver, &value, call)?,
        Value::Range(_) | Value::Iterator(_) => adapter::method(evaluator, receiver, &value, call)?,
        Value::Matrix(_) => matrix::method(evaluator, receiver, &value, call)?,
        Value::Option(content) => option::method(evaluator, receiver, content.as_deref(), call)?,
        Value::Bool(known) => option::bool_method(evaluator, *known, call)?,
        _ => None,
    };
    if special.is_some() {
        return Ok(special);
    }
    common(evaluator, value, call)
}

/// Whether a number or a matrix has an inherent method of this name, which hides those of traits.
pub fn is_inherent(ty: &Type, name: &str) -> bool {
    match ty {
        Type::Real => float::is_inherent(name),
        Type::Integer(_) => integer::is_inherent(name),
        Type::Matrix(..) => matrix::is_inherent(name),
        _ => false,
    }
}

/// Whether every value has this method.
fn is_common(name: &str) -> bool {
    matches!(name, "clone" | "to_owned" | "borrow" | "as_ref" | "into" | "try_into")
}

/// Methods of every value.
fn common(evaluator: &mut Evaluator, value: Value, call: &Call) -> Result<Option<Value>> {
    if !is_common(call.name) {
        return Ok(None);
    }
    call.expect_argument_count(0)?;
    Ok(Some(match call.name {
        "into" => convert(evaluator, value, call.expected, call.at)?,
        "try_into" => {
            let ty = match call.expected {
                Type::Option(ty) => (**ty).clone(),
                _ => Type::Unknown,
            };
            match (&value, &ty) {
                (Value::Integer(integer), Type::Integer(ty)) => {
                    let fitted = super::arithmetic::checked_integer(Some(integer.value), Some(*ty));
                    Value::Option(fitted.map(|integer| Box::new(Value::Integer(integer))))
                }
                (Value::Integer(_), _) => {
                    return Err(error(
                        call.at,
                        "the macro does not see what type `try_into` makes here: write `usize::try_from(..)`",
                    ));
                }
                _ => Value::some(convert(evaluator, value, &ty, call.at)?),
            }
        }
        _ => value,
    }))
}

/// `From` and `Into` between numbers, arrays and matrices; the value itself if the type is unknown.
pub fn convert(evaluator: &mut Evaluator, value: Value, ty: &Type, at: TokenSpan) -> Result<Value> {
    match (&value, ty) {
        (Value::Integer(integer), Type::Real) => {
            Ok(Value::Real(evaluator.graph.constant(integer.value as f64)))
        }
        (Value::Integer(integer), Type::Integer(ty)) => {
            let fitted =
                super::arithmetic::checked_integer(Some(integer.value), Some(*ty)).map(Value::Integer);
            fitted.ok_or_else(|| error(at, format!("{} does not fit into `{}`", integer.value, ty.name())))
        }
        (Value::Array(elements), Type::Matrix(rows, columns)) => {
            matrix::from_arrays(evaluator, elements, *rows, *columns, at)
        }
        (Value::Matrix(matrix), Type::Array(element, _)) => {
            let nested = matches!(**element, Type::Array(..));
            Ok(matrix::to_arrays(matrix, nested))
        }
        _ => Ok(value),
    }
}

/// A function called by path: `core::array::from_fn`, `Vector3::new`, `f64::from`. `None` if there
/// is no such function; `f64::sqrt(x)` is then tried as `x.sqrt()`.
pub fn function(evaluator: &mut Evaluator, function: &Builtin, call: &Call) -> Result<Option<Value>> {
    function::call(evaluator, function, call)
}

/// A constant named by path: `core::f64::consts::PI`, `f64::EPSILON`. `None` if there is no such
/// constant.
pub fn constant(evaluator: &mut Evaluator, path: &Builtin) -> Option<Value> {
    function::constant(evaluator, path)
}

/// An operator with a matrix as one operand. `None` if there is no such operator.
pub fn matrix_operator(
    evaluator: &mut Evaluator,
    operator: super::arithmetic::Operator,
    a: &Value,
    b: &Value,
    at: TokenSpan,
) -> Result<Option<Value>> {
    algebra::operator(evaluator, operator, a, b, at)
}
