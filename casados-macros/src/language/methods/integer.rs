//! Methods and constants of integers, which are always known.

use super::Call;
use crate::language::arithmetic::{checked_integer, wrapped_integer};
use crate::language::evaluator::{Evaluator, error};
use crate::language::value::{Integer, IntegerType, Value};
use syn::Result;

/// A method of an integer. `None` if there is no such method.
pub fn method(evaluator: &mut Evaluator, a: Integer, call: &Call) -> Result<Option<Value>> {
    if let Some((operator, comparison)) = super::float::operator_by_name(call.name) {
        call.expect_argument_count(1)?;
        let (a, other) = (Value::Integer(a), &call.arguments[0]);
        return match (operator, comparison) {
            (Some(operator), _) => evaluator.binary(operator, &a, other, call.at).map(Some),
            (_, Some(comparison)) => evaluator.compare(comparison, &a, other, call.at).map(Some),
            _ => Ok(None),
        };
    }
    let mut others = Vec::new();
    if takes_integers(call.name) {
        call.expect_argument_count(if call.name == "clamp" { 2 } else { 1 })?;
        for argument in &call.arguments {
            others.push(evaluator.integer(argument, call.at)?);
        }
    }
    let ty = if call.name.ends_with("pow") { a.ty } else { others.iter().fold(a.ty, |ty, b| ty.or(b.ty)) };
    let (x, y) = (a.value, others.first().map_or(0, |b| b.value));
    let whole = |value: Option<i128>| {
        checked_integer(value, ty)
            .map(|value| Some(Value::Integer(value)))
            .ok_or_else(|| error(call.at, format!("`{}` of {x} overflows here, or has no value", call.name)))
    };
    let checked = |value: Option<i128>| {
        Ok(Some(Value::Option(checked_integer(value, ty).map(|value| Box::new(Value::Integer(value))))))
    };
    let saturated = |value: i128| {
        let value = ty.map_or(value, |ty| value.clamp(ty.min(), ty.max()));
        Ok(Some(Value::Integer(Integer { value, ty })))
    };
    let wrapped = |value: i128| {
        Ok(Some(Value::Integer(ty.map_or(Integer { value, ty }, |ty| wrapped_integer(value, ty)))))
    };
    match call.name {
        "pow" => whole(u32::try_from(y).ok().and_then(|n| x.checked_pow(n))),
        "min" => whole(Some(x.min(y))),
        "max" => whole(Some(x.max(y))),
        "clamp" => {
            let high = others.get(1).map_or(0, |b| b.value);
            if y > high {
                return Err(error(call.at, format!("the bounds of `clamp` are {y} > {high}")));
            }
            whole(Some(x.clamp(y, high)))
        }
        "abs" | "unsigned_abs" => whole(x.checked_abs()),
        "abs_diff" => whole(x.checked_sub(y).and_then(i128::checked_abs)),
        "signum" => whole(Some(x.signum())),
        "rem_euclid" => whole(x.checked_rem_euclid(y)),
        "div_euclid" => whole(x.checked_div_euclid(y)),
        "div_ceil" => {
            whole(x.checked_div_euclid(y).and_then(|q| q.checked_add(i128::from(x.rem_euclid(y) != 0))))
        }
        "next_multiple_of" => {
            whole(x.checked_rem_euclid(y).and_then(|r| if r == 0 { Some(x) } else { x.checked_add(y - r) }))
        }
        "is_multiple_of" => Ok(Some(Value::Bool(if y == 0 { x == 0 } else { x % y == 0 }))),
        "is_power_of_two" => Ok(Some(Value::Bool(x > 0 && x & (x - 1) == 0))),
        "is_positive" => Ok(Some(Value::Bool(x > 0))),
        "is_negative" => Ok(Some(Value::Bool(x < 0))),
        "isqrt" => whole(x.checked_isqrt()),
        "saturating_add" => saturated(x.saturating_add(y)),
        "saturating_sub" => saturated(x.saturating_sub(y)),
        "saturating_mul" => saturated(x.saturating_mul(y)),
        "wrapping_add" => wrapped(x.wrapping_add(y)),
        "wrapping_sub" => wrapped(x.wrapping_sub(y)),
        "wrapping_mul" => wrapped(x.wrapping_mul(y)),
        "checked_add" => checked(x.checked_add(y)),
        "checked_sub" => checked(x.checked_sub(y)),
        "checked_mul" => checked(x.checked_mul(y)),
        "checked_div" => checked(x.checked_div(y)),
        "checked_pow" => checked(u32::try_from(y).ok().and_then(|n| x.checked_pow(n))),
        // Negative numbers have the bits of their type.
        "count_ones" => Ok(Some(bit_count((x << (128 - ty.map_or(32, IntegerType::bits))).count_ones()))),
        "trailing_zeros" => {
            Ok(Some(bit_count(if x == 0 { ty.map_or(32, IntegerType::bits) } else { x.trailing_zeros() })))
        }
        "ilog2" => match x.checked_ilog2() {
            Some(log) => Ok(Some(bit_count(log))),
            None => whole(None),
        },
        _ => Ok(None),
    }
}

/// Whether the arguments of a method are integers.
fn takes_integers(name: &str) -> bool {
    matches!(
        name,
        "pow"
            | "min"
            | "max"
            | "clamp"
            | "abs_diff"
            | "rem_euclid"
            | "div_euclid"
            | "div_ceil"
            | "is_multiple_of"
            | "next_multiple_of"
            | "saturating_sub"
            | "saturating_add"
            | "saturating_mul"
            | "wrapping_add"
            | "wrapping_sub"
            | "wrapping_mul"
            | "checked_add"
            | "checked_sub"
            | "checked_mul"
            | "checked_div"
            | "checked_pow"
            | "ilog"
    )
}

/// Whether integers have an inherent method of this name.
pub fn is_inherent(name: &str) -> bool {
    takes_integers(name) && !matches!(name, "min" | "max" | "clamp")
        || matches!(name, "abs" | "unsigned_abs" | "signum" | "isqrt" | "is_power_of_two" | "is_positive")
        || matches!(name, "is_negative" | "count_ones" | "trailing_zeros" | "ilog2")
}

fn bit_count(value: u32) -> Value {
    Value::Integer(Integer { value: i128::from(value), ty: Some(IntegerType::U32) })
}

/// `usize::MAX`, `i32::BITS`.
pub fn constant(ty: IntegerType, name: &str) -> Option<Value> {
    match name {
        "MAX" => Some(Value::Integer(Integer { value: ty.max(), ty: Some(ty) })),
        "MIN" => Some(Value::Integer(Integer { value: ty.min(), ty: Some(ty) })),
        "BITS" => Some(bit_count(ty.bits())),
        _ => None,
    }
}
