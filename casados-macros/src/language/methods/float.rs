//! Methods and constants of `f64`.
//!
//! Each is built from functions of the graph with bitwise equal results, with four exceptions:
//! `mul_add` rounds twice, `max` and `min` of a NaN and a number may be NaN, `copysign` of a NaN is
//! NaN, and `powi` is that of the scalar type.

use super::Call;
use crate::graph::{Binary, Compare, Node, Unary};
use crate::language::arithmetic::{Comparison, Operator};
use crate::language::evaluator::{Evaluator, error, unsupported};
use crate::language::value::Value;
use core::cmp::Ordering;
use syn::Result;

/// A method of `f64`. `None` if there is no such method.
pub fn method(evaluator: &mut Evaluator, a: Node, call: &Call) -> Result<Option<Value>> {
    if let Some(function) = unary(call.name) {
        call.expect_argument_count(0)?;
        return Ok(Some(Value::Real(evaluator.graph.unary(function, a))));
    }
    if let Some((operator, comparison)) = operator_by_name(call.name) {
        call.expect_argument_count(1)?;
        let other = &call.arguments[0];
        let a = Value::Real(a);
        return match (operator, comparison) {
            (Some(operator), _) => evaluator.binary(operator, &a, other, call.at).map(Some),
            (_, Some(comparison)) => evaluator.compare(comparison, &a, other, call.at).map(Some),
            _ => Ok(None),
        };
    }
    let value = match call.name {
        "neg" => evaluator.graph.unary(Unary::Neg, a),
        "sin_cos" => {
            call.expect_argument_count(0)?;
            let sin = evaluator.graph.unary(Unary::Sin, a);
            let cos = evaluator.graph.unary(Unary::Cos, a);
            return Ok(Some(Value::tuple(vec![Value::Real(sin), Value::Real(cos)])));
        }
        "powi" => {
            call.expect_argument_count(1)?;
            let n = evaluator.integer(&call.arguments[0], call.at)?.value;
            let n = i32::try_from(n).map_err(|_| error(call.at, format!("the exponent {n} is no `i32`")))?;
            evaluator.graph.powi(a, n)
        }
        "powf" | "atan2" | "hypot" => {
            let [b] = argument_nodes(evaluator, call)?;
            let function = match call.name {
                "powf" => Binary::Powf,
                "atan2" => Binary::Atan2,
                _ => Binary::Hypot,
            };
            evaluator.graph.binary(function, a, b)
        }
        "log" => {
            let [base] = argument_nodes(evaluator, call)?;
            let (a, base) = (evaluator.graph.unary(Unary::Ln, a), evaluator.graph.unary(Unary::Ln, base));
            evaluator.graph.binary(Binary::Div, a, base)
        }
        "mul_add" => {
            let [b, c] = argument_nodes(evaluator, call)?;
            let product = evaluator.graph.binary(Binary::Mul, a, b);
            evaluator.graph.binary(Binary::Add, product, c)
        }
        "recip" => {
            call.expect_argument_count(0)?;
            let one = evaluator.graph.constant(1.0);
            evaluator.graph.binary(Binary::Div, one, a)
        }
        "max" => {
            let [b] = argument_nodes(evaluator, call)?;
            max_node(evaluator, a, b)
        }
        "min" => {
            let [b] = argument_nodes(evaluator, call)?;
            min_node(evaluator, a, b)
        }
        "clamp" => clamp(evaluator, a, call)?,
        "copysign" => copysign(evaluator, a, call)?,
        "to_radians" => {
            call.expect_argument_count(0)?;
            let factor = evaluator.graph.constant(core::f64::consts::PI / 180.0);
            evaluator.graph.binary(Binary::Mul, a, factor)
        }
        "to_degrees" => {
            call.expect_argument_count(0)?;
            let factor = evaluator.graph.constant(180.0 / core::f64::consts::PI);
            evaluator.graph.binary(Binary::Mul, a, factor)
        }
        _ => return known_number_method(evaluator, a, call),
    };
    Ok(Some(Value::Real(value)))
}

fn clamp(evaluator: &mut Evaluator, a: Node, call: &Call) -> Result<Node> {
    let [low, high] = argument_nodes(evaluator, call)?;
    if let (Some(low), Some(high)) = (evaluator.graph.value(low), evaluator.graph.value(high))
        && !matches!(low.partial_cmp(&high), Some(Ordering::Less | Ordering::Equal))
    {
        return Err(error(call.at, format!("the bounds of `clamp` are {low} > {high}, or NaN")));
    }
    let a = max_node(evaluator, a, low);
    Ok(min_node(evaluator, a, high))
}

fn copysign(evaluator: &mut Evaluator, a: Node, call: &Call) -> Result<Node> {
    let [sign] = argument_nodes(evaluator, call)?;
    let size = evaluator.graph.unary(Unary::Abs, a);
    Ok(match evaluator.graph.value(sign) {
        Some(sign) if sign.is_sign_negative() => evaluator.graph.unary(Unary::Neg, size),
        Some(_) => size,
        None => {
            let sign = evaluator.graph.unary(Unary::Signum, sign);
            evaluator.graph.binary(Binary::Mul, size, sign)
        }
    })
}

/// `a` if it is not less than `b`.
fn max_node(evaluator: &mut Evaluator, a: Node, b: Node) -> Node {
    if let (Some(a), Some(b)) = (evaluator.graph.value(a), evaluator.graph.value(b)) {
        return evaluator.graph.constant(a.max(b));
    }
    let less = evaluator.graph.compare(Compare::Lt, a, b);
    evaluator.graph.select(less, b, a)
}

/// `a` if it is not greater than `b`.
fn min_node(evaluator: &mut Evaluator, a: Node, b: Node) -> Node {
    if let (Some(a), Some(b)) = (evaluator.graph.value(a), evaluator.graph.value(b)) {
        return evaluator.graph.constant(a.min(b));
    }
    let greater = evaluator.graph.compare(Compare::Lt, b, a);
    evaluator.graph.select(greater, b, a)
}

/// Methods of known numbers.
#[rustfmt::skip]
const KNOWN_NUMBER_METHODS: &[&str] = &[
    "floor", "ceil", "round", "round_ties_even", "trunc", "fract", "rem_euclid", "div_euclid", "is_nan",
    "is_finite", "is_infinite", "is_sign_positive", "is_sign_negative", "total_cmp", "partial_cmp", "to_bits",
];

/// Whether `f64` has an inherent method of this name.
pub fn is_inherent(name: &str) -> bool {
    unary(name).is_some()
        || KNOWN_NUMBER_METHODS.contains(&name) && name != "partial_cmp"
        || matches!(name, "sin_cos" | "powi" | "powf" | "atan2" | "hypot" | "log" | "mul_add" | "recip")
        || matches!(name, "max" | "min" | "clamp" | "copysign" | "to_radians" | "to_degrees")
}

/// Methods without a useful derivative: for known numbers the result is known.
fn known_number_method(evaluator: &mut Evaluator, a: Node, call: &Call) -> Result<Option<Value>> {
    if !KNOWN_NUMBER_METHODS.contains(&call.name) {
        return Ok(None);
    }
    let refuse = || unsupported(call.at, format!("`{}` of a model variable", call.name));
    let a = evaluator.graph.value(a).ok_or_else(refuse)?;
    let value = match call.name {
        "floor" => a.floor(),
        "ceil" => a.ceil(),
        "round" => a.round(),
        "round_ties_even" => a.round_ties_even(),
        "trunc" => a.trunc(),
        "fract" => a.fract(),
        "rem_euclid" | "div_euclid" => {
            let [b] = argument_nodes(evaluator, call)?;
            let b = evaluator.graph.value(b).ok_or_else(refuse)?;
            if call.name == "rem_euclid" { a.rem_euclid(b) } else { a.div_euclid(b) }
        }
        "is_nan" => return Ok(Some(Value::Bool(a.is_nan()))),
        "is_finite" => return Ok(Some(Value::Bool(a.is_finite()))),
        "is_infinite" => return Ok(Some(Value::Bool(a.is_infinite()))),
        "is_sign_positive" => return Ok(Some(Value::Bool(a.is_sign_positive()))),
        "is_sign_negative" => return Ok(Some(Value::Bool(a.is_sign_negative()))),
        _ => return Err(refuse()),
    };
    Ok(Some(Value::Real(evaluator.graph.constant(value))))
}

/// The arguments as nodes.
fn argument_nodes<const N: usize>(evaluator: &mut Evaluator, call: &Call) -> Result<[Node; N]> {
    call.expect_argument_count(N)?;
    let mut numbers = [Node(0); N];
    for (number, argument) in numbers.iter_mut().zip(&call.arguments) {
        *number = evaluator.real(argument, call.at)?;
    }
    Ok(numbers)
}

fn unary(name: &str) -> Option<Unary> {
    Some(match name {
        "sqrt" => Unary::Sqrt,
        "cbrt" => Unary::Cbrt,
        "exp" => Unary::Exp,
        "exp2" => Unary::Exp2,
        "exp_m1" => Unary::ExpM1,
        "ln" => Unary::Ln,
        "ln_1p" => Unary::Ln1p,
        "log2" => Unary::Log2,
        "log10" => Unary::Log10,
        "sin" => Unary::Sin,
        "cos" => Unary::Cos,
        "tan" => Unary::Tan,
        "asin" => Unary::Asin,
        "acos" => Unary::Acos,
        "atan" => Unary::Atan,
        "sinh" => Unary::Sinh,
        "cosh" => Unary::Cosh,
        "tanh" => Unary::Tanh,
        "asinh" => Unary::Asinh,
        "acosh" => Unary::Acosh,
        "atanh" => Unary::Atanh,
        "abs" => Unary::Abs,
        "signum" => Unary::Signum,
        _ => return None,
    })
}

/// Methods of `core::ops` and `core::cmp`.
pub fn operator_by_name(name: &str) -> Option<(Option<Operator>, Option<Comparison>)> {
    Some(match name {
        "add" => (Some(Operator::Add), None),
        "sub" => (Some(Operator::Sub), None),
        "mul" => (Some(Operator::Mul), None),
        "div" => (Some(Operator::Div), None),
        "rem" => (Some(Operator::Rem), None),
        "eq" => (None, Some(Comparison::Eq)),
        "ne" => (None, Some(Comparison::Ne)),
        "lt" => (None, Some(Comparison::Lt)),
        "le" => (None, Some(Comparison::Le)),
        "gt" => (None, Some(Comparison::Gt)),
        "ge" => (None, Some(Comparison::Ge)),
        _ => return None,
    })
}

/// `f64::EPSILON`, `core::f64::consts::PI`, by the last segments of the path.
pub fn constant(module: &str, name: &str) -> Option<f64> {
    use core::f64::consts;
    Some(match (module, name) {
        ("f64", "EPSILON") => f64::EPSILON,
        ("f64", "MIN") => f64::MIN,
        ("f64", "MAX") => f64::MAX,
        ("f64", "MIN_POSITIVE") => f64::MIN_POSITIVE,
        ("f64", "INFINITY") => f64::INFINITY,
        ("f64", "NEG_INFINITY") => f64::NEG_INFINITY,
        ("f64", "NAN") => f64::NAN,
        ("consts", "PI") => consts::PI,
        ("consts", "TAU") => consts::TAU,
        ("consts", "E") => consts::E,
        ("consts", "SQRT_2") => consts::SQRT_2,
        ("consts", "LN_2") => consts::LN_2,
        ("consts", "LN_10") => consts::LN_10,
        ("consts", "LOG2_10") => consts::LOG2_10,
        ("consts", "LOG2_E") => consts::LOG2_E,
        ("consts", "LOG10_2") => consts::LOG10_2,
        ("consts", "LOG10_E") => consts::LOG10_E,
        ("consts", "FRAC_1_PI") => consts::FRAC_1_PI,
        ("consts", "FRAC_1_SQRT_2") => consts::FRAC_1_SQRT_2,
        ("consts", "FRAC_2_PI") => consts::FRAC_2_PI,
        ("consts", "FRAC_2_SQRT_PI") => consts::FRAC_2_SQRT_PI,
        ("consts", "FRAC_PI_2") => consts::FRAC_PI_2,
        ("consts", "FRAC_PI_3") => consts::FRAC_PI_3,
        ("consts", "FRAC_PI_4") => consts::FRAC_PI_4,
        ("consts", "FRAC_PI_6") => consts::FRAC_PI_6,
        ("consts", "FRAC_PI_8") => consts::FRAC_PI_8,
        _ => return None,
    })
}
