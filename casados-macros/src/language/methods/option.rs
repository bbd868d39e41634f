//! Methods of `Option` and `bool`.

use super::iterator::Iter;
use super::{Call, Receiver};
use crate::language::evaluator::{Evaluator, error};
use crate::language::place::{Place, Projection};
use crate::language::value::Value;
use syn::Result;

/// A method of an option, or of a result, of which only the value is stored. `None` if there is no
/// such method.
pub fn method(
    evaluator: &mut Evaluator,
    receiver: &Receiver,
    content: Option<&Value>,
    call: &Call,
) -> Result<Option<Value>> {
    let value = match (call.name, content) {
        ("unwrap" | "expect" | "unwrap_or" | "unwrap_or_else" | "unwrap_or_default", Some(value)) => {
            super::convert(evaluator, value.clone(), call.expected, call.at)?
        }
        ("unwrap" | "expect", None) => {
            return Err(error(call.at, format!("`{}` is called on `None` here", call.name)));
        }
        ("unwrap_or", None) => call.only()?.clone(),
        ("unwrap_or_else", None) => evaluator.call(call.only()?, Vec::new(), call.at)?,
        ("unwrap_or_default", None) => super::function::default(evaluator, call.expected, call.at)?,
        ("is_some" | "is_ok", _) => Value::Bool(content.is_some()),
        ("is_none" | "is_err", _) => Value::Bool(content.is_none()),
        ("copied" | "cloned" | "as_ref" | "as_deref" | "ok", _) => {
            Value::Option(content.cloned().map(Box::new))
        }
        ("as_mut", Some(_)) => match receiver {
            Receiver::Place(place) => {
                Value::some(Value::Reference(evaluator.project(place, Projection::Some, call.at)?))
            }
            Receiver::Value(value) => value.clone(),
        },
        ("as_mut", None) => Value::Option(None),
        ("take", _) => {
            if let Receiver::Place(place) = receiver {
                evaluator.write(place, Value::Option(None), call.at)?;
            }
            Value::Option(content.cloned().map(Box::new))
        }
        ("replace", _) => {
            let new = Value::some(call.only()?.clone());
            if let Receiver::Place(place) = receiver {
                evaluator.write(place, new, call.at)?;
            }
            Value::Option(content.cloned().map(Box::new))
        }
        ("map", Some(value)) => Value::some(evaluator.call(call.only()?, vec![value.clone()], call.at)?),
        ("map" | "and_then" | "filter" | "zip", None) => Value::Option(None),
        ("and_then", Some(value)) => evaluator.call(call.only()?, vec![value.clone()], call.at)?,
        ("map_or", Some(value)) => {
            call.expect_argument_count(2)?;
            evaluator.call(&call.arguments[1], vec![value.clone()], call.at)?
        }
        ("map_or", None) => {
            call.expect_argument_count(2)?;
            call.arguments[0].clone()
        }
        ("or", _) => match content {
            Some(value) => Value::some(value.clone()),
            None => call.only()?.clone(),
        },
        ("iter" | "into_iter", _) => {
            let elements: Vec<Value> = content.cloned().into_iter().collect();
            Value::iterator(Iter::Elements { front: 0, back: elements.len(), array: elements.into() })
        }
        _ => return Ok(None),
    };
    Ok(Some(value))
}

/// A method of a known `bool`. `None` if there is no such method.
pub fn bool_method(evaluator: &mut Evaluator, known: bool, call: &Call) -> Result<Option<Value>> {
    Ok(match call.name {
        "then" | "then_some" if !known => Some(Value::Option(None)),
        "then_some" => Some(Value::some(call.only()?.clone())),
        "then" => Some(Value::some(evaluator.call(call.only()?, Vec::new(), call.at)?)),
        _ => None,
    })
}

/// Writes a changed value back to its place, as `next` of an iterator in a variable.
pub fn update(evaluator: &mut Evaluator, receiver: &Receiver, value: Value, call: &Call) -> Result<()> {
    match receiver {
        Receiver::Place(place) => evaluator.write(place, value, call.at),
        Receiver::Value(Value::Reference(place)) => {
            let place: Place = place.clone();
            evaluator.write(&place, value, call.at)
        }
        Receiver::Value(_) => Ok(()),
    }
}
