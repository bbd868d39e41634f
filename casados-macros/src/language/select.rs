//! `if condition { a } else { b }` for values, with a run-time condition.

use super::evaluator::{Evaluator, TokenSpan, error};
use super::value::{Struct, Value};
use crate::graph::Node;
use std::rc::Rc;
use syn::Result;

impl Evaluator {
    /// `if condition { a } else { b }`, elementwise.
    pub fn select(&mut self, condition: Node, a: &Value, b: &Value, at: TokenSpan) -> Result<Value> {
        Ok(match (a, b) {
            (Value::Uninitialised, _) | (_, Value::Uninitialised) => Value::Uninitialised,
            (Value::Reference(x), Value::Reference(y)) if x.is_same_memory(y) => a.clone(),
            (Value::Reference(_), _) | (_, Value::Reference(_)) => {
                return Err(error(
                    at,
                    "this reference depends on model variables: choose between values instead",
                ));
            }
            (Value::Real(x), Value::Real(y)) if x == y => a.clone(),
            (Value::Real(_) | Value::Opaque(_), Value::Real(_) | Value::Opaque(_)) => {
                let (x, y) = (self.real(a, at)?, self.real(b, at)?);
                Value::Real(if x == y { x } else { self.graph.select(condition, x, y) })
            }
            (Value::Integer(x), Value::Integer(y)) if x.value == y.value => {
                Value::Integer(super::value::Integer { value: x.value, ty: x.ty.or(y.ty) })
            }
            (Value::Integer(_), Value::Integer(_)) => {
                return Err(error(
                    at,
                    "this integer depends on model variables, but integers must be known at compile time: choose \
                     between `f64` values instead",
                ));
            }
            (Value::Bool(x), Value::Bool(y)) if x == y => a.clone(),
            (Value::Condition(x), Value::Condition(y)) if x == y => a.clone(),
            (Value::Bool(_) | Value::Condition(_), Value::Bool(_) | Value::Condition(_)) => {
                let not = self.graph.not(condition);
                let then = self.and(&Value::Condition(condition), a, at)?;
                let otherwise = self.and(&Value::Condition(not), b, at)?;
                match (a, b) {
                    (Value::Bool(true), _) => self.or(&Value::Condition(condition), b, at)?,
                    (_, Value::Bool(true)) => self.or(&Value::Condition(not), a, at)?,
                    _ => self.or(&then, &otherwise, at)?,
                }
            }
            (Value::Tuple(x), Value::Tuple(y)) if Rc::ptr_eq(x, y) => a.clone(),
            (Value::Tuple(x), Value::Tuple(y)) if x.len() == y.len() => {
                Value::tuple(self.select_elements(condition, x, y, at)?)
            }
            (Value::Array(x), Value::Array(y)) if Rc::ptr_eq(x, y) => a.clone(),
            (Value::Array(x), Value::Array(y)) if x.len() == y.len() => {
                Value::array(self.select_elements(condition, x, y, at)?)
            }
            (Value::Matrix(x), Value::Matrix(y)) if Rc::ptr_eq(x, y) => a.clone(),
            (Value::Matrix(x), Value::Matrix(y)) if (x.rows, x.columns) == (y.rows, y.columns) => {
                Value::matrix(
                    x.rows,
                    x.columns,
                    self.select_elements(condition, &x.elements, &y.elements, at)?,
                )
            }
            (Value::Struct(x), Value::Struct(y)) if Rc::ptr_eq(x, y) => a.clone(),
            (Value::Struct(x), Value::Struct(y)) if x.variant == y.variant => {
                let fields = self.select_elements(condition, &x.fields, &y.fields, at)?;
                Value::Struct(Rc::new(Struct {
                    definition: x.definition.clone(),
                    variant: x.variant,
                    fields,
                }))
            }
            (Value::Option(None), Value::Option(None)) => a.clone(),
            (Value::Option(Some(x)), Value::Option(Some(y))) => {
                Value::some(self.select(condition, x, y, at)?)
            }
            (Value::Range(x), Value::Range(y)) if Rc::ptr_eq(x, y) => a.clone(),
            (Value::Builtin(x), Value::Builtin(y)) if Rc::ptr_eq(x, y) => a.clone(),
            (Value::Closure(x), Value::Closure(y)) if Rc::ptr_eq(x, y) => a.clone(),
            (Value::Function(x), Value::Function(y)) if Rc::ptr_eq(&x.item, &y.item) => a.clone(),
            _ => {
                return Err(error(
                    at,
                    format!(
                        "the branches of a condition on model variables have the types {} and {}: both must be \
                         numbers or arrays of equal length",
                        a.description(),
                        b.description()
                    ),
                ));
            }
        })
    }

    fn select_elements(
        &mut self,
        condition: Node,
        a: &[Value],
        b: &[Value],
        at: TokenSpan,
    ) -> Result<Vec<Value>> {
        a.iter().zip(b).map(|(a, b)| self.select(condition, a, b, at)).collect()
    }
}
