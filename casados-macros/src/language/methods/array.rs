//! Methods of arrays and slices.

use super::iterator::{self, Iter};
use super::{Call, Receiver, option};
use crate::language::arithmetic::Comparison;
use crate::language::evaluator::{Evaluator, error, unsupported};
use crate::language::place::Projection;
use crate::language::value::Value;
use std::rc::Rc;
use syn::Result;

/// A method of an array or a slice. `None` if there is no such method.
pub fn method(
    evaluator: &mut Evaluator,
    receiver: &Receiver,
    value: &Value,
    call: &Call,
) -> Result<Option<Value>> {
    let Value::Array(elements) = value else { return Ok(None) };
    let found = reading_method(evaluator, elements, call)?;
    if found.is_some() {
        return Ok(found);
    }
    let found = splitting_method(evaluator, receiver, elements, call)?;
    if found.is_some() {
        return Ok(found);
    }
    mutating_method(evaluator, receiver, elements, call)
}

/// Methods that only read.
fn reading_method(
    evaluator: &mut Evaluator,
    elements: &Rc<Vec<Value>>,
    call: &Call,
) -> Result<Option<Value>> {
    let (at, length) = (call.at, elements.len());
    let value = match call.name {
        "len" => Value::usize(length),
        "is_empty" => Value::Bool(length == 0),
        "iter" | "into_iter" => {
            Value::iterator(Iter::Elements { array: elements.clone(), front: 0, back: length })
        }
        "as_slice" | "each_ref" | "as_array" => Value::Array(elements.clone()),
        "first" => Value::Option(elements.first().cloned().map(Box::new)),
        "last" => Value::Option(elements.last().cloned().map(Box::new)),
        "get" => match evaluator.follow_value(call.only()?.clone(), at)? {
            Value::Range(range) => {
                let (start, end) = evaluator.range_bounds(&range, length, at)?;
                Value::Option(elements.get(start..end).map(|part| Box::new(Value::array(part.to_vec()))))
            }
            index => {
                let index = evaluator.usize(&index, at)?;
                Value::Option(elements.get(index).cloned().map(Box::new))
            }
        },
        "map" => {
            let closure = call.only()?;
            let expected = call.expected.element();
            let mut mapped = Vec::with_capacity(length);
            for element in elements.iter() {
                mapped.push(evaluator.call_expecting(closure, vec![element.clone()], &expected, at)?);
            }
            Value::array(mapped)
        }
        "concat" | "as_flattened" => {
            let mut all = Vec::new();
            for element in elements.iter() {
                match evaluator.follow_value(element.clone(), at)? {
                    Value::Array(inner) => all.extend(inner.iter().cloned()),
                    other => {
                        return Err(error(
                            at,
                            format!("`{}` of arrays, not of {}", call.name, other.description()),
                        ));
                    }
                }
            }
            Value::array(all)
        }
        "contains" => {
            let item = call.only()?;
            let mut result = Value::Bool(false);
            for element in elements.iter() {
                let equal = evaluator.compare(Comparison::Eq, element, item, at)?;
                result = evaluator.or(&result, &equal, at)?;
            }
            result
        }
        "windows" | "chunks" | "chunks_exact" | "rchunks" | "array_windows" | "as_chunks"
        | "array_chunks" => {
            return slicing_method(evaluator, elements, call).map(Some);
        }
        "sum" | "product" | "fold" | "zip" | "enumerate" | "rev" => {
            return Err(error(
                at,
                format!("an array has no method `{0}`: write `.iter().{0}(..)`", call.name),
            ));
        }
        "to_vec" | "into_vec" | "repeat" | "join" => {
            return Err(unsupported(
                at,
                format!("`{}`, which allocates (an array of fixed length does not),", call.name),
            ));
        }
        _ => return Ok(None),
    };
    Ok(Some(value))
}

/// Consecutive parts of an array.
fn slicing_method(evaluator: &mut Evaluator, elements: &[Value], call: &Call) -> Result<Value> {
    let of_const = matches!(call.name, "array_windows" | "as_chunks" | "array_chunks");
    let size = match (of_const, call.constant()) {
        (true, Some(size)) => usize::try_from(size).unwrap_or(0),
        (true, None) => {
            return Err(error(call.at, format!("write the length, as in `{}::<2>()`", call.name)));
        }
        (false, _) => evaluator.usize(call.only()?, call.at)?,
    };
    if size == 0 {
        return Err(error(call.at, format!("`{}` needs a length of at least one", call.name)));
    }
    let slice = |part: &[Value]| Value::array(part.to_vec());
    let parts: Vec<Value> = match call.name {
        "windows" | "array_windows" => elements.windows(size).map(slice).collect(),
        "chunks" => elements.chunks(size).map(slice).collect(),
        "rchunks" => elements.rchunks(size).map(slice).collect(),
        _ => elements.chunks_exact(size).map(slice).collect(),
    };
    evaluator.count_steps(parts.len().saturating_mul(size), call.at)?;
    if call.name == "as_chunks" {
        let rest = elements.len() - elements.len() % size;
        return Ok(Value::tuple(vec![Value::array(parts), slice(&elements[rest..])]));
    }
    Ok(Value::iterator(Iter::of(parts)))
}

/// Methods that split, and those that return `&mut` to parts.
fn splitting_method(
    evaluator: &mut Evaluator,
    receiver: &Receiver,
    elements: &Rc<Vec<Value>>,
    call: &Call,
) -> Result<Option<Value>> {
    let (at, length) = (call.at, elements.len());
    let mutable = call.name.ends_with("_mut");
    // A part: a reference to it, or its value.
    let part = |evaluator: &mut Evaluator, projection: Projection| -> Result<Value> {
        match receiver {
            Receiver::Place(place) if mutable => {
                Ok(Value::Reference(evaluator.project(place, projection, at)?))
            }
            _ => evaluator.value_part(&Value::Array(elements.clone()), projection, at),
        }
    };
    let value = match call.name.trim_end_matches("_mut") {
        "iter" | "as_slice" | "each" if mutable => match receiver {
            Receiver::Place(place) if call.name == "iter_mut" => {
                Value::iterator(Iter::Places { place: place.clone(), front: 0, back: length })
            }
            Receiver::Place(place) if call.name == "as_mut_slice" => Value::Reference(place.clone()),
            Receiver::Place(_) => {
                let all: Result<Vec<_>> =
                    (0..length).map(|i| part(evaluator, Projection::Index(i))).collect();
                Value::array(all?)
            }
            Receiver::Value(value) => Value::iterator(iterator::into_iter(evaluator, value.clone(), at)?),
        },
        "as_mut_slice" => match receiver {
            Receiver::Place(place) => Value::Reference(place.clone()),
            Receiver::Value(value) => value.clone(),
        },
        "split_at" => {
            let middle = evaluator.usize(call.only()?, at)?;
            let front = part(evaluator, Projection::Slice(0, middle))?;
            Value::tuple(vec![front, part(evaluator, Projection::Slice(middle, length))?])
        }
        "split_first" | "split_last" if length == 0 => Value::Option(None),
        "split_first" => {
            let first = part(evaluator, Projection::Index(0))?;
            Value::some(Value::tuple(vec![first, part(evaluator, Projection::Slice(1, length))?]))
        }
        "split_last" => {
            let last = part(evaluator, Projection::Index(length - 1))?;
            Value::some(Value::tuple(vec![last, part(evaluator, Projection::Slice(0, length - 1))?]))
        }
        "first_chunk" | "last_chunk" => {
            let size = usize::try_from(call.constant().unwrap_or(-1))
                .map_err(|_| error(at, format!("write the length, as in `{}::<2>()`", call.name)))?;
            if size > length {
                Value::Option(None)
            } else if call.name.starts_with("first") {
                Value::some(part(evaluator, Projection::Slice(0, size))?)
            } else {
                Value::some(part(evaluator, Projection::Slice(length - size, length))?)
            }
        }
        "first" | "last" if length == 0 => Value::Option(None),
        "first" => Value::some(part(evaluator, Projection::Index(0))?),
        "last" => Value::some(part(evaluator, Projection::Index(length - 1))?),
        "get" => {
            let index = evaluator.usize(call.only()?, at)?;
            if index < length {
                Value::some(part(evaluator, Projection::Index(index))?)
            } else {
                Value::Option(None)
            }
        }
        "chunks" | "chunks_exact" => {
            let size = evaluator.usize(call.only()?, at)?;
            if size == 0 {
                return Err(error(at, format!("`{}` needs a length of at least one", call.name)));
            }
            let whole = if call.name.starts_with("chunks_exact") { length - length % size } else { length };
            let mut chunks = Vec::new();
            for start in (0..whole).step_by(size) {
                chunks.push(part(evaluator, Projection::Slice(start, (start + size).min(length)))?);
            }
            Value::iterator(Iter::of(chunks))
        }
        _ => return Ok(None),
    };
    Ok(Some(value))
}

/// Methods that change the array.
fn mutating_method(
    evaluator: &mut Evaluator,
    receiver: &Receiver,
    elements: &Rc<Vec<Value>>,
    call: &Call,
) -> Result<Option<Value>> {
    let (at, length) = (call.at, elements.len());
    let mut new = (**elements).clone();
    match call.name {
        "fill" => {
            let value = evaluator.follow_value(call.only()?.clone(), at)?;
            new.fill(value);
        }
        "fill_with" => {
            for element in &mut new {
                *element = evaluator.call(call.only()?, Vec::new(), at)?;
            }
        }
        "swap" => {
            call.expect_argument_count(2)?;
            let (a, b) = (evaluator.usize(&call.arguments[0], at)?, evaluator.usize(&call.arguments[1], at)?);
            if let Some(out) = [a, b].into_iter().find(|&index| index >= length) {
                return Err(error(
                    at,
                    format!("index out of range: the length is {length} but the index is {out}"),
                ));
            }
            new.swap(a, b);
        }
        "reverse" => new.reverse(),
        "rotate_left" | "rotate_right" => {
            let by = evaluator.usize(call.only()?, at)?;
            if by > length {
                return Err(error(at, format!("the length is {length}, but it is rotated by {by}")));
            }
            if call.name == "rotate_left" { new.rotate_left(by) } else { new.rotate_right(by) }
        }
        "copy_from_slice" | "clone_from_slice" => match evaluator.follow_value(call.only()?.clone(), at)? {
            Value::Array(source) if source.len() == length => new.clone_from_slice(&source),
            Value::Array(source) => {
                return Err(error(
                    at,
                    format!(
                        "`{}` of {} elements into {length}: the lengths must be equal",
                        call.name,
                        source.len()
                    ),
                ));
            }
            other => return Err(error(at, format!("expected a slice, found {}", other.description()))),
        },
        "sort" | "sort_by" | "sort_unstable" | "sort_unstable_by" | "sort_by_key" => {
            return Err(unsupported(at, format!("`{}`, whose order depends on values,", call.name)));
        }
        _ => return Ok(None),
    }
    option::update(evaluator, receiver, Value::array(new), call)?;
    Ok(Some(Value::unit()))
}
