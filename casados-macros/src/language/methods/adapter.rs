//! Methods of iterators that adapt, search, or change them.

use super::iterator::{Iter, holds, into_iter, option_content};
use super::{Call, Receiver, option};
use crate::language::arithmetic::Comparison;
use crate::language::evaluator::{Evaluator, error};
use crate::language::value::Value;
use syn::Result;

/// A method of an iterator or a range. `None` if there is no such method.
pub fn method(
    evaluator: &mut Evaluator,
    receiver: &Receiver,
    value: &Value,
    call: &Call,
) -> Result<Option<Value>> {
    if let Value::Range(range) = value {
        match call.name {
            "contains" => {
                let item = call.only()?;
                let above = match &range.start {
                    Some(start) => evaluator.compare(Comparison::Le, start, item, call.at)?,
                    None => Value::Bool(true),
                };
                let end = if range.inclusive { Comparison::Le } else { Comparison::Lt };
                let below = match &range.end {
                    Some(bound) => evaluator.compare(end, item, bound, call.at)?,
                    None => Value::Bool(true),
                };
                return evaluator.and(&above, &below, call.at).map(Some);
            }
            "clone" => return Ok(None),
            _ => {}
        }
    }
    if matches!(call.name, "clone" | "to_owned") {
        return Ok(None);
    }
    let iter = into_iter(evaluator, value.clone(), call.at)?;
    if let Some(value) = mutating_method(evaluator, receiver, iter.clone(), call)? {
        return Ok(Some(value));
    }
    if let Some(adapted) = adaptor_method(evaluator, iter.clone(), call)? {
        return Ok(Some(Value::iterator(adapted)));
    }
    super::consume::consume(evaluator, iter, call)
}

/// Methods that take `&mut self`.
fn mutating_method(
    evaluator: &mut Evaluator,
    receiver: &Receiver,
    mut iter: Iter,
    call: &Call,
) -> Result<Option<Value>> {
    let at = call.at;
    let value = match call.name {
        "next" => Value::Option(iter.next(evaluator, at)?.map(Box::new)),
        "next_back" => Value::Option(iter.next_back(evaluator, at)?.map(Box::new)),
        "nth" | "nth_back" => {
            let n = evaluator.usize(call.only()?, at)?;
            let back = call.name == "nth_back";
            let mut step = || if back { iter.next_back(evaluator, at) } else { iter.next(evaluator, at) };
            let mut value = step()?;
            for _ in 0..n {
                if value.is_none() {
                    break;
                }
                value = step()?;
            }
            Value::Option(value.map(Box::new))
        }
        "peek" => match &mut iter {
            Iter::Peekable(inner, peeked) => {
                let next = match peeked.take() {
                    Some(next) => next,
                    None => inner.next(evaluator, at)?.map(Box::new),
                };
                *peeked = Some(next.clone());
                Value::Option(next)
            }
            _ => return Ok(None),
        },
        "by_ref" => {
            return Ok(Some(match receiver {
                Receiver::Place(place) => Value::Reference(place.clone()),
                Receiver::Value(value) => value.clone(),
            }));
        }
        "find" | "position" | "any" | "all" | "find_map" => searching_method(evaluator, &mut iter, call)?,
        _ => return Ok(None),
    };
    option::update(evaluator, receiver, Value::iterator(iter), call)?;
    Ok(Some(value))
}

/// Short-circuiting methods.
fn searching_method(evaluator: &mut Evaluator, iter: &mut Iter, call: &Call) -> Result<Value> {
    let (closure, at) = (call.only()?, call.at);
    match call.name {
        "any" | "all" => {
            // Run-time conditions are combined over all elements.
            let any = call.name == "any";
            let mut result = Value::Bool(!any);
            loop {
                let mut next = |evaluator: &mut Evaluator| match iter.next(evaluator, at)? {
                    Some(value) => evaluator.call(closure, vec![value], at).map(Some),
                    None => Ok(None),
                };
                // The changes of the closure depend on the preceding results.
                let holds = match result {
                    Value::Condition(node) => {
                        let undecided = if any { evaluator.graph.not(node) } else { node };
                        evaluator.run_conditionally(undecided, next, at)?
                    }
                    _ => next(evaluator)?,
                };
                let Some(holds) = holds else { break };
                result = if any {
                    evaluator.or(&result, &holds, at)?
                } else {
                    evaluator.and(&result, &holds, at)?
                };
                if matches!(result, Value::Bool(known) if known == any) {
                    break;
                }
            }
            Ok(result)
        }
        "find_map" => {
            while let Some(value) = iter.next(evaluator, at)? {
                let value = evaluator.call(closure, vec![value], at)?;
                if let Some(value) = option_content(value, at)? {
                    return Ok(Value::some(value));
                }
            }
            Ok(Value::Option(None))
        }
        _ => {
            let mut index = 0;
            while let Some(value) = iter.next(evaluator, at)? {
                if holds(evaluator, closure, value.clone(), call.name, at)? {
                    return Ok(Value::some(if call.name == "find" { value } else { Value::usize(index) }));
                }
                index += 1;
            }
            Ok(Value::Option(None))
        }
    }
}

/// Adaptors.
fn adaptor_method(evaluator: &mut Evaluator, iter: Iter, call: &Call) -> Result<Option<Iter>> {
    let at = call.at;
    let inner = Box::new(iter);
    Ok(Some(match call.name {
        "iter" | "into_iter" | "copied" | "cloned" | "fuse" => {
            call.expect_argument_count(0)?;
            *inner
        }
        "zip" => Iter::Zip(inner, Box::new(into_iter(evaluator, call.only()?.clone(), at)?)),
        "chain" => Iter::Chain(Some(inner), Box::new(into_iter(evaluator, call.only()?.clone(), at)?)),
        "enumerate" => Iter::Enumerate(inner, 0),
        "map" => Iter::Map(inner, call.only()?.clone()),
        "filter" => Iter::Filter(inner, call.only()?.clone()),
        "filter_map" => Iter::FilterMap(inner, call.only()?.clone()),
        "flat_map" => {
            let mapped = Box::new(Iter::Map(inner, call.only()?.clone()));
            Iter::Flatten { inner: mapped, front: None, back: None }
        }
        "flatten" => Iter::Flatten { inner, front: None, back: None },
        "take_while" => Iter::TakeWhile(Some(inner), call.only()?.clone()),
        "skip_while" => Iter::SkipWhile(inner, Some(call.only()?.clone())),
        "map_while" => Iter::MapWhile(Some(inner), call.only()?.clone()),
        "scan" => {
            call.expect_argument_count(2)?;
            Iter::Scan { inner, state: call.arguments[0].clone(), closure: call.arguments[1].clone() }
        }
        "rev" => Iter::Rev(inner),
        "take" => Iter::Take(inner, evaluator.usize(call.only()?, at)?),
        "skip" => Iter::Skip(inner, evaluator.usize(call.only()?, at)?),
        "step_by" => {
            let step = evaluator.usize(call.only()?, at)?;
            if step == 0 {
                return Err(error(at, "`step_by` needs a step of at least one"));
            }
            Iter::StepBy { inner, step, begun: false }
        }
        "cycle" => Iter::Cycle { original: inner.clone(), now: inner },
        "peekable" => Iter::Peekable(inner, None),
        "inspect" => Iter::Inspect(inner, call.only()?.clone()),
        _ => return Ok(None),
    }))
}
