//! Methods that consume an iterator.

use super::iterator::Iter;
use super::{Call, float, function};
use crate::language::arithmetic::{Comparison, Operator};
use crate::language::evaluator::{Evaluator, error, unsupported};
use crate::language::types::Type;
use crate::language::value::{Generic, Value};
use syn::Result;

/// A consuming method. `None` if there is no such method.
pub fn consume(evaluator: &mut Evaluator, mut iter: Iter, call: &Call) -> Result<Option<Value>> {
    let at = call.at;
    let value = match call.name {
        "fold" | "rfold" | "reduce" | "sum" | "product" => reducing_method(evaluator, iter, call)?,
        "for_each" => {
            let closure = call.only()?;
            while let Some(value) = iter.next(evaluator, at)? {
                evaluator.call(closure, vec![value], at)?;
            }
            Value::unit()
        }
        "count" => {
            let mut count = 0;
            while iter.next(evaluator, at)?.is_some() {
                count += 1;
            }
            Value::usize(count)
        }
        "len" => Value::usize(iter.length(evaluator, at)?),
        "last" => {
            let mut last = None;
            while let Some(value) = iter.next(evaluator, at)? {
                last = Some(Box::new(value));
            }
            Value::Option(last)
        }
        "min" | "max" | "min_by_key" | "max_by_key" => extreme(evaluator, iter, call)?,
        "eq" | "ne" | "lt" | "le" | "gt" | "ge" => {
            let Some((_, Some(comparison))) = float::operator_by_name(call.name) else { return Ok(None) };
            let mut other = super::iterator::into_iter(evaluator, call.only()?.clone(), at)?;
            let (mut a, mut b) = (Vec::new(), Vec::new());
            while let Some(value) = iter.next(evaluator, at)? {
                a.push(value);
            }
            while let Some(value) = other.next(evaluator, at)? {
                b.push(value);
            }
            evaluator.compare(comparison, &Value::array(a), &Value::array(b), at)?
        }
        "unzip" | "collect" | "partition" => {
            return Err(unsupported(
                at,
                format!(
                    "`{}` into a collection on the heap (an array does the same: `core::array::from_fn`, `map`)",
                    call.name
                ),
            ));
        }
        "min_by" | "max_by" => {
            return Err(unsupported(
                at,
                format!("`{}` (of numbers, `fold` with `f64::max` or `f64::min` does the same)", call.name),
            ));
        }
        _ => return Ok(None),
    };
    Ok(Some(value))
}

/// Methods that reduce all elements to one value.
fn reducing_method(evaluator: &mut Evaluator, mut iter: Iter, call: &Call) -> Result<Value> {
    let at = call.at;
    Ok(match call.name {
        "fold" => {
            call.expect_argument_count(2)?;
            let mut accumulated = call.arguments[0].clone();
            while let Some(value) = iter.next(evaluator, at)? {
                accumulated = evaluator.call(&call.arguments[1], vec![accumulated, value], at)?;
            }
            accumulated
        }
        "rfold" => {
            call.expect_argument_count(2)?;
            let mut accumulated = call.arguments[0].clone();
            while let Some(value) = iter.next_back(evaluator, at)? {
                accumulated = evaluator.call(&call.arguments[1], vec![accumulated, value], at)?;
            }
            accumulated
        }
        "reduce" => {
            let closure = call.only()?;
            let Some(mut accumulated) = iter.next(evaluator, at)? else {
                return Ok(Value::Option(None));
            };
            while let Some(value) = iter.next(evaluator, at)? {
                accumulated = evaluator.call(closure, vec![accumulated, value], at)?;
            }
            Value::some(accumulated)
        }
        // Sums start with the first element: adding it to zero changes only the sign of a zero.
        _ => {
            let operator = if call.name == "sum" { Operator::Add } else { Operator::Mul };
            let Some(first) = iter.next(evaluator, at)? else {
                return empty_result(evaluator, call);
            };
            let mut accumulated = evaluator.follow_value(first, at)?;
            while let Some(value) = iter.next(evaluator, at)? {
                accumulated = evaluator.binary(operator, &accumulated, &value, at)?;
            }
            accumulated
        }
    })
}

/// The empty sum or product.
fn empty_result(evaluator: &mut Evaluator, call: &Call) -> Result<Value> {
    let given = call.turbofish.iter().find_map(|generic| match generic {
        Generic::Type(Type::Unknown) | Generic::Const(_) => None,
        Generic::Type(ty) => Some(ty.clone()),
    });
    let ty = given.unwrap_or_else(|| call.expected.clone());
    let one = call.name == "product";
    match ty {
        Type::Integer(_) | Type::Matrix(..) if !one => function::default(evaluator, &ty, call.at),
        Type::Integer(ty) => Ok(Value::Integer(crate::language::value::Integer { value: 1, ty: Some(ty) })),
        _ => Ok(Value::Real(evaluator.graph.constant(if one { 1.0 } else { 0.0 }))),
    }
}

/// The smallest or largest of known elements: the last of several largest, the first of several
/// smallest.
fn extreme(evaluator: &mut Evaluator, mut iter: Iter, call: &Call) -> Result<Value> {
    let at = call.at;
    let largest = call.name.starts_with("max");
    let key = call.name.ends_with("key");
    let mut best: Option<(Value, Value)> = None;
    while let Some(value) = iter.next(evaluator, at)? {
        let measure =
            if key { evaluator.call(call.only()?, vec![value.clone()], at)? } else { value.clone() };
        let better = match &best {
            None => true,
            Some((_, other)) => {
                let comparison = if largest { Comparison::Ge } else { Comparison::Lt };
                match evaluator.compare(comparison, &measure, other, at)? {
                    Value::Bool(known) => known,
                    _ => {
                        return Err(error(
                            at,
                            format!(
                                "`{}` of model variables: use `fold` with `f64::max` or `f64::min`",
                                call.name
                            ),
                        ));
                    }
                }
            }
        };
        if better {
            best = Some((value, measure));
        }
    }
    Ok(Value::Option(best.map(|(value, _)| Box::new(value))))
}
