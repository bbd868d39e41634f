//! Adapters for a single element.

use super::ends::IteratorEnd;
use super::{Iter, holds, into_iter, option_content};
use crate::language::evaluator::{Evaluator, TokenSpan, error};
use crate::language::place::Place;
use crate::language::value::Value;
use syn::Result;

/// Advances an iterator in a variable, and writes the rest back.
pub fn by_ref(
    place: &Place,
    end: IteratorEnd,
    evaluator: &mut Evaluator,
    at: TokenSpan,
) -> Result<Option<Value>> {
    let Value::Iterator(mut inner) = evaluator.read(place, at)? else {
        return Err(error(at, "this is no iterator any more"));
    };
    let value = inner.pull(end, evaluator, at)?;
    evaluator.write(place, Value::Iterator(inner), at)?;
    Ok(value)
}

/// `iter::successors`: returns the current value and computes its successor.
pub fn successor(
    now: &mut Option<Box<Value>>,
    closure: &Value,
    evaluator: &mut Evaluator,
    at: TokenSpan,
) -> Result<Option<Value>> {
    let Some(value) = now.take() else { return Ok(None) };
    let next = evaluator.call(closure, vec![(*value).clone()], at)?;
    *now = option_content(next, at)?.map(Box::new);
    Ok(Some(*value))
}

pub fn map(
    inner: &mut Iter,
    closure: &Value,
    end: IteratorEnd,
    evaluator: &mut Evaluator,
    at: TokenSpan,
) -> Result<Option<Value>> {
    match inner.pull(end, evaluator, at)? {
        None => Ok(None),
        Some(value) => evaluator.call(closure, vec![value], at).map(Some),
    }
}

pub fn inspect(
    inner: &mut Iter,
    closure: &Value,
    end: IteratorEnd,
    evaluator: &mut Evaluator,
    at: TokenSpan,
) -> Result<Option<Value>> {
    let value = inner.pull(end, evaluator, at)?;
    if let Some(value) = &value {
        evaluator.call(closure, vec![value.clone()], at)?;
    }
    Ok(value)
}

pub fn filter(
    inner: &mut Iter,
    closure: &Value,
    end: IteratorEnd,
    evaluator: &mut Evaluator,
    at: TokenSpan,
) -> Result<Option<Value>> {
    while let Some(value) = inner.pull(end, evaluator, at)? {
        if holds(evaluator, closure, value.clone(), "filter", at)? {
            return Ok(Some(value));
        }
    }
    Ok(None)
}

pub fn filter_map(
    inner: &mut Iter,
    closure: &Value,
    end: IteratorEnd,
    evaluator: &mut Evaluator,
    at: TokenSpan,
) -> Result<Option<Value>> {
    while let Some(value) = inner.pull(end, evaluator, at)? {
        let value = evaluator.call(closure, vec![value], at)?;
        if let Some(value) = option_content(value, at)? {
            return Ok(Some(value));
        }
    }
    Ok(None)
}

pub fn take_while(
    inner: &mut Option<Box<Iter>>,
    closure: &Value,
    evaluator: &mut Evaluator,
    at: TokenSpan,
) -> Result<Option<Value>> {
    let Some(open) = inner else { return Ok(None) };
    if let Some(value) = open.next(evaluator, at)?
        && holds(evaluator, closure, value.clone(), "take_while", at)?
    {
        return Ok(Some(value));
    }
    *inner = None;
    Ok(None)
}

pub fn skip_while(
    inner: &mut Iter,
    closure: &mut Option<Value>,
    evaluator: &mut Evaluator,
    at: TokenSpan,
) -> Result<Option<Value>> {
    while let Some(value) = inner.next(evaluator, at)? {
        match closure {
            Some(skip) if holds(evaluator, skip, value.clone(), "skip_while", at)? => {}
            _ => {
                *closure = None;
                return Ok(Some(value));
            }
        }
    }
    Ok(None)
}

pub fn map_while(
    inner: &mut Option<Box<Iter>>,
    closure: &Value,
    evaluator: &mut Evaluator,
    at: TokenSpan,
) -> Result<Option<Value>> {
    let Some(open) = inner else { return Ok(None) };
    let value = match open.next(evaluator, at)? {
        None => None,
        Some(value) => option_content(evaluator.call(closure, vec![value], at)?, at)?,
    };
    if value.is_none() {
        *inner = None;
    }
    Ok(value)
}

/// `scan`: the closure borrows the state.
pub fn scan(
    state: &mut Value,
    closure: &Value,
    value: Value,
    evaluator: &mut Evaluator,
    at: TokenSpan,
) -> Result<Option<Value>> {
    let place = Place::new(state.clone());
    let next = evaluator.call(closure, vec![Value::Reference(place.clone()), value], at)?;
    *state = evaluator.read(&place, at)?;
    option_content(next, at)
}

pub fn skip(
    inner: &mut Iter,
    left: &mut usize,
    evaluator: &mut Evaluator,
    at: TokenSpan,
) -> Result<Option<Value>> {
    while *left > 0 {
        *left -= 1;
        if inner.next(evaluator, at)?.is_none() {
            *left = 0;
        }
    }
    inner.next(evaluator, at)
}

pub fn step_by(
    inner: &mut Iter,
    step: usize,
    begun: &mut bool,
    evaluator: &mut Evaluator,
    at: TokenSpan,
) -> Result<Option<Value>> {
    if std::mem::replace(begun, true) {
        for _ in 1..step {
            if inner.next(evaluator, at)?.is_none() {
                return Ok(None);
            }
        }
    }
    inner.next(evaluator, at)
}

/// The last one of every `step`-th element.
pub fn last_of_steps(
    inner: &mut Iter,
    step: usize,
    begun: bool,
    evaluator: &mut Evaluator,
    at: TokenSpan,
) -> Result<Option<Value>> {
    let length = inner.length(evaluator, at)?;
    // The elements are those at `first`, `first + step`, ..
    let first = if begun { step - 1 } else { 0 };
    if length <= first {
        return Ok(None);
    }
    for _ in 0..(length - 1 - first) % step {
        inner.next_back(evaluator, at)?;
    }
    inner.next_back(evaluator, at)
}

pub fn chain(
    first: &mut Option<Box<Iter>>,
    second: &mut Iter,
    evaluator: &mut Evaluator,
    at: TokenSpan,
) -> Result<Option<Value>> {
    if let Some(inner) = first {
        if let Some(value) = inner.next(evaluator, at)? {
            return Ok(Some(value));
        }
        *first = None;
    }
    second.next(evaluator, at)
}

/// The last pair: surplus elements of the longer one are dropped.
pub fn last_of_both(
    a: &mut Iter,
    b: &mut Iter,
    evaluator: &mut Evaluator,
    at: TokenSpan,
) -> Result<Option<Value>> {
    let (left, right) = (a.length(evaluator, at)?, b.length(evaluator, at)?);
    for _ in right..left {
        a.next_back(evaluator, at)?;
    }
    for _ in left..right {
        b.next_back(evaluator, at)?;
    }
    Ok(match (a.next_back(evaluator, at)?, b.next_back(evaluator, at)?) {
        (Some(a), Some(b)) => Some(Value::tuple(vec![a, b])),
        _ => None,
    })
}

/// An element of nested iterators: from the open one at this end, from the next ones, or from the
/// open one at the other end.
pub fn flatten(
    inner: &mut Iter,
    [near, far]: [&mut Option<Box<Iter>>; 2],
    end: IteratorEnd,
    evaluator: &mut Evaluator,
    at: TokenSpan,
) -> Result<Option<Value>> {
    loop {
        if let Some(open) = near {
            if let Some(value) = open.pull(end, evaluator, at)? {
                return Ok(Some(value));
            }
            *near = None;
        }
        match (inner.pull(end, evaluator, at)?, &mut *far) {
            (Some(value), _) => *near = Some(Box::new(into_iter(evaluator, value, at)?)),
            (None, Some(open)) => return open.pull(end, evaluator, at),
            (None, None) => return Ok(None),
        }
    }
}
