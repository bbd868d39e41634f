//! Functions and constants of the language called by path.

use super::iterator::{self, Iter};
use super::{Call, float, integer, matrix, table};
use crate::language::evaluator::{Evaluator, TokenSpan, error, unsupported};
use crate::language::place::Place;
use crate::language::types::Type;
use crate::language::value::{Builtin, Function, Integer, IntegerType, Struct, Value};
use std::rc::Rc;
use syn::Result;

/// A call of a function by path. `None` if there is no such function.
pub fn call(evaluator: &mut Evaluator, function: &Builtin, call: &Call) -> Result<Option<Value>> {
    let Some(name) = function.path.last().map(String::as_str) else { return Ok(None) };
    let before = function.path.iter().rev().nth(1).map_or("", String::as_str);
    let at = call.at;
    if let Some(value) = matrix::function(evaluator, function, call)? {
        return Ok(Some(value));
    }
    if let Some(value) = table::construct(evaluator, before, call)? {
        return Ok(Some(value));
    }
    let of_user = matches!(function.path[0].as_str(), "crate" | "super" | "self");
    let value = match (before, name) {
        // Functions of the user's own modules are excluded, whatever their names.
        _ if function.owner.is_none() && of_user => return Ok(None),
        ("array", "from_fn") => from_fn(evaluator, call)?,
        ("array", "from_ref") | ("convert", "identity") => call.only()?.clone(),
        ("array", "repeat") => {
            let length = array_length(call)?;
            evaluator.count_steps(length, at)?;
            Value::array(vec![call.only()?.clone(); length])
        }
        ("iter", _) => return iterator_constructor(evaluator, name, call),
        ("mem", "swap" | "replace") => swap_or_replace(evaluator, name, call)?,
        ("cmp", "min" | "max") => {
            call.expect_argument_count(2)?;
            let a = evaluator.integer(&call.arguments[0], at)?;
            let inner = Call {
                name,
                turbofish: &[],
                arguments: vec![call.arguments[1].clone()],
                expected: call.expected,
                at,
            };
            return integer::method(evaluator, a, &inner);
        }
        ("mem" | "", "drop") => Value::unit(),
        ("", "Some" | "Ok") | ("Option", "Some") | ("Result", "Ok") => Value::some(call.only()?.clone()),
        ("f64", "from") => match evaluator.follow_value(call.only()?.clone(), at)? {
            Value::Integer(integer) => Value::Real(evaluator.graph.constant(integer.value as f64)),
            Value::Bool(known) => Value::Real(evaluator.graph.constant(f64::from(u8::from(known)))),
            other => Value::Real(evaluator.real(&other, at)?),
        },
        (before, "default")
            if call.arguments.is_empty() && (function.owner.is_some() || before == "Default") =>
        {
            let ty = function.owner.clone().unwrap_or_default();
            let ty = if matches!(ty, Type::Unknown) { call.expected.clone() } else { ty };
            return match ty {
                Type::Unknown => Ok(None),
                ty => default(evaluator, &ty, at).map(Some),
            };
        }
        (ty, "from" | "try_from") if IntegerType::by_name(ty).is_some() => {
            let integer = match evaluator.follow_value(call.only()?.clone(), at)? {
                Value::Bool(known) => Integer { value: i128::from(known), ty: None },
                value => evaluator.integer(&value, at)?,
            };
            let ty = IntegerType::by_name(ty);
            let fitted =
                crate::language::arithmetic::checked_integer(Some(integer.value), ty).map(Value::Integer);
            match (name, fitted) {
                ("try_from", fitted) => Value::Option(fitted.map(Box::new)),
                (_, Some(value)) => value,
                (_, None) => return Err(error(at, format!("{} does not fit", integer.value))),
            }
        }
        ("Vec" | "Box" | "String" | "Rc" | "Arc" | "VecDeque" | "HashMap" | "BTreeMap", _) => {
            return Err(unsupported(
                at,
                format!("`{before}`, which is on the heap (arrays of fixed length are not),"),
            ));
        }
        _ => return Ok(None),
    };
    Ok(Some(value))
}

/// Iterators of `core::iter`.
fn iterator_constructor(evaluator: &mut Evaluator, name: &str, call: &Call) -> Result<Option<Value>> {
    let at = call.at;
    Ok(Some(match name {
        "repeat" => Value::iterator(Iter::Repeat(call.only()?.clone())),
        "repeat_n" => {
            call.expect_argument_count(2)?;
            let n = evaluator.usize(&call.arguments[1], at)?;
            Value::iterator(Iter::Take(Box::new(Iter::Repeat(call.arguments[0].clone())), n))
        }
        "from_fn" => Value::iterator(Iter::FromFn(call.only()?.clone())),
        "once" => Value::iterator(Iter::of(vec![call.only()?.clone()])),
        "empty" => Value::iterator(Iter::of(Vec::new())),
        "successors" => {
            call.expect_argument_count(2)?;
            match &call.arguments[0] {
                Value::Option(first) => {
                    Value::iterator(Iter::Successors(first.clone(), call.arguments[1].clone()))
                }
                other => {
                    return Err(error(at, format!("expected an `Option`, found {}", other.description())));
                }
            }
        }
        "zip" => {
            call.expect_argument_count(2)?;
            let a = iterator::into_iter(evaluator, call.arguments[0].clone(), at)?;
            let b = iterator::into_iter(evaluator, call.arguments[1].clone(), at)?;
            Value::iterator(Iter::Zip(Box::new(a), Box::new(b)))
        }
        _ => return Ok(None),
    }))
}

/// `mem::swap`, `mem::replace`
fn swap_or_replace(evaluator: &mut Evaluator, name: &str, call: &Call) -> Result<Value> {
    let at = call.at;
    call.expect_argument_count(2)?;
    let place = reference(&call.arguments[0], at)?;
    let old = evaluator.read(&place, at)?;
    if name == "swap" {
        let other = reference(&call.arguments[1], at)?;
        let new = evaluator.read(&other, at)?;
        evaluator.write(&place, new, at)?;
        evaluator.write(&other, old, at)?;
        return Ok(Value::unit());
    }
    let new = evaluator.follow_value(call.arguments[1].clone(), at)?;
    evaluator.write(&place, new, at)?;
    Ok(old)
}

/// `core::array::from_fn`
fn from_fn(evaluator: &mut Evaluator, call: &Call) -> Result<Value> {
    let length = array_length(call)?;
    let closure = call.only()?;
    let element = call.expected.element();
    let mut elements = Vec::with_capacity(length.min(1 << 16));
    for index in 0..length {
        evaluator.count_steps(1, call.at)?;
        elements.push(evaluator.call_expecting(closure, vec![Value::usize(index)], &element, call.at)?);
    }
    Ok(Value::array(elements))
}

/// The length from the context or a const argument.
fn array_length(call: &Call) -> Result<usize> {
    let given = call.constant().and_then(|length| usize::try_from(length).ok());
    let expected = match call.expected {
        Type::Array(_, length) => *length,
        _ => None,
    };
    given.or(expected).ok_or_else(|| {
        error(
            call.at,
            format!("the length of this array is not known here: write `{}::<_, 3, _>(..)` or `let a: [f64; 3] = ..`", call.name),
        )
    })
}

/// The place of a `&mut`.
fn reference(value: &Value, at: TokenSpan) -> Result<Place> {
    match value {
        Value::Reference(place) => Ok(place.clone()),
        other => Err(error(at, format!("expected a mutable reference, found {}", other.description()))),
    }
}

/// The default value: zeros.
pub fn default(evaluator: &mut Evaluator, ty: &Type, at: TokenSpan) -> Result<Value> {
    Ok(match ty {
        Type::Integer(ty) => Value::Integer(Integer { value: 0, ty: Some(*ty) }),
        Type::Bool => Value::Bool(false),
        Type::Option(_) => Value::Option(None),
        Type::Tuple(parts) => {
            let parts: Result<Vec<_>> = parts.iter().map(|part| default(evaluator, part, at)).collect();
            Value::tuple(parts?)
        }
        Type::Array(element, Some(length)) => {
            evaluator.count_steps(*length, at)?;
            let element = default(evaluator, element, at)?;
            Value::array(vec![element; *length])
        }
        Type::Matrix(Some(rows), Some(columns)) => {
            evaluator.count_steps(rows.saturating_mul(*columns), at)?;
            let zero = Value::Real(evaluator.graph.constant(0.0));
            Value::matrix(*rows, *columns, vec![zero; rows * columns])
        }
        Type::Real | Type::Unknown => Value::Real(evaluator.graph.constant(0.0)),
        Type::Struct(definition, arguments) => {
            let name = evaluator.symbol_of("default");
            if let Some((implementation, item)) = evaluator.find_function(name, ty) {
                let (scope, owner) = (implementation.scope.clone(), Some((implementation, ty.clone())));
                let function = Function { item, scope, turbofish: Vec::new(), owner };
                return evaluator.call(&Value::Function(Rc::new(function)), Vec::new(), at);
            }
            if definition.is_enum {
                return Err(error(at, "the default of an enum is not known here: name the variant"));
            }
            // The derived implementation.
            let types = evaluator.field_types(definition, 0, arguments)?;
            let fields = types.iter().map(|ty| default(evaluator, ty, at)).collect::<Result<_>>()?;
            Value::Struct(Rc::new(Struct { definition: definition.clone(), variant: 0, fields }))
        }
        _ => return Err(error(at, "the default value of this type is not known here")),
    })
}

/// A constant by path. `None` if there is no such constant.
pub fn constant(evaluator: &mut Evaluator, path: &Builtin) -> Option<Value> {
    let mut last = path.path.iter().rev();
    let (name, module) = (last.next()?, last.next().map_or("", String::as_str));
    if (module, name.as_str()) == ("", "None") || (module, name.as_str()) == ("Option", "None") {
        return Some(Value::Option(None));
    }
    // Other modules may be called `consts`, too.
    let of_float = match path.path.as_slice() {
        [root @ .., float, _, _] if module == "consts" => {
            float == "f64" && (root.is_empty() || root == ["core"] || root == ["std"])
        }
        _ => module != "consts",
    };
    if of_float && let Some(value) = float::constant(module, name) {
        return Some(Value::Real(evaluator.graph.constant(value)));
    }
    let ty = match &path.owner {
        Some(Type::Integer(ty)) => Some(*ty),
        Some(Type::Real) => {
            return float::constant("f64", name).map(|value| Value::Real(evaluator.graph.constant(value)));
        }
        _ => IntegerType::by_name(module),
    };
    integer::constant(ty?, name)
}
