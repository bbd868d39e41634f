//! Methods and functions that belong to the language: those of `f64`, integers, arrays, iterators, nalgebra.

pub mod iterator;

use super::evaluator::{At, Evaluator};
use super::place::Place;
use super::types::Type;
use super::value::{Builtin, Generic, Value};
use syn::Result;

/// What a method is called on: a place if it is one (`iter_mut`, `swap`, `next` change it), with
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
    pub fn value(&self, evaluator: &mut Evaluator, at: At) -> Result<Value> {
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
    /// Arguments; the receiver is not one of them.
    pub arguments: Vec<Value>,
    /// The type that the context expects of the result, as far as it is known.
    pub expected: &'a Type,
    /// What errors point at.
    pub at: At<'a>,
}

/// A method call. `None` if there is no such method.
pub fn method(_evaluator: &mut Evaluator, _receiver: &Receiver, _call: &Call) -> Result<Option<Value>> {
    Ok(None)
}

/// A call of a function that is named by path: `core::array::from_fn`, `Vector3::new`, `f64::from`.
/// `None` if there is no such function. `f64::sqrt(x)` is tried as `x.sqrt()` after that.
pub fn function(_evaluator: &mut Evaluator, _function: &Builtin, _call: &Call) -> Result<Option<Value>> {
    Ok(None)
}

/// A constant that is named by path: `core::f64::consts::PI`, `f64::EPSILON`. `None` if there is no such constant.
pub fn constant(_evaluator: &mut Evaluator, _path: &Builtin) -> Option<Value> {
    None
}

/// An operator of which one side is a matrix. `None` if there is no such operator.
pub fn matrix_operator(
    _evaluator: &mut Evaluator,
    _operator: super::evaluator::Operator,
    _a: &Value,
    _b: &Value,
    _at: At,
) -> Result<Option<Value>> {
    Ok(None)
}
