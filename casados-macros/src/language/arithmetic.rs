//! Operators.

use super::evaluator::{Evaluator, TokenSpan, error, opaque_value_error, unsupported};
use super::methods;
use super::value::{Integer, IntegerType, Value};
use crate::graph::{Binary, Compare, Node, Unary};
use syn::Result;

/// Binary operators that return numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Operator {
    Add,
    Sub,
    Mul,
    Div,
    Rem,
    BitXor,
    BitAnd,
    BitOr,
    Shl,
    Shr,
}

impl Operator {
    /// Its symbol.
    pub fn symbol(self) -> &'static str {
        match self {
            Operator::Add => "+",
            Operator::Sub => "-",
            Operator::Mul => "*",
            Operator::Div => "/",
            Operator::Rem => "%",
            Operator::BitXor => "^",
            Operator::BitAnd => "&",
            Operator::BitOr => "|",
            Operator::Shl => "<<",
            Operator::Shr => ">>",
        }
    }

    /// Its trait and method in `core::ops`.
    pub fn method(self) -> (&'static str, &'static str) {
        match self {
            Operator::Add => ("Add", "add"),
            Operator::Sub => ("Sub", "sub"),
            Operator::Mul => ("Mul", "mul"),
            Operator::Div => ("Div", "div"),
            Operator::Rem => ("Rem", "rem"),
            Operator::BitXor => ("BitXor", "bitxor"),
            Operator::BitAnd => ("BitAnd", "bitand"),
            Operator::BitOr => ("BitOr", "bitor"),
            Operator::Shl => ("Shl", "shl"),
            Operator::Shr => ("Shr", "shr"),
        }
    }
}

/// Comparisons.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Comparison {
    Eq,
    Ne,
    Lt,
    Le,
    Gt,
    Ge,
}

impl Evaluator {
    /// `a ∘ b` for all types of values, with elementwise and user-defined operators.
    pub fn binary(&mut self, operator: Operator, a: &Value, b: &Value, at: TokenSpan) -> Result<Value> {
        match (a, b) {
            (Value::Real(_) | Value::Opaque(_), Value::Real(_) | Value::Opaque(_)) => {
                let (a, b) = (self.real(a, at)?, self.real(b, at)?);
                self.real_operator(operator, a, b, at).map(Value::Real)
            }
            (Value::Integer(a), Value::Integer(b)) => {
                integer_operator(operator, *a, *b).map(Value::Integer).map_err(|message| error(at, message))
            }
            (Value::Integer(_), Value::Opaque(_)) | (Value::Opaque(_), Value::Integer(_)) => {
                Err(opaque_value_error(at, "an integer"))
            }
            (Value::Bool(_) | Value::Condition(_), Value::Bool(_) | Value::Condition(_)) => match operator {
                Operator::BitAnd => self.and(a, b, at),
                Operator::BitOr => self.or(a, b, at),
                Operator::BitXor => self.compare(Comparison::Ne, a, b, at),
                _ => Err(error(at, format!("`bool` has no operator `{}`", operator.symbol()))),
            },
            (Value::Reference(place), _) => {
                let a = self.read(place, at)?;
                self.binary(operator, &a, b, at)
            }
            (_, Value::Reference(place)) => {
                let b = self.read(place, at)?;
                self.binary(operator, a, &b, at)
            }
            _ => {
                if let Some(value) = self.user_operator(operator, a, b, at)? {
                    return Ok(value);
                }
                if let Some(value) = methods::matrix_operator(self, operator, a, b, at)? {
                    return Ok(value);
                }
                Err(error(
                    at,
                    format!(
                        "there is no `{}` between {} and {}",
                        operator.symbol(),
                        a.description(),
                        b.description()
                    ),
                ))
            }
        }
    }

    fn real_operator(&mut self, operator: Operator, a: Node, b: Node, at: TokenSpan) -> Result<Node> {
        let function = match operator {
            Operator::Add => Binary::Add,
            Operator::Sub => Binary::Sub,
            Operator::Mul => Binary::Mul,
            Operator::Div => Binary::Div,
            Operator::Rem => {
                return match (self.graph.value(a), self.graph.value(b)) {
                    (Some(a), Some(b)) => Ok(self.graph.constant(a % b)),
                    _ => Err(unsupported(at, "the remainder of model variables, which is not continuous,")),
                };
            }
            _ => return Err(error(at, format!("`f64` has no operator `{}`", operator.symbol()))),
        };
        Ok(self.graph.binary(function, a, b))
    }

    /// `-a`
    pub fn negate(&mut self, a: &Value, at: TokenSpan) -> Result<Value> {
        match a {
            Value::Real(_) | Value::Opaque(_) => {
                let a = self.real(a, at)?;
                Ok(Value::Real(self.graph.unary(Unary::Neg, a)))
            }
            Value::Integer(a) => checked_integer(a.value.checked_neg(), a.ty)
                .map(Value::Integer)
                .ok_or_else(|| error(at, "attempt to negate with overflow")),
            Value::Reference(place) => {
                let a = self.read(place, at)?;
                self.negate(&a, at)
            }
            Value::Matrix(matrix) => {
                let mut negative = (**matrix).clone();
                for element in &mut negative.elements {
                    *element = self.negate(element, at)?;
                }
                Ok(Value::Matrix(negative.into()))
            }
            _ => match self.user_method("Neg", "neg", a, Vec::new(), at)? {
                Some(value) => Ok(value),
                None => Err(error(at, format!("there is no `-` of {}", a.description()))),
            },
        }
    }

    /// `!a`
    pub fn invert(&mut self, a: &Value, at: TokenSpan) -> Result<Value> {
        match a {
            Value::Bool(a) => Ok(Value::Bool(!a)),
            Value::Condition(a) => Ok(Value::Condition(self.graph.not(*a))),
            Value::Integer(a) => {
                let Some(ty) = a.ty else { return Ok(Value::Integer(Integer { value: !a.value, ty: None })) };
                let value = if ty.signed() { !a.value } else { ty.max() - a.value };
                Ok(Value::Integer(Integer { value, ty: a.ty }))
            }
            Value::Reference(place) => {
                let a = self.read(place, at)?;
                self.invert(&a, at)
            }
            Value::Opaque(_) => Err(opaque_value_error(at, "a `bool`")),
            _ => match self.user_method("Not", "not", a, Vec::new(), at)? {
                Some(value) => Ok(value),
                None => Err(error(at, format!("there is no `!` of {}", a.description()))),
            },
        }
    }

    /// `a && b` of values.
    pub fn and(&mut self, a: &Value, b: &Value, at: TokenSpan) -> Result<Value> {
        Ok(match (a, b) {
            (Value::Bool(true), b) => b.clone(),
            (a, Value::Bool(true)) => a.clone(),
            (Value::Bool(false), _) | (_, Value::Bool(false)) => Value::Bool(false),
            (Value::Condition(a), Value::Condition(b)) => Value::Condition(self.graph.and(*a, *b)),
            _ => {
                return Err(error(
                    at,
                    format!("there is no `&` of {} and {}", a.description(), b.description()),
                ));
            }
        })
    }

    /// `a || b` of values.
    pub fn or(&mut self, a: &Value, b: &Value, at: TokenSpan) -> Result<Value> {
        Ok(match (a, b) {
            (Value::Bool(false), b) => b.clone(),
            (a, Value::Bool(false)) => a.clone(),
            (Value::Bool(true), _) | (_, Value::Bool(true)) => Value::Bool(true),
            (Value::Condition(a), Value::Condition(b)) => Value::Condition(self.graph.or(*a, *b)),
            _ => {
                return Err(error(
                    at,
                    format!("there is no `|` of {} and {}", a.description(), b.description()),
                ));
            }
        })
    }

    /// A comparison: a `Bool` if it is known, otherwise a `Condition`.
    pub fn compare(&mut self, comparison: Comparison, a: &Value, b: &Value, at: TokenSpan) -> Result<Value> {
        match (a, b) {
            (Value::Reference(place), _) => {
                let a = self.read(place, at)?;
                return self.compare(comparison, &a, b, at);
            }
            (_, Value::Reference(place)) => {
                let b = self.read(place, at)?;
                return self.compare(comparison, a, &b, at);
            }
            _ => {}
        }
        match comparison {
            Comparison::Eq => self.equal(a, b, at),
            Comparison::Ne => {
                let equal = self.equal(a, b, at)?;
                self.invert(&equal, at)
            }
            Comparison::Gt => self.ordered(Comparison::Lt, b, a, at),
            Comparison::Ge => self.ordered(Comparison::Le, b, a, at),
            _ => self.ordered(comparison, a, b, at),
        }
    }

    fn ordered(&mut self, comparison: Comparison, a: &Value, b: &Value, at: TokenSpan) -> Result<Value> {
        let strict = comparison == Comparison::Lt;
        match (a, b) {
            (Value::Integer(a), Value::Integer(b)) => {
                Ok(Value::Bool(if strict { a.value < b.value } else { a.value <= b.value }))
            }
            (Value::Bool(a), Value::Bool(b)) => Ok(Value::Bool(if strict { !a & b } else { a <= b })),
            (Value::Real(_) | Value::Opaque(_), Value::Real(_) | Value::Opaque(_)) => {
                let (a, b) = (self.real(a, at)?, self.real(b, at)?);
                Ok(match (self.graph.value(a), self.graph.value(b)) {
                    (Some(a), Some(b)) => Value::Bool(if strict { a < b } else { a <= b }),
                    _ => {
                        let comparison = if strict { Compare::Lt } else { Compare::Le };
                        Value::Condition(self.graph.compare(comparison, a, b))
                    }
                })
            }
            (Value::Opaque(_), Value::Integer(_)) | (Value::Integer(_), Value::Opaque(_)) => {
                Err(opaque_value_error(at, "an integer"))
            }
            (Value::Tuple(x), Value::Tuple(y)) | (Value::Array(x), Value::Array(y)) => {
                // Lexicographic: later elements decide if all earlier ones are equal.
                let mut result =
                    if x.len() == y.len() { Value::Bool(!strict) } else { Value::Bool(x.len() < y.len()) };
                for (x, y) in x.iter().zip(y.iter()).rev() {
                    let less = self.compare(Comparison::Lt, x, y, at)?;
                    let equal = self.compare(Comparison::Eq, x, y, at)?;
                    let rest = self.and(&equal, &result, at)?;
                    result = self.or(&less, &rest, at)?;
                }
                Ok(result)
            }
            _ => Err(unsupported(
                at,
                format!("this comparison of {} and {}", a.description(), b.description()),
            )),
        }
    }

    fn equal(&mut self, a: &Value, b: &Value, at: TokenSpan) -> Result<Value> {
        match (a, b) {
            (Value::Integer(a), Value::Integer(b)) => Ok(Value::Bool(a.value == b.value)),
            (Value::Bool(a), Value::Bool(b)) => Ok(Value::Bool(a == b)),
            (Value::Bool(known), Value::Condition(node)) | (Value::Condition(node), Value::Bool(known)) => {
                Ok(Value::Condition(if *known { *node } else { self.graph.not(*node) }))
            }
            (Value::Condition(a), Value::Condition(b)) => {
                let both = self.graph.and(*a, *b);
                let (not_a, not_b) = (self.graph.not(*a), self.graph.not(*b));
                let neither = self.graph.and(not_a, not_b);
                Ok(Value::Condition(self.graph.or(both, neither)))
            }
            (Value::Real(_) | Value::Opaque(_), Value::Real(_) | Value::Opaque(_)) => {
                let (a, b) = (self.real(a, at)?, self.real(b, at)?);
                Ok(match (self.graph.value(a), self.graph.value(b)) {
                    (Some(a), Some(b)) => Value::Bool(a == b),
                    _ => Value::Condition(self.graph.compare(Compare::Eq, a, b)),
                })
            }
            (Value::Tuple(x), Value::Tuple(y)) | (Value::Array(x), Value::Array(y)) => {
                self.compare_elements(x, y, at)
            }
            (Value::Matrix(x), Value::Matrix(y)) => self.compare_elements(&x.elements, &y.elements, at),
            (Value::Struct(x), Value::Struct(y)) => {
                if let Some(value) = self.user_method("PartialEq", "eq", a, vec![b.clone()], at)? {
                    return Ok(value);
                }
                if x.variant != y.variant {
                    return Ok(Value::Bool(false));
                }
                self.compare_elements(&x.fields, &y.fields, at)
            }
            (Value::Option(x), Value::Option(y)) => match (x, y) {
                (Some(x), Some(y)) => self.compare(Comparison::Eq, x, y, at),
                (x, y) => Ok(Value::Bool(x.is_none() && y.is_none())),
            },
            (Value::Opaque(_), Value::Integer(_)) | (Value::Integer(_), Value::Opaque(_)) => {
                Err(opaque_value_error(at, "an integer"))
            }
            _ => {
                Err(unsupported(at, format!("the comparison of {} and {}", a.description(), b.description())))
            }
        }
    }

    fn compare_elements(&mut self, x: &[Value], y: &[Value], at: TokenSpan) -> Result<Value> {
        let mut result = Value::Bool(x.len() == y.len());
        for (x, y) in x.iter().zip(y) {
            let equal = self.compare(Comparison::Eq, x, y, at)?;
            result = self.and(&result, &equal, at)?;
        }
        Ok(result)
    }
}

/// The integer, if it is in the range of its type.
pub fn checked_integer(value: Option<i128>, ty: Option<IntegerType>) -> Option<Integer> {
    let value = value?;
    match ty {
        Some(ty) if value < ty.min() || value > ty.max() => None,
        _ => Some(Integer { value, ty }),
    }
}

/// The integer wrapped into the range of its type, as by `as`.
pub fn wrapped_integer(value: i128, ty: IntegerType) -> Integer {
    let bits = ty.bits();
    let value = if bits == 128 {
        value
    } else if ty.signed() {
        value << (128 - bits) >> (128 - bits)
    } else {
        value & ty.max()
    };
    Integer { value, ty: Some(ty) }
}

/// Integer arithmetic with the checks of a debug build.
pub fn integer_operator(operator: Operator, a: Integer, b: Integer) -> std::result::Result<Integer, String> {
    let shift = matches!(operator, Operator::Shl | Operator::Shr);
    let ty = if shift { a.ty } else { a.ty.or(b.ty) };
    let (x, y) = (a.value, b.value);
    let value = match operator {
        Operator::Add => x.checked_add(y),
        Operator::Sub => x.checked_sub(y),
        Operator::Mul => x.checked_mul(y),
        Operator::Div | Operator::Rem if y == 0 => {
            return Err(format!("{x} {} 0 has no value", operator.symbol()));
        }
        Operator::Div => x.checked_div(y),
        Operator::Rem => x.checked_rem(y),
        Operator::BitXor => Some(x ^ y),
        Operator::BitAnd => Some(x & y),
        Operator::BitOr => Some(x | y),
        Operator::Shl | Operator::Shr => {
            let bits = ty.map_or(32, IntegerType::bits);
            match u32::try_from(y) {
                Ok(y) if y < bits => {
                    if operator == Operator::Shr {
                        Some(x >> y)
                    } else {
                        Some(ty.map_or(x << y, |ty| wrapped_integer(x << y, ty).value))
                    }
                }
                _ => None,
            }
        }
    };
    // Without a known type it is `i32`, unless the compiler infers another one.
    let value = value.filter(|&value| ty.is_some() || i32::try_from(value).is_ok());
    checked_integer(value, ty).ok_or_else(|| {
        let name = ty.map_or("i32", IntegerType::name);
        let text = format!("attempt to compute `{x} {} {y}`, which overflows `{name}`", operator.symbol());
        if ty.is_some() { text } else { format!("{text}: if another type is meant, write it, as in `1_i64`") }
    })
}
